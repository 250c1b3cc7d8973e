"""Bench files that were changed: a report draws them, or refuses them with one message."""

import os
import shutil

import h5py
import pytest
from forgeries import change
from hypothesis import given, settings
from hypothesis import strategies as st
from specs import power_spec

EXAMPLES = int(os.environ.get("GFMD_FORGERIES", "8"))  # `make test-kills` takes 200
SPEC = power_spec(n=0, points=16, p_star=0.1, cutoff=0.2)
LINKS = {
    "another file": lambda: h5py.ExternalLink("other.h5", "/runs/0"),
    "a device": lambda: h5py.ExternalLink("/dev/zero", "/"),
    "itself": lambda: h5py.SoftLink("/runs/0"),
    "another trace": lambda: h5py.SoftLink("/runs/1"),
}


@pytest.fixture(scope="module")
def original(tmp_path_factory, invoke):
    """A folder with a study and a bench of two traces."""
    folder = tmp_path_factory.mktemp("original")
    spec, study, bench = (folder / name for name in ("s.toml", "s.h5", "b.h5"))
    spec.write_text(SPEC)
    more = ("--set", "load.p_star=[0.1, 0.3]", "-q")
    assert invoke("run", spec, "-o", study, "-j", "1", *more).exit_code == 0
    assert invoke("bench", spec, "-o", bench, "--figures", folder, *more).exit_code == 0
    return folder


@pytest.fixture
def report(original, invoke, tmp_path):
    """Writes a report with a changed bench: changes it, then calls the command."""

    def report(changed):
        shutil.copy(original / "b.h5", tmp_path / "b.h5")
        with h5py.File(tmp_path / "b.h5", "r+") as file:
            changed(file)
        html = tmp_path / "report.html"
        html.unlink(missing_ok=True)
        done = invoke("report", original / "s.h5", "--bench", tmp_path / "b.h5", "-o", html)
        assert html.exists() == (done.exit_code == 0), done.output
        return done

    return report


def refused(done, *words):
    """Whether one message with these words ended the command."""
    assert done.exit_code == 74, done.output
    assert len(done.output.splitlines()) == 1
    return all(word in done.output for word in ("b.h5", *words))


@pytest.mark.parametrize("to", LINKS)
@pytest.mark.parametrize("place", ["runs", "runs/0", "runs/0/u_g_error"])
def test_links_in_a_bench_are_not_followed(report, original, tmp_path, place, to):
    shutil.copy(original / "b.h5", tmp_path / "other.h5")

    def link(file):
        file.move(place, "hidden")
        file[place] = LINKS[to]()

    assert refused(report(link), f"{place.rpartition('/')[2]!r} is a link to another place")


@pytest.mark.parametrize("how", ["external", "virtual"])
def test_a_column_that_lies_in_another_file_is_refused(report, tmp_path, how):
    def move_out(file):
        runs, values = file["runs/0"], file["runs/0/seconds"][()]
        del runs["seconds"]
        if how == "external":
            (tmp_path / "raw").write_bytes(values.tobytes())
            runs.create_dataset("seconds", values.shape, "f8", external=[("raw", 0, values.nbytes)])
        else:
            layout = h5py.VirtualLayout(values.shape, "f8")
            layout[:] = h5py.VirtualSource("other.h5", "seconds", values.shape)
            runs.create_virtual_dataset("seconds", layout)

    assert refused(report(move_out), "seconds", "other files")


@pytest.mark.parametrize("name", ["solver", "time_step", "boundary"])
def test_a_list_in_the_place_of_a_value_is_refused(report, name):
    def change(file):
        file["runs/0"].attrs[name] = [1.0, 2.0]

    assert refused(report(change), name)


@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_a_changed_bench_is_drawn_or_refused(report, data):
    done = report(lambda file: change(file, data.draw))
    assert done.exit_code == 0 or refused(done)
