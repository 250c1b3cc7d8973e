"""Records in the folder of unfinished work that were changed and given a valid checksum again."""

import os
import shutil
import signal
from pathlib import Path

import h5py
import pytest
from forgeries import change
from hypothesis import given, settings
from hypothesis import strategies as st
from specs import power_spec

from gfmd_cli.files.checksums import sealed
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import Status
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

SPEC = power_spec(
    n=0,
    points=16,
    p_star=[0.1, 0.3],
    cutoff=0.2,
    more="""\
[output]
fields = ["u"]
spectra = true
""",
)
EXAMPLES = int(os.environ.get("GFMD_FORGERIES", "25"))  # `make test-kills` takes 200


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    """A study of two tasks with a record of the first one that is not collected."""
    folder = tmp_path_factory.mktemp("half")
    (folder / "s.toml").write_text(SPEC)
    spec, text = read_spec(folder / "s.toml", ())

    def stop(progress):
        if progress.event == "end":  # a shard that was stopped leaves its record to others
            signal.raise_signal(signal.SIGTERM)

    run_study(spec, text, folder / "s.h5", stop, RunOptions(jobs=1, shard=(0, 2)))
    return folder


def test_a_record_without_its_scene_is_solved_again_by_the_same_run(half, invoke, tmp_path):
    place = tmp_path / "again"
    shutil.copytree(half, place)
    (record,) = place.glob("s.parts/*.record")
    record.write_bytes(record.read_bytes()[:-8])
    with h5py.File(record, "r+") as file:
        del file["scenes"]
    record.write_bytes(sealed(record.read_bytes()))
    check(place, invoke)


def check(place, invoke):
    """The study becomes complete by the next run, whatever is in the folder beside it."""
    known = invoke("status", place / "s.toml", "-o", place / "s.h5")
    assert known.exit_code in (0, 1), known.output
    done = invoke("run", place / "s.toml", "-o", place / "s.h5", "-j", "1", "-q")
    assert done.exit_code == 0, done.output
    assert done.output.count("set aside as") == len(list(place.glob("s.parts/*.bad"))) <= 1
    assert [row["status"] for row in read_rows(place / "s.h5")] == [Status.CONVERGED] * 2


@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_a_changed_record_is_used_or_set_aside_with_one_message(half, invoke, tmp_path, data):
    place = tmp_path / "again"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(half, place)
    (record,) = Path(place).glob("s.parts/*.record")
    content = bytearray(record.read_bytes()[:-8])
    if data.draw(st.booleans()):
        for _ in range(data.draw(st.integers(1, 4))):
            at = data.draw(st.integers(0, len(content) - 1))
            content[at] = data.draw(st.integers(0, 255))
        record.write_bytes(bytes(content))
    else:
        record.write_bytes(bytes(content))
        with h5py.File(record, "r+") as file:
            change(file, data.draw)
    record.write_bytes(sealed(record.read_bytes()))
    check(place, invoke)
