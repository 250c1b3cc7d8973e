import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from threading import Thread

import h5py
import numpy as np
import pytest
import xarray
from specs import power_spec

from gfmd_cli.analysis.compare import compare
from gfmd_cli.errors import Interrupted, SpaceError, StudyError
from gfmd_cli.grid import plans
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics import indenters
from gfmd_cli.solvers import multigrid
from gfmd_cli.solvers.pcg import PCGState, ProjectedCG
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study import measure, run_task
from gfmd_cli.study import run as run_module
from gfmd_cli.study.checkpoint import Checkpoint
from gfmd_cli.study.columns import COLUMNS, LAYOUT
from gfmd_cli.study.history import TaskHistory, Trial
from gfmd_cli.study.pointer import read_pointer
from gfmd_cli.study.reading import open_study, read_rows
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.tasks import plan
from gfmd_cli.study.unfinished_work import read_record

SMALL = power_spec(
    n=[0, 1],
    points=64,
    p_star=[0.1, 1.0],
    cutoff=0.05,
    more="""\
[output]
fields = ["u", "sigma", "height"]
cross_section = true
""",
)
LONG = """\
[surface]
kind = "self-affine"
cutoff = 0.01
[elastomer]
kind = "power"
n = 4
[grid]
points = 256
[load]
p_star = [1e-3, 2e-3, 4e-3]
[solver]
tolerance = 1e-15  # below rounding: every task takes all its steps
max_steps = 500
[output]
fields = ["u"]
"""
NUMBERS = [c.name for c in COLUMNS if c.kind is not str and c.name != "seconds"]


@pytest.fixture
def run(tmp_path):
    """Runs a spec into tmp_path/study.h5; returns (path, events, outcome)."""

    def run(text=SMALL, name="study.h5", overrides=(), report=None, **options):
        spec_path = tmp_path / "spec.toml"
        spec_path.write_text(text)
        spec, _ = read_spec(spec_path, overrides)
        events = []
        report = report or events.append
        outcome = run_study(spec, text, tmp_path / name, report, RunOptions(**options))
        return tmp_path / name, events, outcome

    return run


def results(path):
    return [[row[name] for name in NUMBERS] for row in read_rows(path)]


def test_a_study_holds_one_row_a_task(run):
    path, events, outcome = run()
    rows = read_rows(path)
    assert outcome == {"converged": 4}
    assert [(row["n"], row["p_star"]) for row in rows] == [(0, 0.1), (0, 1), (1, 0.1), (1, 1)]
    assert all(row["status"] == "converged" and row["residual"] < 1e-6 for row in rows)
    assert {event.event for event in events} >= {"start", "end"}
    assert not path.with_suffix(".parts").exists()


def test_a_second_call_finds_everything_done(run):
    path, _, _ = run()
    before = path.read_bytes()
    _, events, outcome = run()
    assert events == []
    assert outcome == {"converged": 4}
    assert path.read_bytes() == before


PARABOLA_AUTO = """\
[surface]
kind = "parabola"
[elastomer]
kind = "half-space"
[grid]
points = "auto"
[load]
pressure = [0.03, 0.002]
[accuracy]
contact_area = 0.2
max_points = 128
"""


@pytest.mark.parametrize(
    "pressures", [("[0.03, 0.002]",), ("[0.002, 0.03]",), ("0.03", "0.002"), ("0.002", "0.03")]
)
def test_the_spectrum_of_a_scene_of_several_grids_is_that_of_the_finest(run, pressures):
    """Whichever load comes first; Delta_sigma of an indenter depends on the grid."""
    for pressure in pressures:
        path, _, _ = run(PARABOLA_AUTO, overrides=[f"load.pressure={pressure}"])
    coarse, fine = sorted(read_rows(path), key=lambda row: row["points"])
    assert coarse["points"] < fine["points"]
    assert abs(coarse["delta_sigma"] / fine["delta_sigma"] - 1) > 1e-3
    (curve,) = compare(path).curves
    variance = curve.persson.shells.variance.sum()
    assert variance == pytest.approx(fine["delta_sigma"] ** 2, rel=1e-12)
    assert curve.units[0] == fine["delta_sigma"]


def test_shards_make_up_the_whole(run):
    whole, _, _ = run(name="whole.h5")
    path, _, first = run(shard=(0, 3))
    states = [row["status"] for row in read_rows(path)]
    assert states == ["converged", "missing", "missing", "converged"]
    assert first == {"converged": 2}
    run(shard=(1, 3))
    run(shard=(2, 3))
    np.testing.assert_array_equal(results(path), results(whole))
    with h5py.File(path) as a, h5py.File(whole) as b:
        np.testing.assert_array_equal(a["fields/2/sigma"], b["fields/2/sigma"])


def test_worker_processes_change_nothing(run):
    alone, _, _ = run(name="alone.h5", jobs=1)
    path, events, outcome = run(jobs=2)
    assert outcome == {"converged": 4}
    assert sum(event.event == "end" for event in events) == 4
    np.testing.assert_array_equal(results(path), results(alone))


def test_the_study_opens_labelled_in_xarray(run):
    path, _, _ = run()
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.a_r.dims == ("task",)
        assert data.pr_sigma.dims == ("task", "sigma")
        assert data.pr_sigma_log.dims == ("task", "sigma_log")
        assert data.u_g.attrs["long_name"] == "mean gap / h_std"
        assert data.pressure.attrs["units"] == "Pa"
        assert data.attrs["Conventions"] == "CF-1.11"
    with xarray.open_dataset(path, engine="h5netcdf", group="fields/2") as fields:
        assert fields.u.dims == ("y", "x")
        assert fields.x.attrs["units"] == "m"
    with xarray.open_dataset(path, engine="h5netcdf", group="scenes/1") as scene:
        assert scene.variance.dims == ("shell",)


def test_a_study_says_where_it_comes_from(run):
    path, _, _ = run()
    with h5py.File(path) as file:
        attrs = dict(file.attrs)
    assert json.loads(attrs["spec"])["elastomer"][1]["n"] == 1
    assert attrs["spec_text"] == SMALL
    assert json.loads(attrs["packages"])["numpy"] == np.__version__
    assert json.loads(attrs["machine"])["cores"] >= 1
    assert attrs["date"]
    assert "git_commit" in attrs


def test_stored_fields_reproduce_the_row(run):
    path, _, _ = run()
    row = read_rows(path)[2]
    with h5py.File(path) as file:
        u, sigma, height = (file[f"fields/2/{name}"][()] for name in ("u", "sigma", "height"))
        diagonal = file["cross_sections/2/u"][()]
    assert np.mean(u - height) / row["h_std"] == pytest.approx(row["u_g"], rel=1e-12)
    pressure = np.where((u == height) & (sigma > 0), sigma, 0.0)
    assert np.std(pressure) / row["delta_sigma"] == pytest.approx(row["sigma_p"], rel=1e-12)
    assert np.mean(sigma) == pytest.approx(row["pressure"], rel=1e-12)
    assert np.mean(sigma > 1e-3 * row["delta_sigma"]) == pytest.approx(row["a_r"], abs=0.02)
    np.testing.assert_array_equal(diagonal, np.diagonal(u))


def test_the_stress_distribution_is_normalised_and_has_its_first_moment(run):
    path, _, _ = run(overrides=("load.p_star=[0.3]",))
    row = read_rows(path)[1]
    with h5py.File(path) as file:
        middle, edges = file["sigma"][()], file["sigma"].attrs["edges"]
    weight = row["pr_sigma"] * np.diff(edges)
    assert row["pr_zero"] + weight.sum() + row["pr_beyond"] == pytest.approx(1, rel=1e-12)
    assert row["pr_zero"] == pytest.approx(1 - row["a_r"], rel=1e-12)
    assert weight @ middle == pytest.approx(0.3, rel=0.01)  # bins of 0.05


def test_the_stored_spectrum_has_the_variances_of_the_scene(run):
    path, _, _ = run()
    row = read_rows(path)[2]
    with open_study(path) as study:
        shells = study.shells(row["scene"])
    assert np.sqrt(shells.height.sum()) == pytest.approx(row["h_std"], rel=1e-12)
    assert np.sqrt(shells.variance.sum()) == pytest.approx(row["delta_sigma"], rel=1e-12)


def test_without_output_nothing_more_is_stored(run):
    path, _, _ = run(
        overrides=("output.fields=[]", "output.cross_section=false", "output.histogram=false")
    )
    with h5py.File(path) as file:
        assert not {"fields", "cross_sections", "pr_sigma", "pr_zero"} & set(file)


def test_a_task_that_is_refused_as_it_begins_leaves_no_checkpoint(run):
    stiff = SMALL.replace('"power"\nn = [0, 1]', '"half-space"\nE_star = [1.0, 1e308]')
    path, events, outcome = run(stiff)
    assert outcome == {"converged": 2, "failed": 2}
    assert "out of range" in events[-1].message
    assert not [folder for folder in path.with_suffix(".parts").iterdir() if folder.is_dir()]


def test_a_damaged_record_is_set_aside_and_solved_again(run, tmp_path):
    whole, _, _ = run(name="whole.h5")
    path, _, _ = run(shard=(0, 2))
    parts = tmp_path / "study.parts"
    parts.mkdir(exist_ok=True)
    bad = parts / f"{'0' * 16}.record"
    bad.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    with pytest.raises(StudyError, match="damaged record"):
        read_record(bad)
    _, _, outcome = run()
    assert outcome == {"converged": 4}
    assert bad.with_suffix(".bad").exists()
    np.testing.assert_array_equal(results(path), results(whole))


def test_columns_that_are_not_stored_are_blank(run):
    path, _, _ = run(overrides=("load.p_star=0.1",))
    before = results(path)
    with h5py.File(path, "r+") as file:
        del file["load_value"], file["load"]
    rows = read_rows(path)
    assert [row["load"] for row in rows] == ["", ""]
    without = [i for i, name in enumerate(NUMBERS) if name != "load_value"]
    np.testing.assert_array_equal(np.array(results(path))[:, without], np.array(before)[:, without])


def test_a_file_that_is_no_study_is_refused_and_kept(run, tmp_path):
    path = tmp_path / "study.h5"
    path.write_bytes(b"not HDF5")
    with pytest.raises(StudyError, match="not a readable study"):
        run()
    assert path.read_bytes() == b"not HDF5"
    path.unlink()
    with h5py.File(path, "w") as file:
        file["x"] = 1
    with pytest.raises(StudyError, match="not a study"):
        run()


def test_a_missed_tolerance_is_said_and_kept(run):
    path, _, outcome = run(overrides=("elastomer.n=3", "solver.max_steps=2", "load.p_star=0.1"))
    assert outcome == {"max_steps": 1}
    row = read_rows(path)[0]
    assert row["status"] == "max_steps"
    assert row["residual"] > 1e-6


SOLVER = ProjectedCG()
HISTORY = TaskHistory(trials=[Trial(16, 0.1, 0.2, 1.0)])


def test_checkpoints_come_back_as_they_were(tmp_path):
    grid = Grid(16)
    rng = np.random.default_rng(0)

    class Contact:
        pass

    contact = Contact()
    contact.grid = grid
    u, sigma, direction, change = rng.random((4, 16, 16))
    state = PCGState(
        u=u, sigma=sigma, direction=np.float32(direction), change=np.float32(change), moved=1 / 3
    )
    state.exact, state.residual, state.step, state.transforms = False, 0.1, 7, 9
    state.misses, state.screening, state.coarser_transforms = 2, 0.3, 12.5
    with Checkpoint.exclusive(tmp_path / "c") as checkpoint:
        assert checkpoint.restore() is None
        assert checkpoint.load(grid, SOLVER) is None
        checkpoint.save(contact, state, TaskHistory())
        older = state.u.copy()
        state.u += 1
        state.step = 8
        checkpoint.save(contact, state, HISTORY)
        with Checkpoint.exclusive(tmp_path / "c") as second:
            assert second.restore() is None
            assert second.load(grid, SOLVER) is None  # another process has it
    checkpoint = Checkpoint(tmp_path / "c")
    assert checkpoint.restore() is None
    assert checkpoint.history == HISTORY
    resume = checkpoint.load(grid, SOLVER)
    assert (resume.shape, resume.moved) == ((16, 16), False)
    stored = resume.state
    for name, value in vars(state).items():
        assert type(vars(stored)[name]) is type(value), name
        np.testing.assert_array_equal(vars(stored)[name], value, err_msg=name, strict=True)
    flip(tmp_path / "c" / checkpoint.slots[0].name, 800)
    checkpoint = Checkpoint(tmp_path / "c")
    assert "the one before it is resumed" in checkpoint.restore()
    np.testing.assert_array_equal(checkpoint.load(grid, SOLVER).state.u, older)
    assert checkpoint.history == TaskHistory()
    flip(tmp_path / "c" / "pointer", 80)
    checkpoint = Checkpoint(tmp_path / "c")
    assert "set aside as .bad" in checkpoint.restore()
    assert checkpoint.load(grid, SOLVER) is None
    assert (tmp_path / "c.pointer.bad").exists()
    checkpoint.remove()
    assert not (tmp_path / "c").exists()


def flip(path, bit):
    """Change one bit of a file."""
    content = bytearray(path.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)


def test_fields_keep_their_labels_when_a_study_is_collected_again(run):
    path, _, _ = run(shard=(0, 2))
    run()
    with xarray.open_dataset(path, engine="h5netcdf", group="fields/0") as fields:
        assert fields.u.dims == ("y", "x")
    with xarray.open_dataset(path, engine="h5netcdf", group="scenes/0") as scene:
        assert scene.variance.dims == ("shell",)


def test_a_study_of_another_layout_is_refused_with_the_version_that_wrote_it(run):
    path, _, _ = run()
    with h5py.File(path, "r+") as file:
        file.attrs.update({"layout": 9, "software_version": "7.0"})
    with pytest.raises(StudyError, match=rf"layout 9, written by gfmd 7\.0; .* layout {LAYOUT}"):
        read_rows(path)


def test_a_changed_attribute_of_a_study_is_found_out(run):
    path, _, _ = run()
    with h5py.File(path, "r+") as file:
        file.attrs["spec_text"] = file.attrs["spec_text"].replace("0.05", "0.06")
    with pytest.raises(StudyError, match="attributes"):
        read_rows(path)


def test_p_star_whose_unit_depends_on_the_grid_is_warned_of_once(run):
    """With a free boundary Delta_sigma is that of the mirrored heights, which have a kink."""
    spec = power_spec(n=0.5, points=[32, 64], p_star=0.1)
    spec = spec.replace("[load]", 'boundary = "free"\n[load]')
    for name, overrides, count in [
        ("free", (), 1),
        ("one", ("grid.points=32",), 0),
        ("pressure", ("load={pressure=1}",), 0),
    ]:
        path, events, _ = run(spec, f"{name}.h5", overrides)
        stored = "".join(row["warnings"] for row in read_rows(path))
        said = stored + "".join(event.message for event in events)
        assert said.count("p* is another pressure on another grid") == count
    path, events, _ = run(
        power_spec(n=3, points=[16, 32], p_star=0.003),
        "parabola.h5",
        ("surface={kind='parabola'}",),
    )
    assert "p* is" not in "".join(event.message for event in events)
    for row in read_rows(path):
        assert row["warnings"].count("p* is another pressure on another grid") == 1


def test_a_damaged_record_is_said_in_one_line(run, tmp_path):
    (tmp_path / "study.parts").mkdir()
    (tmp_path / "study.parts" / "0000.record").write_bytes(b"nothing")
    _, events, _ = run()
    (note,) = [event.message for event in events if event.event == "warning"]
    assert "0000.record: damaged record" in note
    assert "set aside as 0000.bad" in note


@pytest.mark.parametrize(("seconds_later", "stops"), [(9.0, False), (21.0, True)])
def test_max_hours_stop_a_run_as_a_signal_does(run, tmp_path, monkeypatch, seconds_later, stops):
    """The clock moves on at the first step, on slow machines too."""
    clock = [0.0]

    def report(event):
        if event.event == "step":
            clock[0] = seconds_later

    monkeypatch.setattr(run_module, "monotonic", lambda: clock[0])
    limits = {"report": report, "max_seconds": 20.0, "jobs": 1}
    if not stops:
        run(LONG, "study.h5", ("solver.max_steps=20",), **limits)
        return
    with pytest.raises(Interrupted, match="run again"):
        run(LONG, **limits)
    assert list((tmp_path / "study.parts").glob("*/pointer"))


@pytest.mark.usefixtures("threads_by_size")
def test_a_reproducible_run_has_the_same_bits_on_any_number_of_processes(run):
    run(LONG, "measured.h5", ("solver.max_steps=1",))  # its plans are known in this process only
    paths = [
        run(LONG, f"{jobs}.h5", ("solver.max_steps=20",), jobs=jobs, reproducible=True)[0]
        for jobs in (1, 2)
    ]
    assert_equal_studies(*paths)
    with h5py.File(paths[0]) as file:
        assert json.loads(file.attrs["machine"])["plans"] == "estimated"


@pytest.mark.usefixtures("small_plans_measured")
def test_plans_are_kept_beside_an_unfinished_study(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    run(shard=(0, 4))
    wisdom = plans.read_wisdom(tmp_path / "study.parts")
    cached = plans.read_wisdom(tmp_path / "cache" / "gfmd")
    assert wisdom == cached
    shutil.rmtree(tmp_path / "cache")
    by_wisdom, used = plans._by_wisdom, []

    def note(texts, *others):
        used.append(texts)
        return by_wisdom(texts, *others)

    monkeypatch.setattr(plans, "_by_wisdom", note)
    run(shard=(1, 4))
    assert used
    assert all(texts in wisdom.values() for texts in used)
    (file,) = (tmp_path / "study.parts").glob("wisdom-*.json")
    flip(file, 8 * 300)
    _, events, _ = run(shard=(2, 4))
    assert any("planned anew" in event.message for event in events)


@pytest.mark.usefixtures("small_plans_measured")
def test_runs_in_two_threads_keep_their_plans_apart(tmp_path, monkeypatch):
    """Each stores its plans beside its own study, although FFTW knows those of the other."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    one, other = tmp_path / "one", tmp_path / "other"
    values = np.zeros(97, dtype=complex)
    for folder in (one, other):
        folder.mkdir()

    def plan_in_other():
        plans.plan_with(other)
        plans.planned_transforms(lambda fftw: fftw(values, values.copy()), 97)

    try:
        plans.plan_with(one)
        thread = Thread(target=plan_in_other)
        thread.start()
        thread.join()
        assert plans.read_wisdom(one) is None
        assert plans.read_wisdom(other)
        plans.planned_transforms(lambda fftw: fftw(values, values.copy()), 97)
    finally:
        plans.plan_with(None)
    assert plans.read_wisdom(one)


@pytest.mark.parametrize(
    ("module", "name"), [(indenters, "highest_point"), (measure, "map_spectrum")]
)
def test_no_number_comes_from_transforms_of_an_earlier_run(run, monkeypatch, module, name):
    """Their plans may have been others."""
    found, compute = [], getattr(module, name)
    monkeypatch.setattr(module, name, lambda value: found.append(compute(value)) or found[-1])
    run(jobs=1)
    assert len(found) > 0
    count = len(found)
    run(name="again.h5", jobs=1)
    assert found == 2 * found[:count]


def test_a_seed_does_not_depend_on_how_many_run(run):
    some = ("load.p_star=0.1", "elastomer.n=1", "output.fields=['height']")
    alone, _, _ = run(name="alone.h5", overrides=(*some, "surface.seed=7"))
    among, _, _ = run(name="among.h5", overrides=(*some, "surface.seed=[3,5,7]"))
    with h5py.File(alone) as a, h5py.File(among) as b:
        np.testing.assert_array_equal(a["fields/0/height"], b["fields/2/height"])


def gfmd(folder, *words):
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "gfmd_cli", *words],
        cwd=folder,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )


STOPPED = {
    "multigrid": ("elastomer.n=2",),
    "long waves": ("elastomer.n=1", "solver.tolerance=1e-9"),
    "table": ("elastomer={kind='table', path='jump.txt'}",),
    "green": ("elastomer.n=0.3",),
    "steep": ("elastomer.n=4",),
    "line": ("surface={kind='ridge'}", "elastomer.n=1", "output.cross_section=false"),
    "fire": ("elastomer.n=1", "solver.kind='fire'", "solver.max_steps=60"),
    "ccg": ("elastomer.n=1", "solver.kind='ccg'", "solver.max_steps=60"),
    "polonsky-keer": ("elastomer.n=1", "solver.kind='polonsky-keer'", "solver.max_steps=60"),
    "sort": ("elastomer.n=0",),
    "accuracy": ("elastomer.n=2", "accuracy.mean_gap=0.01", "grid.points=128"),
    "auto": ("elastomer.n=2", "accuracy.mean_gap=1e-3", "grid.points='auto'"),
}


@pytest.mark.parametrize("case", STOPPED)
def test_a_run_stopped_again_and_again_ends_bit_for_bit(run, case, monkeypatch, tmp_path):
    monkeypatch.setattr(run_task, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", 8)
    q = np.geomspace(1.0, 1e4, 200)
    np.savetxt(tmp_path / "jump.txt", np.c_[q, q**2 * np.where(q < 60, 1.0, 100.0)])
    overrides = ("load.p_star=[0.1]", *STOPPED[case])
    unbroken, _, _ = run(name="unbroken.h5", overrides=overrides, jobs=1)
    events, stops, resumed = [], 0, 0

    def stop_at_every_seventh_word(progress):
        nonlocal resumed
        events.append(progress)
        resumed += progress.event == "step" and progress.step > 0 and events[-2].event == "start"
        if len(events) % 7 == 0:
            signal.raise_signal(signal.SIGTERM)

    while stops < 200:
        try:
            path, _, _ = run(overrides=overrides, jobs=1, report=stop_at_every_seventh_word)
            break
        except Interrupted:
            stops += 1
    assert 0 < stops < 200 or case == "sort"  # that has one step
    assert resumed > 0 or case == "sort"
    assert_equal_studies(path, unbroken)


def assert_equal_studies(path, other):
    """All numbers and fields of two studies are the same bits."""
    np.testing.assert_array_equal(results(path), results(other))
    with h5py.File(path) as a, h5py.File(other) as b:
        names = []
        b.visit(names.append)
        for name in names:
            if isinstance(b[name], h5py.Dataset) and name != "seconds":
                np.testing.assert_array_equal(a[name][()], b[name][()], name)


@pytest.mark.usefixtures("threads_by_size")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_signal_saves_the_state_and_the_same_call_goes_on(run, tmp_path, jobs):
    unbroken, _, _ = run(LONG, name="unbroken.h5")
    words = ["run", "spec.toml", "-o", "broken.h5", "-j", jobs]
    parts = tmp_path / "broken.parts"
    process = gfmd(tmp_path, *words)
    for _ in range(6000):
        if list(parts.glob("*/lock")):  # a task has begun
            break
        time.sleep(0.01)
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 75
    process.stderr.close()
    saved = {path.parent.name: read_pointer(path)[0] for path in parts.glob("*/pointer")}
    assert saved
    _, events, _ = run(LONG, name="broken.h5", jobs=int(jobs))
    for task in plan(read_spec(tmp_path / "spec.toml")[0]):
        if task.id in saved:
            steps = (e for e in events if (e.task, e.event) == (task.index, "step"))
            first, slot = next(steps), saved[task.id]
            assert (first.points, first.step) >= (slot.shape[-1], slot.state.step)
    np.testing.assert_array_equal(results(tmp_path / "broken.h5"), results(unbroken))


def test_a_killed_run_loses_no_finished_pressure(run, tmp_path):
    unbroken, _, _ = run(name="unbroken.h5")
    shutil.copy(tmp_path / "spec.toml", tmp_path / "again.toml")
    words = ["run", "again.toml", "-o", "killed.h5", "-j", "1"]
    process, records = gfmd(tmp_path, *words), []
    for _ in range(6000):
        if records := list((tmp_path / "killed.parts").glob("*.record")):
            break
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stderr.close()
    seconds = {read_record(path).entry.row["seconds"] for path in records}
    assert seconds
    process = gfmd(tmp_path, *words)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert seconds <= {row["seconds"] for row in read_rows(tmp_path / "killed.h5")}
    np.testing.assert_array_equal(results(tmp_path / "killed.h5"), results(unbroken))


GROWN = ("surface.seed=[2,0,1]", "load.p_star=[1.0,0.3,0.1]")


def test_a_spec_with_more_tasks_makes_a_study_grow(run):
    """Those that are there keep their numbers and fields, at their new places."""
    more = "output={fields=['u'],cross_section=true,spectra=true,patches=true}"
    path, _, _ = run(overrides=(more, "surface.seed=[0,1]"))
    before = {row["seed"]: row["seconds"] for row in read_rows(path) if row["p_star"] == 0.1}
    _, events, outcome = run(overrides=(more, *GROWN))
    assert outcome == {"converged": 18}
    assert sum(event.event == "end" for event in events) == 18 - 8
    after = {row["seed"]: row["seconds"] for row in read_rows(path) if row["p_star"] == 0.1}
    assert {seed: after[seed] for seed in before} == before
    whole, _, _ = run(overrides=(more, *GROWN), name="whole.h5")
    np.testing.assert_array_equal(results(path), results(whole))
    with h5py.File(path) as grown, h5py.File(whole) as fresh:
        names = []
        fresh.visititems(lambda name, item: names.append(name))
        for name in names:
            if isinstance(fresh[name], h5py.Dataset) and name != "seconds":
                np.testing.assert_array_equal(grown[name][()], fresh[name][()], err_msg=name)


SMALL_CONTACT = power_spec(n=1, points=512, p_star=0.002, cutoff=0.02)


def test_calls_that_are_too_short_advance_all_the_same(run, tmp_path, monkeypatch):
    """Also in the solve on tiles, which follows the grid of 128 points here."""
    monkeypatch.setattr(run_task, "REPORT_EVERY", 0.0)
    straight, progress, _ = run(SMALL_CONTACT, "straight.h5", jobs=1, reproducible=True)
    steps = [(event.points, event.step) for event in progress if event.event == "step"]
    assert steps.count((128, max(step for points, step in steps if points == 128))) > 20

    def stop_at_128(event):
        if event.points == 128:
            signal.raise_signal(signal.SIGTERM)

    reached, options = [], {"jobs": 1, "reproducible": True}
    with pytest.raises(Interrupted):
        run(SMALL_CONTACT, report=stop_at_128, **options)
    for _ in range(len(steps)):
        events = []
        try:
            path, *_ = run(SMALL_CONTACT, report=events.append, max_seconds=1e-9, **options)
            break
        except Interrupted:
            reached += [(e.points, e.step) for e in events if e.event == "step"][-1:]
            (warning,) = [e.message for e in events if e.event == "warning"]
            assert "a shorter call makes no progress" in warning
    assert reached == sorted(set(reached))
    assert_equal_studies(straight, path)


def test_max_hours_shorter_than_the_start_of_the_workers_solve_a_task(run, tmp_path):
    """Each call solves those that its workers have begun as the time is found to be over."""
    pressures = [1.0, 0.5, 0.2, 0.1]
    more, solved = ("elastomer.n=0", f"load.p_star={pressures}"), [0]
    while solved[-1] < len(pressures):
        with suppress(Interrupted):
            run(overrides=more, max_seconds=1e-9, jobs=2)
        rows = read_rows(tmp_path / "study.h5")
        solved.append(sum(row["status"] == "converged" for row in rows))
        assert solved[-1] > solved[-2]
    assert len(solved) > 2


def test_a_time_without_end_is_no_limit(run):
    _, events, outcome = run(overrides=("elastomer.n=0",), max_seconds=float("inf"), jobs=1)
    assert outcome.total() == 2
    assert not [event for event in events if event.event == "warning"]


def test_a_study_whose_folder_is_renamed_during_a_run_does_not_begin_anew(run, tmp_path):
    """The run ends with an error; with its name back, the study goes on with what was solved."""
    folder, aside = tmp_path / "results", tmp_path / "renamed"
    folder.mkdir()

    def rename(event):
        if event.event == "end" and folder.exists():
            folder.rename(aside)

    with pytest.raises(SpaceError, match=r"study\.parts: renamed or deleted during the run"):
        run(name="results/study.h5", report=rename, jobs=2)
    assert not folder.exists()
    aside.rename(folder)
    path, events, _ = run(name="results/study.h5")
    assert sum(event.event == "start" for event in events) < 4
    assert {row["status"] for row in read_rows(path)} == {"converged"}


def test_a_file_in_place_of_unfinished_work_ends_the_run(run, tmp_path):
    parts = tmp_path / "study.parts"

    def replace(event):
        if event.event == "end" and parts.is_dir():
            shutil.rmtree(parts)
            parts.write_text("mine")

    with pytest.raises(SpaceError, match="renamed or deleted during the run"):
        run(report=replace, jobs=1)
    assert parts.read_text() == "mine"


@pytest.mark.parametrize("shard", [(0, 1), (0, 2)])
def test_unfinished_work_that_is_deleted_ends_the_run_and_is_not_made_anew(run, tmp_path, shard):
    """Also that of a shard, which leaves collecting to the others; no other task is begun."""
    parts, begun = tmp_path / "study.parts", []

    def delete(event):
        if event.event == "start":
            begun.append(event.task)
        elif event.event == "end" and parts.exists():
            shutil.rmtree(parts)

    with pytest.raises(SpaceError, match="renamed or deleted during the run"):
        run(report=delete, jobs=1, shard=shard)
    assert len(begun) == 1
    assert not list(tmp_path.glob("study*"))


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_study_that_is_deleted_during_a_run_is_said_to_lack_its_results(run, tmp_path, jobs):
    path, *_ = run(overrides=("elastomer.n=0",))
    stored = len(read_rows(path))

    def delete(event):
        if event.event == "end":
            path.unlink(missing_ok=True)

    with pytest.raises(Interrupted, match=rf"study\.h5: deleted .* with {stored} results"):
        run(report=delete, jobs=jobs)
    path, _, outcome = run()
    assert set(outcome) == {"converged"}
    assert {row["status"] for row in read_rows(path)} == {"converged"}


@pytest.fixture
def run_on_map(tmp_path):
    """Runs a spec of three loads on a map; calls `change` with its path as an event is reported."""
    np.save(tmp_path / "h.npy", np.random.default_rng(0).normal(size=(64, 64)))
    (tmp_path / "spec.toml").write_text(
        '[surface]\nkind = "file"\npath = "h.npy"\nlength = 1.0\n'
        '[elastomer]\nkind = "half-space"\n[grid]\npoints = 64\n[load]\np_star = [0.1, 0.2, 0.3]\n'
    )
    spec, text = read_spec(tmp_path / "spec.toml", ())

    def run(change=lambda path, event: None):
        events = []

        def report(event):
            events.append(event)
            change(tmp_path / "h.npy", event)

        return run_study(spec, text, tmp_path / "study.h5", report, RunOptions(jobs=1)), events

    return run


def test_a_file_that_changes_during_a_run_fails_the_tasks_that_use_it(run_on_map):
    """Its checksum would stand beside results of other heights."""

    def replace(path, event):
        if (event.task, event.event) == (1, "step"):
            np.save(path.with_name("new.npy"), 2 * np.load(path))
            path.with_name("new.npy").replace(path)

    counts, events = run_on_map(replace)
    assert counts == {"converged": 1, "failed": 2}
    errors = [event.message for event in events if event.status == "failed"]
    assert all("h.npy: the file was changed during the run" in error for error in errors)
    assert not [event for event in events if event.task == 2 and event.event == "step"]
    assert run_on_map()[0] == {"converged": 3}


def test_a_file_that_is_touched_during_a_run_has_no_effect(run_on_map):
    """Backups, copies and `touch` change its date and its place on the disk, not its content."""

    def copy(path, event):
        if event.event == "end" and event.task == 0:
            path.with_name("same.npy").write_bytes(path.read_bytes())
            path.with_name("same.npy").replace(path)

    assert run_on_map(copy)[0] == {"converged": 3}
