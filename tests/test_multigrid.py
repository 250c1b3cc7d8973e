"""The V-cycle: symmetric, positive, zero at contacts, the same on any number of threads.

On large grids, with its steps for long waves: as exact as these, and faster.
"""

from typing import ClassVar

import numpy as np
import pytest

from gfmd_cli.grid import fft_grid, rows
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power, Tabulated
from gfmd_cli.physics.scenes import build_scene, reduce_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import direct_start, multigrid
from gfmd_cli.solvers import multigrid_transfer_kernels as kernels
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.contact_state import PRESSED, TENSILE
from gfmd_cli.solvers.multigrid import Multigrid, has_coarser_level, level_rows
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG


class WholeGrids(ProjectedCG):
    """Without tiles and direct solves."""

    starts_locally: ClassVar[bool] = False


PATTERNS = ("none", "points", "sparse", "dense", "disc", "grooves", "all but one", "corner")


# Numbers of points along y and x, and the ratio of the sides of the cell
SQUARE = ((64, 64), 1.0)
OTHERS = [
    ((33, 33), 1.0),
    ((45, 60), 0.75),
    ((50, 75), 0.5),
    ((32, 64), 1.0),
    ((96, 24), 1.0),
    ((27, 85), 1.2),
]


STEP = "q^3 with a step by a factor of 100"


def contact(n, shape=64, length_y=1.0, threads=1):
    points_y, points = (shape, shape) if isinstance(shape, int) else shape
    grid = Grid(points, points_y=points_y, length_y=length_y, threads=threads)
    q = grid.wavenumber()
    k = Power(n=3 if n == STEP else n).stiffness(q, grid.length)
    if n == STEP:
        k[q > 0.3 * q.max()] *= 100
    return Contact(grid, np.zeros(grid.shape), k / k.max(), 1.0)


def pattern(kind, shape=64):
    rng = np.random.default_rng(1)
    rows, columns = shape = (shape, shape) if isinstance(shape, int) else shape
    y, x = np.mgrid[:rows, :columns]
    held = {
        "none": np.zeros(shape, dtype=bool),
        "points": (x % 16 == 7) & (y % 16 == 8),
        "sparse": rng.random(shape) < 0.01,
        "dense": rng.random(shape) < 0.5,
        "disc": (x / columns - 1 / 2) ** 2 + (y / rows - 1 / 3) ** 2 < 0.0366,
        "grooves": x % 10 < 3,
        "all but one": (x != 5) | (y != 6),
        "corner": (x % 2 == 1) & (y % 2 == 1),
    }[kind]
    return np.where(held, PRESSED, 0).astype(np.int8)


def applied(n, state, force, threads=1, threshold=PRESSED, length_y=1.0):
    """z, and the two sums, for a force on the points."""
    case = contact(n, state.shape, length_y, threads)
    cycle = Multigrid(case, case.grid)
    cycle.z[...] = np.nan
    change = np.cos(np.arange(state.size)).reshape(state.shape).astype(np.float32)
    slope, turned = cycle.apply(-force, state, threshold, change)
    z = cycle.z[:, : state.shape[1]]
    free = np.where(state < threshold, force, 0.0)
    assert slope == pytest.approx(np.vdot(z, free), rel=1e-5)
    assert turned == pytest.approx(np.vdot(z, change), rel=1e-5, abs=1e-5 * np.abs(z).sum())
    return z.copy()


@pytest.mark.parametrize(
    ("n", "shape", "length_y"),
    [(n, *SQUARE) for n in (1, 2, 3, 4, STEP)]
    + [(n, *other) for n in (1, 4, STEP) for other in OTHERS],
)
@pytest.mark.parametrize("kind", PATTERNS)
def test_symmetric_positive_and_zero_where_held(n, kind, shape, length_y):
    state = pattern(kind, shape)
    a, b = np.random.default_rng(2).normal(size=(2, *shape))
    za, zb = (applied(n, state, force, length_y=length_y) for force in (a, b))
    assert not za[state == PRESSED].any()
    size = np.sqrt(np.vdot(a, za) * np.vdot(b, zb))
    assert np.vdot(a, zb) == pytest.approx(np.vdot(b, za), abs=1e-5 * size)
    waves = [np.sin(2 * np.pi * np.arange(points) / points) for points in shape]
    along_y, along_x = waves[0][:, None] * np.ones(shape), waves[1] * np.ones(shape)
    checks = (-1.0) ** np.indices(shape).sum(axis=0)
    for force in (a, along_y, along_x, checks, np.ones(shape)):
        free = np.where(state == PRESSED, 0.0, force)
        assert np.vdot(free, applied(n, state, force, length_y=length_y)) > 0


@pytest.mark.parametrize("n", [2, 4, STEP])
@pytest.mark.parametrize("kind", PATTERNS)
@pytest.mark.parametrize(
    ("shape", "length_y"), [((16, 16), 1.0), ((15, 17), 1.0), ((9, 32), 1.0), ((36, 8), 1.0)]
)
def test_positive_in_its_least_direction(n, kind, shape, length_y):
    """The whole matrix of the cycle on a small grid."""
    state = pattern(kind, shape)
    free = np.flatnonzero(state.ravel() < PRESSED)
    case = contact(n, shape, length_y)
    cycle, change = Multigrid(case, case.grid), np.zeros(shape, np.float32)
    columns = []
    for i in free:
        force = np.zeros(state.size)
        force[i] = 1.0
        cycle.apply(-force.reshape(shape), state, PRESSED, change)
        columns.append(cycle.z[:, : shape[1]].ravel()[free])
    matrix = np.array(columns)
    assert np.allclose(matrix, matrix.T, rtol=0, atol=1e-5 * np.abs(matrix).max())
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert values[0] > 1e-6 * values[-1]


def line_contact(n, points):
    grid = Grid(points, 1)
    k = Power(n=n).stiffness(grid.wavenumber(), grid.length)
    return Contact(grid, np.zeros(points), k / k.max(), 1.0)


@pytest.mark.parametrize("n", [1, 4])
@pytest.mark.parametrize("points", [32, 45])
@pytest.mark.parametrize("held", [[], [7], [3, 4, 5, 20], range(28)])
def test_symmetric_and_positive_on_a_line(n, points, held):
    """The whole matrix of the cycle, from forces on single points."""
    case, state = line_contact(n, points), np.zeros((1, points), np.int8)
    state[0, list(held)] = PRESSED
    cycle, free = Multigrid(case, case.grid), np.flatnonzero(state[0] < PRESSED)
    columns = []
    for force in np.eye(points)[free]:
        cycle.apply(-force[None], state, PRESSED, np.zeros((1, points), np.float32))
        assert not cycle.z[0, list(held)].any()
        columns.append(cycle.z[0, free])
    matrix = np.array(columns)
    assert np.allclose(matrix, matrix.T, rtol=0, atol=1e-5 * np.abs(matrix).max())
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert values[0] > 1e-6 * values[-1]


def penalty_matrix(penalty):
    """The matrix of a penalty from its elements; a diagonal one counts for both diagonals."""
    own, east, south, cross = (penalty[:, kind, 1:].astype(float) for kind in range(4))
    here = np.arange(own.size).reshape(own.shape)
    right, below = np.roll(here, -1, 1), np.roll(here, -1, 0)
    matrix = np.diag(own.ravel())
    pairs = (here, right, east), (here, below, south)
    for one, other, values in (*pairs, (here, np.roll(right, -1, 0), cross), (right, below, cross)):
        np.add.at(matrix, (one, other), values)
        np.add.at(matrix, (other, one), values)
    return matrix


@pytest.mark.parametrize("n", [0.5, 0.75, 1])
@pytest.mark.parametrize(
    ("shape", "length_y"), [((64, 64), 1.0), ((63, 65), 1.0), ((128, 64), 0.5)]
)
@pytest.mark.parametrize("kind", ["points", "sparse", "disc"])
def test_long_waves_are_solved_with_the_stiffness_itself(kind, shape, length_y, n, monkeypatch):
    """On one level, against a dense solve."""
    monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", 8)
    monkeypatch.setattr(multigrid, "LONG_WAVE_STEPS", 40)
    state, case = pattern(kind, shape), contact(n, shape, length_y)
    cycle = Multigrid(case, case.grid)
    cycle.apply(np.ones(shape), state, PRESSED, np.zeros(shape, np.float32))
    long_waves = cycle.solve_rest.__self__
    grid, level = long_waves.grid, long_waves.levels[0]
    force = np.random.default_rng(9).normal(size=grid.shape)
    level.rhs[...] = force
    long_waves.solve()
    k = Power(n=n).stiffness(grid.wavenumber(), 1.0)
    k /= Power(n=n).stiffness(case.grid.wavenumber(), 1.0).max()
    points = np.eye(grid.size).reshape(-1, *grid.shape)
    matrix = np.fft.irfft2(np.fft.rfft2(points) * k, grid.shape).reshape(grid.size, -1)
    units = multigrid._levels(case)[len(cycle.finer)]
    matrix *= case.grid.size / grid.size / units.scale
    scale = multigrid.LONG_WAVE_PENALTY * units.growth * float(level.operator.penalty_scale)
    matrix += scale * penalty_matrix(level.penalty)
    expected = np.linalg.solve(matrix, force.ravel())
    assert level.y.ravel() == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("threads", [2, 3])
def test_long_waves_on_several_threads(threads, monkeypatch):
    """The level has threads, too; its transforms are divided, which may change last bits."""
    monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", 64)
    monkeypatch.setattr(rows, "MIN_THREADED_ROWS", 16)
    monkeypatch.setattr(fft_grid, "MIN_THREADED_SIDE", 16)
    state = (2 * (np.random.default_rng(5).random((512, 512)) < 0.02)).astype(np.int8)
    force = np.random.default_rng(6).normal(size=state.shape)
    one, many = applied(1, state, force), applied(1, state, force, threads)
    assert many == pytest.approx(one, abs=1e-5 * np.abs(one).max())


def test_without_contact_the_mean_displacement_is_finite(monkeypatch):
    """K and the penalty do not determine it then."""
    force = 1 + 1e-3 * np.random.default_rng(7).normal(size=(256, 256))
    state, largest = pattern("none", 256), []
    for points in (32, 1000):
        monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", points)
        largest.append(np.abs(applied(1, state, force)).max())
    assert largest[0] == pytest.approx(largest[1], rel=1e-3)


@pytest.mark.parametrize("n", [0.5, 0.75, 1])
def test_few_points_of_contact_take_fewer_steps(n, monkeypatch):
    """There the uniform displacement is far softer than all waves."""
    case = build_scene(SelfAffine(cutoff=0.0156, seed=3), Power(n=n), 256).contact(1e-4)
    steps = []
    for points in (32, 1000):
        monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", points)
        steps.append(solve_contact(case, WholeGrids(tolerance=1e-4)).steps)
    assert steps[0] < steps[1]


def test_where_long_waves_are_solved_apart():
    """On large grids, where k(q) grows slowly; the level has an eighth of the points a side."""
    for n, points, expected in ((1, 1024, 128), (0.5, 1024, 128), (1, 1000, 125), (1, 1600, 200)):
        cycle = Multigrid(contact(n, points), Grid(points))
        assert cycle.solve_rest.__self__.grid.points == expected
    for n, points in ((1, 512), (1, 750), (1.25, 1024)):
        cycle = Multigrid(contact(n, points), Grid(points))
        assert len(cycle.finer) == 1


def test_the_mean_gap_converges_faster_where_long_waves_are_solved_apart(monkeypatch):
    """After three steps on the finest grid its error is a tenth of that without these steps."""
    monkeypatch.setattr(multigrid, "MIN_LONG_WAVE_POINTS", 32)
    case = build_scene(SelfAffine(cutoff=0.0156, seed=6), Power(n=1), 256).contact(0.1)
    gaps = {}

    def watch(current, state):
        if current is case:
            gaps[state.step] = float(np.mean(state.u - case.height))

    exact = solve_contact(case, Auto(tolerance=1e-8))
    mean_gap, errors = float(np.mean(exact.u - case.height)), []
    for growth in (multigrid.MAX_LONG_WAVE_GROWTH, 0.0):
        monkeypatch.setattr(multigrid, "MAX_LONG_WAVE_GROWTH", growth)
        solve_contact(case, Auto(tolerance=1e-5), watch)
        errors.append(abs(gaps[3] / mean_gap - 1))
    assert errors[0] < 0.3 * errors[1]


def hats(fine, coarse):
    """Values of the hats of a coarse level at the points of the next finer one, along one axis."""
    distance = np.arange(fine)[:, None] / fine - np.arange(coarse) / coarse
    distance -= np.round(distance)  # periodic
    return np.maximum(0.0, 1 - np.abs(distance) * coarse)


TRANSFERS = [((33, 45), (18, 24)), ((30, 31), (30, 16)), ((9, 64), (6, 32)), ((32, 48), (16, 24))]


@pytest.mark.parametrize(("fine", "coarse"), TRANSFERS)
def test_hats_of_any_numbers_of_points(fine, coarse):
    rng = np.random.default_rng(7)
    along_y, along_x = (hats(*numbers) for numbers in zip(fine, coarse, strict=True))
    residual, restricted = rng.normal(size=fine).astype(np.float32), np.empty(coarse, np.float32)
    kernels.restrict(residual, restricted, 0, coarse[0])
    assert restricted == pytest.approx(along_y.T @ residual @ along_x, abs=1e-5)
    values, restricted = rng.normal(size=coarse).astype(np.float32), np.empty(fine, np.float32)
    kernels.interpolate(values, restricted, 0, fine[0])
    assert restricted == pytest.approx(along_y @ values @ along_x.T, abs=1e-5)


@pytest.mark.parametrize(("fine", "coarse"), TRANSFERS)
@pytest.mark.parametrize("weighted", [0, 1])
def test_the_penalty_on_hats_of_any_numbers_of_points(fine, coarse, weighted):
    """P^T w P in units of 1/64, for the neighbours that `compute_penalty` names."""
    values = np.random.default_rng(8).integers(0, 4, size=fine).astype(np.int8)
    threshold = 4 if weighted else PRESSED
    w = values / 4 if weighted else 1.0 * (values >= PRESSED)
    along_y, along_x = (hats(*numbers) for numbers in zip(fine, coarse, strict=True))
    next_y, next_x = (np.roll(axis, -1, axis=1) for axis in (along_y, along_x))
    penalty, weights = np.zeros((coarse[0], 4, coarse[1] + 1), np.uint8), np.zeros(coarse, np.int8)
    kernels.compute_any_penalty(values, threshold, weighted, penalty, weights, 0, coarse[0])
    pairs = ((along_y, along_x), (along_y, next_x), (next_y, along_x), (next_y, next_x))
    for kind, (other_y, other_x) in enumerate(pairs):
        expected = 64 * (along_y * other_y).T @ w @ (along_x * other_x)
        assert np.abs(penalty[:, kind, 1:] - expected).max() <= 0.501
    assert np.array_equal(penalty[:, :, 0], penalty[:, :, -1])
    expected = np.minimum(4, 4 * along_y.T @ w @ along_x)
    assert np.abs(weights - expected).max() <= 0.501


def test_the_penalty_of_exactly_half_the_points_is_the_same():
    state = pattern("sparse")
    results = []
    for kernel in (kernels.compute_penalty, kernels.compute_any_penalty):
        penalty, weights = np.zeros((32, 4, 33), np.uint8), np.zeros((32, 32), np.int8)
        kernel(state, PRESSED, 0, penalty, weights, 0, 32)
        results.append((penalty, weights))
    assert np.array_equal(results[0][0], results[1][0])


def test_points_under_tension_are_held_where_asked():
    state = pattern("disc")
    state[10:20, 10:20] = TENSILE
    force = np.random.default_rng(3).normal(size=state.shape)
    assert applied(3, state, force)[15, 15] != 0
    assert not applied(3, state, force, threshold=TENSILE)[state >= TENSILE].any()


def steps_of_conjugate_gradients(n, state, length_y=1.0):
    """For K on the free points, to 1e-8 of the energy."""
    held, case = state == PRESSED, contact(n, state.shape, length_y)
    force = np.where(held, 0.0, np.random.default_rng(4).normal(size=held.shape))
    cycle, change = Multigrid(case, case.grid), np.zeros(held.shape, np.float32)
    steps, start = 0, None
    direction, old = np.zeros_like(force), 1.0
    while True:
        cycle.apply(-force, state, PRESSED, change)
        z = cycle.z[:, : held.shape[1]].copy()
        new = float(np.vdot(z, force))
        start = start or new
        if new < 1e-8 * start or steps > 200:
            return steps
        direction = z + new / old * direction if steps else z
        pull = np.fft.irfft2(case.stiffness * np.fft.rfft2(direction), held.shape)
        pull[held] = 0.0
        force -= new / np.vdot(direction, pull) * pull
        old, steps = new, steps + 1


@pytest.mark.parametrize(
    ("n", "kind", "most"),
    [(1, "disc", 17), (2, "disc", 12), (2, "sparse", 12), (3, "sparse", 16), (4, "disc", 36)],
)
def test_conjugate_gradients_take_few_steps_on_any_grid(n, kind, most):
    """With the contacts refined."""
    for points in (64, 128):
        state = np.kron(pattern(kind), np.ones((points // 64,) * 2, dtype=np.int8))
        assert steps_of_conjugate_gradients(n, state) <= most


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("shape", "length_y"),
    [((125, 125), 1.0), ((127, 127), 1.0), ((97, 130), 0.75), ((64, 128), 1.0), ((128, 32), 1.0)],
)
def test_odd_numbers_of_points_and_oblong_pixels_take_about_as_many_steps(n, shape, length_y):
    square = steps_of_conjugate_gradients(n, pattern("disc", 128))
    assert steps_of_conjugate_gradients(n, pattern("disc", shape), length_y) <= 2 * square


@pytest.mark.parametrize(
    ("shape", "length_y", "expected"),
    [
        ((64, 64), 1.0, [(64, 64), (32, 32), (16, 16), (8, 8), (4, 4)]),
        ((96, 48), 2.0, [(96, 48), (48, 24), (24, 12), (12, 6)]),
        ((33, 75), 0.44, [(33, 75), (18, 38), (9, 19), (6, 10)]),
        ((16, 64), 1.0, [(16, 64), (16, 32), (16, 16), (8, 8), (4, 4)]),
        ((64, 24), 1.0, [(64, 24), (32, 24), (16, 12), (8, 6)]),
    ],
)
def test_shapes_of_the_levels(shape, length_y, expected):
    grid = Grid(shape[1], points_y=shape[0], length_y=length_y)
    assert [level for level, _ in level_rows(grid)] == expected


def test_shapes_of_the_levels_of_a_line():
    shapes = [level for level, _ in level_rows(Grid(45, 1))]
    assert shapes == [(1, 45), (1, 24), (1, 12), (1, 6)]


def test_same_on_any_number_of_threads():
    points = 512
    state = (2 * (np.random.default_rng(5).random((points, points)) < 0.05)).astype(np.int8)
    force = np.random.default_rng(6).normal(size=state.shape)
    one = applied(3, state, force)
    for threads in (2, 3):
        assert np.array_equal(applied(3, state, force, threads), one)


@pytest.mark.parametrize(("shape", "length_y"), [((513, 301), 1.7), ((600, 300), 1.0)])
def test_other_grids_are_the_same_on_any_number_of_threads(shape, length_y):
    state = (2 * (np.random.default_rng(5).random(shape) < 0.05)).astype(np.int8)
    force = np.random.default_rng(6).normal(size=shape)
    one = applied(3, state, force, length_y=length_y)
    other = applied(3, state, force, threads=3, length_y=length_y)
    assert np.array_equal(other, one)


def test_a_steep_line_contact_converges():
    """With the Green's function, 3000 steps do not suffice."""
    rng, waves, points = np.random.default_rng(3), np.arange(1, 129), 4096
    modes = np.zeros(points // 2 + 1, complex)
    modes[waves] = (rng.normal(size=128) + 1j * rng.normal(size=128)) * waves**-1.3
    height = np.fft.irfft(modes, points)
    scene = reduce_scene(Grid(points, 1), height, Power(n=4))
    solution = solve_contact(scene.contact(0.1), Auto(max_steps=1000))
    assert solution.status.is_converged


@pytest.mark.parametrize(
    ("law", "p_star", "most"),
    [
        (lambda m: m**3 * np.where(m > 16, 100, 1), 0.05, 150),
        (lambda m: m**3 * np.where(m > 16, 100, 1), 0.001, 800),
        (lambda m: m**6.5, 0.05, 700),
    ],
    ids=["step-0.05", "step-0.001", "q^6.5"],
)
def test_an_abrupt_and_a_steep_stiffness_converge(law, p_star, most, tmp_path, monkeypatch):
    """In 40, 283 and 423 transforms; without the limit on k(q) of the levels in 58, 382 and 821.

    There the weights of the corrections keep their values at the limit (`without_limit` of
    scripts/steep_stiffness.py); with weights that fall further it is 45, 297 and 532.
    """
    monkeypatch.setattr(direct_start, "MAX_COST", 0)
    m = np.geomspace(1, 256, 4000)
    np.savetxt(tmp_path / "k.txt", np.c_[2 * np.pi * m, law(m)])
    scene = build_scene(SelfAffine(cutoff=0.02), Tabulated(path=tmp_path / "k.txt"), 256)
    solution = solve_contact(scene.contact(p_star), Auto())
    assert solution.status.is_converged
    assert solution.transforms < most


def test_what_has_a_coarser_level():
    assert has_coarser_level(contact(4).grid)
    assert has_coarser_level(contact(1, 10).grid)
    assert not has_coarser_level(contact(2, 6).grid)
