"""What a study keeps of a measured surface: pictures, and the contact on changed heights."""

import numpy as np
import pytest

from gfmd_cli import solve
from gfmd_cli.maps.map_preparation import mirror
from gfmd_cli.maps.pictures import MAP_PIXELS, picture
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.study.reading import open_study

pytestmark = pytest.mark.usefixtures("estimated_plans")
SPEC = """\
[surface]
kind = "file"
path = "peak.npy"
periodic = false
level = "none"
edges = "window"
length = 2e-6
[elastomer]
kind = "half-space"
[grid]
points = 32
[load]
p_star = 1e-2
"""
ACCURACY = "accuracy.contact_area=0.5"


def peak(place, size=32):
    """A paraboloid around a point, 1 nm high, on a plane."""
    y, x = np.mgrid[:size, :size]
    return 1e-9 * np.maximum(0, 1 - np.hypot(y - place[0], x - place[1]) ** 2 / 9)


@pytest.mark.parametrize(("place", "share"), [((16, 16), 0.0), ((16, 29), 1.0)])
def test_the_share_of_the_tapered_edges_is_that_of_the_peak(rows_of, tmp_path, place, share):
    heights = peak(place)
    heights[:, 29:] *= 2  # less than half of it is left by the window
    np.save(tmp_path / "peak.npy", heights)
    (row,) = rows_of()
    assert (row["edge_contact"], row["edge_load"]) == pytest.approx((share, share), abs=1e-12)


def test_a_map_that_is_not_tapered_has_no_such_share(rows_of, tmp_path):
    np.save(tmp_path / "peak.npy", peak((16, 16)))
    (row,) = rows_of("surface.edges=none")
    assert np.isnan(row["edge_contact"])


@pytest.mark.parametrize("points", [32, 64, 96, 128])
def test_the_share_of_the_tapered_edges_is_the_same_from_all_sides(points):
    heights = SelfAffine(cutoff=1 / 16, seed=3).heights(32)
    spec = {
        "surface": {"edges": "window", "periodic": False, "taper": 0.2},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": points},
        "load": {"p_star": 0.2},
        "solver": {"tolerance": 1e-10},
    }
    turned = [heights, heights[::-1], heights[:, ::-1], heights.T[::-1, ::-1]]
    shares = [
        [solve(spec, heights=each).columns[f"edge_{name}"] for name in ("contact", "load")]
        for each in turned
    ]
    assert shares[0][0] > 0.01
    assert shares[1:] == [pytest.approx(shares[0], rel=1e-7)] * 3


def test_much_contact_at_the_edges_is_told(gfmd, tmp_path):
    np.save(tmp_path / "peak.npy", peak((16, 29)))
    warning = "of the load is at the edges, where the window has changed the heights"
    assert warning in gfmd("run", "spec.toml").output
    assert warning in gfmd("analyze", "study.h5").output
    assert "at the edges" not in gfmd("run", "spec.toml", "--set", "surface.edges=none").output


def rough_map(missing):
    """A random surface [m], without the heights that `missing` marks."""
    heights = 1e-8 * SelfAffine(cutoff=1 / 16).heights(128)
    heights[missing(heights)] = np.nan
    return heights


def highest(heights):
    return heights > np.quantile(heights, 0.99)


def at_random(heights):
    return np.random.default_rng(3).random(heights.shape) < 0.02


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_filled_points_of_a_finer_grid_with_a_free_boundary_lie_where_their_heights_do(factor):
    """Every part of a pixel whose height was missing is filled in, and no part of another."""
    heights = rough_map(at_random)[:32, :48]
    spec = {
        "surface": {"length": 1e-4, "periodic": False},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": 48 * factor, "boundary": "free"},
        "load": {"p_star": 0.2},
    }
    solved = solve(spec, heights=heights)
    filled = np.isnan(heights).repeat(factor, 0).repeat(factor, 1)
    share = np.count_nonzero(solved.contact & filled) / np.count_nonzero(solved.contact)
    load = solved.pressure[filled].sum() / solved.pressure.sum()
    assert 0 < share < 0.5
    assert solved.columns["filled_contact"] == pytest.approx(share, rel=1e-12)
    assert solved.columns["filled_load"] == pytest.approx(load, rel=1e-12)


@pytest.mark.parametrize("edges", ["none", "mirror"])
def test_much_contact_on_heights_that_were_filled_in_is_told(edges):
    """One in a hundred is missing: the contact area is wrong where these are the highest."""
    spec = {
        "surface": {"length": 1e-4, "periodic": edges != "mirror", "edges": edges},
        "elastomer": {"kind": "half-space"},
        "load": {"pressure": 1e-5},
    }
    known = solve(spec, heights=rough_map(lambda heights: heights > np.inf))
    told = solve(spec, heights=rough_map(highest))
    silent = solve(spec, heights=rough_map(at_random))
    assert np.isnan(known.columns["filled_contact"])
    assert told.a_r > 1.2 * known.a_r
    filled = np.isnan(rough_map(highest))
    if edges == "mirror":
        filled = mirror(filled)
    share = np.count_nonzero(told.contact & filled) / np.count_nonzero(told.contact)
    load = told.pressure[filled].sum() / told.pressure.sum()
    assert told.columns["filled_contact"] == pytest.approx(share, rel=1e-12)
    assert told.columns["filled_load"] == pytest.approx(load, rel=1e-12)
    assert share > 0.1
    warning = "of the load is where heights are missing and were filled in"
    assert warning in "".join(told.warnings)
    assert silent.a_r == pytest.approx(known.a_r, rel=0.02)
    assert silent.columns["filled_contact"] < 0.05
    assert warning not in "".join(silent.warnings)


def test_heights_that_never_touch_are_not_filled_in():
    spec = {
        "surface": {"length": 1e-4, "missing": "void"},
        "elastomer": {"kind": "half-space"},
        "load": {"pressure": 1e-5},
    }
    assert np.isnan(solve(spec, heights=rough_map(highest)).columns["filled_contact"])


def two_waves(points, amplitude):
    """A wave of eight points along x, one of three along y with its gradient times `amplitude`."""
    y, x = 2 * np.pi * np.mgrid[:points, :points]
    return 1e-3 * (8 * np.sin(x / 8) + amplitude * 3 * np.sin(y / 3))


@pytest.mark.parametrize("points", [48, 96])
@pytest.mark.parametrize("n", [0.5, 1, 2])
@pytest.mark.parametrize("amplitude", [0, 0.3, 2])
def test_the_factor_of_short_waves_is_that_of_the_waves_below_four_points(points, n, amplitude):
    """Delta_sigma^2 = sum of k^2 |h(q)|^2 with k = q^n, Eq. (23)."""
    spec = {"elastomer": {"kind": "power", "n": n}, "load": {"p_star": 0.1}}
    solved = solve(spec | {"grid": {"points": points}}, heights=two_waves(48, amplitude))
    expected = np.hypot(1, amplitude * (8 / 3) ** (n - 1))
    assert solved.columns["short_wave_factor"] == pytest.approx(expected, rel=1e-9)


def test_without_longer_waves_or_a_map_there_is_no_such_factor():
    spec = {"elastomer": {"kind": "half-space"}, "load": {"p_star": 0.1}}
    short = two_waves(48, 1) - two_waves(48, 0)
    assert np.isnan(solve(spec, heights=short).columns["short_wave_factor"])
    random = {"surface": {"kind": "self-affine", "cutoff": 0.1}, "grid": {"points": 32}}
    assert np.isnan(solve(spec | random).columns["short_wave_factor"])


@pytest.mark.parametrize(("wavelength", "is_resolved"), [(4, True), (2, False)])
def test_who_requests_an_accuracy_is_told_that_a_map_does_not_resolve_its_roughness(
    gfmd, tmp_path, wavelength, is_resolved
):
    """A part of a random surface, with shortest waves of so many points."""
    whole = 1e-8 * SelfAffine(cutoff=wavelength / 256, seed=1).heights(256)
    np.save(tmp_path / "peak.npy", whole[:128, :96])
    of_scan = ["--set", "surface.edges=mirror", "--set", "surface.level=plane"]
    words = [*of_scan, "--set", "load={pressure = 1e-4}"]
    warning = "the waves of 2 to 4 points of the map increase Delta_sigma"
    plain = gfmd("run", "spec.toml", *words, "--set", "grid.points=96")
    assert plain.exit_code == 0
    assert warning not in plain.output
    told = gfmd("run", "spec.toml", *words, "--set", "grid.points=192", "--set", ACCURACY)
    assert (warning not in told.output) is is_resolved
    assert (warning not in gfmd("surface", "spec.toml", *words).output) is is_resolved
    written = gfmd("init", "scan.toml", "--from", "peak.npy", *of_scan)
    assert (warning not in written.output) is is_resolved
    gfmd("report", "study.h5")
    report = (tmp_path / "study.html").read_text("utf-8")
    assert ("Resolution: the waves of 2 to 4 points" not in report) is is_resolved


def test_a_study_keeps_the_map_as_measured_and_as_prepared(rows_of, tmp_path):
    heights = peak((16, 16))
    heights[3, 4] = np.nan
    np.save(tmp_path / "peak.npy", heights)
    rows_of("surface.edges=mirror", "grid.points=64")
    with open_study(tmp_path / "study.h5") as study:
        pictures = study.pictures(0)
    np.testing.assert_allclose(pictures["measured"].heights, heights, rtol=1e-6)
    assert pictures["measured"].sides == pytest.approx((2e-6, 2e-6))
    assert pictures["prepared"].heights.shape == (64, 64)
    assert pictures["prepared"].sides == pytest.approx((4e-6, 4e-6))
    assert np.isfinite(pictures["prepared"].heights).all()


def test_a_picture_has_the_means_of_the_known_heights():
    heights = np.arange(4.0 * MAP_PIXELS * 2).reshape(4, -1)
    missing = np.zeros(heights.shape, dtype=bool)
    missing[0, 0] = missing[2:, 2:4] = True
    small = picture(heights, (1.0, 2.0), missing)
    assert small.heights.shape == (2, MAP_PIXELS)
    assert small.heights[0, 0] == pytest.approx(np.mean([1, 2 * MAP_PIXELS, 2 * MAP_PIXELS + 1]))
    assert np.isnan(small.heights[1, 1])


def test_the_report_begins_with_both_maps(gfmd, tmp_path):
    pytest.importorskip("matplotlib")
    np.save(tmp_path / "peak.npy", peak((16, 16)))
    assert gfmd("run", "spec.toml").exit_code == 0
    assert gfmd("report", "study.h5").exit_code == 0
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert page.index("Heights as measured") < page.index("Heights as prepared")
    assert page.index("Heights as prepared") < page.index('id="contact-area"')


def test_areas_in_square_metres_of_an_oblong_mirrored_map():
    """a_r times both sides of the cell, patches in L^2; the cell is four copies of the map."""
    heights = 1e-9 * np.random.default_rng(0).normal(size=(24, 40))
    contact = solve(
        {
            "surface": {"length": 1e-6, "periodic": False, "edges": "mirror"},
            "elastomer": {"kind": "half-space", "E_star": 1e9},
            "load": {"p_star": 0.3},
            "output": {"patches": True},
        },
        heights=heights,
    )
    row, touching = contact.columns, contact.pressure > 0
    assert (row["length"], row["length_y"]) == pytest.approx((2e-6, 1.2e-6))
    pixel = (1e-6 / 40) ** 2
    area = row["a_r"] * row["length"] * row["length_y"]
    assert area == pytest.approx(np.count_nonzero(touching) * pixel, rel=1e-9, abs=0)
    of_map = np.count_nonzero(touching[:24, :40]) * pixel
    assert area / 4 == pytest.approx(of_map, rel=1e-9, abs=0)
    of_patches = row["patches"] * row["patch_area_mean"] * row["length"] ** 2
    assert of_patches == pytest.approx(area, rel=1e-9, abs=0)
