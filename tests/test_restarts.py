"""Conjugate gradients restart after a direction that is not theirs, and only then."""

import numpy as np
import pytest

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.loop import Start, solve
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG, _Run


def steps_to_the_solution(contact, u, direction=None):
    """Number of steps from a displacement, the last of which was `direction` if that is given."""
    solver = ProjectedCG(tolerance=1e-8)
    state = solver.begin_from(Start(contact, 0.0, u.copy(), contact.stress(u, np.empty_like(u))))
    if direction is not None:
        change = contact.apply_stiffness(direction, np.empty_like(u))
        state.direction[...], state.change[...] = direction, change
        state.length = state.moved = state.best_length = 1.0
        state.curvature = float(np.vdot(direction, change))
    assert solve(contact, solver, state).is_converged
    return state.step


@pytest.mark.parametrize("seed", [3, 4])
def test_a_foreign_direction_costs_no_steps(seed):
    """If it is kept, convergence is linear: 34 instead of 18 steps, and 47 instead of 17."""
    contact = build_scene(SelfAffine(cutoff=0.0625, seed=seed), Power(n=1), 64).contact(0.001)
    solution = solve_contact(contact, ProjectedCG(tolerance=1e-10))
    gap = solution.u - contact.obstacle
    u, noise = solution.u + 0.3 * gap, np.random.default_rng(seed).random(gap.shape)
    foreign = steps_to_the_solution(contact, u, 0.3 * gap * (1 + noise))
    assert foreign <= steps_to_the_solution(contact, u) + 4


@pytest.mark.parametrize("n", [0.3, 1])
@pytest.mark.parametrize("share", [0.25, 0.5])
def test_the_direction_of_a_move_that_ends_early_is_kept(n, share):
    """The rest of the move is still worth making; its force is not orthogonal to the last one."""
    contact = build_scene(SelfAffine(cutoff=0.0625), Power(n=n), 64).contact(0.001)
    solution = solve_contact(contact, ProjectedCG(tolerance=1e-10))
    u = solution.u + 0.3 * (solution.u - contact.obstacle)
    state = ProjectedCG().begin_from(Start(contact, 0.0, u, contact.stress(u, np.empty_like(u))))
    state.exact = True  # so that the sums over the points are computed
    run = _Run(contact, state)
    run.select()
    run.precondition()
    descent = run.update_direction(0.0)[0]
    state.length = share * run.exact_length(descent)
    run.crosses = lambda length: True
    run.advance(run.precondition())
    assert state.moved == pytest.approx(share * state.best_length, rel=1e-3)
    assert run.precondition() > 0
