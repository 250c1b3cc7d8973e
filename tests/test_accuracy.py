"""Errors of a study: "auto" grids, error bounds, spreads over seeds."""

import json
from functools import cache

import numpy as np
import pytest
from scipy import stats
from scipy.special import erf
from specs import power_spec

from gfmd_cli import solve
from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.ensemble import Ensemble, ensembles, spread_of
from gfmd_cli.analysis.run_summary import MAX_ROWS, run_text
from gfmd_cli.analysis.table import plus_minus
from gfmd_cli.analysis.tables import seeds_table, study_tables
from gfmd_cli.bench.run import run_bench
from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomers import Power, Slab
from gfmd_cli.physics.error_bounds import error_bounds
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.status import Status
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.refinement import _sizes
from gfmd_cli.study.resources import HEADROOM
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.tasks import plan

SPEC = power_spec(
    n=1,
    points='"auto"',
    p_star=0.1,
    cutoff=0.06,
    more="""\
[accuracy]
mean_gap = 0.01
contact_area = 0.05
""",
)
MAIN_OBSERVABLES = ("a_r", "sigma_p", "u_g")


HOLED = """\
[surface]
kind = "file"
path = "holed.npy"
[elastomer]
kind = "power"
n = 1
[load]
p_star = 0.3
[grid]
points = 64
[accuracy]
mean_gap = 0.5
"""


@pytest.mark.parametrize(("missing", "verdict"), [("void", "unknown"), ("fill", "regular")])
def test_a_map_with_voids_has_no_error_bars(rows_of, tmp_path, missing, verdict):
    """A hole has an edge, which no law describes."""
    heights = SelfAffine(cutoff=0.1).heights(64, 64)
    heights[20, 20] = np.nan
    np.save(tmp_path / "holed.npy", heights)
    keys = (f'surface.missing="{missing}"', 'surface.interpolation="fourier"')
    (row,) = rows_of(*keys, text=HOLED)
    assert [row[f"{name}_verdict"] for name in MAIN_OBSERVABLES] == [verdict] * 3


def test_gaps_below_the_heights_of_voids_have_errors_too(rows_of, tmp_path):
    x = 2 * np.pi * np.arange(32) / 32
    heights = np.cos(x) + np.cos(x)[:, None]
    heights[heights > 1.2] = np.nan
    np.save(tmp_path / "holed.npy", heights)
    keys = ('surface.missing="void"', "grid.points=32", "load={pressure=9.0}")
    (row,) = rows_of(*keys, "elastomer={kind='half-space'}", text=HOLED)
    assert row["u_g"] < 0 < row["u_g_algebraic"]


# --- grids chosen by accuracy ---------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 0.5, 1, 2, 3])
def test_an_auto_grid_is_as_good_as_asked(rows_of, n):
    (row,) = rows_of(f"elastomer.n={n}")
    (fine,) = rows_of(f"elastomer.n={n}", f"grid.points={4 * row['points']}", name="fine.h5")
    assert (row["status"], row["grid"]) == ("converged", "auto")
    for name, share in (("u_g", 0.01), ("a_r", 0.05)):
        best, error = row[f"{name}_continuum"], row[f"{name}_continuum_error"]
        assert 0 < error <= share * best
        assert abs(fine[f"{name}_continuum"] - best) <= error + fine[f"{name}_continuum_error"]
        assert abs(fine[f"{name}_continuum"] - row[name]) <= 1.1 * row[f"{name}_error"]


def test_an_auto_grid_resolves_an_oblong_cell(rows_of):
    """84 points along x resolve the cut-off, but 168 along y do not."""
    (row,) = rows_of(
        "surface={kind='self-affine', cutoff=0.0235, length_y=2}", "elastomer.n=0",
        "grid.points='auto'", "accuracy={mean_gap=0.1}",
    )  # fmt: skip
    assert row["status"] == "converged"
    assert (row["points"], row["points_y"]) == (88, 176)


@pytest.mark.parametrize("length_y", [0.07, 0.5, 1.3, 2.17, 3])
@pytest.mark.parametrize("max_points", [257, 4096])
def test_auto_grids_of_an_oblong_cell_are_halves_of_each_other(spec_of, length_y, max_points):
    for cutoff, p_star in ((2 / 85, 0.01), (0.031, 0.01), (0.1, 0.01), (0.1, 3)):
        (task,) = plan(
            spec_of(
                f"surface={{kind='self-affine', cutoff={cutoff}, length_y={length_y}}}",
                f"load={{p_star={p_star}}}", "grid.points='auto'",
                f"accuracy={{mean_gap=0.003, max_points={max_points}}}",
            )
        )  # fmt: skip
        sizes = _sizes(task)
        assert task.points in sizes
        first_y = task.points_y_on(sizes[0])
        assert first_y % 2 == 0
        for i, points in enumerate(sizes):
            assert task.points_y_on(points) == first_y * 2**i
            task.surface.check_resolved(points, first_y * 2**i)


def test_less_is_asked_of_a_coarser_grid(rows_of):
    loose = rows_of("accuracy.mean_gap=0.1", "accuracy.contact_area=0.3")[0]
    tight = rows_of("accuracy.mean_gap=0.001", "accuracy.contact_area=0.02", name="tight.h5")[0]
    assert loose["points"] < tight["points"]
    assert loose["u_g_error"] > tight["u_g_error"]


def test_an_auto_grid_ends_where_it_may_not_grow(rows_of):
    (row,) = rows_of("accuracy.mean_gap=1e-6", "accuracy.max_points=100")
    assert (row["status"], row["points"]) == (Status.ACCURACY_NOT_REACHED, 64)
    assert row["points_y"] == 64  # not those of the forecast, 100
    assert row["u_g_error"] > 1e-6 * row["u_g"]
    text = Status.ACCURACY_NOT_REACHED.explain(row)
    assert "next to full contact" not in text
    assert text.startswith("estimated errors on the grid with 64 points along x are larger")


def test_a_limit_below_the_first_auto_grid_is_refused(spec_of):
    assert plan(spec_of("accuracy.max_points=64"))
    with pytest.raises(InputError, match=r"max_points: 63 given, but .* 64 points .* 64 or more"):
        plan(spec_of("accuracy.max_points=63"))


def test_a_grid_that_ends_next_to_full_contact_says_why(rows_of):
    (row,) = rows_of("load.p_star=3.1", "accuracy={mean_gap=1e-3, max_points=128}")
    assert row["status"] == Status.ACCURACY_NOT_REACHED
    assert 0.99 < row["a_r"] < 1
    assert "loosen accuracy.mean_gap" in Status.ACCURACY_NOT_REACHED.explain(row)


def test_an_auto_grid_ends_where_memory_ends(rows_of, monkeypatch, spec_of):
    (task,) = plan(spec_of())
    enough = 1.2 * max(task.bytes, 2.2e8) / 0.9
    monkeypatch.setattr("gfmd_cli.study.resources.available_memory", lambda: enough)
    (row,) = rows_of("accuracy.mean_gap=1e-9")
    assert row["status"] == Status.ACCURACY_NOT_REACHED
    assert row["points"] < 1200


def test_a_solve_that_does_not_converge_is_kept_where_memory_ends(monkeypatch, spec_of, tmp_path):
    """No finer grid follows it, so that a reproducible run needs no memory for one."""
    spec = spec_of("accuracy.mean_gap=1e-9", "solver.max_steps=1", "surface.cutoff=0.01")
    (task,) = plan(spec)
    enough = np.mean([task.bytes_on(points * task.least_points) for points in (1, 2)]) / HEADROOM
    monkeypatch.setattr("gfmd_cli.study.resources.available_memory", lambda: enough)
    options = RunOptions(jobs=1, reproducible=True)
    run_study(spec, SPEC, tmp_path / "study.h5", lambda _: None, options)
    (row,) = read_rows(tmp_path / "study.h5")
    assert row["status"] == Status.MAX_STEPS


def test_no_grid_is_spent_on_what_has_no_limit(rows_of):
    (row,) = rows_of("elastomer.n=4", "accuracy={stress_deviation=0.1}")
    assert (row["status"], row["sigma_p_verdict"]) == (Status.ACCURACY_NOT_REACHED, "diverges")
    assert row["points"] <= 72
    assert np.isnan(row["sigma_p_error"])


def test_the_area_of_a_plate_needs_a_second_grid(rows_of):
    (row,) = rows_of("elastomer.n=4", "load.p_star=1.0", "accuracy={contact_area=0.3}")
    assert (row["status"], row["a_r_verdict"]) == (Status.CONVERGED, "regular")
    assert row["a_r_continuum"] < row["a_r"]
    assert row["a_r_continuum_error"] <= 0.3 * row["a_r_continuum"]


@pytest.mark.parametrize("a_r", [0.2, 0.7])
def test_the_membrane_on_a_paraboloid_has_its_exact_area_within_the_bar(rows_of, a_r):
    """a_r = p / (p + 2 tau / R) in any periodic cell."""
    text = SPEC.replace('kind = "self-affine"\ncutoff = 0.06', 'kind = "parabola"\nradius = 1.0')
    text = text.replace('kind = "power"\nn = 1', 'kind = "membrane"\ntension = 1.0')
    text = text.replace("p_star = 0.1", f"pressure = {2 * a_r / (1 - a_r)}")
    (row,) = rows_of(text=text)
    assert row["status"] == "converged"
    assert abs(row["a_r_continuum"] - a_r) <= row["a_r_continuum_error"] <= 0.05 * a_r
    assert abs(row["a_r"] - a_r) <= row["a_r_error"]


def test_a_given_grid_gets_errors_where_they_are_asked_for(rows_of):
    (row,) = rows_of("grid.points=128", "accuracy.mean_gap=1e-9")
    assert (row["status"], row["points"], row["grid"]) == ("converged", 128, "given")
    assert all(row[f"{name}_error"] > 0 for name in MAIN_OBSERVABLES)
    plain = SPEC.partition("[accuracy]")[0]
    (other,) = rows_of("grid.points=128", text=plain, name="plain.h5")
    assert all(np.isnan(other[f"{name}_error"]) for name in MAIN_OBSERVABLES)
    assert [other[name] for name in MAIN_OBSERVABLES] == pytest.approx(
        [row[name] for name in MAIN_OBSERVABLES], rel=1e-5
    )


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_a_turned_map_has_the_error_bars_of_the_map(boundary):
    """On a second grid, too, which only one of the numbers of points is large enough for."""
    heights = np.maximum(SelfAffine(cutoff=1 / 12, length_y=0.75).heights(64, 48), -0.5)
    spec = {
        "surface": {"length": 1.0},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": 128, "boundary": boundary},
        "load": {"pressure": 1.0},
        "solver": {"tolerance": 1e-10},
        "accuracy": {"mean_gap": 0.5},
    }
    turned = spec | {"surface": {"length": 0.75}, "grid": {"points": 96, "boundary": boundary}}
    ends = ("", "_error", "_continuum", "_continuum_error")
    names = [f"{name}{end}" for name in ("a_r", "u_g") for end in ends]
    one = solve(spec, heights=heights).columns
    other = solve(turned, heights=np.rot90(heights)).columns
    assert one["a_r_verdict"] == one["u_g_verdict"] == "regular"
    assert [other[name] for name in names] == pytest.approx([one[name] for name in names], rel=1e-6)


def test_the_finest_grid_of_a_small_contact_is_solved_on_tiles():
    """As without [accuracy]: both grids take as many transforms as two solves of their own."""

    def transforms(points, **tables):
        surface = {"kind": "self-affine", "cutoff": 0.05}
        half_space = {"kind": "power", "n": 1}
        spec = {"surface": surface, "elastomer": half_space, "grid": {"points": points}}
        return solve(spec | {"load": {"p_star": 0.003}} | tables).columns["transforms"]

    expected = transforms(512) + transforms(256) / 4
    assert transforms(512, accuracy={"mean_gap": 0.1}) == pytest.approx(expected)


def test_pressures_share_the_scene_of_the_finest_grid(rows_of, monkeypatch):
    """That of the coarser grid is built anew: both would take more memory than predicted."""
    built = []

    def build(surface, elastomer, points, *shared, points_y):
        built.append(points)
        return build_scene(surface, elastomer, points, *shared, points_y=points_y)

    monkeypatch.setitem(SCENES, "periodic", build)
    together = rows_of("grid.points=128", "load.p_star=[0.05,0.1,0.2]")
    assert built == [64, 128, 64, 64]
    built.clear()
    rows_of("grid.points=[130,128]", "surface.seed=[1,2]", name="others.h5")
    assert built == [130, 64, 128] * 2  # 65 points are odd
    alone = [rows_of("grid.points=128", f"load.p_star={p}", name=f"{p}.h5") for p in (0.05, 0.2)]
    for (row,), shared in zip(alone, together[::2], strict=True):
        assert [row[name] for name in MAIN_OBSERVABLES] == [
            shared[name] for name in MAIN_OBSERVABLES
        ]


def test_nearly_full_contact_on_a_second_grid_is_contact(rows_of):
    """Interpolated from the first grid, all pressed points have gaps of rounding."""
    surface = "surface={kind='self-affine', cutoff=0.3, rolloff=0.3, hurst=0.79, seed=9079}"
    at = ("elastomer={kind='half-space'}", "grid.points=128", "load.p_star=2.3")
    rows = [
        rows_of(surface, *at, f"solver.tolerance={tolerance}", "accuracy={contact_area=0.05}")[0]
        for tolerance in (1e-4, 1e-11)
    ]
    assert rows[1]["a_r"] > 0.99
    assert rows[0]["a_r"] == pytest.approx(
        rows[1]["a_r"], abs=rows[0]["a_r_algebraic"] + 3 / 128**2
    )


def test_full_contact_is_exact(rows_of):
    (row,) = rows_of("load.p_star=30")
    assert (row["a_r"], row["a_r_error"], row["u_g_error"]) == (1, 0, 0)
    assert [row[f"{name}_continuum"] for name in ("a_r", "u_g")] == [1, 0]
    assert row["status"] == "converged"


def test_full_contact_with_white_noise_has_a_bar_of_the_stress(tmp_path):
    """Delta_sigma of a map with monotone interpolation depends on the grid."""
    heights = np.random.default_rng(7).normal(size=(32, 32))
    spec = {
        "elastomer": {"kind": "power", "n": 0.5},
        "load": {"pressure": 100.0},
        "accuracy": {"stress_deviation": 0.01},
    }
    rows = [
        solve(spec | {"grid": {"points": points}}, heights=heights).columns
        for points in (32, 128, 256)
    ]
    assert [row["a_r"] for row in rows] == [1, 1, 1]
    assert rows[0]["sigma_p_verdict"] == rows[0]["a_r_verdict"] == "unknown"
    assert rows[1]["sigma_p_verdict"] == "regular"
    first, *finer = (row["sigma_p"] * row["delta_sigma"] for row in rows)
    assert first > 1.2 * finer[0]
    error = rows[1]["sigma_p_error"] * rows[1]["delta_sigma"]
    assert 0 < abs(finer[1] - finer[0]) <= error < 0.05 * finer[0]


@pytest.mark.parametrize(("boundary", "n"), [("periodic", 1.0), ("free", 0.9)])
def test_full_contact_of_a_map_with_kinks_holds_the_gap_between_its_points(boundary, n):
    """Both grids are in full contact, so that their change is zero; a finer grid is not."""
    heights = np.random.default_rng(5).normal(size=(32, 32))
    accuracy = {"accuracy": {"contact_area": 0.1}}

    def solved(points, pressure, **more):
        tables = {"elastomer": {"kind": "power", "n": n}, "load": {"pressure": pressure}, **more}
        grid = {"points": points, "boundary": boundary}
        return solve(tables | {"grid": grid}, heights=heights)

    low, high = 10.0, 1e4
    while high > 1.003 * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if solved(128, middle).a_r == 1 else (middle, high)
    coarse, fine = solved(128, high, **accuracy), solved(512, high)
    assert fine.a_r < coarse.a_r == 1
    assert 0 < 1 - fine.a_r <= coarse.columns["a_r_error"] < 0.01
    assert 0 < fine.u_g <= coarse.columns["u_g_error"] < 1e-3


def test_theory_has_the_units_of_its_spectrum_where_they_depend_on_the_grid(rows_of, tmp_path):
    heights = np.random.default_rng(1).normal(size=(64, 64)) > 0
    np.save(tmp_path / "steps.npy", heights.astype(float))
    keys = ("elastomer.n=1.5", "load={pressure=[1000, 10]}", "accuracy={mean_gap=0.1}")
    surface = f"surface={{kind='file', path='{tmp_path}/steps.npy'}}"
    rows = rows_of(surface, *keys)
    assert rows[0]["delta_sigma"] > 1.01 * rows[1]["delta_sigma"]
    comparison = compare(tmp_path / "study.h5")
    for record in comparison.records:
        assert record["a_r_persson"] == pytest.approx(erf(record["p_star"] / np.sqrt(2)), rel=1e-9)
    assert f"Delta_sigma = {rows[1]['delta_sigma']:.6g} to {rows[0]['delta_sigma']:.6g}" in str(
        comparison
    )


def test_an_interrupted_auto_grid_goes_on_bit_for_bit(goes_on_bit_for_bit):
    row, reports = goes_on_bit_for_bit("accuracy.mean_gap=1e-3", "elastomer.n=2")
    assert reports > 50
    assert row["points"] > 100


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[accuracy]\nmean_gap = 0.01\ncontact_area = 0.05\n", ""), ["auto", "[accuracy]"]),
        (("mean_gap = 0.01\ncontact_area = 0.05\n", ""), ["accuracy", "mean_gap"]),
        (("mean_gap = 0.01", "mean_gap = 0"), ["accuracy.mean_gap", "greater than 0"]),
        (("mean_gap = 0.01", "meangap = 0.1"), ["accuracy.meangap", "did you mean 'mean_gap'"]),
        (('"auto"', '"automatic"'), ["grid.points", '"auto"', "automatic"]),
    ],
)
def test_a_wrong_accuracy_is_refused(spec_of, change, words):
    with pytest.raises(InputError) as error:
        spec_of(text=SPEC.replace(*change))
    for word in words:
        assert word in str(error.value)


def test_a_bench_takes_no_auto_grid(spec_of):
    with pytest.raises(InputError, match="auto"):
        run_bench(spec_of(), lambda progress: None)


def test_reduced_pressures_of_a_kinked_cell_are_refused(rows_of):
    text = SPEC.replace('kind = "self-affine"\ncutoff = 0.06', 'kind = "parabola"\nradius = 1.0')
    with pytest.raises(InputError, match=r"load\.p_star: .* give load\.pressure"):
        rows_of(text=text)


def test_the_forecast_of_grids_is_right_within_a_factor_of_four(spec_of, rows_of):
    spec = spec_of("elastomer.n=[0.5, 1, 2]", "load.p_star=[0.03, 0.3]")
    expected = [task.points for task in plan(spec)]
    rows = rows_of("elastomer.n=[0.5, 1, 2]", "load.p_star=[0.03, 0.3]")
    for points, row in zip(expected, rows, strict=True):
        assert 0.25 <= points / row["points"] <= 4


# --- error bounds ---------------------------------------------------------------------------------


@cache
def solved_to(tolerance, elastomer, p_star):
    """A contact, its solution and its observables."""
    contact = build_scene(SelfAffine(cutoff=0.04), elastomer, 128).contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=tolerance))
    contact.recompute(solution.u, solution.sigma)
    return contact, solution, observe(contact, solution.u, solution.sigma)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("p_star", [0.003, 0.1, 1.0, 3.0])
@pytest.mark.parametrize(
    "elastomer", [Power(n=0.5), Power(n=1), Power(n=2), Power(n=4), Slab(thickness=0.02)]
)
def test_the_bounds_hold_the_distance_to_the_solution(elastomer, p_star, tolerance):
    *_, exact = solved_to(1e-11, elastomer, p_star)
    contact, approximate, observables = solved_to(tolerance, elastomer, p_star)
    bounds = error_bounds(contact, approximate.u, approximate.sigma)
    assert abs(observables.u_g - exact.u_g) <= bounds.u_g
    assert abs(observables.sigma_p - exact.sigma_p) <= bounds.sigma_p
    assert (
        observables.energy + p_star * observables.u_g - exact.energy - p_star * exact.u_g + 1e-12
        >= 0
    )
    assert (
        observables.energy + p_star * observables.u_g - exact.energy - p_star * exact.u_g
        <= bounds.duality_gap + 1e-12
    )
    for name in ("u_g", "sigma_p"):
        error = bounds.estimated_error(name, observables, approximate.residual)
        assert abs(getattr(observables, name) - getattr(exact, name)) <= error + 1e-13
    assert abs(observables.a_r - exact.a_r) <= bounds.a_r + 3 / contact.grid.size
    assert bounds.a_r < {1e-2: 0.3, 1e-4: 0.01, 1e-6: 1e-3}[tolerance]


def test_a_bad_solution_gets_wide_bounds():
    contact = build_scene(SelfAffine(cutoff=0.04), Power(n=1), 128).contact(0.1)
    u = contact.settle(np.full(contact.grid.shape, 5.0))
    bounds = error_bounds(contact, u, contact.stress(u, out=contact.grid.empty()))
    exact = solve_contact(contact, Auto(tolerance=1e-9))
    assert bounds.u_g >= float(np.mean(u - exact.u)) > 0.5


@pytest.mark.parametrize("p_star", [0.1, 10.0])
def test_the_bounds_of_any_displacement_are_those_of_the_energies(p_star):
    """J(u) + E(s) of two energies, and the level of the best admissible mean p' = (1 +- t) p."""
    contact = build_scene(SelfAffine(cutoff=0.2), Slab(thickness=0.1), 32).contact(p_star)
    h, p = contact.height, contact.pressure
    draw = np.random.default_rng(0)
    u = h + np.maximum(draw.normal(size=h.shape), 0.0)
    sigma = contact.stress(u, out=contact.grid.empty())
    bounds = error_bounds(contact, u, sigma)

    s = np.maximum(sigma, 0.0)
    s *= p / s.mean()
    k = contact.stiffness.copy()
    k[0, 0] = np.inf
    b = np.mean((s - p) * np.fft.irfft2(np.fft.rfft2(s - p) / k, h.shape))
    gap = np.mean(u * (sigma - p)) / 2 + p * u.mean() - (np.mean(s * h) - b / 2)
    level = (np.mean(s * h) - b) / p
    t = min(np.sqrt(2 * gap / b), 1.0)
    level_bound = (t * b / 2 + gap / t) / p
    assert bounds.duality_gap == pytest.approx(gap, rel=1e-9)
    assert bounds.u_g == pytest.approx(abs(u.mean() - level) + level_bound, rel=1e-9)
    pressure = sigma * ((u == h) & (sigma > 0))
    omitted = np.sqrt(np.mean((sigma - pressure) ** 2))
    assert omitted > 0
    stress_bound = np.sqrt(2 * gap * contact.stiffness.max()) + omitted
    assert bounds.sigma_p == pytest.approx(stress_bound, rel=1e-9)


def test_the_table_says_that_its_values_are_counted_where_those_of_the_continuum_follow(
    rows_of, tmp_path
):
    rows_of()
    counted, *others = study_tables(compare(tmp_path / "study.h5"))
    assert "Values on the grid, not extrapolated" in " ".join(counted.as_text().split())
    assert any(table.as_text().startswith("Continuum values") for table in others)
    rows_of(text=SPEC.partition("[accuracy]")[0].replace('"auto"', "64"), name="plain.h5")
    plain = study_tables(compare(tmp_path / "plain.h5"))
    assert not any("Continuum values" in table.as_text() for table in plain)


# --- seeds ----------------------------------------------------------------------------------------


def test_seeds_have_a_mean_and_a_confidence_interval(rows_of, tmp_path, output_of):
    plain = SPEC.partition("[accuracy]")[0].replace('points = "auto"', "points = 64")
    rows = rows_of("surface.seed=[0, 1, 2, 3]", "load.p_star=[0.1, 1.0]", text=plain)
    comparison = compare(tmp_path / "study.h5")
    groups = ensembles(comparison)
    assert [len(ensemble.rows) for ensemble in groups] == [4, 4]
    values = [row["u_g"] for row in rows if row["p_star"] == 0.1]
    spread = groups[0].spread("u_g")
    low, high = stats.t.interval(0.95, 3, np.mean(values), stats.sem(values))
    assert spread.mean == pytest.approx(np.mean(values))
    assert spread.standard_error == pytest.approx(stats.sem(values))
    assert (spread.mean - spread.half_width, spread.mean + spread.half_width) == pytest.approx(
        (low, high)
    )
    assert "mean of 4 seeds" in seeds_table(comparison).as_text()
    assert "not converged" not in seeds_table(comparison).as_text()
    assert "of some seed is unknown" not in seeds_table(comparison).as_text()
    records = json.loads(output_of("analyze", tmp_path / "study.h5", "--json"))
    assert len(records) == 8
    assert records[0]["u_g_mean"] == pytest.approx(np.mean(values))


def test_seeds_are_not_averaged_where_some_have_a_continuum_value_only():
    rows = [
        {"u_g": 1.0, "u_g_error": 0.1, "u_g_verdict": "unknown"},
        {"u_g": 2.0, "u_g_continuum": 1.8, "u_g_continuum_error": 0.1, "u_g_verdict": "regular"},
    ]
    assert np.isnan(Ensemble(rows).spread("u_g").mean)
    assert Ensemble([rows[1]] * 2).spread("u_g").mean == pytest.approx(1.8)


def test_the_interval_of_a_mean_holds_the_error_that_all_seeds_share(rows_of, tmp_path, output_of):
    """On 64 points sigma_p of n = 2 is too small for every seed, by several of Student's widths."""
    keys = ("surface.seed=[0, 1, 2, 3]", "elastomer.n=2", "load.p_star=0.02")
    means = {}
    for points in (64, 512):
        rows_of(*keys, f"grid.points={points}", name=f"{points}.h5")
        (ensemble,) = ensembles(compare(tmp_path / f"{points}.h5"))
        means[points] = ensemble.spread("sigma_p")
    missed = abs(means[64].mean - means[512].mean)
    assert stats.t.ppf(0.975, 3) * means[64].standard_error < missed < means[64].half_width


def test_the_errors_of_equal_values_remain_in_their_mean():
    row = {"a_r": 0.01, "a_r_error": 0.01, "a_r_continuum": 0.0, "a_r_continuum_error": 0.002}
    assert Ensemble([row, row]).spread("a_r").half_width == pytest.approx(0.002)
    assert spread_of([1.0, 3.0], [0.4, 0.2]).half_width == pytest.approx(
        np.hypot(spread_of([1.0, 3.0]).half_width, 0.3)
    )
    assert spread_of([1.0, 3.0], [np.nan, 0.2]) == spread_of([1.0, 3.0])


def test_equal_values_without_errors_have_no_interval():
    """Their scatter is unknown, not zero, also where it is rounded."""
    row = {"p_star": 0.1, "status": Status.CONVERGED, "load": "p_star", "a_r": 0.1}
    row |= {"sigma_p": 1.0, "u_g": 0.7} | {f"{name}_error": np.nan for name in MAIN_OBSERVABLES}
    assert np.std([0.1] * 3) != 0
    means = Ensemble([row] * 3).means()
    assert all(np.isnan(means[f"{name}_confidence"]) for name in MAIN_OBSERVABLES)
    assert means["a_r_mean"] == pytest.approx(0.1)


@pytest.mark.parametrize("first", [0, 1])
def test_means_are_of_the_rows_with_errors_where_both_are_stored(rows_of, tmp_path, first):
    plain = SPEC.partition("[accuracy]")[0]
    keys = ("surface.seed=[0, 1]", "grid.points=64", "load.p_star=0.1")
    rows_of(*keys, text=(plain, SPEC)[first])
    rows = rows_of(*keys, text=(SPEC, plain)[first])
    known = [row["a_r_continuum"] for row in rows if row["a_r_verdict"]]
    assert (len(rows), len(known)) == (4, 2)
    (ensemble,) = ensembles(compare(tmp_path / "study.h5"))
    assert ensemble.spread("a_r").mean == pytest.approx(np.mean(known))


def test_an_unknown_mean_over_seeds_is_null_in_json(rows_of, tmp_path, output_of):
    rows_of("surface.seed=[0, 1]", "grid.points=64", "load.p_star=0.001")
    text = output_of("analyze", tmp_path / "study.h5", "--json")
    records = json.loads(text, parse_constant=pytest.fail)
    assert [record["a_r_mean"] for record in records] == [None, None]


def test_seeds_with_grids_of_their_own_on_an_oblong_cell_are_averaged(rows_of, tmp_path):
    keys = ("surface.seed=[0, 1]", "surface.length_y=0.5", "accuracy={mean_gap=0.01}")
    rows = rows_of(*keys, "surface.cutoff=0.2")
    assert len({(row["points"], row["points_y"]) for row in rows}) == 2
    (ensemble,) = ensembles(compare(tmp_path / "study.h5"))
    assert len(ensemble.rows) == 2


def test_means_of_a_free_boundary_are_told_apart_on_auto_grids(rows_of, tmp_path):
    rows_of("surface.seed=[0, 1]", "grid.boundary=['periodic', 'free']", "surface.cutoff=0.2",
            "load={pressure=50}", "accuracy={mean_gap=0.2}")  # fmt: skip
    titles = [group.title for group in seeds_table(compare(tmp_path / "study.h5")).groups]
    assert [", free boundary" in title for title in titles] == [False, True]


def test_contacts_of_several_tolerances_have_titles_of_their_own(rows_of, tmp_path, output_of):
    plain = SPEC.partition("[accuracy]")[0].replace('points = "auto"', "points = 32")
    seeds, tolerances = "surface.seed=[0, 1]", "solver.tolerance=[1e-6, 1e-8]"
    rows = rows_of(seeds, tolerances, "surface.cutoff=0.2", text=plain)
    tables = [table.as_text() for table in study_tables(compare(tmp_path / "study.h5"))]
    for text in (*tables, run_text(rows)):
        assert text.count("points a side, tolerance=1e-06") == (1 if "mean of" in text else 2)
        assert text.count("points a side, tolerance=1e-08") == (1 if "mean of" in text else 2)


def test_a_long_table_of_a_run_is_cut(rows_of):
    rows = rows_of(
        "surface.cutoff=0.2", text=SPEC.partition("[accuracy]")[0].replace('"auto"', "32")
    )
    whole, cut = (run_text(rows * count).splitlines() for count in (MAX_ROWS, MAX_ROWS + 2))
    assert cut == [*whole, "", "and 2 more contacts"]


def test_a_pressure_that_was_searched_has_an_interval_and_a_given_one_is_exact(rows_of, tmp_path):
    plain = SPEC.partition("[accuracy]")[0].replace('points = "auto"', "points = 64")
    seeds = "surface.seed=[0, 1, 2]"
    rows = rows_of(seeds, "load={mean_gap=0.5}", text=plain)
    (ensemble,) = ensembles(compare(tmp_path / "study.h5"))
    spread = spread_of([row["p_star"] for row in rows])
    assert ensemble.means()["p_star_confidence"] == spread.half_width > 0
    assert (
        plus_minus(spread.mean, spread.half_width)
        in seeds_table(compare(tmp_path / "study.h5")).as_text()
    )
    (row,) = rows_of("load={mean_gap=0.5}", "accuracy.mean_gap=0.5", text=plain, name="error.h5")
    assert plus_minus(row["p_star"], row["p_star_error"]) in run_text([row])
    half_space = 'elastomer={kind="half-space", E_star=1e9}'
    keys = (seeds, "load={pressure=[1e6, 3.7e6]}", "surface.h_std=1e-6", half_space)
    rows = rows_of(*keys, text=plain, name="pa.h5")
    assert {row["pressure"] for row in rows} == {1e6, 3.7e6}
    assert "p_star_confidence" not in ensembles(compare(tmp_path / "pa.h5"))[0].means()


def test_the_interval_of_a_searched_pressure_holds_the_error_that_all_seeds_share(
    rows_of, tmp_path
):
    keys = ("surface.seed=[0, 1, 2, 3]", "grid.points=64", "accuracy.mean_gap=0.5")
    rows = rows_of(*keys, "elastomer.n=2", "load={contact_area=0.2}")
    (ensemble,) = ensembles(compare(tmp_path / "study.h5"))
    student = spread_of([row["p_star"] for row in rows]).half_width
    shared = np.mean([row["p_star_error"] for row in rows])
    assert ensemble.pressure_spread().half_width == pytest.approx(np.hypot(student, shared))
    unknown = Ensemble([*rows[1:], rows[0] | {"p_star_error": np.nan}]).pressure_spread()
    assert unknown.mean == pytest.approx(ensemble.pressure_spread().mean)
    assert np.isnan(unknown.half_width)


def test_values_that_are_equal_up_to_their_residuals_have_no_interval():
    rows = [{"u_g": u_g, "u_g_error": np.nan, "residual": 1e-6} for u_g in (0.5, 0.5000001)]
    assert np.isnan(Ensemble(rows).spread("u_g").half_width)
    rows[0]["residual"] = rows[1]["residual"] = 1e-8
    assert Ensemble(rows).spread("u_g").half_width > 0


def test_means_over_seeds_name_the_contacts_that_have_not_converged(rows_of, tmp_path):
    plain = SPEC.partition("[accuracy]")[0].replace('points = "auto"', "points = 64")
    steps = "solver={max_steps=1, nested=false}"
    rows_of("surface.seed=[0, 1]", "load.p_star=0.1", steps, text=plain)
    table = seeds_table(compare(tmp_path / "study.h5")).as_text()
    assert "not converged" in table
    assert table.endswith("2 max_steps")
    (ensemble,) = ensembles(compare(tmp_path / "study.h5"))
    assert ensemble.means()["seeds_not_converged"] == 2


def test_the_interval_holds_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(2000):
        values = rng.normal(3.0, 0.5, size=5)
        spread = Ensemble([{"u_g": value, "u_g_error": np.nan} for value in values]).spread("u_g")
        held += abs(spread.mean - 3.0) <= spread.half_width
    assert held / 2000 == pytest.approx(0.95, abs=0.015)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.123456, 0.0123, "0.123 +- 0.012"),
        (1.5, 0.0, "1.5"),
        (12.3456, 3.0, "12.3 +- 3.0"),
        (0.5, np.nan, "0.5"),
    ],
)
def test_values_have_the_digits_that_their_errors_leave(value, error, text):
    assert plus_minus(value, error) == text


def _texture(points):
    """Eight waves along each side, all alike."""
    x = 16 * np.pi * np.arange(points) / points
    return 1e-7 * (np.cos(x)[:, None] + np.cos(x))


def _ribbons(points, seed=0):
    """Minus the square of a Gaussian surface: ridges as high as each other, where that is zero."""
    q = np.hypot(np.fft.fftfreq(points, 1 / points)[:, None], np.fft.fftfreq(points, 1 / points))
    power = np.where((q > 0) & (q <= 7), (1 + (0.3 * q) ** 2) ** -0.75, 0.0)
    noise = np.random.default_rng(seed).standard_normal((points, points))
    a = np.fft.ifft2(np.fft.fft2(noise) * power).real
    return -1e-7 * (a / a.std()) ** 2


@pytest.mark.parametrize("heights", [_texture(64), _ribbons(64)])
@pytest.mark.parametrize("n", [0.5, 1])
def test_bars_hold_for_textures_and_ribbons(heights, n):
    def solved(points):
        tables = {
            "surface": {"length": 1e-4, "periodic": True, "interpolation": "fourier"},
            "elastomer": {"kind": "power", "n": n},
            "grid": {"points": points},
            "load": {"p_star": 0.02},
            "accuracy": {"mean_gap": 0.1, "contact_area": 0.3, "stress_deviation": 0.1},
        }
        return solve(tables, heights=heights).columns

    exact = solved(512)
    for points in (64, 128, "auto"):
        found = solved(points)
        for name in ("a_r", "sigma_p", "u_g"):
            value, bar = found[f"{name}_continuum"], found[f"{name}_continuum_error"]
            own = exact[f"{name}_continuum_error"]
            assert found[f"{name}_verdict"] == ("unknown" if points == 64 else "regular")
            if points != 64:
                assert abs(value - exact[f"{name}_continuum"]) <= np.hypot(bar, own)
    assert exact["u_g_verdict"] == "regular"
