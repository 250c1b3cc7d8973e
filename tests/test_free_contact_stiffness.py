"""Contact stiffness with a free boundary: a direct solution, differences, the circular punch."""

from dataclasses import replace

import free_contacts
import numpy as np
import pytest
from free_contacts import ELASTOMERS, compliance_matrix, oblong_contact
from scipy.integrate import dblquad

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.free_contact import FreeCompliance, FreeContact
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.contact_stiffness import contact_stiffness
from gfmd_cli.solvers.nested_grids import solve_contact

SPEC = f"{free_contacts.SPEC}[output]\nstiffness = true\n"


@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_stiffness_is_that_of_a_direct_solution_and_of_two_contacts(elastomer):
    contact = oblong_contact(elastomer)
    touching = solve_contact(contact, Auto(tolerance=1e-10)).sigma > 0
    stiffness = contact_stiffness(contact, touching)

    compliance = compliance_matrix(elastomer, contact.grid)
    held = touching.ravel()
    punch = np.zeros(held.size)
    punch[held] = np.linalg.solve(compliance[np.ix_(held, held)], np.ones(held.sum()))
    assert stiffness == pytest.approx(punch.mean() / np.mean(1 - compliance @ punch), rel=1e-7)

    step, gaps = 1e-3, []
    for share in (1 - step, 1 + step):
        pressed = replace(contact, pressure=contact.pressure * share)
        gaps.append(float(np.mean(solve_contact(pressed, Auto(tolerance=1e-11)).u)))
    assert stiffness == pytest.approx(2 * step * contact.pressure / (gaps[0] - gaps[1]), rel=1e-2)


def test_circular_contact_on_a_half_space_is_a_punch():
    """<t> L^2 = 2 E* a, and a displacement of (2 / pi) arcsin(a / r) beside the punch."""
    points, a, modulus = 128, 0.25, 3.0
    grid = Grid(points, 2, 1.0)
    compliance = FreeCompliance(HalfSpace(E_star=modulus), grid, 1.0)
    contact = FreeContact(grid, np.zeros(grid.shape), np.empty(0), 0.1, compliance=compliance)
    middles = (np.arange(points) + 0.5) / points - 0.5
    touching = np.hypot(middles[:, None], middles) < a
    inside = np.pi * a**2 / 4  # of a quarter of the map, where the displacement is 1
    beside, _ = dblquad(
        lambda y, x: 2 / np.pi * np.arcsin(a / np.hypot(x, y)),
        *(0, 0.5),
        lambda x: max(a**2 - x**2, 0.0) ** 0.5,
        0.5,
    )
    exact = 2 * modulus * a / (1 - 4 * (inside + beside))
    assert contact_stiffness(contact, touching) == pytest.approx(exact, rel=2e-2)


def test_full_contact_is_rigid_and_no_contact_has_no_stiffness():
    contact = oblong_contact(HalfSpace())
    everywhere = np.ones(contact.grid.shape, dtype=bool)
    assert contact_stiffness(contact, everywhere) == np.inf
    assert np.isnan(contact_stiffness(contact, ~everywhere))


def test_run_stores_the_stiffness(rows_of):
    (row,) = rows_of()
    assert row["boundary"] == "free"
    assert 0 < row["stiffness"] < np.inf
