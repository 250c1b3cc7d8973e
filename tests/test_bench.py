from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from specs import power_spec

from gfmd_cli.bench import run as bench
from gfmd_cli.bench.file import Trace, read_bench, write_bench
from gfmd_cli.bench.results import bench_table, contact_of, draw_bench, solver_names
from gfmd_cli.bench.run import REFERENCE, run_bench, solve_reference, solvers_to_compare
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.observables import MAIN_OBSERVABLES, observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.solvers.dual import Dual
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.tasks import plan

SPEC = power_spec(
    n=1,
    points=128,
    p_star=0.1,
    cutoff=0.05,
    name="tiny",
    more='[solver]\nkind = ["auto", "ccg", "fire"]\n',
)


@pytest.fixture
def gfmd(tmp_path, monkeypatch, invoke):
    """Calls the command in tmp_path, where spec.toml is SPEC on a smaller grid."""
    monkeypatch.chdir(tmp_path)
    Path("spec.toml").write_text(SPEC.replace("128", "64"))
    return invoke


def ignore(_):
    pass


def kinds(spec):
    """Solvers that are compared on each contact, one contact a elastomer."""
    names = []
    for task in plan(spec, suited=False):
        contact = build_scene(task.surface, task.elastomer, task.points).contact(task.load)
        names.append([solver.kind for solver in solvers_to_compare(spec, task, contact)])
    return names


def made_up(errors, points=64, **row):
    """A trace with these errors, one transform and a millisecond each."""
    known = {
        "surface": "s", "seed": 0, "elastomer": "e", "points": points, "p_star": 0.1, "solver": "a",
        "tolerance": 1e-6, "nested": True, "residual": 0.0, "status": "converged",
        "reference_residual": 1e-10,
    }  # fmt: skip
    samples = [(i + 1.0, 1e-3 * (i + 1), points, 1.0, e, e, e) for i, e in enumerate(errors)]
    return Trace.of(known | row, samples)


def test_errors_fall_to_the_tolerance_while_costs_rise(spec_of):
    traces = run_bench(spec_of("elastomer.n=[1, 3]"), ignore)
    assert [trace.row["solver"] for trace in traces] == ["pcg", "ccg", "fire"] * 2
    for trace in traces:
        samples = trace.samples
        assert trace.row["status"] == "converged"
        assert trace.row["reference_residual"] < 1e-9
        assert samples["residual"][-1] == trace.row["residual"] < 1e-6
        assert np.all(np.diff(samples["transforms"]) > 0)
        assert np.all(np.diff(samples["seconds"]) > 0)
        assert samples["transforms"].size > 10
        for name in ("sigma_p", "u_g"):
            lasting = trace.lasting_error(name)
            assert lasting[-1] < 1e-5
            assert np.nanmax(samples[f"{name}_error"]) > 100 * lasting[-1]
            assert np.all(np.diff(lasting[np.isfinite(lasting)]) <= 0)
        assert samples["a_r_error"][-1] < 1e-3


def test_coarser_grids_cost_but_have_no_error(spec_of):
    trace = run_bench(spec_of("solver.kind='pcg'"), ignore)[0]
    coarse = trace.samples["points"] < 128
    assert np.any(coarse)
    assert np.all(np.isnan(trace.samples["u_g_error"]) == coarse)
    assert trace.samples["transforms"][~coarse][0] > trace.samples["transforms"][coarse][-1] > 0
    assert np.all(np.isinf(trace.lasting_error("u_g")) == coarse)


def test_samples_are_taken_as_the_transforms_grow(spec_of):
    trace = run_bench(spec_of("solver.kind='fire'", "solver.nested=false"), ignore)[0]
    transforms = trace.samples["transforms"]
    assert np.all(transforms[1:-1] >= 1.05 * transforms[:-2])


def test_the_recording_is_not_timed(spec_of, monkeypatch):
    clock = [0.0]
    observe = bench.observe

    def slow(*words):
        clock[0] += 100.0
        return observe(*words)

    monkeypatch.setattr(bench, "observe", slow)
    monkeypatch.setattr(bench.time, "process_time", lambda: clock[0])
    for trace in run_bench(spec_of(), ignore):
        assert np.all(trace.samples["seconds"] == 0)


def test_an_open_choice_of_solver_compares_all_that_fit_the_elastomer(spec_of):
    spec = spec_of("solver.kind='auto'", "elastomer.n=[0, 1, 3]", "grid.points=64")
    assert kinds(spec) == [
        ["sort", "ccg", "fire", "polonsky-keer"],
        ["pcg", "ccg", "fire", "polonsky-keer"],
        ["pcg", "ccg", "fire"],
    ]
    spec = spec_of("solver.kind=['sort', 'pcg', 'polonsky-keer']", "elastomer.n=[0, 3]")
    assert kinds(spec)[0] == ["sort", "pcg", "polonsky-keer"]
    assert kinds(spec)[-1] == ["pcg"]


def test_a_solver_that_is_left_out_is_told(spec_of):
    spec = spec_of("solver.kind=['auto', 'polonsky-keer']", "elastomer.n=[1, 3]", "grid.points=40",
                   "load.p_star=[0.1, 0.2]")  # fmt: skip
    told = []
    traces = run_bench(spec, told.append)
    solvers = [trace.row["solver"] for trace in traces]
    assert solvers == ["pcg", "polonsky-keer", "pcg", "polonsky-keer", "pcg", "pcg"]
    (warning,) = (each.message for each in told if each.event == "warning")
    assert warning == "polonsky-keer is left out, as it does not suit power n=3"


def test_a_reference_that_rounding_stops_is_as_good_as_it_gets(spec_of, monkeypatch):
    hopeless = REFERENCE.model_copy(update={"tolerance": 1e-16})
    monkeypatch.setattr(bench, "REFERENCE", hopeless)
    task = plan(spec_of("grid.points=64"))[0]
    contact = build_scene(task.surface, task.elastomer, task.points).contact(task.load)
    observables, residual = solve_reference(contact)
    assert 1e-16 < residual < 1e-10
    assert observables.u_g > 0


def test_an_error_counts_as_reached_where_it_lasts():
    trace = made_up([np.nan, 1.0, 1e-5, 1e-3, 1e-5, 1e-7])
    assert trace.reached("u_g", 1e-4) == (5.0, 5e-3)
    assert trace.reached("u_g", 1e-2) == (3.0, 3e-3)
    assert trace.reached("u_g", 1e-8) is None
    assert trace.reached("u_g", 10.0) == (2.0, 2e-3)


def test_the_table_has_a_dash_where_an_error_is_never_reached():
    table = bench_table(
        [made_up([1.0, 1e-3], status="max_steps"), made_up([1e-7], points=32)]
    ).as_text()
    row = next(line for line in table.splitlines() if "max_steps" in line).split()
    assert row[:10] == ["e", "64", "0.1", "a", "2", "-", "-", "0.002", "-", "-"]
    assert "surface" not in table
    several = bench_table([made_up([1.0]), made_up([1.0], surface="other")]).as_text()
    assert "surface" in several
    assert "other" in several


def test_names_tell_runs_of_one_solver_apart():
    traces = [made_up([1.0], tolerance=1e-3), made_up([1.0]), made_up([1.0], nested=False)]
    assert solver_names(traces) == [
        "a, tolerance=0.001, nested=True",
        "a, tolerance=1e-06, nested=True",
        "a, tolerance=1e-06, nested=False",
    ]
    assert solver_names(traces[1:2]) == ["a"]
    traces = [made_up([1.0], time_step=step, max_steps=9) for step in (0.5, 1.2)]
    other = made_up([1.0], solver="b", max_steps=7)
    assert solver_names([*traces, other]) == [
        "a, max_steps=9, time_step=0.5", "a, max_steps=9, time_step=1.2", "b, max_steps=7",
    ]  # fmt: skip


def test_the_keys_of_each_solver_are_stored_with_its_trace(spec_of):
    spec = spec_of("solver=[{kind='fire', time_step=0.5}, {kind='fire', time_step=1.2}]")
    steps = [trace.row["time_step"] for trace in run_bench(spec, ignore)]
    assert set(steps) == {0.5, 1.2}


def test_boundaries_are_a_column_where_there_are_several():
    traces = [made_up([1e-3], boundary=name) for name in ("periodic", "free")]
    assert "boundary" in bench_table(traces).as_text()
    assert "boundary" not in bench_table(traces[:1]).as_text()


def test_a_bench_is_stored_with_labels_and_read_back(spec_of, tmp_path):
    spec, path = spec_of("solver.kind=['auto', 'ccg']"), tmp_path / "b.h5"
    traces = run_bench(spec, ignore)
    write_bench(path, spec, SPEC, traces)
    assert [p.name for p in tmp_path.glob("*b.h5*")] == ["b.h5"]
    for old, new in zip(traces, read_bench(path), strict=True):
        assert {k: v for k, v in old.row.items() if v == v} == {
            k: v for k, v in new.row.items() if v == v
        }
        for name, values in old.samples.items():
            np.testing.assert_array_equal(new.samples[name], values)
    with xarray.open_dataset(path, engine="h5netcdf", group="runs/1") as data:
        assert data["u_g_error"].dims == ("sample",)
        assert data["seconds"].attrs["units"] == "s"
        assert all(data[name].attrs["long_name"] for name in data.variables)
        assert data.attrs["solver"] == "ccg"
        assert {f"{name}_reference" for name in MAIN_OBSERVABLES} < set(data.attrs)
    with h5py.File(path) as file:
        assert file.attrs["spec_text"] == SPEC
        assert {"software_version", "machine", "date", "spec_digest"} < set(file.attrs)


def test_few_scenes_share_a_figure_and_many_have_one_each(tmp_path):
    flat = [made_up([0.0], elastomer="flat"), made_up([0.1, 0.0], status="max_steps")]
    lost = made_up([np.nan, np.nan], elastomer="lost", status="diverged")
    few = draw_bench([*flat, lost], tmp_path / "few")
    assert sorted(path.name for path in few) == ["work_precision.pdf", "work_precision.png"]
    assert all(path.stat().st_size > 1000 for path in few)
    assert len(draw_bench([lost], tmp_path / "lost")) == 2
    many = draw_bench([made_up([1.0, 0.1], points=2**i) for i in range(3, 8)], tmp_path / "many")
    names = [path.name for path in many]
    assert len(set(names)) == 10
    assert names[0] == "work_precision_0_e-on-s-8-points-p=0.1.pdf"


def test_a_solver_without_transforms_is_drawn(gfmd):
    done = gfmd("bench", "spec.toml", "-q", "--set", "elastomer.n=0", "--set", "solver.kind='auto'")
    assert done.exit_code == 0
    assert "log" not in done.output  # a warning of a logarithmic axis
    (line,) = (line.split() for line in done.output.splitlines() if "sort" in line)
    assert line[line.index("sort") + 1] == "0"
    assert Path("work_precision.png").exists()


def test_bench_prints_a_table_and_keeps_file_and_figure(gfmd):
    result = gfmd("bench", "spec.toml", "--figures", "out")
    assert result.exit_code == 0, result.output
    for solver in ("pcg", "ccg", "fire"):
        assert any(
            f" {solver} " in line and line.endswith("converged")
            for line in result.stdout.splitlines()
        )
    assert Path("out/work_precision.png").read_bytes().startswith(b"\x89PNG")
    assert Path("out/work_precision.pdf").exists()
    assert len(read_bench(Path("tiny-bench.h5"))) == 3
    result = gfmd("analyze", "tiny-bench.h5")
    assert result.exit_code == 74
    assert "a bench file, not a study" in result.output
    before = Path("tiny-bench.h5").read_bytes()
    again = gfmd("bench", "spec.toml", "-q")  # measures again
    assert again.exit_code == 0
    assert Path("tiny-bench.h5").read_bytes() != before
    other = gfmd("bench", "spec.toml", "--set", "load.p_star=0.2")
    assert other.exit_code == 2
    assert "load.p_star" in other.output


def test_what_is_no_bench_is_not_replaced(gfmd):
    Path("notes.h5").write_text("dear diary")
    with h5py.File("study.h5", "w") as file:
        file.attrs["layout"] = 1
    with h5py.File("damaged.h5", "w") as file:
        file.attrs.update({"bench_layout": 1, "spec": [1.0, 2.0]})
    for name in ("notes.h5", "study.h5", "damaged.h5"):
        before = Path(name).read_bytes()
        result = gfmd("bench", "spec.toml", "-o", name)
        assert result.exit_code == 2
        assert "is not a bench file" in result.output
        assert Path(name).read_bytes() == before


@pytest.mark.parametrize(
    "words",
    [
        ("none.toml",),
        ("spec.toml", "--set", "elastomer.n=9"),
        ("spec.toml", "--set", "surface.cutoff=0.001"),
        ("spec.toml", "--set", "solver.kind='sort'"),
    ],
)
def test_a_bad_spec_ends_in_status_2_and_leaves_nothing(gfmd, words):
    before = set(Path().iterdir())
    result = gfmd("bench", *words)
    assert result.exit_code == 2
    assert result.output.strip()
    assert set(Path().iterdir()) == before


def test_a_place_that_cannot_be_written_is_told_before_anything_is_solved(gfmd, monkeypatch):
    monkeypatch.setattr(bench, "run_bench", lambda *_: pytest.fail("solved"))
    Path("file").write_text("")
    result = gfmd("bench", "spec.toml", "-o", "file/b.h5")
    assert result.exit_code == 73
    assert "cannot be written" in result.output


def test_a_missed_tolerance_is_status_1(gfmd):
    result = gfmd("bench", "spec.toml", "--set", "solver.max_steps=3")
    assert result.exit_code == 1
    assert "max_steps" in result.output
    assert Path("tiny-bench.h5").exists()


def test_a_bench_of_a_free_boundary_has_the_solver_that_suits_it(spec_of):
    spec = spec_of("grid.boundary=free", "grid.points=64", "solver.kind=auto")
    (trace,) = run_bench(spec, ignore)
    assert trace.row["solver"] == "dual"
    assert trace.row["boundary"] == "free"
    assert trace.row["status"] == "converged"
    (task,) = plan(spec)
    contact = build_free_scene(task.surface, task.elastomer, 64).contact(0.1)
    solution = solve_contact(contact, Dual(tolerance=1e-9))
    observables = observe(contact, solution.u, solution.sigma)
    assert trace.row["u_g_reference"] == pytest.approx(observables.u_g, rel=1e-6)
    assert trace.samples["u_g_error"][-1] < 1e-4


def test_boundaries_are_scenes_of_their_own():
    periodic, free = (made_up([1e-3], boundary=name) for name in ("periodic", "free"))
    assert contact_of(periodic) != contact_of(free)
