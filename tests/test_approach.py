"""Loads given as the displacement of the indenter from first touch."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import gamma

from gfmd_cli import solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import Layer
from gfmd_cli.physics.highest_point import highest_point, highest_point_of_mirrored
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.study import load_search

pytestmark = pytest.mark.usefixtures("estimated_plans")
SPEC = """\
[surface]
kind = "parabola"
radius = 2.0
[elastomer]
kind = "half-space"
E_star = 3.0
[grid]
points = 128
boundary = "free"
[load]
displacement = 0.045
"""


def test_hertz_contact_has_the_radius_of_its_depth(rows_of):
    """d = a^2 / R and F = 4 E* a^3 / 3 R, at a = 0.3 of the side."""
    (row,) = rows_of("load.tolerance=1e-5")
    assert row["status"] == "converged"
    assert row["displacement"] == pytest.approx(0.045, rel=1e-5)
    assert row["pressure"] == pytest.approx(4 * 3.0 * 0.3**3 / (3 * 2.0), rel=3e-4)


@pytest.mark.parametrize("n", [0.5, 1.5])
def test_generalised_hertz_contact_has_the_force_of_its_depth(rows_of, n):
    """d = a^2 / (2 - n) R, F = pi k 2^(n-1) a^(4-n) / [R Gamma(3 - n/2) Gamma(2 - n/2)]."""
    depth = 0.3**2 / ((2 - n) * 2.0)
    (row,) = rows_of(f"elastomer={{kind='power', n={n}}}", f"load.displacement={depth}")
    force = np.pi * 2 ** (n - 1) * 0.3 ** (4 - n) / (2 * gamma(3 - n / 2) * gamma(2 - n / 2))
    assert row["status"] == "converged"
    assert row["pressure"] == pytest.approx(force, rel=1e-2)


@pytest.mark.parametrize("base", ["sliding", "bonded"])
def test_layer_in_full_contact_moves_by_the_pressure_over_its_stiffness(rows_of, base):
    """u = h: the mean displacement 0 lies p / k(0) above the level of the undeformed surface."""
    thickness, modulus, nu = 0.05, 2e6, 0.3
    stiffness = modulus / thickness  # of a sliding layer
    if base == "bonded":
        stiffness *= (1 - nu) ** 2 / (1 - 2 * nu)
    (row,) = rows_of(
        "surface={kind='self-affine', cutoff=0.1, h_std=1e-4}",
        f"elastomer={{kind='layer', thickness={thickness}, E_star={modulus}, "
        f"poisson={nu}, base='{base}'}}",
        "grid={points=64}",
        "load={displacement=3e-3, tolerance=1e-5}",
    )
    heights = SelfAffine(cutoff=0.1, h_std=1e-4).heights(2048)
    assert (row["a_r"], row["status"]) == (1.0, "converged")
    assert row["displacement"] == pytest.approx(3e-3, rel=1e-5)
    depth = heights.max() - heights.mean() + row["pressure"] / stiffness
    assert row["displacement"] == pytest.approx(depth, rel=1e-6)


def test_springs_have_one_displacement_with_every_boundary(rows_of):
    """n = 0: each point stands for itself, sigma = k max(d - (max h - h), 0)."""
    rough = ("surface={kind='self-affine', cutoff=0.1}", "elastomer={kind='power', n=0}")
    periodic, free = (
        rows_of(*rough, f"grid={{points=64, boundary='{name}'}}", "load={p_star=0.2}", name=name)[0]
        for name in ("periodic", "free")
    )
    surface = SelfAffine(cutoff=0.1)
    heights, peak = surface.heights(64), surface.heights(2048).max()
    for row in (periodic, free):
        overlap = np.maximum(heights - peak + row["displacement"], 0)
        assert overlap.mean() == pytest.approx(row["pressure"], rel=1e-4)


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize("points", [40, 41])
def test_the_highest_point_lies_between_grid_points(dimension, points):
    """Of waves with at most 10 periods along each side, against grids that are 40 times finer."""
    draw = np.random.default_rng(points)
    coarse, fine = (
        np.meshgrid(*[np.arange(n) / n] * dimension, indexing="ij") for n in (points, 40 * points)
    )
    q, phases = draw.integers(-10, 11, (20, dimension)), 2 * np.pi * draw.random(20)
    on_coarse, on_fine = (
        sum(
            np.cos(2 * np.pi * sum(a * b for a, b in zip(k, x, strict=True)) + phase)
            for k, phase in zip(q, phases, strict=True)
        )
        for x in (coarse, fine)
    )
    assert highest_point(on_coarse) == pytest.approx(on_fine.max(), rel=5e-4)
    assert highest_point(on_coarse) >= on_fine.max()
    assert on_coarse.max() < 0.9995 * on_fine.max()


@pytest.mark.parametrize("row", [10.3, 231.6, 299.7])
def test_the_highest_point_of_a_bump_is_its_top_wherever_it_lies(row):
    """In every block of rows. exp(20 cos x) has no waves beyond those of the grid but rounding."""
    y, x = (np.arange(n) - place for n, place in ((300, row), (280, 70.8)))
    bump = np.exp(20 * (np.cos(2 * np.pi * y[:, None] / 300) + np.cos(2 * np.pi * x / 280) - 2))
    assert highest_point(3.0 * bump) == pytest.approx(3.0, rel=1e-9)


def test_a_wide_peak_does_not_hide_a_narrow_one_that_is_higher_between_the_points():
    x = np.arange(32)
    wide = np.exp(-((x - 8) ** 2) / 8)
    narrow = np.cos(2 * np.pi * np.outer(x - 20.125, np.arange(-15, 16)) / 32).sum(axis=1) / 31
    heights = np.outer(wide, wide) + 1.02 * np.outer(narrow, narrow)
    assert highest_point(heights) == pytest.approx(1.02, rel=1e-9)


@pytest.mark.parametrize("shape", [(16, 16), (15, 16), (16, 20), (16,)], ids=str)
def test_the_highest_point_of_a_map_with_nyquist_waves_is_that_of_finer_grids(shape):
    """Seen from all sides: a Nyquist wave stands for +q and -q alike."""
    grid = Grid(shape[-1], len(shape), points_y=shape[0])
    fine = Grid(32 * shape[-1], len(shape), points_y=32 * shape[0])
    for seed in range(8):
        heights = gaussian_filter(np.random.default_rng(seed).normal(size=shape), 0.4, mode="wrap")
        highest = highest_point(heights)
        above = highest - grid.resample(heights, fine).max()
        assert -1e-9 < above < 5e-3 * heights.std()
        for turned in (heights[::-1], heights[..., ::-1], heights.T):
            assert highest_point(turned) == pytest.approx(highest, rel=1e-7)


@pytest.mark.parametrize("shape", [(24, 24), (20, 33), (9, 8), (75,)])
def test_the_highest_point_of_a_mirrored_map_is_that_of_its_cell(shape):
    for seed in range(4):
        heights = np.random.default_rng(seed).normal(size=shape)
        whole = np.pad(heights, [(0, points) for points in shape], mode="symmetric")
        highest = highest_point(whole)
        assert highest_point_of_mirrored(heights) == pytest.approx(highest, rel=1e-6)


@pytest.mark.parametrize("hurst", [0.1, 0.8])
def test_the_highest_point_of_a_random_surface(hurst):
    """Against a grid with 32 points per lambda_s, on which it is at most 0.2 % too low."""
    for seed in range(8):
        surface = SelfAffine(cutoff=0.05, hurst=hurst, seed=seed)
        highest = surface.heights(640).max()
        assert highest <= surface.peak() * (1 + 1e-12)
        assert surface.peak() == pytest.approx(highest, rel=2e-3)


@pytest.mark.parametrize(
    "keys",
    [
        {"cutoff": 0.02, "rolloff": 0.02, "hurst": 0.3, "seed": 103466},
        {"cutoff": 0.02, "rolloff": 0.02, "hurst": 0.3, "seed": 43050},
        {"cutoff": 0.05, "rolloff": 0.1, "hurst": 0.05, "seed": 675385, "length_y": 2.0},
        {"cutoff": 0.1, "rolloff": 0.1, "hurst": 0.05, "seed": 169784, "length_y": 0.3},
    ],
    ids=lambda keys: f"seed {keys['seed']}",
)
def test_the_highest_peak_can_lie_between_low_grid_points(keys):
    """Short waves alone: on two points per wave many other points are higher than those next to it.

    In the last case square pixels have only two points per wave along y.
    """
    surface = SelfAffine(**keys)
    highest = surface.heights(16 * surface.smallest_grid()).max()
    assert highest <= surface.peak() * (1 + 1e-12)
    assert surface.peak() == pytest.approx(highest, rel=1e-2)


def test_a_map_with_borders_is_pressed_from_between_its_points():
    """One displacement on its own points and on finer ones, where the series is higher."""
    heights = 1e-8 * gaussian_filter(np.random.default_rng(1).normal(size=(40, 40)), 1.5)
    spec = {
        "surface": {"length": 1e-5, "periodic": False},
        "elastomer": {"kind": "half-space", "E_star": 1e9},
        "load": {"pressure": 1e4},
    }
    coarse, fine = (solve(spec | {"grid": {"points": n}}, heights=heights) for n in (40, 160))
    displacement = fine.columns["displacement"]
    assert fine.height.max() - coarse.height.max() > 0.1 * displacement
    assert coarse.columns["displacement"] == pytest.approx(displacement, rel=1e-2)


@pytest.mark.parametrize("points", [64, 65])
def test_a_cone_is_pressed_from_its_tip_on_every_grid(rows_of, points):
    """p L^2 = 2 E* d^2 / (pi s) (Sneddon 1965); the tip lies between points if they are odd."""
    (row,) = rows_of(
        "surface={kind='cone', slope=0.1}", f"grid.points={points}", "load={displacement=0.03}"
    )
    assert row["pressure"] == pytest.approx(2 * 3.0 * 0.03**2 / (np.pi * 0.1), rel=0.01)


def test_a_displacement_at_which_no_grid_point_touches_is_refused():
    """The four points around the tip of a cone touch together."""
    spec = {"surface": {"kind": "cone", "slope": 0.1}, "elastomer": {"kind": "half-space"},
            "grid": {"points": 65, "boundary": "free"}}  # fmt: skip
    first = 0.1 * np.sqrt(0.5) / 65
    with pytest.raises(InputError, match=rf"touches at {first:.6g} m"):
        solve(spec | {"load": {"displacement": 0.99 * first}})
    result = solve(spec | {"load": {"displacement": 1.01 * first}})
    assert (result.status, result.contact.sum()) == ("converged", 4)


def test_a_coarser_grid_that_touches_later_is_left_out(monkeypatch):
    """The tip of a cone is a point of 66^2, not of 33^2."""
    grids, trial_on = set(), load_search._at

    def note(task, points, pressure):
        grids.add(points)
        return trial_on(task, points, pressure)

    monkeypatch.setattr(load_search, "_at", note)
    result = solve({
        "surface": {"kind": "cone", "slope": 0.1}, "elastomer": {"kind": "half-space"},
        "grid": {"points": 66, "boundary": "free"},
        "load": {"displacement": 0.05 * np.sqrt(0.5) / 33},
    })  # fmt: skip
    assert result.status == "converged"
    assert grids == {66}


def test_a_displacement_means_the_same_on_every_grid(rows_of):
    """Two, four and sixteen points per lambda_s."""
    gaps = [
        rows_of(
            "surface={kind='self-affine', cutoff=0.05, h_std=1e-6, length=1e-3, seed=1}",
            "elastomer={kind='layer', E_star=1e7, thickness=1e-4, poisson=0.3}",
            f"grid={{points={points}}}",
            "load={displacement=1e-6}",
            name=str(points),
        )[0]["u_g"]
        for points in (40, 80, 320)
    ]
    assert gaps == pytest.approx([gaps[-1]] * 3, rel=5e-4)


def test_displacement_vanishes_with_the_load(rows_of):
    """As F^(2/3) for a paraboloid: by 100 where the load falls by 1000."""
    rows = rows_of("load={pressure=[1e-3, 1e-6]}", "grid.points=512", "solver.tolerance=1e-9")
    a = [(3 * row["pressure"] * 2.0 / (4 * 3.0)) ** (1 / 3) for row in rows]
    assert rows[0]["displacement"] == pytest.approx(a[0] ** 2 / 2.0, rel=3e-2)
    assert 0 < rows[1]["displacement"] < 2e-2 * rows[0]["displacement"]


def test_table_that_begins_constant_has_a_level(rows_of, tmp_path):
    """The stiffness of a sliding layer as a table, k(0) its first rows."""
    layer = Layer(thickness=0.1, base="sliding")
    q = np.geomspace(1e-3, 1e4, 2000)
    k = np.append(np.full(2, layer.uniform_stiffness), layer.stiffness(q[2:]))
    np.savetxt(tmp_path / "k.txt", np.column_stack([q, k]), fmt="%.17g")
    rough = "surface={kind='self-affine', cutoff=0.1}"
    rows = [
        rows_of(rough, f"elastomer={table}", "grid={points=64}", "load={p_star=0.3}", name=name)[0]
        for name, table in {
            "layer": "{kind='layer', thickness=0.1, base='sliding'}",
            "table": f"{{kind='table', path='{tmp_path / 'k.txt'}'}}",
        }.items()
    ]
    assert rows[1]["displacement"] == pytest.approx(rows[0]["displacement"], rel=1e-5)


@pytest.mark.parametrize(
    "overrides",
    [
        ("grid.boundary=periodic",),
        ("grid.boundary=periodic", "elastomer={kind='slab', thickness=0.1}"),
        ("surface={kind='line-parabola'}",),
    ],
)
def test_displacement_without_a_level_is_refused(gfmd, overrides):
    words = [word for override in overrides for word in ("--set", override)]
    done = gfmd("run", "spec.toml", *words)
    assert done.exit_code == 2
    assert "load.displacement" in done.output
    assert "use load.mean_gap" in done.output
    assert "Traceback" not in done.output


def test_other_tables_have_no_displacement(rows_of):
    (row,) = rows_of("grid.boundary=periodic", "load={p_star=0.1}")
    assert np.isnan(row["displacement"])
