"""The reference solvers: solvers x problems, against projected conjugate gradients."""

import copy
from functools import cache
from itertools import islice

import numpy as np
import pytest
from pydantic import ValidationError

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.indenters import Wave
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.ccg import ConstrainedCG
from gfmd_cli.solvers.fire import Fire
from gfmd_cli.solvers.loop import solve
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG
from gfmd_cli.solvers.polonsky_keer import PolonskyKeer

POINTS = 64
TOLERANCE = 1e-9
REFERENCE = 1e-11
SOLVERS = [ConstrainedCG(), Fire(), PolonskyKeer()]


@cache
def contact_of(n, p_star):
    return build_scene(SelfAffine(cutoff=0.06), Power(n=n), POINTS).contact(p_star)


def flat(contact):
    u = contact.grid.empty()
    u[...] = contact.height.max()
    return u


def solved(contact, solver, tolerance=TOLERANCE, max_steps=20000):
    solver = solver.model_copy(update={"tolerance": tolerance, "max_steps": max_steps})
    state = solver.begin(contact, flat(contact))
    return solve(contact, solver, state), state


@cache
def reference(n, p_star):
    status, state = solved(contact_of(n, p_star), ProjectedCG(), REFERENCE)
    assert status == "converged"
    return state


def kind(value):
    return getattr(value, "kind", None)


def bound(contact, u, exact):
    """Largest possible difference of `u`, which meets the tolerance, to the solution.

    With x = min(g, sigma), both u - x - h and sigma - x are non-negative, one of them zero, so that
    (e - x) (K e - x) <= 0 for e = u - exact (Pang, Math. Oper. Res. 12, 474, 1987). A common point
    of contact bounds the mean of e by the norm |f| of its fluctuations, of stiffness k_1 at least:
    k_1 |f|^2 <= |x| (|f| + |mean e| sqrt(size) + k_max |f|), and |e| <= 2 |f| everywhere.
    """
    assert np.any((u == contact.height) & (exact == contact.height))
    root = np.sqrt(contact.grid.size)
    x = TOLERANCE * min(contact.pressure, 1) * root
    return 2 * x * (1 + root + contact.stiffness.max()) / contact.stiffness.ravel()[1:].min()


@pytest.mark.parametrize("p_star", [0.02, 0.1, 1.0])
@pytest.mark.parametrize("n", [0.5, 1, 2, 3])
@pytest.mark.parametrize("solver", SOLVERS, ids=kind)
def test_every_solver_ends_in_the_same_solution(solver, n, p_star):
    if isinstance(solver, PolonskyKeer) and n > 1:
        pytest.skip("degrades beyond n = 1: see the next test")
    contact = contact_of(n, p_star)
    expected = reference(n, p_star)
    status, state = solved(contact, solver)
    assert status == "converged"
    fresh = contact.stress(state.u, out=contact.grid.empty())
    assert contact.residual(state.u, fresh) < TOLERANCE
    assert state.sigma == pytest.approx(fresh, abs=1e-12)
    assert state.sigma.mean() == pytest.approx(p_star, rel=1e-11)
    assert (state.u - contact.height).min() >= 0
    difference = np.abs(state.u - expected.u).max()
    assert difference <= bound(contact, state.u, expected.u)
    assert difference < 1e-8  # the bound is loose for n > 1; largest seen: 5e-9
    ours = observe(contact, state.u, state.sigma)
    theirs = observe(contact, expected.u, expected.sigma)
    assert ours.a_r == theirs.a_r
    assert 0 < ours.a_r < 1


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize(
    ("shape", "length_y"), [((45, 60), 0.75), ((63, 63), 1.0), ((48, 96), 1.0), ((160, 40), 1.0)]
)
def test_odd_grids_and_oblong_pixels_end_in_the_same_solution(n, shape, length_y):
    surface = SelfAffine(cutoff=0.06, length_y=length_y)
    contact = build_scene(surface, Power(n=n), shape[1], points_y=shape[0]).contact(0.05)
    status, expected = solved(contact, ConstrainedCG())
    assert status == "converged"
    solution = solve_contact(contact, ProjectedCG(tolerance=REFERENCE))
    assert solution.status == "converged"
    difference = np.abs(solution.u - expected.u).max()
    assert difference <= bound(contact, expected.u, solution.u)
    assert difference < 1e-7  # the bound is loose for n > 1


def test_plates_are_out_of_reach_of_the_pressure_only():
    contact = contact_of(4, 0.1)
    expected = reference(4, 0.1)
    for solver in (ConstrainedCG(), Fire()):
        status, state = solved(contact, solver)
        assert status == "converged"
        assert state.u == pytest.approx(expected.u, abs=1e-7)
    status, state = solved(contact, PolonskyKeer(), max_steps=300)
    assert status == "max_steps"
    assert state.residual > 1e-3
    assert (state.u - contact.height).min() >= 0


def test_the_time_step_leaves_the_solution_alone():
    status, state = solved(contact_of(1, 0.1), Fire(time_step=0.5))
    assert status == "converged"
    assert state.u == pytest.approx(reference(1, 0.1).u, abs=1e-8)


@pytest.mark.parametrize("time_step", [0.0, 2.0])
def test_a_time_step_that_is_not_stable_is_refused(time_step):
    with pytest.raises(ValidationError, match="time_step"):
        Fire(time_step=time_step)


@pytest.mark.parametrize("solver", SOLVERS, ids=kind)
def test_any_start_ends_in_the_same_solution(solver):
    contact = contact_of(1, 0.1)
    expected = reference(1, 0.1)
    noise = np.random.default_rng(0).standard_normal((POINTS, POINTS))
    for start in (contact.height, 5 * noise, expected.u, contact.height - 3):
        u = contact.grid.empty()
        u[...] = start
        limited = solver.model_copy(update={"tolerance": TOLERANCE, "max_steps": 2000})
        state = solver.begin(contact, u)
        assert solve(contact, limited, state) == "converged"
        assert state.u == pytest.approx(expected.u, abs=1e-8)


@pytest.mark.parametrize("solver", SOLVERS, ids=kind)
def test_a_line_is_solved_as_well(solver):
    scene = build_scene(Wave(), HalfSpace(E_star=2.0), POINTS)
    contact = scene.contact(0.3 * 2 * np.pi / scene.delta_sigma)
    _, expected = solved(contact, ProjectedCG())
    status, state = solved(contact, solver)
    assert status == "converged"
    assert state.u == pytest.approx(expected.u, abs=1e-8)


@pytest.mark.parametrize("n", [0.5, 1, 3])
@pytest.mark.parametrize("solver", SOLVERS, ids=kind)
def test_a_stopped_solve_goes_on_bit_by_bit(solver, n):
    contact = contact_of(n, 0.05)
    state = solver.begin(contact, flat(contact))
    states = [copy.deepcopy(current) for current in islice(solver.iterate(contact, state), 60)]
    for chosen in (0, 1, 7, 30, 58):
        resumed = copy.deepcopy(states[chosen])
        steps = 60 - chosen
        for current in islice(solver.iterate(contact, resumed), steps):
            same(current, states[current.step])
        assert resumed.step == 59


def same(state, other):
    for name, value in vars(other).items():
        np.testing.assert_array_equal(vars(state)[name], value, err_msg=name)


@pytest.mark.parametrize("solver", SOLVERS, ids=kind)
def test_every_transform_is_counted(solver, monkeypatch):
    """All but those that read the displacement off the pressure, one pair a yield."""
    pairs = 0
    apply = Grid.apply

    def counted(self, *arguments, **named):
        nonlocal pairs
        pairs += 1
        return apply(self, *arguments, **named)

    monkeypatch.setattr(Grid, "apply", counted)
    contact = contact_of(1, 0.1)
    state = solver.begin(contact, flat(contact))
    for current in islice(solver.iterate(contact, state), 40):
        unseen = current.step + 1 if isinstance(solver, PolonskyKeer) else 0
        assert current.transforms == 2 * (pairs - unseen)


def test_the_energy_falls_at_every_step_of_fire():
    contact = contact_of(2, 0.1)
    energies = []
    state = Fire().begin(contact, flat(contact))
    for current in islice(Fire().iterate(contact, state), 300):
        elastic = current.sigma - contact.pressure
        energies.append(0.5 * np.mean(current.u * elastic) + contact.pressure * current.u.mean())
    assert np.all(np.diff(energies) <= 1e-13 * abs(energies[0]))
