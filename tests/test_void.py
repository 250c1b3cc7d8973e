"""Points without a measured height that never touch: the conditions of contact, deep holes."""

from dataclasses import replace

import numpy as np
import pytest
from fields import assert_close

from gfmd_cli import solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.interpolation import nearest
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Power
from gfmd_cli.physics.error_bounds import error_bounds
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.indenters import Punch
from gfmd_cli.physics.observables import contact_points, gap_histogram, observe, stress_histogram
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.ccg import ConstrainedCG
from gfmd_cli.solvers.fire import Fire
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.polonsky_keer import PolonskyKeer

SHAPE = (96, 128)
MATERIAL = {"elastomer": {"kind": "half-space", "E_star": 2.0}, "load": {"pressure": 5.0}}


def holed_heights():
    """An oblong random map; a tenth of its points, the highest among them, is unknown."""
    heights = SelfAffine(cutoff=0.06, length_y=0.75).heights(SHAPE[1], SHAPE[0])
    peak = np.unravel_index(np.argmax(heights), SHAPE)
    y, x = (i - middle for i, middle in zip(np.indices(SHAPE), peak, strict=True))
    heights[np.hypot(y, x) < 9] = np.nan
    heights[:, 20:27] = np.nan
    heights[np.random.default_rng(1).random(SHAPE) < 0.03] = np.nan
    return heights


class HoledMap(SelfAffine):
    """A random map with holes, which "fill" lets touch."""

    missing: str = "void"

    def void(self, grid):
        return np.isnan(holed_heights()) if self.missing == "void" else None


@pytest.fixture
def surface():
    return HoledMap(cutoff=0.06, length_y=0.75)


@pytest.fixture
def square_map(tmp_path):
    np.save(tmp_path / "holed.npy", holed_heights()[:, : SHAPE[0]])
    return FileSurface(path=tmp_path / "holed.npy", missing="void")


def scene_of(surface, elastomer, boundary="periodic"):
    return SCENES[boundary](surface, elastomer, SHAPE[1], points_y=SHAPE[0])


def stress_of(scene, elastomer, contact, u):
    """K u + p by the transforms of NumPy."""
    y, x = (
        2 * np.pi * np.fft.fftfreq(n, spacing)
        for n, spacing in zip(SHAPE, scene.grid.spacings, strict=True)
    )
    k = elastomer.stiffness(np.hypot(y[:, None], x)) * scene.h_std / scene.delta_sigma
    return np.fft.ifft2(k * np.fft.fft2(u)).real + contact.pressure


def check_conditions(contact, solution, unknown, gap, accuracy):
    """sigma = 0 on unknown points, sigma >= 0, g >= 0 and sigma g = 0 on the others."""
    sigma = solution.sigma
    assert np.abs(sigma[unknown]).max() < accuracy
    assert sigma.min() > -accuracy
    assert gap[~unknown].min() > -accuracy
    assert np.abs(np.minimum(gap, sigma)[~unknown]).max() < accuracy
    assert sigma.mean() == pytest.approx(contact.pressure, rel=1e-9)


@pytest.mark.parametrize("p_star", [1e-3, 0.1, 3.0])
@pytest.mark.parametrize(
    "elastomer",
    [*(Power(n=n) for n in (0, 0.5, 1, 2, 3, 4)), Layer(thickness=0.1, poisson=0.3)],
    ids=lambda elastomer: elastomer.label,
)
def test_periodic_solution_satisfies_the_conditions_of_contact(surface, elastomer, p_star):
    scene = scene_of(surface, elastomer)
    contact, unknown = scene.contact(p_star), np.isnan(holed_heights())
    solution = solve_contact(contact, Auto(tolerance=1e-9))
    assert solution.status == "converged"
    assert_close(solution.sigma, stress_of(scene, elastomer, contact, solution.u), 1e-9)
    gap = solution.u - contact.height
    check_conditions(contact, solution, unknown, gap, 1e-5 * min(p_star, 1.0))
    touching = contact_points(contact.obstacle, solution.u, solution.sigma)
    assert touching.any()
    assert not np.any(touching & unknown)


@pytest.mark.parametrize("p_star", [1e-2, 1.0])
@pytest.mark.parametrize("elastomer", [Power(n=0.5), HalfSpace()], ids=lambda e: e.label)
def test_free_solution_satisfies_the_conditions_of_contact(surface, elastomer, p_star):
    scene = scene_of(surface, elastomer, "free")
    contact, unknown = scene.contact(p_star), np.isnan(holed_heights())
    solution = solve_contact(contact, Auto(tolerance=1e-9))
    assert solution.status == "converged"
    kernel = elastomer.free_compliance(SHAPE, contact.grid.spacings) * contact.compliance.unit
    sizes = [2 * n for n in SHAPE]
    around = kernel[
        np.ix_(
            *(
                np.minimum(np.arange(m), m - np.arange(m)).clip(0, n - 1)
                for m, n in zip(sizes, SHAPE, strict=True)
            )
        )
    ]
    response = np.fft.irfft2(np.fft.rfft2(around) * np.fft.rfft2(solution.sigma, sizes), sizes)[
        : SHAPE[0], : SHAPE[1]
    ]
    touching = solution.sigma > 0
    gap = response - contact.height
    gap -= gap[touching].mean()
    check_conditions(contact, solution, unknown, gap, 1e-5 * min(p_star, 1.0))
    assert_close(solution.u - contact.height, gap, 1e-6)
    assert not np.any(touching[unknown])


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_unknown_points_are_as_good_as_deep_holes(surface, boundary):
    """Heights 1000 h_std below the others are met by nothing."""
    scene = scene_of(surface, HalfSpace(), boundary)
    contact = scene.contact(0.2)
    deep = np.where(contact.may_touch, contact.height, -1e3)
    hole = replace(contact, height=deep, may_touch=None)
    solver = Auto(tolerance=1e-10, nested=False)
    solution, same = solve_contact(contact, solver), solve_contact(hole, solver)
    assert solution.sigma == pytest.approx(same.sigma, abs=1e-7)
    assert solution.u == pytest.approx(same.u, abs=1e-7)
    assert observe(contact, solution.u, solution.sigma).a_r == observe(hole, same.u, same.sigma).a_r


@pytest.mark.parametrize("solver", [ConstrainedCG, Fire, PolonskyKeer])
def test_every_solver_leaves_unknown_points_out(surface, solver):
    contact = scene_of(surface, HalfSpace()).contact(0.1)
    best = solve_contact(contact, Auto(tolerance=1e-9))
    solution = solve_contact(contact, solver(tolerance=1e-7))
    assert solution.status == "converged"
    assert_close(solution.sigma, best.sigma, 1e-5)


def test_filled_points_would_touch(surface):
    """The void is not the map with its holes filled in."""
    filled = surface.model_copy(update={"missing": "fill"})
    area = {}
    for case in (surface, filled):
        contact = scene_of(case, HalfSpace()).contact(0.3)
        solution = solve_contact(contact, Auto())
        area[case.missing] = observe(contact, solution.u, solution.sigma).a_r
    assert area["fill"] > 1.02 * area["void"]


def test_punch_with_a_hole_has_the_stress_of_its_ring(tmp_path):
    """A flat face with an unknown middle is a ring: the same as a punch with a deep bore."""
    grid = Grid(96)
    y, x = (np.indices(grid.shape) - 48) / 96
    r = np.hypot(y, x)
    face = Punch(radius=0.3).heights(96)
    np.save(tmp_path / "void.npy", np.where(r < 0.12, np.nan, face))
    np.save(tmp_path / "bore.npy", np.where(r < 0.12, -1.0, face))
    deviations = {}
    for name in ("void", "bore"):
        surface = FileSurface(path=tmp_path / f"{name}.npy", missing="void")
        scene = build_scene(surface, HalfSpace(), 96)
        contact = scene.contact(0.02 / scene.delta_sigma)
        solution = solve_contact(contact, Auto(tolerance=1e-10))
        deviations[name] = solution.sigma * scene.delta_sigma
    assert deviations["void"] == pytest.approx(
        deviations["bore"], abs=1e-6 * deviations["bore"].max()
    )


def test_bounds_hold(surface):
    contact = scene_of(surface, HalfSpace()).contact(0.1)
    best = solve_contact(contact, Auto(tolerance=1e-12))
    exact = observe(contact, best.u, best.sigma)
    for tolerance in (1e-2, 1e-4):
        solution = solve_contact(contact, Auto(tolerance=tolerance))
        bounds = error_bounds(contact, solution.u, solution.sigma)
        observables = observe(contact, solution.u, solution.sigma)
        assert abs(observables.u_g - exact.u_g) <= bounds.u_g < 300 * tolerance
        assert abs(observables.sigma_p - exact.sigma_p) <= bounds.sigma_p


def test_derivative_of_the_energy_by_the_mean_gap_is_the_pressure(surface):
    """-dv/du_g = p, which holds for the distance of the mean planes."""
    scene, p, step = scene_of(surface, HalfSpace()), 0.1, 1e-3
    low, high = (
        observe(contact, solution.u, solution.sigma)
        for contact in (scene.contact(p * (1 - step)), scene.contact(p * (1 + step)))
        for solution in [solve_contact(contact, Auto(tolerance=1e-10))]
    )
    assert (high.energy - low.energy) / (low.u_g - high.u_g) == pytest.approx(p, rel=1e-4)


def test_histograms_count_known_gaps_and_all_stresses(surface):
    contact = scene_of(surface, HalfSpace()).contact(0.1)
    solution = solve_contact(contact, Auto())
    gap, stress = (
        gap_histogram(contact, solution.u),
        stress_histogram(contact, solution.u, solution.sigma),
    )
    known = contact.may_touch
    touching = (solution.u == contact.height) & known
    assert gap.zero == pytest.approx(touching.sum() / known.sum(), rel=1e-12)
    assert stress.zero == pytest.approx(
        1 - observe(contact, solution.u, solution.sigma).a_r, rel=1e-12
    )


def test_finer_grid_has_the_void_of_its_nearest_points():
    mask = np.array([[True, False, False], [False, False, True]])
    assert np.array_equal(nearest(mask, (2, 3)), mask)
    fine = nearest(mask, (4, 6))  # half way belongs to the next point
    assert np.array_equal(fine[0], [True, False, False, False, False, True])
    assert np.array_equal(fine[:, 0], [True, False, False, True])


def test_mirrored_map_has_the_mirrored_void(square_map):
    mirrored, side = square_map.model_copy(update={"edges": "mirror"}), SHAPE[0]
    void = mirrored.void(mirrored.grid(2 * side))
    assert np.array_equal(void[:side, :side], np.isnan(holed_heights()[:, :side]))
    assert np.array_equal(void, void[::-1, ::-1])


def test_masked_points_never_touch():
    heights = holed_heights()[:, : SHAPE[0]]
    unknown = np.isnan(heights)
    masked = solve(MATERIAL, heights=np.ma.masked_invalid(heights))
    filled = solve(MATERIAL, heights=heights)
    assert masked.status == filled.status == "converged"
    assert not np.any(masked.pressure[unknown])
    assert np.any(filled.pressure[unknown])
    assert masked.u_g * masked.h_std == pytest.approx(masked.gap.mean(), rel=1e-9)
    chosen = MATERIAL | {"surface": {"missing": "fill"}}
    again = solve(chosen, heights=np.ma.masked_invalid(heights))
    assert np.array_equal(again.pressure, filled.pressure)


def test_a_hole_is_entered_as_deep_as_a_crack_under_pressure():
    """Mean (8 / 3 pi) a dp / E* for a circle of radius a, which makes the mean gap negative.

    Source: Johnson, Contact Mechanics, 1985, Sect. 3.5: a crack in an infinite solid.
    """
    y, x = np.mgrid[:128, :128] / 128 - 0.5
    hole, radius = np.hypot(y, x) < 0.1, 0.1
    heights = np.where(hole, np.nan, 1e-6 * np.cos(2 * np.pi * x) * np.cos(2 * np.pi * y))
    spec = MATERIAL | {"surface": {"missing": "void"}}
    low, high = (solve(spec | {"load": {"pressure": p}}, heights=heights) for p in (1.0, 2.0))
    depth = (low.gap - high.gap)[hole].mean()
    assert depth == pytest.approx(8 / (3 * np.pi) * radius / 2.0, rel=0.05)
    assert any("the mean gap is negative" in warning for warning in high.warnings)


def test_study_says_what_never_touches(square_map, rows_of):
    text = f'''
        [surface]
        kind = "file"
        path = "{square_map.path}"
        missing = "void"
        [elastomer]
        kind = "half-space"
        [grid]
        points = {SHAPE[0]}
        boundary = "free"
        [load]
        p_star = 0.1
    '''
    (row,) = rows_of(text=text)
    assert (row["status"], row["missing"]) == ("converged", "void")
    count = np.isnan(holed_heights()[:, : SHAPE[0]]).sum()
    assert f"{count} missing heights never touch" in row["preparation"]


def test_map_without_heights_is_refused():
    class Void(SelfAffine):
        def void(self, grid):
            return np.ones(grid.shape, dtype=bool)

    with pytest.raises(InputError, match="no point that can touch"):
        build_scene(Void(cutoff=0.1), HalfSpace(), 64)
