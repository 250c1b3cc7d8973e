"""Contacts of a map with an elastomer that goes on beyond it: exact results, other methods."""

import copy
from dataclasses import replace

import free_contacts
import h5py
import numpy as np
import pytest
import scipy.fft
from free_contacts import ELASTOMERS, compliance_matrix, oblong_contact
from scipy.optimize import nnls

from gfmd_cli import api
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.indenters import LineParabola, Parabola
from gfmd_cli.physics.observables import contact_line, observe
from gfmd_cli.physics.patches import contact_patches, open_gap
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.dual import Dual
from gfmd_cli.solvers.loop import solve
from gfmd_cli.solvers.nested_grids import Resume, solve_contact
from gfmd_cli.study.observables import SolvedContact

pytestmark = pytest.mark.usefixtures("estimated_plans")
ROUGH = SelfAffine(cutoff=0.05)
SPEC = free_contacts.SPEC


@pytest.mark.parametrize("pressure", [1e-3, 0.1, 3.0])
@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_solution_is_that_of_non_negative_least_squares(elastomer, pressure):
    """At the level c of the undeformed surface, s >= 0 minimises <s C s>/2 - <s (h - c)>.

    With C = R^T R this is |R s - R^-T (h - c)|^2, which the active-set method of Lawson and
    Hanson solves.
    """
    contact = oblong_contact(elastomer, pressure)
    solution = solve_contact(contact, Auto(tolerance=1e-11))
    assert solution.status == "converged"
    level = contact.reference_level(solution.u, solution.sigma)
    compliance = compliance_matrix(elastomer, contact.grid)
    root = np.linalg.cholesky(compliance).T
    stress, _ = nnls(root, np.linalg.solve(root.T, contact.height.ravel() - level))
    assert stress.mean() == pytest.approx(pressure, rel=1e-8)
    assert solution.sigma.ravel() == pytest.approx(stress, abs=1e-8 * stress.max())
    gap = compliance @ stress + level - contact.height.ravel()
    assert (solution.u - contact.height).ravel() == pytest.approx(np.maximum(gap, 0), abs=1e-7)


def test_hertz_contact_has_no_images():
    """Hertz: a^3 = 3 F R / 4 E*, p_0 = 2 E* a / pi R, depth a^2 / R, at a = 0.3 of the side."""
    radius, modulus, a = 2.0, 3.0, 0.3
    scene = build_free_scene(Parabola(radius=radius), HalfSpace(E_star=modulus), 128)
    contact = scene.contact(4 * modulus * a**3 / (3 * radius) / scene.delta_sigma)
    solution = solve_contact(contact, Auto())
    highest = solution.sigma.max() * scene.delta_sigma
    assert highest == pytest.approx(2 * modulus * a / (np.pi * radius), rel=2e-4)
    depth = contact.height.max() - contact.reference_level(solution.u, solution.sigma)
    assert depth * scene.h_std == pytest.approx(a**2 / radius, rel=2e-4)
    area = observe(contact, solution.u, solution.sigma).a_r
    assert area == pytest.approx(np.pi * a**2, rel=2e-2)  # the perimeter times a spacing / 4


def test_hertz_line_contact_has_no_images():
    """a^2 = 4 P R / pi E*, p_0 = E* a / 2 R."""
    radius, modulus, a = 2.0, 3.0, 0.3
    scene = build_free_scene(LineParabola(radius=radius), HalfSpace(E_star=modulus), 512)
    load = np.pi * modulus * a**2 / (4 * radius)
    solution = solve_contact(scene.contact(load / scene.delta_sigma), Auto())
    highest = solution.sigma.max() * scene.delta_sigma
    assert highest == pytest.approx(modulus * a / (2 * radius), rel=1e-4)
    assert np.mean(solution.sigma > 0) == pytest.approx(2 * a, abs=2 / 512)


@pytest.mark.parametrize("n", [0.5, 1.5])
def test_generalised_hertz_contact_has_no_images(n):
    """sigma_0 = 2^(n-1) k a^(2-n) / [R Gamma(2-n/2)^2], depth a^2 / [(2-n) R]: exact results."""
    from scipy.special import gamma

    a, points = 0.3, 128
    scene = build_free_scene(Parabola(radius=1.0), Power(n=n), points)
    force = np.pi * 2 ** (n - 1) * a ** (4 - n) / (gamma(3 - n / 2) * gamma(2 - n / 2))
    contact = scene.contact(force / scene.delta_sigma)
    solution = solve_contact(contact, Auto())
    highest = solution.sigma.max() * scene.delta_sigma
    assert highest == pytest.approx(2 ** (n - 1) * a ** (2 - n) / gamma(2 - n / 2) ** 2, rel=3e-3)
    depth = contact.height.max() - contact.reference_level(solution.u, solution.sigma)
    assert depth * scene.h_std == pytest.approx(a**2 / (2 - n), rel=3e-3)


@pytest.mark.parametrize("p_star", [1e-3, 0.1, 2.0])
def test_energy_is_half_of_the_work_and_stress_has_its_mean(p_star):
    contact = build_free_scene(ROUGH, HalfSpace(), 64).contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=1e-9))
    observables = observe(contact, solution.u, solution.sigma)
    assert observables.work == pytest.approx(2 * observables.energy, rel=1e-7)
    assert solution.sigma.mean() == pytest.approx(p_star, rel=1e-12)
    assert np.all(solution.u[solution.sigma > 0] == contact.height[solution.sigma > 0])


def test_unit_of_pressure_is_that_of_the_mirrored_map():
    """Of a half-space, E*/2 times the rms gradient: of a plane of slope 0.3, up to its kinks."""

    class Plane(Parabola):
        def heights_on(self, grid):
            return 0.3 * (np.arange(grid.points) / grid.points) * np.ones(grid.shape)

    scene = build_free_scene(Plane(), HalfSpace(E_star=2.0), 256)
    assert scene.delta_sigma == pytest.approx(0.3, rel=1e-2)
    assert scene.h_std == pytest.approx(0.3 / np.sqrt(12), rel=1e-4)


@pytest.mark.parametrize("shape", [(24, 24), (24,)])
def test_finer_grid_of_a_map_does_not_join_its_borders(tmp_path, shape):
    """A staircase along x, whose heights between the points lie between those beside them."""
    steps = np.floor(np.arange(24) / 4)
    np.save(tmp_path / "stairs.npy", np.broadcast_to(steps, shape))
    surface = FileSurface(path=tmp_path / "stairs.npy", periodic=False, level="none", edges="none")
    fine = build_free_scene(surface, HalfSpace(), 72)
    rows = fine.in_metres(fine.height)
    assert np.diff(rows, axis=-1).min() >= -1e-12
    assert rows[..., 1::3] == pytest.approx(np.broadcast_to(steps, (*fine.grid.shape[:-1], 24)))
    periodic = build_scene(surface, HalfSpace(), 72)
    assert np.diff(periodic.height, axis=-1).min() < -0.1


def test_points_beside_a_border_never_touch_because_of_the_other_border(tmp_path):
    heights = SelfAffine(cutoff=0.1).heights(32)
    heights[:, 0] = np.nan
    np.save(tmp_path / "holed.npy", heights)
    surface = FileSurface(path=tmp_path / "holed.npy", periodic=False, edges="none", missing="void")
    known = build_free_scene(surface, HalfSpace(), 128).may_touch
    assert np.all(known[:, 4:])
    assert not np.any(known[:, :4])


def solved_map(heights, points, **surface):
    keys = {"length": 1e-6, "periodic": False, "level": "none"}
    return api.solve(
        {
            "surface": {key: value for key, value in (keys | surface).items() if value is not None},
            "elastomer": {"kind": "half-space", "E_star": 1e9},
            "grid": {"points": points, "boundary": "free"},
            "load": {"p_star": 0.1},
            "solver": {"tolerance": 1e-9},
        },
        heights=heights,
    )


@pytest.mark.parametrize("points", [24, 37, 48, 72])
@pytest.mark.parametrize("interpolation", ["monotone", "fourier"])
def test_a_map_may_be_turned_on_any_grid(interpolation, points):
    heights = 1e-9 * SelfAffine(cutoff=0.1, seed=3).heights(48)[:24, 5:29]
    turned = (heights, heights[::-1, ::-1], heights[:, ::-1])
    results = [solved_map(each, points, interpolation=interpolation) for each in turned]
    for result in results:
        assert result.height.std() == pytest.approx(result.h_std, rel=1e-9, abs=0)
        assert result.a_r == pytest.approx(results[0].a_r, abs=2 / points**2)
        assert result.u_g == pytest.approx(results[0].u_g, rel=1e-6)


def test_an_array_ends_at_a_free_boundary_and_is_not_levelled():
    """Also between its points: those at opposite borders do not meet."""
    heights = 1e-9 * SelfAffine(cutoff=0.1, seed=3).heights(48)[:24, 5:29]
    array, stated = (solved_map(heights, 48, **keys) for keys in ({"periodic": None}, {}))
    assert array.height == pytest.approx(stated.height)
    assert array.a_r == stated.a_r
    keys = {"periodic": None, "level": None}
    assert solved_map(heights, 48, **keys).height == pytest.approx(stated.height)


def test_the_gap_of_a_map_converges_with_the_grid():
    """All grids cover the same area."""
    heights = 1e-9 * SelfAffine(cutoff=0.2, seed=1).heights(64)[:24, :24]
    gaps = [solved_map(heights, points).gap.mean() for points in (48, 96, 192)]
    assert abs(gaps[2] - gaps[1]) < 0.6 * abs(gaps[1] - gaps[0])


@pytest.mark.parametrize("stop_at", [0, 1, 5])
@pytest.mark.parametrize("elastomer", [HalfSpace(), Power(n=1.5)], ids=["n=1", "n=1.5"])
def test_resumed_solve_is_bit_identical(elastomer, stop_at):
    contact, solver = build_free_scene(ROUGH, elastomer, 128).contact(0.1), Dual()
    saved = []

    def watch(level, state):
        if level is contact and state.step == stop_at:
            saved.append(copy.deepcopy(state))

    straight = solve_contact(contact, solver, watch)
    resumed = solve_contact(contact, solver, resume=Resume((128, 128), saved[0]))
    assert np.array_equal(resumed.sigma, straight.sigma)
    assert np.array_equal(resumed.u, straight.u)
    assert resumed.transforms == straight.transforms


def test_energy_never_rises():
    contact = build_free_scene(ROUGH, Power(n=1.5), 64).contact(0.3)
    energies = []

    def watch(contact, state):
        stress = state.sigma
        response = contact.compliance.displacement(stress, np.empty_like(stress))
        energies.append(np.mean(stress * (0.5 * response - contact.height)))

    state = Dual().begin(contact, contact.grid.empty())
    solve(contact, Dual(tolerance=1e-8), state, watch)
    assert np.all(np.diff(energies) <= 1e-13)
    assert len(energies) > 10


@pytest.mark.parametrize(("n", "points", "p_star"), [(1.5, 64, 0.01), (1.5, 256, 0.001)])
def test_a_spike_does_not_stop_the_solver(n, points, p_star, tmp_path):
    """It carries much more of the load on coarse grids than on the finest."""
    rough = build_scene(SelfAffine(cutoff=0.05), HalfSpace(), points).contact(0.1).height
    rng = np.random.default_rng(1)
    heights = 0.3 * rough + 0.1 * rng.standard_normal(rough.shape)
    heights.flat[rng.choice(heights.size)] += 45.0
    np.save(tmp_path / "map.npy", heights)
    surface = FileSurface(path=tmp_path / "map.npy", level="none", length=float(points))
    scene = build_free_scene(surface, Power(n=n), points)
    solution = solve_contact(scene.contact(p_star), Auto(max_steps=300))
    assert solution.status == "converged"
    assert solution.transforms < 3000


def average_pixels(values, shape):
    grid, target = (Grid(columns, points_y=rows) for rows, columns in (values.shape, shape))
    return grid.average(values, target)


@pytest.mark.parametrize(("n", "p_star", "tolerance"), [(1, 1e6, 1e-13), (1.5, 3, 1e-15)])
def test_a_tolerance_below_the_rounding_ends_the_solve(n, p_star, tolerance):
    contact = build_free_scene(SelfAffine(cutoff=0.2), Power(n=n), 20).contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=tolerance))
    assert solution.status == "rounding"
    assert solution.steps < 1000
    assert solution.residual < 1e-7
    fresh = copy.deepcopy(solution)
    fresh.recompute(contact)
    assert fresh.residual == pytest.approx(solution.residual, rel=0.5)


def test_averages_over_larger_pixels_keep_the_mean():
    values = np.random.default_rng(0).random((12, 15))
    halved = average_pixels(values, (6, 15))
    assert halved == pytest.approx(0.5 * (values[::2] + values[1::2]))
    for shape in ((5, 7), (12, 15), (24, 31)):
        assert average_pixels(values, shape).mean() == pytest.approx(values.mean())
    assert np.array_equal(average_pixels(values, values.shape), values)
    lonely = np.zeros((8, 8))
    lonely[3, 3] = 1.0
    assert np.count_nonzero(average_pixels(lonely, (16, 16))) == 4


def test_patches_end_at_a_free_border():
    touching = np.zeros((6, 8), dtype=bool)
    touching[2, [0, 7]] = True
    assert contact_patches(touching).sizes.size == 1
    assert contact_patches(touching, periodic=False).sizes.tolist() == [1, 1]
    grid = Grid(8, points_y=6)
    assert contact_line(grid, touching) == pytest.approx(6 * 8 / 48)
    assert contact_line(grid, touching, periodic=False) == pytest.approx(6 * 8 / 48)
    touching[:, 4] = True
    assert open_gap(touching, periodic=False).percolates.tolist() == [True, False]
    assert open_gap(~touching, periodic=False).percolates.tolist() == [True, False]


def test_run_stores_the_boundary(rows_of):
    (row,) = rows_of()
    assert row["boundary"] == "free"
    assert (row["solver"], row["status"]) == ("dual", "converged")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("elastomer={kind='slab', thickness=0.1}", "decays with the distance"),
        ("solver.kind=pcg", 'solver.kind: "pcg" solves contacts with grid.boundary = "periodic"'),
    ],
)
def test_what_a_free_boundary_does_not_allow(gfmd, override, message):
    done = gfmd("run", "spec.toml", "--set", override)
    assert done.exit_code == 2
    assert message in done.output
    assert "Traceback" not in done.output


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([[1.0, 1.0], [10.0, 100.0]], "decays with the distance"),
        ([[1.0, 1.0], [10.0, 0.9], [100.0, 9.0]], "begins with k ~ q^-0.046: add rows at smaller"),
        ([[1.0, 1.0], [10.0, 10.0], [100.0, 10.0]], "rises at its upper end"),
    ],
)
def test_table_without_a_compliance_kernel_is_refused(gfmd, tmp_path, rows, message):
    np.savetxt(tmp_path / "k.txt", rows)
    done = gfmd("run", "spec.toml", "--set", "elastomer={kind='table', path='k.txt'}")
    assert done.exit_code == 2
    assert message in done.output


def test_table_of_a_half_space_is_solved_as_the_half_space(rows_of, tmp_path):
    np.savetxt(tmp_path / "k.txt", [[1.0, 0.5], [10.0, 5.0]])  # E* = 1
    (table,) = rows_of("elastomer={kind='table', path='k.txt'}", name="table.h5")
    (half_space,) = rows_of("elastomer={kind='half-space', E_star=1}")
    assert table["status"] == "converged"
    assert table["a_r"] == pytest.approx(half_space["a_r"], abs=2 / 32**2)
    for name in ("sigma_p", "u_g", "delta_sigma", "displacement"):
        assert table[name] == pytest.approx(half_space[name], rel=1e-5)


def test_dual_solver_is_for_a_free_boundary(gfmd):
    done = gfmd("run", "spec.toml", "--set", "grid.boundary=periodic", "--set", "solver.kind=dual")
    assert done.exit_code == 2
    assert 'boundary = "free", not "periodic"' in done.output


def test_thin_layer_is_planned_and_solved(rows_of):
    """Much thinner than the side, but not than the spacing."""
    (row,) = rows_of("elastomer={kind='layer', thickness=0.02, base='sliding'}")
    assert row["status"] == "converged"


def test_spectra_of_a_map_are_its_cosine_transform(gfmd):
    """The mirrored map has the modes of a DCT of type II."""
    words = ["output.spectra=true", 'output.fields=["height", "u", "sigma"]']
    done = gfmd("run", "spec.toml", *(part for word in words for part in ("--set", word)))
    assert done.exit_code == 0, done.output
    with h5py.File("study.h5") as file:
        (task,) = file["spectra"]
        waves = file[f"spectra/{task}/waves"][()]
        q = file[f"spectra/{task}/q"][()]
        for name in ("height", "u", "sigma"):
            field = file[f"fields/{task}/{name}"][()]
            power = file[f"spectra/{task}/{name}"][()]
            cosines = scipy.fft.dctn(field, type=2, norm="ortho") ** 2 / field.size
            assert power.sum() == pytest.approx(field.var(), rel=1e-10)
            assert power[0] == pytest.approx(cosines[0, 1] + cosines[1, 0], rel=1e-6)
        assert waves.sum() == 4 * field.size - 1
        assert q[0] == pytest.approx(np.pi)  # half a wave on the side L = 1


def test_stress_of_full_contact_is_that_of_the_mirrored_map():
    """On a half-space the quadrature is E*/2 times the rms gradient over the contact."""
    surface = SelfAffine(cutoff=0.25, seed=3)
    contact = build_free_scene(surface, Power(n=1), 64).contact(0.1)
    whole = SolvedContact(contact, contact.height, np.ones(contact.grid.shape))
    assert whole.full_contact_stress.deviation == pytest.approx(1, rel=1e-12)
    assert whole.full_contact_stress.quadrature == pytest.approx(1, rel=1e-3)
    x = np.cos(np.pi * (np.arange(64) + 0.5) / 64)
    wave = replace(contact, height=np.tile(x, (64, 1)), pressure=1.0)
    sigma = np.zeros((64, 64))
    sigma[:, :16] = 1.0
    solved = SolvedContact(wave, wave.height, sigma)
    k = np.pi / contact.compliance.unit
    s = k * x[:16]
    assert solved.full_contact_stress.deviation == pytest.approx(s.std(), rel=1e-10)
    slope = k * np.sin(np.pi * (np.arange(16) + 0.5) / 64)
    expected = np.sqrt(np.mean(slope**2))
    assert solved.full_contact_stress.quadrature == pytest.approx(expected, rel=1e-10)


def test_true_contact_is_measured_with_a_free_boundary(rows_of):
    (row,) = rows_of("output.true_contact=true")
    assert row["boundary"] == "free"
    assert 0 < row["deviation_c"] < 1
    assert 0 < row["quadrature_c"] < 2
    assert row["deviation_bearing"] > 0


def test_an_array_ends_at_its_borders_also_if_the_spec_says_so():
    heights = np.cumsum(np.random.default_rng(0).normal(size=(8, 9)), 0)
    spec = {
        "elastomer": {"kind": "half-space"},
        "grid": {"boundary": "free", "points": 18},
        "load": {"p_star": 0.05},
    }
    by_default, stated = (
        api.solve(spec | {"surface": {"length": 1.0} | edges}, heights=heights)
        for edges in ({}, {"edges": "none"})
    )
    assert by_default.columns["periodic"] == stated.columns["periodic"] == 0
    np.testing.assert_array_equal(stated.height, by_default.height)
    assert stated.columns["displacement"] == by_default.columns["displacement"]


@pytest.mark.parametrize("boundary", ["free", "periodic"])
def test_few_points_in_contact_have_no_standard_deviation(boundary):
    heights = -1 + 0.01 * np.random.default_rng(0).normal(size=(9, 12))
    heights[4, 3] = heights[4, 8] = heights[2, 5] = 1.0
    spec = {
        "surface": {"length": 1.0, "level": "none", "interpolation": "monotone"},
        "elastomer": {"kind": "half-space"},
        "grid": {"boundary": boundary},
        "load": {"p_star": 1e-3},
        "output": {"true_contact": True},
    }
    result = api.solve(spec, heights=heights)
    assert 0 < result.contact.sum() < 10
    assert np.isnan(result.columns["deviation_c"])
