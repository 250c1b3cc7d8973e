import gc
import os
import re
import runpy
import signal
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from math import erf
from pathlib import Path
from threading import Event

import h5py
import numpy as np
import pyfftw
import pytest

import gfmd_cli
from gfmd_cli import compare, dataset, rows, run, solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid import plans
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.error_estimates import Verdict
from gfmd_cli.study.signals import SIGNALS, interruptible, signal_handlers

TABLES = {
    "surface": {"kind": "self-affine", "cutoff": 0.05, "h_std": 1e-6, "length": 1e-3},
    "elastomer": {"kind": "half-space", "E_star": 2e9},
    "grid": {"points": 64},
    "load": {"pressure": 1e6},
}


def test_a_notebook_gets_the_numbers_of_the_command(tmp_path):
    study = run(TABLES | {"load": {"pressure": [1e6, 3e6]}}, tmp_path / "a.h5")
    first, second = rows(study)
    alone = solve(TABLES)
    for name in ("a_r", "sigma_p", "u_g", "residual", "status"):
        assert getattr(alone, name) == first[name], name
    assert second["pressure"] == pytest.approx(3e6)
    assert dataset(study).a_r.values.tolist() == [first["a_r"], second["a_r"]]


def test_fields_are_those_of_the_contact_problem():
    """sigma >= 0, g >= 0, sigma g = 0; sigma - p = K u with k = E* q / 2, by NumPy."""
    result = solve(TABLES | {"solver": {"tolerance": 1e-9}})
    assert result.stress.mean() == pytest.approx(1e6, rel=1e-9)
    assert result.gap.min() > -1e-16
    assert np.abs(result.stress * result.gap).max() < 1e-6 * result.delta_sigma * result.h_std
    q = 2 * np.pi * np.fft.fftfreq(64, 1e-3 / 64)
    elastic = np.fft.ifft2(1e9 * np.hypot(q[:, None], q) * np.fft.fft2(result.displacement)).real
    np.testing.assert_allclose(result.stress, elastic + 1e6, atol=1e-6 * result.delta_sigma, rtol=0)
    assert result.p_star == pytest.approx(1e6 / result.delta_sigma)
    assert result.contact.mean() == result.a_r
    assert result.gap.mean() == pytest.approx(result.u_g * result.h_std, rel=1e-6)


def test_an_array_may_be_pressed():
    """The same heights as those of the surface."""
    alone = solve(TABLES)
    tables = {name: TABLES[name] for name in ("elastomer", "grid", "load")}
    again = solve(tables | {"surface": {"length": 1e-3}}, heights=alone.height)
    assert again.a_r == alone.a_r
    np.testing.assert_allclose(again.stress, alone.stress, atol=1e-5 * alone.delta_sigma, rtol=0)
    with pytest.raises(InputError, match="heights need a dictionary"):
        solve("a.toml", heights=alone.height)
    for path in ("a.npy", Path("a.npy")):
        with pytest.raises(InputError, match=r"needed, not a path; name a file in surface\.path"):
            solve(tables, heights=path)


def test_files_that_have_changed_are_read_again(tmp_path):
    random, q = np.random.default_rng(0), np.geomspace(0.1, 1e4, 50)
    spec = {
        "surface": {"kind": "file", "path": str(tmp_path / "map.npy")},
        "elastomer": {"kind": "table", "path": str(tmp_path / "table.txt")},
        "grid": {"points": 32},
        "load": {"p_star": 0.1},
    }
    for exponent in (1.0, 2.0, 0.5):
        heights = random.normal(size=(32, 32))
        np.save(tmp_path / "map.npy", heights)
        np.savetxt(tmp_path / "table.txt", np.c_[q, q**exponent])
        again = solve({**spec, "elastomer": {"kind": "power", "n": exponent}})
        read = solve(spec)
        assert read.h_std == pytest.approx(heights.std())
        assert read.a_r == pytest.approx(again.a_r, abs=1e-3)
        factors = [result.columns["short_wave_factor"] for result in (read, again)]
        assert factors[0] == pytest.approx(factors[1], rel=1e-6)


def test_a_table_that_changes_within_a_tick_of_the_clock_is_read_again(tmp_path):
    """Lustre, for example, has times in whole seconds."""
    path, q = tmp_path / "table.txt", np.geomspace(0.1, 1e4, 50)
    spec = TABLES | {"elastomer": {"kind": "table", "path": path}, "load": {"p_star": 0.1}}
    areas = []
    for exponent in (1.0, 2.0):
        np.savetxt(path, np.c_[q, q**exponent])
        os.utime(path, (1, 1))
        areas.append(solve(spec).a_r)
    assert areas[0] != areas[1]


def test_every_run_that_fails_gives_its_warnings(tmp_path):
    spec = TABLES | {"load": {"mean_gap": 1e3}}
    shown = []
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # once for each line of a program
        warnings.showwarning = lambda *warning, **_: shown.append(warning)
        for _ in range(2):
            run(spec, tmp_path / "a.h5")
    assert [str(message).split(":")[0] for message, *_ in shown] == 2 * [
        "task 0 (half-space E_star=2 GPa 64 u_g=1000)",
        str(tmp_path / "a.h5"),
    ]
    assert {warning[2] for warning in shown} == {__file__}


@pytest.mark.usefixtures("small_plans_measured")
def test_plans_are_estimated_from_the_next_call_on(monkeypatch):
    """As a notebook asks for them that has solved the contact before."""
    flags, make = set(), pyfftw.FFTW
    solve(TABLES)
    monkeypatch.setattr(
        pyfftw, "FFTW", lambda *a, **b: (flags.update(b["flags"]), make(*a, **b))[1]
    )
    monkeypatch.setenv("GFMD_PLANS", "estimated")
    solve(TABLES)
    assert plans.plans() == "estimated"
    assert flags == {"FFTW_ESTIMATE", "FFTW_WISDOM_ONLY"}


def test_theory_stands_beside_a_study(tmp_path):
    (curve,) = compare(run(TABLES, tmp_path / "a.h5")).curves
    (row,) = curve.rows
    assert curve.prediction.a_r == pytest.approx([erf(row["p_star"] / 2**0.5)], rel=1e-9)


def test_a_spec_in_a_file_takes_overrides(tmp_path):
    (tmp_path / "a.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\np_star = 1\n"
    )
    study = run(tmp_path / "a.toml", tmp_path / "a.h5", overrides=("load.p_star=0.5",))
    assert [row["p_star"] for row in rows(study)] == [0.5]


def test_what_makes_no_sense_is_refused(tmp_path):
    with pytest.raises(InputError, match="the spec has 2; use run"):
        solve(TABLES | {"load": {"p_star": [0.1, 1]}})
    with pytest.raises(InputError, match=r"spec: surface.hursts: unknown key 'hursts' - did you"):
        solve(TABLES | {"surface": {"kind": "self-affine", "hursts": 1}})
    with pytest.raises(InputError, match="overrides need a spec in a file"):
        run(TABLES, tmp_path / "a.h5", overrides=("load.p_star=0.5",))
    with pytest.raises(AttributeError, match="no attribute 'walk'"):
        _ = gfmd_cli.walk


def test_a_study_may_be_run_in_a_thread(tmp_path):
    with ThreadPoolExecutor(1) as pool:
        study = pool.submit(run, TABLES, tmp_path / "a.h5").result()
    assert rows(study)[0]["status"] == "converged"


def test_threads_solve_on_one_surface_at_the_same_time():
    """The transforms of a grid work in one memory, which no two threads may share."""
    tables = TABLES | {"grid": {"points": 256}}
    pressures = np.geomspace(1e6, 1e7, 6)
    solves = [tables | {"load": {"pressure": pressure}} for pressure in pressures]
    alone = [solve(one).displacement for one in solves]
    with ThreadPoolExecutor(3) as pool:
        together = [result.displacement for result in pool.map(solve, solves)]
    for one, other in zip(alone, together, strict=True):
        assert other == pytest.approx(one, abs=1e-12 * np.ptp(one))


def rough_map(points=32, seed=1):
    surface = {"kind": "self-affine", "cutoff": 0.125, "seed": seed, "h_std": 1e-8, "length": 1e-5}
    return solve({**MATERIAL, "surface": surface, "grid": {"points": points}}).height


MATERIAL = {"elastomer": {"kind": "half-space", "E_star": 2e9}, "load": {"pressure": 1e6}}


class Topography:
    """What `solve` uses of a topography of SurfaceTopography: arrays [x, y], sides, unit."""

    unit = "nm"
    is_periodic = True

    def __init__(self, heights, *sides):
        self._heights, self.physical_sizes = heights, sides

    def heights(self):
        return self._heights

    def to_unit(self, unit):
        assert unit == "m"
        scaled = Topography(1e-9 * self._heights, *(1e-9 * side for side in self.physical_sizes))
        scaled.unit = unit
        return scaled


SQUARE = Topography(np.eye(16), 1e3, 1e3)


def test_the_contact_pressure_is_zero_off_contact_and_gives_the_area():
    result = solve(TABLES)
    assert (result.pressure > 0).mean() == result.a_r
    assert (result.pressure[result.gap > 0] == 0).all()
    np.testing.assert_array_equal(result.pressure[result.contact], result.stress[result.contact])
    assert result.pressure.mean() == pytest.approx(result.nominal_pressure, rel=1e-5)
    assert result.sigma_p * result.delta_sigma == pytest.approx(result.pressure.std(), rel=1e-12)


def test_points_and_sides_come_from_the_heights():
    heights = rough_map()
    result = solve({**MATERIAL, "surface": {"length": 1e-5}}, heights=heights)
    assert result.height.shape == (32, 32)
    twice = solve({**MATERIAL, "grid": {}, "surface": {"length": 1e-5}}, heights=heights.tolist())
    assert twice.a_r == result.a_r
    topography = Topography(1e9 * heights.T, 1e4, 1e4)
    measured = solve(MATERIAL, heights=topography)
    assert measured.length == pytest.approx(1e-5, rel=1e-12)
    assert measured.a_r == result.a_r
    np.testing.assert_allclose(measured.height, result.height, rtol=1e-12)


def test_topographies_of_the_library_itself_are_read():
    """Maps with and without unit, filtered ones, and line scans."""
    with warnings.catch_warnings(action="ignore", category=ImportWarning):  # without mpi4py
        import SurfaceTopography as surface_topography
    heights = rough_map()
    by_hand = solve({**MATERIAL, "surface": {"length": 1e-5, "periodic": False}}, heights=heights)
    scan = surface_topography.Topography(1e9 * heights.T, (1e4, 1e4), unit="nm")
    for each in (scan, scan.to_unit("um"), scan.detrend("center")):
        result = solve(MATERIAL, heights=each)
        assert result.length == pytest.approx(1e-5, rel=1e-12)
        assert result.a_r == by_hand.a_r
    bare = surface_topography.Topography(heights.T, (1e-5, 1e-5))
    assert solve(MATERIAL, heights=bare).a_r == by_hand.a_r
    for unit in ("V", "furlong"):
        with pytest.raises(InputError, match=f"^heights: .*'{unit}'"):
            solve(MATERIAL, heights=surface_topography.Topography(heights.T, (1, 1), unit=unit))
    profile = surface_topography.UniformLineScan(1e9 * heights[0], 1e4, unit="nm")
    assert solve(MATERIAL, heights=profile).length == pytest.approx(1e-5, rel=1e-12)


def test_a_topography_states_both_sides_also_of_a_part():
    heights = rough_map()[:20]
    whole = Topography(1e9 * heights.T, 1e4, 4e4)
    result = solve(MATERIAL, heights=whole)
    assert (result.length, result.length_y) == pytest.approx((1e-5, 4e-5), rel=1e-12)
    by_hand = solve({**MATERIAL, "surface": {"length": 1e-5, "length_y": 4e-5}}, heights=heights)
    assert result.a_r == by_hand.a_r
    unknown = Topography(1e9 * heights.T, 1e4, 4e4)
    unknown.unit = None
    scaled = solve({**MATERIAL, "surface": {"scale": 1e-9}}, heights=unknown)
    assert (scaled.length, scaled.length_y) == pytest.approx((1e-5, 4e-5), rel=1e-12)
    assert scaled.a_r == pytest.approx(result.a_r)
    for region in ({"x": [8, 24]}, {"x": [8 * 1e-5 / 32, 24 * 1e-5 / 32], "unit": "m"}):
        part = solve({**MATERIAL, "surface": {"region": region}}, heights=whole)
        assert part.height.shape == (20, 16)
        assert (part.length, part.length_y) == pytest.approx((5e-6, 4e-5), rel=1e-12)
    square = solve({**MATERIAL, "surface": {"crop": True}}, heights=whole)
    assert square.height.shape == (20, 20)
    assert (square.length, square.length_y) == pytest.approx((20 / 32 * 1e-5, 4e-5), rel=1e-12)


def test_an_array_of_xarray_is_read_with_its_coordinates_and_units():
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    heights = rough_map()[:20]
    um = {"units": "um"}
    scan = xarray.DataArray(
        1e9 * heights,
        dims=("y", "x"),
        coords={
            "x": ("x", 10 / 32 * np.arange(32.0), um),
            "y": ("y", 5 - 0.25 * np.arange(20.0), um),
            "time": 7.0,
        },
        attrs={"units": "nm", "comment": None},
    )
    by_hand = {"length": 1e-5, "length_y": 5e-6, "periodic": False}
    expected = solve({**MATERIAL, "surface": by_hand}, heights=heights[::-1])
    for array in (scan, scan.T, scan.isel(y=slice(None, None, -1))):
        result = solve(MATERIAL, heights=array)
        assert (result.length, result.length_y) == pytest.approx((1e-5, 5e-6), rel=1e-12)
        assert result.a_r == expected.a_r
        np.testing.assert_allclose(result.height, expected.height, rtol=1e-9, atol=1e-20)
    bare = solve(
        {**MATERIAL, "surface": {"length": 1e-5}}, heights=scan.drop_vars(["x", "y"]) / 1e9
    )
    assert bare.a_r == solve({**MATERIAL, "surface": {"length": 1e-5}}, heights=heights).a_r
    with pytest.raises(InputError, match="unit 'furlong'"):
        solve(MATERIAL, heights=scan.assign_attrs(units="furlong"))


def test_positions_of_xarray_without_a_unit_leave_the_side_to_the_spec():
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    heights = rough_map()
    points = {axis: np.arange(32) for axis in "yx"}
    array = xarray.DataArray(heights, dims=("y", "x"), coords=points)
    spec = {**MATERIAL, "surface": {"length": 1e-5}}
    result = solve(spec, heights=array)
    assert result.length == 1e-5
    assert result.a_r == solve(spec, heights=heights).a_r
    for wrong in (array * 1j, array.astype(str), array.to_dataset(name="h")):
        with pytest.raises(InputError, match=r"^heights: "):
            solve(spec, heights=wrong)
    with pytest.raises(InputError, match=r"^heights: "):
        solve(spec, heights=array.stack(both=("y", "x")))


@pytest.mark.parametrize(
    "marks",
    [
        {"_FillValue": -9999},
        {"missing_value": -9999.0},
        {"valid_min": -1.0},
        {"valid_range": (-1, 1)},
    ],
)
def test_marks_of_missing_heights_of_xarray_count(marks):
    """As rioxarray leaves them in the attributes."""
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    heights = rough_map()
    marked, unknown = heights.copy(), heights.copy()
    marked[3, 4:9], unknown[3, 4:9] = -9999, np.nan
    array = xarray.DataArray(marked[None], dims=("band", "y", "x"), attrs=marks)
    spec = {**MATERIAL, "surface": {"length": 1e-5}}
    np.testing.assert_array_equal(
        solve(spec, heights=array).height, solve(spec, heights=unknown).height
    )
    packed = array.assign_attrs(scale_factor=0.1)
    with pytest.raises(InputError, match=r"^heights: .* packed"):
        solve(spec, heights=packed)


def test_a_quantity_with_a_unit_is_refused():
    class Quantity(np.ndarray):
        unit = "nm"

    with pytest.raises(InputError, match=r"^heights: the array has the unit nm; give plain"):
        solve(MATERIAL, heights=np.eye(16).view(Quantity))


def test_masked_rows_in_a_list_are_a_masked_array():
    heights = np.ma.masked_greater(rough_map(), 1e-8)
    whole, rows_of_it = (
        solve({**MATERIAL, "surface": {"length": 1e-5}}, heights=given)
        for given in (heights, list(heights))
    )
    assert not whole.contact[heights.mask].any()
    np.testing.assert_array_equal(rows_of_it.stress, whole.stress)


def test_a_line_scan_at_unequal_distances_is_interpolated():
    class LineScan(Topography):
        is_uniform = False

        def to_unit(self, unit):
            return self

        def positions_and_heights(self):
            return self._heights

    x = np.sort(np.random.default_rng(0).uniform(0, 1e-5, 60))
    result = solve(MATERIAL, heights=LineScan((x, 1e-8 * np.sin(2e6 * x)), 1e-5))
    assert result.length == pytest.approx((x[-1] - x[0]) * 60 / 59)
    at = x[0] + np.arange(60) * result.length / 60
    np.testing.assert_allclose(
        result.height, np.interp(at, x, 1e-8 * np.sin(2e6 * x)), atol=1e-20, rtol=1e-9
    )


def test_a_result_has_the_columns_of_a_study():
    accuracy = {"grid": {"points": "auto"}, "accuracy": {"contact_area": 0.1}}
    result = solve(TABLES | accuracy | {"output": {"patches": True}})
    continuum = {name: text for name, text in result.summary().items() if "continuum" in name}
    assert len(continuum) == 3
    for symbol, text in zip(("a_r", "sigma_p", "u_g"), continuum.values(), strict=True):
        verdict = Verdict(result.columns[f"{symbol}_verdict"])
        assert text.startswith(f"{symbol} = ") == verdict.has_error
        assert text == verdict.explanation or verdict.has_error
    assert result.columns["a_r_verdict"] == "regular"
    assert abs(result.columns["a_r_continuum"] - result.a_r) < 0.2 * result.a_r
    error = result.columns["a_r_continuum_error"]
    shown = result.summary()["contact area in the continuum"].rpartition(" +- ")[2]
    assert float(shown) == pytest.approx(error, rel=0.05)  # one digit would be up to a third off
    assert result.columns["patches"] > 0
    assert result.columns["pr_sigma_log"].sum() > 0


def test_numbers_of_numpy_are_numbers():
    one = solve(TABLES)
    same = {
        "surface": TABLES["surface"] | {"cutoff": np.float64(0.05)},
        "grid": {"points": np.int64(64)},
        "load": {"pressure": np.array([1e6])},
    }
    assert solve(TABLES | same).a_r == one.a_r


@pytest.mark.parametrize(
    ("heights", "surface", "message"),
    [
        ([[1.0, 2.0], [1.0]], {}, "^heights: rows of different lengths"),
        (np.array([["a"]]), {}, "^heights: data of type"),
        (np.ones((8, 8, 2)), {}, r"^heights: data of shape \(8, 8, 2\)"),
        (np.zeros((16, 16)), {}, "^heights: .*flat"),
        (np.full((16, 16), np.nan), {}, "^heights: "),
        (
            np.ma.masked_less(np.eye(16), 0.5),
            {"missing": "refuse"},
            "^heights: 240 of 256 .*missing = .fill. fills",
        ),
        (np.eye(16), {"kind": "wave"}, "surface.kind = 'wave' and the argument heights"),
        (np.eye(16), {"path": "a.npy"}, "surface.path = 'a.npy' and the argument heights"),
        (SQUARE, {"length": 2e-6}, "surface.length = 2e-06: .* a side of 1e-06 m"),
        (SQUARE, {"length_y": 2e-6}, "surface.length_y = 2e-06: .* a side of 1e-06 m"),
        (
            SQUARE,
            {"region": {"x": [0, 2e-6], "unit": "m"}},
            "heights: surface.region: x = .* m: the map",
        ),
        (SQUARE, {"region": {"z": 1}}, "surface.region.z: unknown key"),
        (np.eye(16), {"lenght": 1.0}, "surface.lenght: unknown key"),
    ],
)
def test_messages_name_the_argument(heights, surface, message):
    with pytest.raises(InputError, match=message) as caught:
        solve({**MATERIAL, "surface": surface}, heights=heights)
    assert not re.search(r"\.(npy|h5)", str(caught.value).replace("'a.npy'", ""))


@pytest.mark.parametrize("name", ["surface", "grid"])
def test_a_list_in_the_place_of_a_table_is_refused(name):
    with pytest.raises(InputError, match=f"spec: {name} must be one table"):
        solve({**MATERIAL, name: [{}]}, heights=SQUARE)


def test_what_is_no_spec_is_refused():
    with pytest.raises(InputError, match="a path or a dictionary is needed, not NoneType"):
        solve(None)


@pytest.mark.parametrize(
    "overrides", ["grid.points=48", 48, ["grid.points=48", 1], {"grid.points": 48}]
)
def test_overrides_are_several_strings(tmp_path, overrides):
    """A string is a sequence of strings, too: its letters."""
    path = tmp_path / "spec.toml"
    path.write_text("")
    with pytest.raises(InputError, match=r"overrides = .*48.*: a tuple or list of strings"):
        run(path, overrides=overrides)


@pytest.mark.parametrize("second", ["pressure=1e5", "p_star=0.2"])
def test_two_loads_among_the_overrides_are_refused(tmp_path, second):
    path = tmp_path / "spec.toml"
    path.write_text("")
    with pytest.raises(InputError, match=r"takes the place of --set load\.p_star=0\.1"):
        run(path, overrides=("load.p_star=0.1", f"load.{second}"))


@pytest.mark.parametrize("threads", [0, 1.5, True, "2", None])
def test_threads_are_a_whole_number(threads):
    with pytest.raises(InputError, match=f"threads = {threads!r}: must be a whole number"):
        solve(TABLES, threads=threads)


@pytest.mark.parametrize("kind", ["wave", "ridge", "line-parabola"])
def test_x_counts_from_the_crest(kind, tmp_path):
    tables = {
        "surface": {"kind": kind, "length": 2.0},
        "elastomer": {"kind": "power", "n": 1},
        "grid": {"points": 16},
        "load": {"p_star": 0.1},
        "output": {"cross_section": True},
    }
    result = solve(tables)
    shape = {"wave": np.cos(np.pi * result.x), "ridge": -abs(result.x)}
    wanted = shape.get(kind, -(result.x**2) / 2)
    np.testing.assert_allclose(result.height, wanted, atol=1e-15, rtol=0)
    with h5py.File(run(tables, tmp_path / "a.h5")) as file:
        stored = file["cross_sections/0"]
        np.testing.assert_array_equal(stored["x"][()], result.x)
        np.testing.assert_array_equal(stored["contact_pressure"][()] > 0, result.contact)


def test_positions_on_a_finer_grid_with_a_free_boundary_exceed_those_on_the_map():
    """By (1/N - 1/M) L / 2, as docs/scans.md says."""
    x = np.arange(20) / 20
    bump = np.exp(-100 * ((x - 0.3) ** 2 + (x[:, None] - 0.7) ** 2))
    spec = {"elastomer": {"kind": "half-space"}, "load": {"pressure": 1e-2}}
    for points in (20, 40, 60):
        surface = {"length": 1.0, "periodic": False, "level": "none", "interpolation": "fourier"}
        tables = spec | {"surface": surface, "grid": {"points": points}}
        result = solve(tables, heights=bump)
        weight = np.clip(result.height - 0.3, 0, None).sum(axis=0)
        middle = (weight * result.x).sum() / weight.sum()
        assert middle == pytest.approx(0.3 + (1 / 20 - 1 / points) / 2, abs=5e-4)


def test_a_result_shows_itself():
    result = solve(TABLES)
    for shown in (str(result), repr(result), result._repr_html_()):
        assert "converged" in shown
        assert f"{result.a_r:.5g}" in shown
    assert len(str(result).splitlines()) < 12
    assert result._repr_html_().startswith("<table>")


def test_results_can_be_compared_and_collected():
    one, other = solve(TABLES), solve(TABLES)
    assert one in [other, one]
    assert one != other
    assert len({one, other}) == 2


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_warns_of_tasks_without_a_result(tmp_path, jobs):
    tables = TABLES | {"load": {"mean_gap": [0.5, 1e9]}}
    with pytest.warns(UserWarning, match=r"not reached|1 failed") as caught:
        study = run(tables, tmp_path / "a.h5", jobs=jobs)
    reason, counts = (str(one.message) for one in caught)
    assert reason.startswith("task 1 (")
    assert "load.mean_gap = 1e+09 h_std is not reached" in reason
    assert counts == f"{study}: 1 converged, 1 failed"
    assert len(rows(study)) == 1


def test_a_run_warns_of_contacts_that_have_not_converged(tmp_path):
    tables = TABLES | {"solver": {"max_steps": 1, "nested": False}}
    for _ in range(2):  # the second finds the result
        with pytest.warns(UserWarning, match=r"a.h5: 1 max_steps$"):
            run(tables, tmp_path / "a.h5")
    tables = TABLES | {"grid": {"points": [64, 96], "boundary": "free"}}
    with pytest.warns(UserWarning, match="another pressure on another grid"):
        run(tables | {"load": {"p_star": 0.5}}, tmp_path / "b.h5")


def test_a_comparison_shows_its_tables(tmp_path):
    comparison = compare(run(TABLES, tmp_path / "a.h5"))
    assert "Comparison with Persson theory" in str(comparison)
    assert comparison._repr_html_().count("<tbody>") == str(comparison).count("points a side")
    assert "a free boundary" not in str(comparison)
    free = TABLES | {"grid": TABLES["grid"] | {"boundary": "free"}}
    assert "a free boundary" in " ".join(str(compare(run(free, tmp_path / "free.h5"))).split())


def test_the_package_lists_its_names():
    assert {"Result", "compare", "dataset", "rows", "run", "solve"} <= set(dir(gfmd_cli))
    assert "import_module" not in dir(gfmd_cli)


def test_the_script_whose_types_are_checked_runs(tmp_path):
    script = runpy.run_path(str(Path(__file__).with_name("user_script.py")))
    assert script["main"](tmp_path) == pytest.approx(1)


def test_a_study_does_not_replace_what_other_commands_read(tmp_path):
    with pytest.raises(InputError, match=r"x\.toml: a study is an HDF5 file, such as x\.h5"):
        run(TABLES, tmp_path / "x.toml")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("jobs", [0, -1, 1.5, float("nan"), True, "2"])
def test_workers_are_a_whole_number(tmp_path, jobs):
    spec = {
        "surface": {"kind": "self-affine", "cutoff": 0.2},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": 16},
        "load": {"p_star": 0.1},
    }
    with pytest.raises(InputError, match=f"jobs = {jobs!r}: must be a whole number, at least 1"):
        run(spec, tmp_path / "a.h5", jobs=jobs)
    run(spec, tmp_path / "a.h5")
    with pytest.raises(InputError, match=f"jobs = {jobs!r}: must be a whole number, at least 1"):
        run(spec, tmp_path / "a.h5", jobs=jobs)
    with pytest.raises(InputError, match="unknown table '3'"):
        run(spec | {3: 4}, tmp_path / "a.h5")


def test_a_second_ctrl_c_interrupts_only_where_nothing_is_written():
    stop = Event()
    with signal_handlers(stop, may_exit=False):
        signal.raise_signal(signal.SIGINT)
        assert stop.is_set()
        signal.raise_signal(signal.SIGINT)
        with interruptible(), pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)


INTERRUPTED = """
import os, signal, sys, threading
from gfmd_cli import rows, run
from gfmd_cli.errors import Interrupted

SPEC = {
    "surface": {"kind": "self-affine", "cutoff": 0.02},
    "elastomer": {"kind": "power", "n": 2},
    "grid": {"points": 128},
    "load": {"p_star": [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]},
    "solver": {"kind": "fire", "tolerance": 1e-9},
}
ended, begun = threading.Event(), threading.Event()

def press():
    begun.wait()
    while not ended.wait(0.005):
        os.kill(os.getpid(), signal.SIGINT)

def watch(progress):
    if progress.event == "end":
        begun.set()

signal.signal(signal.SIGINT, lambda *_: None)  # outside of the run
keys = threading.Thread(target=press)
keys.start()
try:
    run(SPEC, "study.h5", jobs=int(sys.argv[1]), report=watch)
except (KeyboardInterrupt, Interrupted) as error:
    ended.set()
    print(type(error).__name__)
ended.set()
keys.join()
before = [row["p_star"] for row in rows("study.h5")]
solved = []
run(SPEC, "study.h5", report=lambda p: solved.append(p.task) if p.event == "end" else None)
print(len(before), len(solved), len(rows("study.h5")))
"""


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_second_ctrl_c_does_not_end_the_process_of_a_notebook(tmp_path, jobs):
    """Finished tasks are stored, and the next call solves the others."""
    (tmp_path / "script.py").write_text(INTERRUPTED)
    words = [sys.executable, "script.py", str(jobs)]
    completed = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    how, numbers = completed.stdout.splitlines()
    before, solved, stored = map(int, numbers.split())
    assert how in ("KeyboardInterrupt", "Interrupted")  # all may be saved before the second
    assert 0 < before < 6
    assert (before + solved, stored) == (6, 6)
    assert not (tmp_path / "study.parts").exists()


FORKED = """
import multiprocessing
from gfmd_cli import solve

SPEC = {
    "surface": {"kind": "self-affine", "cutoff": 0.05},
    "elastomer": {"kind": "half-space"},
    "grid": {"points": 512},
    "load": {"p_star": 0.1},
}
a_r = solve(SPEC, threads=2).a_r
child = multiprocessing.get_context("fork").Process(
    target=lambda: print(solve(SPEC, threads=2).a_r == a_r)
)
child.start()
child.join(120)
child.kill()
"""


def test_a_forked_process_solves_with_threads_of_its_own(tmp_path):
    """Those of the grids of its parent are not there: it would wait for them without end."""
    (tmp_path / "script.py").write_text(FORKED)
    words = [sys.executable, "script.py"]
    completed = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert completed.stdout.splitlines() == ["True"], completed.stderr


FORKED_WHILE_PLANNING = """
import multiprocessing
from threading import Event, Thread
from gfmd_cli import solve
from gfmd_cli.grid import plans

SPEC = {
    "surface": {"kind": "wave"},
    "elastomer": {"kind": "half-space"},
    "grid": {"points": 64},
    "load": {"p_star": 0.1},
}
solve(SPEC)
planning, end = Event(), Event()

def plan(fftw):
    planning.set()
    end.wait(0.5)

Thread(target=plans.planned_transforms, args=(plan, 0)).start()
planning.wait()
child = multiprocessing.get_context("fork").Process(target=lambda: print(solve(SPEC).status))
child.start()
child.join(60)
child.kill()
"""


def test_a_process_forked_while_a_thread_plans_can_solve(tmp_path):
    (tmp_path / "script.py").write_text(FORKED_WHILE_PLANNING)
    words, variables = [sys.executable, "script.py"], os.environ | {"GFMD_PLANS": "estimated"}
    completed = subprocess.run(
        words, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
    )
    assert completed.stdout.splitlines() == ["converged"], completed.stderr


def test_threads_that_read_files_keep_the_filters_of_warnings(tmp_path):
    """Two threads that change them for a while, one after the other, can leave them changed."""
    q = np.geomspace(0.1, 1e4, 3000)
    heights = np.random.default_rng(0).normal(size=(40, 40))
    heights[:, 5] = np.nan  # a line without heights
    spec = TABLES | {"grid": {"points": 40}, "load": {"p_star": 0.1}}

    def solve_one(number):
        table, scan = tmp_path / f"{number}.txt", tmp_path / f"{number}.csv"
        np.savetxt(table, np.c_[q, q])
        np.savetxt(scan, heights)
        surface = {"kind": "file", "path": scan, "length": 1.0, "missing": "fill"}
        return solve(spec | {"surface": surface, "elastomer": {"kind": "table", "path": table}})

    solve_one(0)  # imports may add filters
    before = list(warnings.filters)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(solve_one, range(1, 25)))
    assert warnings.filters == before


def test_nothing_is_kept_that_no_other_call_can_use(tmp_path):
    """Grids of a study have its plans, and those of an array its heights: large arrays."""

    def scenes():
        gc.collect()
        return [each for each in gc.get_objects() if isinstance(each, Scene)]

    others = scenes()
    run(TABLES, tmp_path / "a.h5")
    assert len(scenes()) == len(others)
    height = np.random.default_rng(0).normal(size=(64, 64))
    solve(TABLES | {"surface": {"length": 1.0}, "load": {"p_star": 0.1}}, heights=height)
    assert len(scenes()) == len(others)


def test_signals_that_a_program_blocks_stay_blocked(tmp_path):
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGUSR1])
    try:
        run(TABLES | {"load": {"pressure": [1e6, 2e6]}}, tmp_path / "a.h5", jobs=2)
        assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before | {signal.SIGUSR1}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def test_signals_of_a_program_around_python_stay_its_own(monkeypatch):
    """Of their handlers, as R has them for SIGUSR1, Python only knows that they are not its own."""
    known = signal.getsignal
    monkeypatch.setattr(signal, "getsignal", lambda n: None if n == signal.SIGUSR1 else known(n))
    before = {number: known(number) for number in SIGNALS}
    with signal_handlers(Event(), may_exit=False):
        changed = {number for number in SIGNALS if known(number) != before[number]}
    assert changed == set(SIGNALS) - {signal.SIGUSR1}
