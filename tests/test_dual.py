"""Conjugate gradients in the stress: their direction, projection, preconditioner and rounding."""

import numpy as np
import pytest
from free_contacts import ELASTOMERS, compliance_matrix, oblong_contact
from projections import new_direction

from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import dual
from gfmd_cli.solvers.contact_state import FREE, PENETRATING, PRESSED
from gfmd_cli.solvers.dual import Dual
from gfmd_cli.solvers.loop import ROUNDING_MARGIN, solve
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.stress_preconditioner import StressPreconditioner

TOTAL = 0.1 * 17 * 20  # sum of the stresses of an oblong contact


def run_of(stress, *, enters=False):
    """The working memory of a solve with these stresses, whose moving points are chosen."""
    contact = oblong_contact(HalfSpace())
    state = Dual().begin(contact, contact.grid.empty())
    state.sigma[...] = stress
    run = dual._Run(contact, state)
    run.select()
    run.threshold = PENETRATING if enters else PRESSED
    return run


def chosen(run):
    contact_state, threshold = run.chosen
    return contact_state >= threshold


@pytest.mark.parametrize("seed", range(20))
def test_the_projected_stress_is_the_nearest_of_its_sum(seed):
    """Towards every other admissible stress, the distance grows."""
    random = np.random.default_rng(seed)
    run = run_of(np.maximum(random.normal(size=(17, 20)), 0.0), enters=seed % 2 == 0)
    run.direction[...] = np.where(chosen(run), random.normal(size=(17, 20)), 0.0)
    run.state.length = 10.0 ** random.uniform(-2, 2)
    target = (run.sigma + run.state.length * run.direction.astype(float))[chosen(run)]
    highest, shift, is_clipped = run.project()
    nearest = np.maximum(target - highest - shift, 0.0)
    assert nearest.sum() == pytest.approx(TOTAL, rel=1e-12)
    assert is_clipped == bool((target < 0).any())
    others = TOTAL * random.dirichlet(np.full(target.size, 0.1), size=100)
    assert np.all((others - nearest) @ (nearest - target) >= -1e-12 * TOTAL * abs(target).max())


def test_a_stress_of_this_sum_is_its_own_projection():
    stress = np.zeros((17, 20))
    stress[3, 4], stress[5, 6] = 0.25 * TOTAL, 0.75 * TOTAL
    highest, shift, is_clipped = run_of(stress).project()
    assert highest + shift == pytest.approx(0.0, abs=1e-14 * TOTAL)
    assert not is_clipped


def test_after_a_huge_move_the_largest_stress_takes_all():
    stress = np.zeros((17, 20))
    stress[3, 4], stress[5, 6] = 0.25 * TOTAL, 0.75 * TOTAL
    run = run_of(stress)
    run.direction[3, 4], run.direction[5, 6] = 2.0, 1.0
    run.state.length = 1e30
    highest, shift, _ = run.project()
    targets = run.state.length * run.direction[[3, 5], [4, 6]].astype(float)
    assert np.maximum(targets - highest - shift, 0.0) == pytest.approx([TOTAL, 0.0])


@pytest.mark.parametrize("p_star", [1e-30, 1e-18, 1e6])
def test_moves_of_any_size_keep_the_load(p_star):
    """The first moves exceed the smallest pressure by more than double precision resolves."""
    contact = oblong_contact(HalfSpace(), p_star)
    stress = solve_contact(contact, Dual(nested=False)).sigma
    assert stress.min() >= 0
    assert stress.mean() == pytest.approx(p_star, rel=1e-12)


@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_moves_that_become_longer_keep_the_load(elastomer):
    """After a short move each is up to a hundred times as long; the error of the load is not."""
    contact = oblong_contact(elastomer)
    solver = Dual(tolerance=1e-2)
    state = solver.begin(contact, contact.grid.empty())
    state.length = 1e-10
    lengths, sums = [], []

    def watch(_, state):
        lengths.append(state.length)
        sums.append(state.sigma.sum())

    assert solve(contact, solver, state, watch) == "converged"
    assert max(np.divide(lengths[1:], lengths[:-1])) > 10
    assert np.array([*sums, state.sigma.sum()]) == pytest.approx(TOTAL, rel=1e-12, abs=0)


@pytest.mark.parametrize("beta", [0.0, 0.3, 50.0])
@pytest.mark.parametrize("enters", [False, True])
def test_the_compiled_direction_is_that_of_the_formulas(enters, beta):
    random = np.random.default_rng(3)
    run = run_of(np.maximum(random.normal(size=(17, 20)), 0.0), enters=enters)
    points = chosen(run)
    run.gap[...] = np.where(run.sigma > 0, 1.0, -0.1) * random.uniform(0.5, 1.5, size=(17, 20))
    run.gap[points] -= run.gap[points].mean()
    run.z[...] = np.where(points, random.normal(size=(17, 20)) + run.gap, 0.0)
    last = np.where(points, random.normal(size=(17, 20)), 0.0).astype(np.float32)
    run.direction[...] = last
    z = run.z[points] - run.z[points].mean()
    expected = new_direction(-z, beta * last[points], run.sigma[points], -run.gap[points])
    if not run.combine(run.z[points].mean(), beta, beta * last[points].mean()):
        run.combine(run.z[points].mean(), 0.0, 0.0)
    assert run.direction[points] == pytest.approx(expected, abs=1e-4 * (1 + beta))
    assert not run.direction[~points].any()


@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_the_preconditioner_is_close_to_the_inverse_of_the_compliance(elastomer):
    """Its energies are those of a dense solve."""
    contact = oblong_contact(elastomer)
    random = np.random.default_rng(7)
    held = random.random(contact.grid.shape) < 0.3
    contact_state = np.where(held, PRESSED, FREE).astype(np.int8)
    preconditioner = StressPreconditioner(contact)
    inverse = np.linalg.inv(
        compliance_matrix(elastomer, contact.grid)[np.ix_(held.ravel(), held.ravel())]
    )
    out = np.empty(contact.grid.shape, np.float32)
    ratios = []
    for _ in range(20):
        gap = random.normal(size=contact.grid.shape)
        gap[held] -= gap[held].mean()
        preconditioner.apply(gap, contact_state, PRESSED, out=out)
        assert not out[~held].any()
        ratios.append(gap[held] @ out[held] / (gap[held] @ inverse @ gap[held]))
    assert 0.9 < min(ratios) < max(ratios) < 1.15


@pytest.mark.parametrize(("n", "most"), [(0.5, 8), (1, 14), (1.5, 36)])
def test_a_large_contact_takes_few_steps(n, most):
    """With K restricted to the contact as preconditioner these are 10, 20 and 88 steps."""
    contact = build_free_scene(SelfAffine(cutoff=0.02), Power(n=n), 128).contact(1.0)
    assert solve_contact(contact, Dual(tolerance=1e-6)).steps <= most


@pytest.mark.parametrize("n", [0.5, 1.0, 1.5])
@pytest.mark.parametrize("p_star", [1e-3, 0.1, 1.0])
def test_the_rounding_of_the_moves_is_estimated(n, p_star, monkeypatch):
    """The gap in contact after a step is that of the stress within three times the estimate."""
    contact = build_free_scene(SelfAffine(cutoff=0.05), Power(n=n), 96).contact(p_star)
    errors = []

    def watch(current, state):
        if state.exact or state.rounding < 1e-12:
            return
        gap = current.compliance.displacement(state.sigma, out=current.grid.empty())
        touching = state.sigma > 0
        difference = (gap - current.height - state.gap)[touching]
        difference -= difference.mean()
        error = current.as_residual(float(difference @ difference))
        errors.append(error / state.rounding)

    solution = solve_contact(contact, Dual(tolerance=1e-6), watch)
    assert errors
    assert max(errors) < ROUNDING_MARGIN
    residual = solution.residual
    solution.recompute(contact)
    assert solution.residual == pytest.approx(residual, abs=1e-7)
    assert solution.residual < 1e-6
