"""Properties of every run: random specs, scales and units, one contact in two descriptions, and the
ends of the number range.

`hypothesis` draws the specs, always the same ones; `make validate` draws many more.
"""

import json
import tempfile
from functools import cache
from math import isfinite, sqrt
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from fields import assert_close
from hypothesis import HealthCheck, given, note, settings
from hypothesis import strategies as st

import gfmd_cli
from gfmd_cli.errors import GfmdError, InputError
from gfmd_cli.physics import einstein_solid
from gfmd_cli.physics.contact import PRESSURE_RANGE
from gfmd_cli.physics.elastomers import Plate, Power, Slab, Tabulated, slab_factor
from gfmd_cli.physics.error_bounds import error_bounds
from gfmd_cli.physics.indenters import Parabola, PowerLawIndenter, Punch, Ridge
from gfmd_cli.physics.observables import MAIN_OBSERVABLES, contact_pressure, observe
from gfmd_cli.physics.persson import Persson, Shells
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.spec.models import GeometricSequence
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.context import SolveContext, Watcher, WorkerOptions
from gfmd_cli.study.measure import error_columns
from gfmd_cli.study.refinement import solve_on_grids
from gfmd_cli.study.tasks import plan

EPS = np.finfo(float).eps
STATUS = {"converged", "max_steps", "rounding", "accuracy_not_reached"}
EXAMPLES = 40


def ignore(*_):
    """A watch, or a note taker, that looks away."""


def spec_of(tables):
    """The spec of plain tables, by way of a TOML file."""
    lines = []
    for name, table in tables.items():
        lines += [f"[{name}]", *(f"{key} = {json.dumps(value)}" for key, value in table.items())]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "spec.toml"
        path.write_text("\n".join(lines))
        return read_spec(path)[0]


def solve(tables):
    """The only task of a spec, solved."""
    (task,) = plan(spec_of(tables))
    return solve_on_grids(task, SolveContext(WorkerOptions()), Watcher())


def elastic(contact, u):
    """K u by NumPy's transforms."""
    return np.fft.irfftn(np.fft.rfftn(u) * contact.stiffness, u.shape, axes=range(u.ndim))


# --- random specs ---------------------------------------------------------------------------------


def power_of_ten(low, high):
    return st.floats(low, high).map(lambda x: float(f"{10**x:.6g}"))


UNIT = power_of_ten(-9, 3)


@st.composite
def surfaces(draw, points):
    kind = draw(st.sampled_from(["self-affine"] * 4 + ["line", "single"]))
    length = draw(UNIT)
    if kind == "self-affine":
        mode = draw(st.integers(1, points // 2))
        surface = {
            "kind": kind,
            "hurst": draw(st.floats(0.05, 1)),
            "cutoff": 1 / mode,
            "rolloff": draw(st.floats(1 / mode, 2)),
            "spectrum": draw(st.sampled_from(["rolloff", "cutoff"])),
            "seed": draw(st.integers(0, 2**63 - 1)),
        }
        if draw(st.booleans()):
            surface["h_std"] = draw(UNIT)
        return surface | {"length": length}
    share = draw(st.floats(0.05, 0.45))
    kinds = {
        "line": [
            {"kind": "ridge", "slope": draw(UNIT), "width": draw(st.floats(0.2, 1))},
            {"kind": "line-parabola", "radius": draw(UNIT)},
            {"kind": "wave", "amplitude": draw(UNIT)},
        ],
        "single": [
            {"kind": "parabola", "radius": draw(UNIT)},
            {"kind": "power-law", "exponent": draw(st.floats(0.5, 8)), "radius": draw(UNIT)},
            {"kind": "cone", "slope": draw(UNIT)},
            {"kind": "punch", "radius": share * length, "depth": draw(UNIT)},
        ],
    }
    return draw(st.sampled_from(kinds[kind])) | {"length": length}


ELASTOMERS = st.one_of(
    st.fixed_dictionaries(
        {
            "kind": st.just("power"),
            "n": st.one_of(st.sampled_from([0, 0.5, 1, 2, 3, 4]), st.floats(0, 4)),
            "k_n": UNIT,
        }
    ),
    st.fixed_dictionaries(
        {"kind": st.just("slab"), "thickness": power_of_ten(-3, 1), "E_star": UNIT}
    ),
    st.fixed_dictionaries({"kind": st.just("half-space"), "E_star": UNIT}),
    st.fixed_dictionaries({"kind": st.just("membrane"), "tension": UNIT}),
    st.fixed_dictionaries({"kind": st.just("plate"), "thickness": UNIT, "E_star": UNIT}),
)


@st.composite
def specs(draw):
    points = 2 * draw(st.integers(8, 64))
    kind = draw(st.sampled_from(["auto"] * 5 + ["pcg", "ccg", "polonsky-keer", "fire"]))
    solver = {
        "kind": kind,
        "tolerance": draw(power_of_ten(-9, -1)),
        "max_steps": 3000 if kind in ("auto", "pcg") else 300,
        "nested": draw(st.booleans()),
    }
    tables = {
        "surface": draw(surfaces(points)),
        "elastomer": draw(ELASTOMERS),
        "grid": {"points": points},
        "load": {"p_star": draw(power_of_ten(-6, 2))},
        "solver": solver,
    }
    if draw(st.booleans()):
        tables["accuracy"] = {"mean_gap": draw(power_of_ten(-3, -0.1))}
    return tables


def check(tables):
    """What holds for every run, whatever its spec and however it ended."""
    note(json.dumps(tables))
    try:
        solved = solve(tables)
    except GfmdError as error:
        note(f"refused: {error}")
        return
    contact, solution, observables = solved.contact, solved.solution, solved.observables
    u, sigma, h, p = solution.u, solution.sigma, contact.height, contact.pressure
    assert solution.status in STATUS
    assert solution.steps <= tables["solver"]["max_steps"]
    assert np.all(np.isfinite(u))
    assert np.all(np.isfinite(sigma))
    check_conditions(contact, solution, tables["solver"]["tolerance"])
    gap, pressure = u - h, contact_pressure(h, u, sigma)
    size = sqrt(np.mean(u**2)) * max(sqrt(np.mean(sigma**2)), p)
    assert abs(2 * observables.energy - observables.work - np.mean(sigma * gap)) <= 64 * EPS * size
    assert observables.u_g == pytest.approx(gap.mean(), rel=1e-12)
    assert observables.sigma_p == pytest.approx(pressure.std(), rel=1e-9, abs=64 * EPS * p)
    assert 0 <= observables.a_r <= 1
    columns = error_columns(solved)
    assert bool(columns) == ("accuracy" in tables)
    for name in MAIN_OBSERVABLES if columns else ():
        error, verdict = columns[f"{name}_error"], columns[f"{name}_verdict"]
        if verdict in ("regular", "exact"):
            assert isfinite(error)
            assert error >= 0
            assert isfinite(columns[f"{name}_continuum"])
            assert columns[f"{name}_continuum_error"] >= 0
    check_bounds(contact, solution, observables)


def check_conditions(contact, solution, tolerance):
    """u >= h, sigma >= 0, complementarity and the mean, by a stress computed with NumPy."""
    u, p, points = solution.u, contact.pressure, contact.grid.points
    stress, gap = elastic(contact, u) + p, u - contact.height
    rounding = 64 * EPS * (np.abs(u).max() * contact.stiffness.max() + p)
    assert_close(solution.sigma, stress, rounding)
    assert np.all(gap >= 0)
    assert abs(solution.sigma.mean() - p) <= rounding
    unit = min(p, 1)
    residual = np.sqrt(np.mean(np.minimum(gap, stress) ** 2)) / unit
    assert solution.residual == pytest.approx(residual, rel=1e-6, abs=rounding / unit)
    if solution.status in ("max_steps", "rounding"):
        assert residual >= tolerance - rounding / unit
        return
    assert residual < tolerance + rounding / unit
    most = residual * unit * points ** (contact.grid.dimension / 2)
    assert stress.min() >= -most - rounding
    partner = np.sqrt(np.mean(np.maximum(gap, stress) ** 2))
    assert abs(np.mean(gap * stress)) <= residual * unit * partner * (1 + 1e-6)


def check_bounds(contact, solution, observables):
    """The bounds hold the distance to a solution at 1e-10, which has bounds of its own."""
    bounds = error_bounds(contact, solution.u, solution.sigma)
    assert bounds.duality_gap >= 0
    close = solve_contact(contact, Auto(tolerance=1e-10, max_steps=3000))
    contact.stress(close.u, out=close.sigma)
    best = error_bounds(contact, close.u, close.sigma)
    truth = observe(contact, close.u, close.sigma)
    rounding = 64 * EPS * (1 + contact.pressure)
    assert abs(observables.u_g - truth.u_g) <= bounds.u_g + best.u_g + rounding
    assert abs(observables.sigma_p - truth.sigma_p) <= bounds.sigma_p + best.sigma_p + rounding


PLAIN = settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))


@PLAIN
@given(specs())
def test_every_spec_is_solved_or_says_why_not(tables):
    check(tables)


@pytest.mark.validation
@settings(PLAIN, max_examples=1200)
@given(specs())
def test_many_more_specs_are_solved_or_say_why_not(tables):
    check(tables)


# --- scales and units -----------------------------------------------------------------------------

SCALED = SelfAffine(cutoff=0.06, h_std=1.0)
EXPONENTS = (0, 0.5, 1, 2, 3, 4)
TWO = 2.0**40  # 1.1e12


def plain_tables(**changes):
    """A small spec with error bars; `changes` replace whole tables."""
    return {
        "surface": {"kind": "self-affine", "cutoff": 0.06, "h_std": 1.0},
        "elastomer": {"kind": "power", "n": 1},
        "grid": {"points": 128},
        "load": {"p_star": 0.1},
        "solver": {"tolerance": 1e-12},
        "accuracy": {"mean_gap": 0.5},
    } | changes


def elastomer_table(n, modulus=1.0):
    """A power law, or a slab where `n` says so."""
    if n == "slab":
        return {"kind": "slab", "thickness": 0.03, "E_star": modulus}
    return {"kind": "power", "n": n, "k_n": modulus}


@cache
def numbers(n, modulus=1.0, h_std=1.0, length=1.0):
    """Reduced results and error bars of one contact in some units."""
    surface = {"kind": "self-affine", "cutoff": 0.06, "h_std": h_std, "length": length}
    solved = solve(plain_tables(surface=surface, elastomer=elastomer_table(n, modulus)))
    assert solved.solution.residual < 1e-11  # for n = 3 and 4 rounding ends the solve above 1e-12
    observables, columns = solved.observables, error_columns(solved)
    values = [
        observables.u_g,
        observables.a_r,
        observables.sigma_p,
        observables.perimeter,
        observables.energy,
    ]
    # NaN where a quantity has no continuum value
    bars = [
        columns[f"{name}_{what}"] for name in MAIN_OBSERVABLES for what in ("error", "continuum")
    ]
    exact = [solved.solution.residual, columns["u_g_bound"], columns["sigma_p_bound"]]
    return np.array(values), np.array(bars), np.array(exact)


@pytest.mark.parametrize("n", [*EXPONENTS, "slab"])
def test_units_that_are_powers_of_two_change_no_bit(n):
    expected = numbers(n)
    for scales in (
        {"modulus": TWO},
        {"modulus": 1 / TWO},
        {"h_std": TWO},
        {"h_std": 1 / TWO, "modulus": TWO},
    ):
        for ours, theirs in zip(expected, numbers(n, **scales), strict=True):
            assert np.array_equal(ours, theirs, equal_nan=True)


@pytest.mark.parametrize("length", [TWO, 1 / TWO, 3e12, 1e-12])
@pytest.mark.parametrize("n", [*EXPONENTS, "slab"])
def test_the_length_of_the_cell_drops_out(n, length):
    """k(q) changes by a rounding, so the bars, which take differences of grids, by some 1e-10."""
    values, bars, _ = numbers(n)
    other, other_bars, _ = numbers(n, length=length)
    assert other == pytest.approx(values, rel=1e-12)
    assert other_bars == pytest.approx(bars, rel=1e-8, nan_ok=True)


@pytest.mark.parametrize("scale", [1e-12, 3e12])
@pytest.mark.parametrize("n", [*EXPONENTS, "slab"])
def test_units_of_all_kinds_at_once_drop_out(n, scale):
    values, bars, _ = numbers(n)
    other, other_bars, _ = numbers(n, modulus=1 / scale, h_std=scale / 7, length=5 * scale)
    assert other == pytest.approx(values, rel=1e-12)
    assert other_bars == pytest.approx(bars, rel=1e-8, nan_ok=True)


# --- one contact in two descriptions --------------------------------------------------------------

LAYER = {"kind": "layer", "thickness": 0.1, "poisson": 0.4}
OF_QUANTITIES = [f"{name}_{what}" for name in MAIN_OBSERVABLES for what in ("continuum", "error")]
REDUCED = ["u_g", "a_r", "sigma_p", "energy", "stiffness", "perimeter", *OF_QUANTITIES]


def reduced(elastomer, pressure, heights=None, **changes):
    """Reduced results and error bars of a contact at a pressure [Pa]; NaN where there are none."""
    tables = plain_tables(elastomer=elastomer, load={"pressure": pressure}, **changes)
    tables["output"] = {"stiffness": True}
    columns = gfmd_cli.solve(tables, heights=heights).columns
    return np.array([columns[name] for name in REDUCED])


@pytest.mark.parametrize(
    "elastomer", [elastomer_table(0.5), elastomer_table(2), elastomer_table("slab"), LAYER]
)
def test_a_map_that_varies_along_x_only_is_the_line_contact(elastomer):
    x = 2 * np.pi * np.arange(64) / 64
    profile = np.cos(x) + 0.3 * np.cos(5 * x + 1) + 0.1 * np.sin(9 * x)
    line = reduced(elastomer, 1.0, profile, surface={}, grid={})
    assert 0 < line[1] < 1
    for rows, length_y in ((64, 1.0), (8, 0.3)):
        surface = {"length_y": length_y}
        plane = reduced(elastomer, 1.0, np.tile(profile, (rows, 1)), surface=surface, grid={})
        assert plane == pytest.approx(line, rel=1e-7, nan_ok=True)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize(
    "surface", [{"kind": "parabola"}, {"kind": "cone"}, {"kind": "punch", "depth": 0.01}]
)
def test_a_cell_that_is_turned_has_the_same_contact(surface, boundary):
    """Cell and pixels are oblong. The contact line is stored times the side along x."""
    results = [
        reduced(
            LAYER,
            0.02,
            surface=surface | {"length": length, "length_y": length_y},
            grid={"points": points, "points_y": points_y, "boundary": boundary},
        )
        / np.where(np.array(REDUCED) == "perimeter", length, 1.0)
        for length, length_y, points, points_y in ((1.0, 1.7, 48, 64), (1.7, 1.0, 64, 48))
    ]
    assert 0 < results[0][1] < 1
    assert results[1] == pytest.approx(results[0], rel=1e-7, nan_ok=True)


def test_the_gap_of_a_thin_slab_is_that_of_a_plate_up_to_the_square_of_its_thickness():
    """At the same pressure and bending stiffness: S(t) = t^3/6 (1 - 3 t^2/10 ...)."""
    pressure = 1e5
    u_g, a_r, *_ = reduced({"kind": "plate", "thickness": 1.0}, pressure)
    assert 0.01 < a_r < 1
    thicknesses = 0.001, 0.0005, 0.00025
    slabs = [{"kind": "slab", "thickness": t, "E_star": t**-3} for t in thicknesses]
    first, second, third = (reduced(slab, pressure)[0] - u_g for slab in slabs)
    assert first / second == pytest.approx(4, rel=0.01)
    assert second / third == pytest.approx(4, rel=0.01)


# --- the ends of the number range -----------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 1, 4])
@pytest.mark.parametrize("p_star", [1e-30, 1e-20, 1e-12, 40.0, 1e6])
def test_pressures_at_both_ends_are_solved(n, p_star):
    tables = plain_tables(
        elastomer=elastomer_table(n), load={"p_star": p_star}, grid={"points": 64}
    )
    tables["solver"] = {"tolerance": 1e-6, "max_steps": 3000}
    solved = solve(tables)
    assert solved.solution.residual < 1e-6
    assert solved.solution.status == "converged"
    if p_star < 1e-15:  # one point in contact
        verdicts = {name: estimate.verdict for name, estimate in solved.estimates.items()}
        diverging = {"sigma_p": "diverges"} if n == 4 else {}  # for n >= 3
        assert verdicts == {**dict.fromkeys(verdicts, "unknown"), **diverging}
        assert solved.solution.transforms < 200
    if p_star < 1:
        assert solved.observables.a_r * 64**2 < 3
        assert solved.solution.sigma.mean() == pytest.approx(p_star, rel=1e-12, abs=0)
    if p_star > 1:
        assert solved.observables.a_r == 1
        assert solved.observables.sigma_p == pytest.approx(1, rel=64 * EPS * p_star)


@pytest.mark.parametrize("factor", [0.99, 1 / 0.99])
def test_pressures_beyond_the_ends_are_refused(factor):
    scene = build_scene(SCALED, Power(n=1), 64)
    end = PRESSURE_RANGE[0] if factor < 1 else PRESSURE_RANGE[1]
    scene.contact(end)
    with pytest.raises(InputError, match="out of range"):
        scene.contact(end * factor)


def test_a_pressure_that_is_nothing_in_reduced_units_is_refused():
    tables = plain_tables(load={"pressure": 1e-300}, elastomer=elastomer_table(1, modulus=1e60))
    with pytest.raises(InputError, match=r"p\* = 0 is out of range"):
        solve(tables)


@pytest.mark.parametrize(
    ("surface", "elastomer"),
    [
        (SelfAffine(cutoff=0.05, h_std=1e-200), Power(n=1)),
        (SelfAffine(cutoff=0.05, h_std=1e160), Power(n=1)),
        (SelfAffine(cutoff=0.05, h_std=1.7e308), Power(n=1)),
        (SelfAffine(cutoff=0.05, rolloff=1e300), Power(n=1)),
        (SelfAffine(cutoff=0.05, length=1e-30), Power(n=4)),
        (SelfAffine(cutoff=0.05, length=1e30), Power(n=4)),
        (SelfAffine(cutoff=0.05), Power(n=1, k_n=1e160)),
        (SelfAffine(cutoff=0.05), Power(n=1, k_n=1e-310)),
        (SelfAffine(cutoff=0.05), Plate(thickness=1e110)),
        (SelfAffine(cutoff=0.05), Slab(thickness=1e-80)),
        (Parabola(radius=1e-300, length=1e12), Power(n=1)),
        (PowerLawIndenter(exponent=100, radius=1e-12), Power(n=1)),
        (Punch(depth=1e300), Power(n=1)),
        (Ridge(slope=1e300, length=1e30), Power(n=1)),
    ],
)
def test_scales_out_of_range_are_refused(surface, elastomer):
    with pytest.raises(InputError, match=r"out of range|overflow|flat"):
        build_scene(surface, elastomer, 64)


def test_a_stiffness_that_falls_to_nothing_is_refused(tmp_path):
    path = tmp_path / "k.txt"
    np.savetxt(path, [[1.0, 1e-300], [100.0, 1.0]])
    with pytest.raises(InputError, match="falls to"):
        build_scene(SCALED, Tabulated(path=path), 64)


@pytest.mark.parametrize(
    "changes",
    [
        {"surface": {"kind": "self-affine", "cutoff": 1e-320}},
        {"surface": {"kind": "self-affine", "cutoff": 1e-300}},
    ],
)
def test_no_grid_resolves_a_tiny_cut_off(changes):
    with pytest.raises(InputError, match="do not resolve"):
        solve(plain_tables(**changes))


def test_an_accuracy_of_the_smallest_number_is_not_reached():
    changes = {"grid": {"points": "auto"}, "accuracy": {"mean_gap": 5e-324, "max_points": 64}}
    solved = solve(plain_tables(**changes))
    assert solved.solution.status == "accuracy_not_reached"


@pytest.mark.parametrize(
    ("first", "last", "step"),
    [(-300, 300, 10), (-300, 308, 8), (-320, 305, 5), (-323, 308, 1), (-100, 200, 100)],
)
def test_a_sequence_spans_all_numbers(first, last, step):
    """One step more is often no number."""
    table = {"from": float(f"1e{first}"), "to": float(f"1e{last}"), "per_decade": 1 / step}
    with mp.workdps(40):
        decades = range(0, last - first + 1, step)
        exact = [float(mp.mpf(table["from"]) * mp.mpf(10) ** decade) for decade in decades]
    values = GeometricSequence.model_validate(table).values()
    assert values == pytest.approx(exact, rel=1e-12, abs=5e-324)


def test_the_slab_factor_keeps_its_digits_as_long_as_it_is_a_number():
    """S = t^3/6 (1 - 3 t^2/10 ...) for thin slabs: q t from 1e-100 on."""
    t = np.concatenate([10.0 ** np.arange(-100, -8, 4), [1e12]])
    with mp.workdps(40):
        exact = [float(mp.mpf(x) ** 3 / 6) if x < 1 else 1.0 for x in map(float, t)]
    assert slab_factor(t) == pytest.approx(exact, rel=4 * EPS, abs=0)


@pytest.mark.parametrize("n", [0, 0.5, 1, 2, 3, 3.7, 4])
def test_stiffness_keeps_its_digits_over_forty_decades(n):
    q = 10.0 ** np.linspace(-20, 20, 81)
    with mp.workdps(40):
        exact = [float(mp.mpf(x) ** mp.mpf(n)) for x in map(float, q)]
    assert Power(n=n).stiffness(q) == pytest.approx(exact, rel=2 * EPS, abs=0)


def test_a_table_keeps_its_digits_over_forty_decades(tmp_path):
    """log k of 90 is rounded to 1e-14, so k is."""
    q = np.logspace(-20, 20, 41)
    path = tmp_path / "k.txt"
    np.savetxt(path, np.column_stack([q, 1e-30 * q**4]), fmt="%.17g")
    stiffness = Tabulated(path=path).stiffness(1.07 * q)
    assert stiffness == pytest.approx(1e-30 * (1.07 * q) ** 4, rel=2e-13, abs=0)


SHELL = Persson(Shells(*(np.array([x]) for x in (1.0, 1.0, 1.0, 2.0, 0.3, 1.0))))


@pytest.mark.parametrize("p_star", [1e-30, 1e-3, 1.0, 6.0, 15.0, 20.0, 30.0, 37.0])
def test_the_tail_of_persson_theory_keeps_its_digits(p_star):
    """u_g falls to 1e-304; a rounding of p*^2 / 2 is then one of 1e-13."""
    width = sqrt(2.0)
    p = p_star * width
    with mp.workdps(50):
        s, start = mp.mpf(2), mp.mpf(p)

        def slope(x):
            y = x / mp.sqrt(2 * s)
            rest = mp.exp(-y * y) / mp.sqrt(mp.pi) - y * mp.erfc(y)  # ierfc
            area = mp.erf(y) + 2 * y * rest
            return (mp.mpf(0.3) + 3 * (1 - mp.mpf(0.3)) * area**2) * mp.sqrt(2 * s) * rest / s

        ends = [mp.log(start)]
        if p_star < 1:
            ends += [mp.log(x) for x in 10.0 ** np.arange(-28, 1, 2) if x > p]
        ends += [mp.log(mp.sqrt(start**2 + 2 * s * y)) for y in (*range(1, 20), 30, 50, 90)]
        ends = sorted(set(ends))
        gap = mp.quad(lambda t: slope(mp.exp(t)), ends, method="gauss-legendre", maxdegree=4)
    assert SHELL.mean_gap(p) == pytest.approx(float(gap), rel=2e-15 * (1 + p_star**2), abs=0)


@pytest.mark.filterwarnings("error")
def test_the_theories_have_limits_at_the_ends_of_all_numbers():
    p = np.array([1e-320, 1e-300, 40.0, 1e200, 1e300])
    for each in p:
        assert SHELL.mean_gap(each) >= 0
        assert np.isfinite(SHELL.mean_gap(each))
    assert np.all(np.diff(SHELL.mean_gap(p)) <= 0)
    assert SHELL.stress_density(np.array([1.0, 1e150]), 1e150)[0] == 0
    assert SHELL.stress_deviation(p[2:]) == pytest.approx([sqrt(2.0)] * 3)
    z = einstein_solid.non_contact_height(p[1:])
    assert einstein_solid.pressure(z) == pytest.approx(p[1:], rel=1e-12, abs=0)
    assert np.all(np.isfinite(einstein_solid.stress_deviation(z)))
