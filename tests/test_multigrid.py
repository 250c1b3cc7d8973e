"""The V-cycle: symmetric, positive, zero at contacts, the same on any number of threads."""

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.solvers.contact_state import PRESSED, TENSE
from gfmd_cli.solvers.multigrid import GROWTH, Multigrid, suits

PATTERNS = ("none", "points", "sparse", "dense", "disc", "grooves", "all but one", "corner")


def contact(n, points=64, threads=1):
    grid = Grid(points, threads=threads)
    k = Power(n=n).stiffness(grid.wavenumber(), grid.length)
    return Contact(grid, np.zeros(grid.shape), k / k.max(), 1.0)


def pattern(kind, points=64):
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:points, :points]
    held = {
        "none": np.zeros((points, points), dtype=bool),
        "points": (x % 16 == 7) & (y % 16 == 8),
        "sparse": rng.random((points, points)) < 0.01,
        "dense": rng.random((points, points)) < 0.5,
        "disc": (x - points / 2) ** 2 + (y - points / 3) ** 2 < 150,
        "grooves": x % 10 < 3,
        "all but one": (x != 5) | (y != 9),
        "corner": (x % 2 == 1) & (y % 2 == 1),
    }[kind]
    return np.where(held, PRESSED, 0).astype(np.int8)


def applied(n, state, force, threads=1, threshold=PRESSED):
    """z, and the two sums, for a force on the points."""
    points = len(state)
    cycle = Multigrid(contact(n, points, threads))
    cycle.z[...] = np.nan
    change = np.cos(np.arange(points**2)).reshape(state.shape).astype(np.float32)
    slope, turned = cycle.apply(-force, state, threshold, change)
    z = cycle.z[:, :points]
    free = np.where(state < threshold, force, 0.0)
    assert slope == pytest.approx(np.vdot(z, free), rel=1e-5)
    assert turned == pytest.approx(np.vdot(z, change), rel=1e-5, abs=1e-5 * np.abs(z).sum())
    return z.copy()


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", PATTERNS)
def test_symmetric_positive_and_zero_where_held(n, kind):
    state = pattern(kind)
    a, b = np.random.default_rng(2).normal(size=(2, *state.shape))
    za, zb = applied(n, state, a), applied(n, state, b)
    assert not za[state == PRESSED].any()
    size = np.sqrt(np.vdot(a, za) * np.vdot(b, zb))
    assert np.vdot(a, zb) == pytest.approx(np.vdot(b, za), abs=1e-5 * size)
    smooth = np.sin(2 * np.pi * np.arange(64) / 64)[:, None] * np.ones(64)
    checks = (-1.0) ** np.indices(state.shape).sum(axis=0)
    for force in (a, smooth, checks, np.ones(state.shape)):
        free = np.where(state == PRESSED, 0.0, force)
        assert np.vdot(free, applied(n, state, force)) > 0


@pytest.mark.parametrize("n", [2, 4])
@pytest.mark.parametrize("kind", PATTERNS)
def test_positive_in_its_least_direction(n, kind):
    """The whole matrix of the cycle on a small grid."""
    points = 16
    state = pattern(kind, points)
    free = np.flatnonzero(state.ravel() < PRESSED)
    columns = []
    for i in free:
        force = np.zeros(points**2)
        force[i] = 1.0
        columns.append(applied(n, state, force.reshape(state.shape)).ravel()[free])
    matrix = np.array(columns)
    assert np.allclose(matrix, matrix.T, rtol=0, atol=1e-5 * np.abs(matrix).max())
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert values[0] > 1e-6 * values[-1]


def test_points_under_tension_are_held_where_asked():
    state = pattern("disc")
    state[10:20, 10:20] = TENSE
    force = np.random.default_rng(3).normal(size=state.shape)
    assert applied(3, state, force)[15, 15] != 0
    assert not applied(3, state, force, threshold=TENSE)[state >= TENSE].any()


@pytest.mark.parametrize(
    ("n", "kind", "most"),
    [(1, "disc", 17), (2, "disc", 12), (2, "sparse", 12), (3, "sparse", 16), (4, "disc", 36)],
)
def test_conjugate_gradients_take_few_steps_on_any_grid(n, kind, most):
    """For K on the free points, to 1e-8 of the energy, with the contacts refined."""
    for points in (64, 128):
        state = np.kron(pattern(kind), np.ones((points // 64,) * 2, dtype=np.int8))
        held, k = state == PRESSED, contact(n, points).stiffness
        force = np.where(held, 0.0, np.random.default_rng(4).normal(size=held.shape))
        steps, start = 0, None
        direction, old = np.zeros_like(force), 1.0
        while True:
            z = applied(n, state, force)
            new = float(np.vdot(z, force))
            start = start or new
            if new < 1e-8 * start:
                break
            direction = z + new / old * direction if steps else z
            pull = np.where(held, 0.0, np.fft.irfft2(k * np.fft.rfft2(direction), held.shape))
            force -= new / np.vdot(direction, pull) * pull
            old, steps = new, steps + 1
            assert steps <= most


def test_same_on_any_number_of_threads():
    points = 512
    state = (2 * (np.random.default_rng(5).random((points, points)) < 0.05)).astype(np.int8)
    force = np.random.default_rng(6).normal(size=state.shape)
    one = applied(3, state, force)
    for threads in (2, 3):
        assert np.array_equal(applied(3, state, force, threads), one)


def test_knows_what_it_does_not_suit():
    assert suits(contact(4))
    assert suits(contact(1, 10))
    assert not suits(contact(2, 6))  # no coarser grid
    steep = contact(4)
    steep.stiffness[:, 20:] *= GROWTH
    assert not suits(steep)
    steep.stiffness[0, 1] = 0.0
    assert not suits(steep)
