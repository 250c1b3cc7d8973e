"""The direct start: its solutions against those without it, and when it is not used."""

import copy
from typing import ClassVar

import numpy as np
import pytest

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power, Slab
from gfmd_cli.physics.indenters import LineParabola
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import direct_start as module
from gfmd_cli.solvers.contact_state import refined
from gfmd_cli.solvers.direct_start import direct_start
from gfmd_cli.solvers.multigrid import largest_growth
from gfmd_cli.solvers.nested_grids import Resume, solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG

SURFACE = SelfAffine(cutoff=0.1)


class WholeGrids(ProjectedCG):
    starts_locally: ClassVar[bool] = False


def square(elastomer, points=256, p_star=0.003):
    return build_scene(SURFACE, elastomer, points).contact(p_star)


def with_holes():
    contact = square(Power(n=2))
    known = np.random.default_rng(0).random(contact.grid.shape) > 0.1
    known[:100, :80] = False
    return Contact(contact.grid, contact.height, contact.stiffness, contact.pressure, known)


def oblong():
    """Half of the points along y, on pixels of 2 to 1."""
    contact = square(Power(n=3))
    return contact.coarsen((128, 256))


CONTACTS = {
    "n=0.5": lambda: square(Power(n=0.5)),
    "n=2": lambda: square(Power(n=2)),
    "n=3": lambda: square(Power(n=3)),
    "n=4": lambda: square(Power(n=4)),
    "slab": lambda: square(Slab(thickness=0.02), p_star=0.0005),
    "odd": lambda: square(Power(n=2), points=181),
    "holes": with_holes,
    "oblong": oblong,
}


@pytest.fixture(autouse=True)
def as_many_points_as_for_steep_elastomers(monkeypatch):
    """Small grids have too many points in contact otherwise."""
    monkeypatch.setattr(module, "MAX_COST", 20000)


@pytest.mark.parametrize("contact", [make() for make in CONTACTS.values()], ids=CONTACTS)
def test_the_solution_is_that_of_the_iteration_and_exact(contact):
    """Without a step on the finest grid, at a residual far below the tolerance."""
    direct = solve_contact(contact, ProjectedCG(tolerance=1e-3))
    whole = solve_contact(contact, WholeGrids(tolerance=1e-7))
    assert direct.status == whole.status == "converged"
    assert direct.steps == 0
    assert direct.residual < 1e-6
    assert contact.recompute(direct.u, np.empty_like(direct.u)) < 1e-6
    assert direct.u == pytest.approx(whole.u, abs=1e-7)
    held = direct.u == contact.obstacle
    assert np.array_equal(held, whole.u == contact.obstacle)
    assert direct.sigma == pytest.approx(whole.sigma, abs=1e-5 * whole.sigma.max())


def test_a_line_contact_is_that_of_the_iteration():
    contact = build_scene(LineParabola(radius=1.0), Power(n=1), 1024).contact(0.003)
    direct = solve_contact(contact, ProjectedCG(tolerance=1e-3))
    assert direct.steps == 0
    assert direct.u == pytest.approx(solve_contact(contact, WholeGrids()).u, abs=1e-6)


BELOW_ROUNDING = {
    "n=4": lambda: square(Power(n=4), p_star=1e-4),
    "n=4, one point": lambda: square(Power(n=4), p_star=1e-8),
    "n=3": lambda: square(Power(n=3), p_star=1e-5),
    "tiles": lambda: square(Power(n=2), points=512, p_star=1e-6),
    "odd": lambda: square(Power(n=4), points=181, p_star=1e-5),
    "single grid": lambda: square(Power(n=4), points=64, p_star=1e-12),
    "line": lambda: build_scene(LineParabola(radius=1.0), Power(n=3), 1024).contact(1e-7),
}


@pytest.mark.parametrize("make", BELOW_ROUNDING.values(), ids=BELOW_ROUNDING)
def test_a_contact_is_solved_although_the_stress_of_a_rounded_displacement_is_not_known(make):
    """K u misses the tolerance, whatever the solver; the displacement of sigma reaches it."""
    contact = make()
    solution = solve_contact(contact, ProjectedCG(tolerance=1e-6))
    assert contact.recompute(solution.u, np.empty_like(solution.u)) > 2e-7
    assert solution.status == "converged"
    assert solution.is_direct
    assert solution.residual < 1e-9
    sigma, axes = solution.sigma, tuple(range(solution.u.ndim))
    modes = np.fft.rfftn(sigma, axes=axes)
    modes.flat[0] = 0.0
    modes /= np.where(contact.stiffness > 0, contact.stiffness, 1.0)
    gap = np.fft.irfftn(modes, sigma.shape, axes=axes) - contact.height
    gap -= gap[sigma > 0].mean()
    violations = np.minimum(gap, sigma)  # in two codes
    assert np.sqrt(np.mean(violations**2)) < 1e-9 * contact.pressure + 1e-15
    assert sigma.mean() == pytest.approx(contact.pressure, rel=1e-12)
    assert solution.u - contact.height == pytest.approx(np.where(sigma > 0, 0.0, gap), abs=1e-12)


def test_a_solve_stopped_in_a_direct_solution_of_its_last_grid_goes_on_bit_by_bit():
    contact, states = BELOW_ROUNDING["tiles"](), []

    def keep(current, state):
        states.append((current.grid.whole_shape, copy.deepcopy(state)))

    straight = solve_contact(contact, ProjectedCG(tolerance=1e-6), keep)
    shape, state = states[-1]
    assert shape == (512, 512)
    rest = solve_contact(contact, ProjectedCG(tolerance=1e-6), resume=Resume(shape, state))
    assert rest.is_direct
    assert np.array_equal(rest.u, straight.u)
    assert np.array_equal(rest.sigma, straight.sigma)
    assert rest.transforms == straight.transforms


@pytest.mark.parametrize(("points", "coarse"), [(64, 32), (66, 34), (61, 32)])
def test_points_in_contact_are_refined_to_those_nearest_and_between(points, coarse):
    contact = square(Power(n=2), points)
    for steps in ((0, 0), (0, 1), (1, 0), (1, 1), (1, -1)):
        touching = np.zeros((coarse, coarse), dtype=bool)
        ends = np.array([(5, 7), (5 + steps[0], 7 + steps[1])])
        touching[ends[:, 0], ends[:, 1]] = True
        places = ends * points / coarse
        fine = np.argwhere(refined(touching, contact))
        for place in places:
            assert np.abs(fine - place).max(axis=1).min() <= 0.5  # the nearest
        low, high = places.min(axis=0) - 0.5, places.max(axis=0) + 0.5
        assert np.all((low <= fine) & (fine <= high))
        if points == 2 * coarse:
            assert len(fine) == (1 if steps == (0, 0) else 3)
    assert refined(np.ones((coarse, coarse), dtype=bool), contact).all()


def test_a_contact_that_the_coarse_grid_misses_is_entered():
    """A spike of one point, between the points of the coarse grid."""
    contact = square(Power(n=2))
    coarse = contact.coarsen((128, 128))
    touching = solve_contact(coarse, WholeGrids()).u == coarse.height
    height = contact.height.copy()
    height[101, 77] += 2.0 * height.max()
    spiked = Contact(contact.grid, height, contact.stiffness, contact.pressure)
    start = direct_start(touching, [spiked])
    assert start is not None
    assert start.u[101, 77] == height[101, 77]
    assert start.u == pytest.approx(solve_contact(spiked, WholeGrids()).u, abs=1e-6)


@pytest.mark.parametrize("n", [2, 3])
def test_the_start_does_not_need_all_points_in_contact_on_the_coarse_grid(n):
    contact = square(Power(n=n))
    coarse = contact.coarsen((128, 128))
    held = solve_contact(coarse, WholeGrids()).u == coarse.height
    whole = solve_contact(contact, WholeGrids(tolerance=1e-7))
    for seed in range(3):
        part = held & (np.random.default_rng(seed).random(held.shape) < 0.7)
        start = direct_start(part, [contact])
        assert start is not None
        assert start.u == pytest.approx(whole.u, abs=1e-7)


def test_a_guess_far_from_the_contact_leads_to_the_solution():
    """A point in a valley pulls the surface down, which then enters thousands of others."""
    contact = square(Power(n=3))
    coarse = contact.coarsen((128, 128))
    start = direct_start(coarse.height == coarse.height.min(), [contact])
    assert start is not None
    assert start.u == pytest.approx(solve_contact(contact, WholeGrids()).u, abs=1e-6)


@pytest.mark.parametrize("points", [128, 256])
def test_sets_that_would_recur_lead_to_the_solution_with_falling_energy(points, monkeypatch):
    """At n = 4: from the second set on that is no better, s C s / 2 - h s falls at each step."""
    contact = build_scene(SelfAffine(cutoff=0.1, seed=1), Power(n=4), points).contact(0.003)
    energies, approach = [], module._DirectSolve.approach

    def energy(solve):
        assert solve.stress.min() >= 0
        modes = np.fft.rfft2(solve.stress)
        modes[0, 0] = 0.0
        u = np.fft.irfft2(modes / np.where(solve.contact.stiffness > 0, solve.contact.stiffness, 1))
        return 0.5 * np.vdot(solve.stress, u) - np.vdot(solve.stress, solve.obstacle)

    def note_energies(solve, *arguments):
        energies.append((solve.grid.points, energy(solve)))
        approach(solve, *arguments)
        energies.append((solve.grid.points, energy(solve)))

    monkeypatch.setattr(module._DirectSolve, "approach", note_energies)
    direct = solve_contact(contact, ProjectedCG(tolerance=1e-3))
    finest = np.array([energy for grid, energy in energies if grid == points])
    assert finest.size >= 2
    assert np.all(np.diff(finest) <= 1e-12 * np.abs(finest[0]))
    assert direct.steps == 0
    assert direct.residual < 1e-6
    whole = solve_contact(contact, WholeGrids(tolerance=1e-7))
    assert direct.u == pytest.approx(whole.u, abs=1e-7)


def test_from_the_grid_on_that_has_too_many_points_the_iteration_goes_on(monkeypatch):
    contact = square(Power(n=3))
    whole = solve_contact(contact, WholeGrids(tolerance=1e-6))
    held = np.count_nonzero(whole.u == contact.height)
    for points in (0.3 * held, 0.9 * held, 1.5 * held):
        cost = points**3 / contact.grid.size / largest_growth(contact) ** 2
        monkeypatch.setattr(module, "MAX_COST", cost)
        solution = solve_contact(contact, ProjectedCG(tolerance=1e-6))
        assert solution.u == pytest.approx(whole.u, abs=1e-6)
        assert solution.is_direct == (points > 1.3 * held)


def test_a_large_contact_is_left_to_the_iteration():
    contact = square(Power(n=2))
    assert direct_start(np.ones((128, 128), bool), [contact]) is None
    assert direct_start(np.zeros((128, 128), bool), [contact]) is None


def test_a_solve_stopped_on_a_coarse_grid_goes_on_bit_by_bit():
    contact, states = square(Power(n=3)), []

    def keep(current, state):
        states.append((current.grid.whole_shape, copy.deepcopy(state)))

    straight = solve_contact(contact, ProjectedCG(tolerance=1e-6), keep)
    assert (256, 256) not in [shape for shape, _ in states]  # a direct solve ends it
    for chosen in (1, len(states) // 2, len(states) - 1):
        shape, state = states[chosen]
        rest = solve_contact(contact, ProjectedCG(tolerance=1e-6), resume=Resume(shape, state))
        assert np.array_equal(rest.u, straight.u)
        assert np.array_equal(rest.sigma, straight.sigma)


def test_a_direct_solve_notices_a_request_to_stop():
    shown = []

    def stop_at_the_third(current, state):
        shown.append((current.grid.points, state.step))
        if shown.count(shown[-1]) == 3:  # only a direct solve shows a state again
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve_contact(square(Power(n=3)), ProjectedCG(tolerance=1e-6), stop_at_the_third)
    assert shown[-1][0] == 64
