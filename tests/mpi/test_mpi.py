"""Runs on several processes give what one process gives."""

import re

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from gfmd_cli.cli import main
from gfmd_cli.study.pointer import read_pointer

pytestmark = pytest.mark.mpi
SAME = 1e-10
SPEC = """\
[study]
name = "study"
[surface]
kind = "self-affine"
cutoff = {cutoff}
[[elastomer]]
kind = "power"
n = {n}
[grid]
points = {points}
[load]
p_star = [0.03, 0.3]
[solver]
kind = "{kind}"
tolerance = 1e-11
[output]
fields = ["u", "sigma", "height"]
cross_section = true
"""
FREE = """\
[study]
name = "study"
[surface]
kind = "self-affine"
cutoff = 0.1
[elastomer]
kind = "power"
n = {n}
[grid]
points = {points}
points_y = {points_y}
boundary = "free"
[load]
p_star = [0.03, 0.3]
[solver]
tolerance = 1e-11
[output]
fields = ["u", "sigma", "height", "contact_pressure"]
histogram = true
cross_section = true
"""
OF_THE_RUN = re.compile("residual|transforms|steps|status|algebraic|bound")
"""Columns that may differ: rounding decides which step is the last."""


def spec(folder, n, points, kind="auto", **more):
    path = folder / "spec.toml"
    text = SPEC.format(n=n, points=points, kind=kind, cutoff=2.56 / points)
    path.write_text(text + "".join(f"[{table}]\n{keys}\n" for table, keys in more.items()))
    return path


def on_one(path, output):
    done = CliRunner().invoke(main, ["run", str(path), "-o", str(output), "-q"])
    assert done.exit_code == 0, done.output


def contents(path):
    """Every dataset and every attribute of a study file, by name."""
    values = {}

    def note(name, item):
        if isinstance(item, h5py.Dataset):
            values[name] = item.asstr()[()] if item.dtype.kind in "OS" else item[()]

    with h5py.File(path) as file:
        file.visititems(note)
        return values, {name: file.attrs[name] for name in ("spec", "layout", "title")}


def assert_same(one, other, exact=False):
    """Two study files hold the same, to 1e-10 of the largest value of each column or field.

    An estimated error is a difference of values; it is the same to 1e-10 of the value itself.
    """
    (values, attributes), (others, other_attributes) = contents(one), contents(other)
    assert attributes == other_attributes
    assert values.keys() == others.keys()
    for name, expected in values.items():
        if name == "seconds" or (not exact and OF_THE_RUN.search(name)):
            continue
        value = others[name]
        assert value.shape == expected.shape, name
        if expected.dtype.kind in "OUSi" or exact:
            assert np.array_equal(value, expected, equal_nan=expected.dtype.kind == "f"), name
        else:
            whole = name.replace("cross_sections", "fields")
            of = values.get(re.sub("(_continuum)?_error$", "", whole), expected)
            of = values["h_std"] if name == "mean_height" else of
            size = np.nanmax(np.abs(of), initial=1e-300)
            np.testing.assert_allclose(value, expected, rtol=0, atol=SAME * size, err_msg=name)
    assert set(others["status"]) <= {"converged", "rounding"}


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_every_process_holds_its_share_of_the_whole(mpiexec, count):
    mpiexec(count, "transforms.py")


@pytest.mark.parametrize(("count", "points"), [(2, 256), (4, 64), (3, 100)])
def test_the_study_is_that_of_one_process(mpiexec, tmp_path, count, points):
    n = {64: [0, 0.5, 1, 2, 3, 4], 100: [1, 3], 256: [2]}[points]
    path = spec(tmp_path, n, points)
    on_one(path, tmp_path / "one.h5")
    done = mpiexec(count, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5")
    assert done.stdout.count("next: gfmd analyze") == 1
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5")
    assert not (tmp_path / "many.parts").exists()


@pytest.mark.parametrize("kind", ["ccg", "fire", "polonsky-keer"])
def test_other_methods_are_shared_out_too(mpiexec, tmp_path, kind):
    path = spec(tmp_path, [1], 64, kind)
    on_one(path, tmp_path / "one.h5")
    mpiexec(2, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5")


def test_a_grid_that_grows_to_its_accuracy(mpiexec, tmp_path):
    """Small grids are solved by each process, large ones shared."""
    path = tmp_path / "spec.toml"
    path.write_text(
        '[study]\nname = "auto"\n[surface]\nkind = "self-affine"\ncutoff = 0.1\n'
        '[elastomer]\nkind = "power"\nn = 1\n[grid]\npoints = "auto"\n[load]\np_star = 0.1\n'
        "[accuracy]\nmean_gap = 3e-3\nmax_points = 256\n[solver]\ntolerance = 1e-11\n"
    )
    on_one(path, tmp_path / "one.h5")
    mpiexec(4, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5")


@pytest.mark.parametrize(
    ("before", "after", "boundary"),
    [
        *((2, 2, ""), (2, 3, ""), (4, 2, ""), (2, 1, ""), (1, 2, "")),
        *((2, 2, "free"), (2, 3, "free"), (1, 2, "free")),
    ],
)
def test_a_stopped_run_goes_on(mpiexec, tmp_path, before, after, boundary):
    """A signal to one process stops all; as many go on bit for bit, others to the tolerance."""
    n, boundary = (1.5, boundary) if boundary else (1, "periodic")
    path, cut, whole = spec(tmp_path, [n], 128), tmp_path / "cut.h5", tmp_path / "whole.h5"
    run = ("run", path, "-q", "--set", "load.p_star=0.3", "--set", f"grid.boundary={boundary}")
    run, plans = (*run, "-o"), {"GFMD_PLANS": "estimated"}  # the same in both studies
    mpiexec(before, "gfmd_cli", *run, whole, **plans)
    steps = contents(whole)[0]["steps"][0]
    mpiexec(before, "interrupted.py", steps // 2 + 3, before - 1, *run, cut, status=75, **plans)
    (pointer,) = (tmp_path / "cut.parts").glob("*/pointer")
    saved = read_pointer(pointer)[0]
    assert [part.rows for part in saved.parts] == [128 // before] * before
    assert saved.shape == (128, 128)
    few = steps - saved.state.step + 5  # looks that are enough to go on, but not to begin anew
    assert saved.state.step > 5
    mpiexec(after, "interrupted.py", few, 0, *run, cut, **plans)
    assert_same(whole, cut, exact=before == after)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_parts_of_a_free_boundary(mpiexec, count):
    mpiexec(count, "free.py")


@pytest.mark.parametrize(
    ("count", "shape", "n"),
    [(1, (64, 64), 1), (2, (128, 64), [0.5, 1.5]), (2, (77, 101), 1), (3, (65, 48), 1)],
)
def test_a_free_boundary_is_that_of_one_process(mpiexec, tmp_path, count, shape, n):
    """Square, odd and oblong maps, with nested grids that are shared and others that are not."""
    path = tmp_path / "spec.toml"
    path.write_text(FREE.format(n=n, points_y=shape[0], points=shape[1]))
    on_one(path, tmp_path / "one.h5")
    mpiexec(count, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5", exact=count == 1)


def test_oblong_pixels_with_a_free_boundary(mpiexec, tmp_path):
    """Levels of the V-cycle are not shared on such pixels."""
    path, square = tmp_path / "spec.toml", FREE.format(n=1, points_y=96, points=48)
    path.write_text(square.replace("cutoff = 0.1", "cutoff = 0.1\nlength = 1.0\nlength_y = 1.0"))
    on_one(path, tmp_path / "one.h5")
    mpiexec(2, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5", exact=False)


def test_a_free_boundary_with_error_bars(mpiexec, tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text(
        '[surface]\nkind = "self-affine"\ncutoff = 0.1\n[elastomer]\nkind = "power"\nn = 0.5\n'
        '[grid]\npoints = 128\nboundary = "free"\n[load]\npressure = 0.1\n'
        "[accuracy]\nmean_gap = 0.5\n[solver]\ntolerance = 1e-11\n"
    )
    on_one(path, tmp_path / "one.h5")
    mpiexec(2, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5")


@pytest.mark.parametrize(
    ("points", "boundary"), [((90, 60), "free"), ((135, 90), "free"), ((90, 60), "periodic")]
)
def test_a_scan_with_holes(mpiexec, tmp_path, points, boundary):
    """On its own points and between them, with points that never touch."""
    y, x = np.mgrid[:90, :60] / 60
    heights = np.sin(9 * x + 4 * y) * np.cos(7 * y - 2 * x**2) + 0.3 * x
    heights[20:31, 41:48] = np.nan
    heights[45 if points == (90, 60) else 80 :] = np.nan  # once all rows of the second process
    np.save(tmp_path / "scan.npy", heights)
    path = tmp_path / "spec.toml"
    path.write_text(
        '[surface]\nkind = "file"\npath = "scan.npy"\nperiodic = false\nmissing = "void"\n'
        'length = 60\n[elastomer]\nkind = "half-space"\n[grid]\n'
        f'boundary = "{boundary}"\npoints = {points[1]}\npoints_y = {points[0]}\n'
        "[load]\ncontact_area = 0.1\n"
        '[solver]\ntolerance = 1e-11\n[output]\nfields = ["u", "sigma"]\n'
    )
    on_one(path, tmp_path / "one.h5")
    mpiexec(2, "gfmd_cli", "run", path, "-o", tmp_path / "many.h5", "-q")
    assert_same(tmp_path / "one.h5", tmp_path / "many.h5")


@pytest.mark.parametrize("kind", ["known", "unknown"])
@pytest.mark.parametrize("others", ["done", "waiting"])
def test_an_error_of_one_process_ends_all(mpiexec, kind, others):
    done = mpiexec(3, "failing.py", kind, others, status=73 if kind == "known" else 1)
    message = "no space on one of them" if kind == "known" else "rank 1: KeyError: 'x'"
    output = done.stdout + done.stderr
    # once from each, or once from the process with the error, which ends the others
    assert output.count(message) == (3 if others == "done" else 1), output


def test_bad_input_gives_one_message(mpiexec, tmp_path):
    path = spec(tmp_path, [1], 6)
    done = mpiexec(2, "gfmd_cli", "run", path, "-o", tmp_path / "s.h5", status=2)
    assert done.stderr.count("grid.points") == 1
    path = spec(tmp_path, [1], 128)
    done = mpiexec(2, "gfmd_cli", "run", path, "-j", 2, "-o", tmp_path / "s.h5", status=2)
    assert done.stderr.count("--jobs 2") == 1
    assert not (tmp_path / "s.h5").exists()
