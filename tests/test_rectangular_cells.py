"""Cells of any sides, with any numbers of points: surfaces, spectra, theory, solutions."""

import json

import h5py
import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace, Power, Slab
from gfmd_cli.physics.indenters import Cone, Parabola, Punch, RigidSurface
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.persson import Persson
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import sample
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact


class Map(RigidSurface):
    """A periodic map of any shape."""

    kind: str = "map"
    values: tuple[tuple[float, ...], ...]
    length: float = 1.0
    length_y: float | None = None

    def smallest_grid(self):
        return len(self.values[0])

    def smallest_grid_y(self):
        return len(self.values)

    def heights_on(self, grid):
        values = np.array(self.values)
        if values.shape == grid.whole_shape:
            return values[grid.own].copy()
        return Grid(values.shape[1], points_y=len(values)).resample(values, grid)


def as_map(values, **sides):
    return Map(values=tuple(map(tuple, np.asarray(values).tolist())), **sides)


def wavenumbers(shape, sides):
    """|q| of all modes of a map in the order of `numpy.fft.fft2`."""
    q_y, q_x = (
        2 * np.pi * np.fft.fftfreq(n, side / n) for n, side in zip(shape, sides, strict=True)
    )
    return np.hypot(q_y[:, None], q_x)


CELLS = [
    {"length_y": 1.0},
    {"length_y": 0.4},
    {"length_y": 2.3},
    {"length": 3.0, "length_y": 1.7},
]


@pytest.mark.parametrize("cell", CELLS, ids=str)
def test_every_amplitude_on_an_oblong_cell_is_the_root_of_the_spectrum(cell):
    surface = SelfAffine(hurst=0.7, rolloff=0.3, cutoff=0.05, **cell)
    length_y, length = surface.sides
    heights = surface.heights(46, 95)
    m = wavenumbers(heights.shape, surface.sides) * length / (2 * np.pi)
    expected = np.sqrt(length / length_y * (1 + (0.3 * m) ** 2) ** -1.7)
    expected[(m == 0) | (m > 20 * (1 + 1e-12))] = 0.0
    modes = np.abs(np.fft.fft2(heights)) / heights.size
    assert modes == pytest.approx(expected, rel=1e-11, abs=1e-15)


@pytest.mark.parametrize("cell", CELLS, ids=str)
@pytest.mark.parametrize("cutoff", [0.1, 0.073])
def test_a_seed_is_one_surface_on_all_grids_of_an_oblong_cell(cell, cutoff):
    surface = SelfAffine(cutoff=cutoff, seed=5, **cell)
    expected = surface.heights(60, 70)  # more than two points per shortest wave
    least, least_y = surface.smallest_grid(), surface.smallest_grid_y()
    for shape in ((least_y, least), (least_y, 41), (75, least), (least_y + 7, least + 1), (96, 81)):
        heights = sample(surface, shape[1], shape[0])[1]
        assert heights == pytest.approx(at_points(expected, shape), abs=1e-12)


def at_points(field, shape):
    """The trigonometric polynomial of a field at the points of another grid, from its sum."""
    modes, waves = np.fft.fft2(field) / field.size, []
    for old, new in zip(field.shape, shape, strict=True):
        m = np.fft.fftfreq(old, 1 / old)
        waves.append(np.exp(2j * np.pi * np.outer(np.arange(new) / new, m)))
    return (waves[0] @ modes @ waves[1].T).real


def test_a_longer_cell_has_about_the_same_heights():
    square, oblong = (SelfAffine(cutoff=0.02, rolloff=0.1, length_y=side) for side in (1.0, 4.0))
    assert oblong.heights(128).std() == pytest.approx(square.heights(128).std(), rel=0.02)


def test_the_side_along_y_follows_from_the_points():
    surface = SelfAffine(cutoff=0.1, length=2.0)
    assert surface.sides == (2.0, 2.0)
    assert surface.on_cell(64, 96).sides == (3.0, 2.0)
    assert surface.on_cell(64, 64) is surface
    oblong = SelfAffine(cutoff=0.1, length=2.0, length_y=0.5)
    assert oblong.on_cell(64, 96).sides == (0.5, 2.0)
    assert oblong.points_y(64) == 16
    assert oblong.points_y(100) == 24  # even
    assert build_scene(oblong, Power(n=1), 64).grid.whole_shape == (16, 64)


def test_a_grid_too_coarse_along_y_is_refused():
    surface = SelfAffine(cutoff=0.05, length_y=0.5)
    assert surface.smallest_grid_y() == 20
    with pytest.raises(InputError, match=r"grid\.points_y: 19 points along y .* use 20 or more"):
        sample(surface, 40, 19)
    with pytest.raises(InputError, match=r"grid\.points: 38 points along x"):
        sample(surface, 38, 20)


@pytest.mark.parametrize("points", [(32, 32), (33, 48), (47, 21)])
def test_round_indenters_measure_distances_in_metres(points):
    cell = {"length": 2.0, "length_y": 0.7}
    x, y = (np.arange(n) / n - 0.5 for n in points)
    r = np.hypot(0.7 * y[:, None], 2.0 * x)
    assert Cone(slope=0.2, **cell).heights(*points) == pytest.approx(-0.2 * r, abs=1e-15)
    assert Parabola(radius=3.0, **cell).heights(*points) == pytest.approx(-(r**2) / 6, abs=1e-15)
    assert np.array_equal(Punch(radius=0.3, **cell).heights(*points) == 0, r <= 0.3)


def test_the_radius_of_a_punch_is_a_spacing_or_more_along_both_sides():
    punch = Punch(radius=0.05, length=1.0, length_y=2.0)
    assert (punch.smallest_grid(), punch.smallest_grid_y()) == (20, 40)


def test_a_punch_without_rim_in_the_short_side_is_refused():
    with pytest.raises(ValueError, match=r"leaves no rim in a cell of 0\.4: less than 0\.2 is"):
        Punch(radius=0.25, length_y=0.4)
    with pytest.raises(InputError, match=r"points_y: .* 16 .*leaves no rim in a cell of 0\.25"):
        Punch(radius=0.25).on_cell(64, 16)


SHAPES = [((64, 64), 1.0), ((48, 30), 0.4), ((31, 49), 2.0), ((27, 27), 1.0), ((16, 50), 1.0)]


@pytest.mark.parametrize(("shape", "length_y"), SHAPES)
@pytest.mark.parametrize("elastomer", [Power(n=0.5), Power(n=3), Slab(thickness=0.1)], ids=str)
def test_the_spectrum_has_every_mode_once(shape, length_y, elastomer):
    heights = np.random.default_rng(1).standard_normal(shape)
    scene = build_scene(as_map(heights, length_y=length_y), elastomer, shape[1], points_y=shape[0])
    q = wavenumbers(shape, (length_y, 1.0))
    power = np.abs(np.fft.fft2(heights)) ** 2 / heights.size**2
    power[0, 0] = 0.0
    k = elastomer.stiffness(q)
    shells = scene.shells
    assert scene.delta_sigma**2 == pytest.approx(
        np.sum(power * elastomer.unit_stiffness(q) ** 2), rel=1e-12
    )
    assert shells.modes.sum() == heights.size - 1
    assert shells.height.sum() == pytest.approx(heights.var(), rel=1e-12)
    assert shells.energy.sum() == pytest.approx(np.sum(power * k), rel=1e-12)
    assert shells.variance.sum() == pytest.approx(np.sum(power * k**2), rel=1e-12)
    smallest = np.unique(np.round(q[q > 0], 9))[:40]
    assert shells.q[:40] == pytest.approx(smallest, rel=1e-8)


@pytest.mark.parametrize("axis", [0, 1])
def test_two_equal_halves_have_the_theory_of_one(axis):
    heights = SelfAffine(cutoff=0.06).heights(40)
    whole = np.concatenate([heights, heights], axis)
    side = {"length": 2.0, "length_y": 1.0} if axis else {"length_y": 2.0}
    one = build_scene(as_map(heights), Power(n=2), 40)
    two = build_scene(as_map(whole, **side), Power(n=2), whole.shape[1], points_y=len(whole))
    assert two.delta_sigma == pytest.approx(one.delta_sigma, rel=1e-12)
    p = one.delta_sigma * np.array([0.01, 0.1, 1.0])
    theories = Persson(one.shells), Persson(two.shells)
    for name in ("contact_area", "stress_deviation", "mean_gap"):
        single, double = (getattr(theory, name)(p) for theory in theories)
        assert double == pytest.approx(single, rel=1e-10)


# --- solutions ------------------------------------------------------------------------------------


def exact(contact, u, sigma):
    """Largest violation of the conditions of contact, with the stress from NumPy's transform."""
    grid, modes = contact.grid, np.fft.rfft2(u)
    stress = np.fft.irfft2(modes * contact.stiffness, grid.shape) + contact.pressure
    gap = u - contact.height
    assert gap.min() >= 0
    assert sigma == pytest.approx(stress, abs=1e-9)
    return np.abs(np.minimum(gap, stress)).max()


@pytest.mark.parametrize("n", [0, 0.5, 1, 2, 3, 4])
@pytest.mark.parametrize(("shape", "length_y"), [((48, 80), 0.6), ((45, 63), 1.0), ((70, 41), 0.8)])
def test_solutions_meet_the_conditions_of_contact(shape, length_y, n):
    surface = SelfAffine(cutoff=0.06, length_y=length_y)
    scene = build_scene(surface, Power(n=n), shape[1], points_y=shape[0])
    contact = scene.contact(0.1)
    solution = solve_contact(contact, Auto(tolerance=1e-11))
    assert solution.status == "converged"
    assert exact(contact, solution.u, solution.sigma) < 1e-9
    assert 0 < np.mean(solution.sigma > 1e-9) < 1


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("n", [0.5, 1, 2, 3])
def test_two_equal_halves_solve_as_one(axis, n):
    heights = SelfAffine(cutoff=0.06).heights(40)
    whole = np.concatenate([heights, heights], axis)
    side = {"length": 2.0, "length_y": 1.0} if axis else {"length_y": 2.0}
    values = []
    for values_on, cell in ((heights, {}), (whole, side)):
        scene = build_scene(as_map(values_on, **cell), Power(n=n), values_on.shape[1])
        contact = scene.contact(0.1)
        solution = solve_contact(contact, Auto(tolerance=1e-12))
        observables = observe(contact, solution.u, solution.sigma)
        values.append((observables.a_r, observables.sigma_p, observables.u_g, observables.energy))
    assert values[1] == pytest.approx(values[0], rel=1e-10)


@pytest.mark.parametrize(("shape", "length_y"), [((256, 24), 2.0), ((255, 31), 0.6)])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_wave_along_y_has_the_contact_of_westergaard(shape, length_y, share):
    """p / p_full = sin^2(pi a_r / 2), where p_full = pi E* / L_y for an amplitude of 1."""
    wave = np.cos(2 * np.pi * np.arange(shape[0]) / shape[0])[:, None] * np.ones(shape)
    indenter = as_map(wave, length_y=length_y)
    scene = build_scene(indenter, HalfSpace(E_star=2.0), shape[1], points_y=shape[0])
    contact = scene.contact(share * 2 * np.pi / length_y / scene.delta_sigma)
    solution = solve_contact(contact, Auto(tolerance=1e-9))
    touching = solution.sigma > 1e-3
    assert touching.mean() == pytest.approx(2 / np.pi * np.arcsin(np.sqrt(share)), abs=2 / shape[0])
    assert np.ptp(solution.u, axis=1).max() < 1e-8


@pytest.mark.parametrize(("shape", "length_y"), [((128, 256), 0.5), ((201, 135), 1.5)])
def test_hertz_on_an_oblong_cell(shape, length_y):
    """p_0 = 2 E* a / (pi R) at the force 4 E* a^3 / (3 R); images lie far from the contact."""
    radius, E_star = 0.06, 2.0
    indenter = Parabola(radius=1.0, length_y=length_y)
    scene = build_scene(indenter, HalfSpace(E_star=E_star), shape[1], points_y=shape[0])
    pressure = 4 * E_star * radius**3 / 3 / length_y
    contact = scene.contact(pressure / scene.delta_sigma)
    solution = solve_contact(contact, Auto(tolerance=1e-8))
    observables = observe(contact, solution.u, solution.sigma)
    spacing = max(scene.grid.spacings)
    assert np.sqrt(observables.a_r * length_y / np.pi) == pytest.approx(radius, abs=0.25 * spacing)
    peak = solution.sigma.max() * scene.delta_sigma
    assert peak == pytest.approx(2 * E_star * radius / np.pi, rel=0.02)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_oblong_cells_of_square_pixels_take_as_many_steps_as_square_ones(n):
    steps = []
    for cell in ({}, {"length_y": 0.5}, {"length_y": 2.0}):
        contact = build_scene(SelfAffine(cutoff=0.04, **cell), Power(n=n), 128).contact(0.05)
        steps.append(solve_contact(contact, Auto(tolerance=1e-6)).steps)
    assert max(steps[1:]) <= 1.5 * steps[0]


OBLONG = """\
[surface]
kind = "self-affine"
cutoff = 0.1
[elastomer]
kind = "power"
n = 1
[grid]
points = [48, 40]
points_y = 72
[load]
p_star = 1.0
[output]
fields = ["height"]
"""


def test_the_summary_is_that_of_the_surface_of_the_study(output_of, tmp_path):
    (tmp_path / "spec.toml").write_text(OBLONG)
    output_of("run", tmp_path / "spec.toml", "-o", tmp_path / "study.h5", "-q")
    (summary,) = json.loads(output_of("surface", tmp_path / "spec.toml", "--json"))
    with h5py.File(tmp_path / "study.h5") as study:
        heights = study["fields/0/height"][()]  # of the finer grid
        assert summary["surface"] == study["surface"].asstr()[0]
    assert summary["sides"] == [1.0, 1.5]
    assert summary["points"] == [48, 72]
    assert summary["Sq"] == pytest.approx(heights.std(), rel=1e-9)
    assert summary["Sz"] == pytest.approx(np.ptp(heights), rel=1e-9)


def test_a_fit_with_longer_waves_than_the_side_along_x_suggests_no_surface(output_of, tmp_path):
    cone = OBLONG.replace('kind = "self-affine"\ncutoff = 0.1', 'kind = "cone"\nlength_y = 3.25')
    (tmp_path / "spec.toml").write_text(cone.replace("[48, 40]", "64").replace("72", "13"))
    text = output_of("surface", tmp_path / "spec.toml")
    assert "lambda_s is larger than the side along x, and no random surface is suggested" in text
    assert "[surface]" not in text
