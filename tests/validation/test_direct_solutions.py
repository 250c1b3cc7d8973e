"""Direct solutions of contacts below the rounding of K u, against extended precision."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

pytestmark = pytest.mark.validation

_SPEC = importlib.util.spec_from_file_location(
    "direct_solutions", Path(__file__).parents[2] / "scripts" / "direct_solutions.py"
)
script = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(script)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("n", "points", "p_star"),
    [(3, 512, 1e-4), (3, 1024, 5e-4), (4, 256, 1e-4), (4, 512, 1e-3), (4, 1024, 1e-2)],
)
def test_points_in_contact_and_their_stresses_are_those_of_extended_precision(
    n, points, p_star, seed
):
    """The rounding of K u exceeds 2e-7 of the pressure; the stresses have errors below 1e-9."""
    contact = build_scene(SelfAffine(cutoff=0.1, seed=seed), Power(n=n), points).contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=1e-6))
    assert contact.rounding(solution.u) > 2e-7
    assert solution.status == "converged"
    touching = solution.sigma > 0
    assert np.array_equal(touching, solution.u == contact.height)
    s, u = script.exact(contact, solution)
    assert s[touching].min() > 0
    assert (u - contact.height)[~touching].min() > 0
    assert np.abs(s - solution.sigma).max() < 1e-9 * s.max()
    assert np.abs(u - solution.u).max() < 1e-12
