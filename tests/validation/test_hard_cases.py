"""Contacts that are hard to solve, those of scripts/hard_cases.py on a smaller grid.

Warnings are errors here as everywhere (pyproject.toml). Contacts are in reduced units.
"""

import importlib.util
import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gfmd_cli.solvers.pcg import ProjectedCG

pytestmark = pytest.mark.validation

POINTS = 128
STEP = 0.005  # relative, in p*: the highest load, 0.99 of full contact, stays below it
EPS = np.finfo(float).eps

_SPEC = importlib.util.spec_from_file_location(
    "hard_cases", Path(__file__).parents[2] / "scripts" / "hard_cases.py"
)
hard = sys.modules["hard_cases"] = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(hard)

NAMES = [str(case) for case in hard.cases(POINTS, Path())]


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Solve a case by its name, at its pressure or a factor of it; each once."""
    folder = tmp_path_factory.mktemp("inputs")
    hard.write_inputs(folder, POINTS)
    known = {str(case): case for case in hard.cases(POINTS, folder)}

    @cache
    def scene(name):
        return known[name].contact(POINTS)

    @cache
    def solve(name, factor=1.0, max_steps=20_000):
        contact = scene(name)
        pressed = type(contact)(
            contact.grid, contact.height, contact.stiffness, contact.pressure * factor
        )
        return hard.solve(pressed, seconds=math.inf, max_steps=max_steps)

    return solve


def elastic(contact, u):
    """K u by NumPy's transforms."""
    if u.ndim == 1:
        return np.fft.irfft(np.fft.rfft(u) * contact.stiffness, u.size)
    return np.fft.irfft2(np.fft.rfft2(u) * contact.stiffness, u.shape)


def compliance(contact):
    """1 / k(q), and 0 at q = 0."""
    k = contact.stiffness
    return np.divide(1.0, k, out=np.zeros_like(k), where=k > 0)


def compliant(contact, sigma):
    """C sigma, of zero mean, by NumPy's transforms."""
    axes = tuple(range(sigma.ndim))
    return np.fft.irfftn(
        np.fft.rfftn(sigma, axes=axes) * compliance(contact), sigma.shape, axes=axes
    )


def rms(field):
    return float(np.sqrt(np.mean(np.square(field))))


def noise(contact, symbol, field):
    """rms error of a symbol times a field where transforms round every value of it ten times.

    They do so log2 of the number of points times, 14 at 128^2, with errors of either sign.
    """
    weighted = symbol**2 * contact.grid.multiplicity()
    spread = float(np.sqrt(np.sum(weighted) / field.size))
    return 10 * EPS * rms(field) * spread


def stiffness_noise(contact, u):
    """rms error of K u."""
    return noise(contact, contact.stiffness, u)


def compliance_noise(contact, sigma):
    """rms error of C sigma."""
    return noise(contact, compliance(contact), sigma)


def test_every_name_is_one_case():
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_it_converges(name, solved):
    """To 1e-6, the default of [solver], with the stress of the displacement, or the reverse."""
    it = solved(name)
    assert it.status == "converged"
    assert it.solution.residual < hard.TOLERANCE
    contact, u, sigma = it.contact, it.solution.u, it.solution.sigma
    if it.solution.is_direct:
        u = compliant(contact, sigma)
        u -= (u - contact.height)[sigma > 0].mean()
    else:
        assert it.floor() < hard.TOLERANCE
        sigma = elastic(contact, u) + contact.pressure
    residual = rms(np.minimum(u - contact.height, sigma)) / min(contact.pressure, 1.0)
    floor = 0.0 if it.solution.is_direct else it.floor()
    assert residual < hard.TOLERANCE + floor  # NumPy's transforms round otherwise


@pytest.mark.parametrize("name", NAMES)
def test_the_solution_meets_the_conditions_of_contact(name, solved):
    it = solved(name)
    contact, u, sigma = it.contact, it.solution.u, it.solution.sigma
    allowed = stiffness_noise(contact, u)
    assert np.isfinite(u).all()
    assert np.isfinite(sigma).all()
    assert np.isfinite([it.observables.energy, it.observables.work, it.observables.perimeter]).all()
    assert np.min(u - contact.height) == 0
    assert 0 < it.observables.a_r <= 1
    if it.solution.is_direct:
        off = u - compliant(contact, sigma)
        laid = it.solution.residual * contact.pressure  # contains the gaps that were closed
        rounding = compliance_noise(contact, sigma) + 10 * EPS * rms(u)
        assert rms(off - off.mean()) < laid + rounding  # two codes
    else:
        assert rms(sigma - elastic(contact, u) - contact.pressure) < 2 * allowed  # two codes
    assert abs(sigma.mean() - contact.pressure) < allowed + EPS * contact.pressure
    # |x|_max <= |x|_2 = N rms for x = min(g, sigma)
    reach = hard.TOLERANCE * min(contact.pressure, 1.0) * np.sqrt(u.size)
    assert sigma.min() >= -reach


@pytest.mark.parametrize("name", NAMES)
def test_twice_the_energy_is_the_work(name, solved):
    """2 v = <sigma h> - p <u> + <sigma g>; <sigma g> is below residual x size of its partner."""
    meets_the_identity(solved(name), hard.TOLERANCE)


def meets_the_identity(it, residual):
    contact, u, sigma = it.contact, it.solution.u, it.solution.sigma
    gap = u - contact.height
    partner = rms(np.maximum(gap, sigma))
    allowed = residual * min(contact.pressure, 1.0) * partner
    rounding = rms(u) * (stiffness_noise(contact, u) + 10 * EPS * rms(sigma))
    assert abs(2 * it.observables.energy - it.observables.work) <= allowed + rounding


@pytest.mark.parametrize("name", NAMES)
def test_the_energy_changes_by_minus_p_times_the_gap(name, solved):
    """v is convex in u_g with slope -p, so a chord's slope lies between those of its ends."""
    it, low, high = (solved(name, factor).observables for factor in (1.0, 1 - STEP, 1 + STEP))
    p = solved(name).contact.pressure
    if it.u_g == 0:
        assert it.a_r == 1
        assert np.array_equal(solved(name).solution.u, solved(name).contact.height)
        return
    assert low.u_g > it.u_g > high.u_g
    slope = (low.energy - high.energy) / (high.u_g - low.u_g)
    assert p * (1 - STEP) < slope < p * (1 + STEP)


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith("a single point")])
def test_what_rounding_forbids_an_iteration_is_not_called_converged(name, solved, monkeypatch):
    """Without direct solutions the residual ends near its floor: within 10 times.

    2 to 4 measured, as transforms round too. 2000 steps, of which the solver needs fewer than 1000.
    """
    monkeypatch.setattr(ProjectedCG, "starts_locally", False)
    contact = solved(name).contact
    it = hard.solve(contact, max_steps=2000)
    assert it.floor() > hard.TOLERANCE
    assert it.status in ("rounding", "max_steps")
    assert hard.TOLERANCE <= it.solution.residual < 10 * it.floor()
    assert np.isfinite(it.solution.u).all()
    meets_the_identity(it, it.solution.residual)
