"""Order, sides and units of arrays in HDF5 and netCDF files that state them."""

import re
import struct

import h5py
import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.maps.topography import read_topography
from gfmd_cli.physics.file_surface import FileSurface

HEIGHTS = np.random.default_rng(1).normal(size=(12, 16))  # [y, x]
X, Y = 0.5 * np.arange(16) + 3.0, 0.25 * np.arange(12)
UNITS = {"height": "nm", "x": "um", "y": "um"}


@pytest.fixture
def array(tmp_path):
    """Writes heights with dimension scales and units; None writes no unit."""

    def write(heights=HEIGHTS, axes=None, units=UNITS, extra=None):
        axes = {"y": Y, "x": X} if axes is None else axes
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.nc"
        with h5py.File(path, "w") as file:
            file["height"] = heights
            for index, (name, positions) in enumerate(axes.items()):
                file[name] = positions
                file[name].make_scale(name)
                file["height"].dims[index].attach_scale(file[name])
            for name, unit in units.items():
                if name in file and unit is not None:
                    file[name].attrs["units"] = unit
            if extra is not None:
                extra(file)
        return path

    return write


def test_units_and_positions_give_a_scan_in_metres(array):
    read = read_topography(array())
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))
    assert (read.metric_sides, read.metric_heights, read.periodic) == (True, True, False)
    surface = FileSurface(path=array())
    assert surface.sides == pytest.approx((3e-6, 8e-6))
    assert surface.levelling() == "plane"
    assert surface.warnings() == []


@pytest.mark.parametrize("names", [("x", "y"), ("lon", "lat"), ("X", "Y")])
def test_an_array_indexed_by_x_and_y_is_transposed(array, names):
    axes = dict(zip(names, (X, Y), strict=True))
    read = read_topography(array(HEIGHTS.T, axes, {"height": "nm", **dict.fromkeys(names, "um")}))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))


def test_axes_of_other_names_keep_their_order(array):
    units = {"height": "m", "scan": "m", "line": "m"}
    read = read_topography(array(HEIGHTS, {"scan": Y, "line": X}, units))
    assert read.heights == pytest.approx(HEIGHTS)
    assert read.spacing == pytest.approx((0.25, 0.5))


@pytest.mark.parametrize("axis", [0, 1])
def test_a_descending_axis_is_turned(array, axis):
    axes = {"y": Y[::-1] if axis == 0 else Y, "x": X[::-1] if axis == 1 else X}
    read = read_topography(array(np.flip(HEIGHTS, axis), axes))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)


def test_uneven_positions_are_refused_by_the_name_of_the_axis(array):
    with pytest.raises(InputError, match="'x' are not evenly spaced"):
        read_topography(array(axes={"y": Y, "x": X**2}))


def test_positions_rounded_to_single_precision_are_even(array):
    """Far from the origin their distances differ by the rounding, here by a fifth of a percent."""
    far = (1000.0 + 0.03 * np.arange(16)).astype(np.float32)
    assert np.ptp(np.diff(far)) > 2e-3 * 0.03
    read = read_topography(array(axes={"y": Y, "x": far}))
    assert read.spacing == pytest.approx((0.25e-6, 0.03e-6), rel=1e-3)


def test_a_unit_of_one_axis_alone_is_refused(array):
    with pytest.raises(InputError, match="the positions 'y' state no unit"):
        read_topography(array(units={"height": "nm", "x": "um"}))


@pytest.mark.parametrize("unit", ["nanometers", "nanometre", "nm"])
def test_units_in_words(array, unit):
    read = read_topography(array(units=UNITS | {"height": unit}))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)


@pytest.mark.parametrize("name", ["x", "height"])
def test_an_unknown_unit_is_refused_by_its_name(array, name):
    with pytest.raises(InputError, match=rf"{name}' states the unit 'furlong'"):
        read_topography(array(units=UNITS | {name: "furlong"}))


def test_heights_without_a_unit_beside_positions_with_one(array):
    path = array(units=UNITS | {"height": None})
    plain, scaled = FileSurface(path=path), FileSurface(path=path, scale=1e-9)
    assert plain.sides == scaled.sides == pytest.approx((3e-6, 8e-6))
    assert scaled.heights(16) == pytest.approx(1e-9 * plain.heights(16))
    assert any("not of its heights" in warning for warning in plain.warnings())
    assert not any("not of its heights" in warning for warning in scaled.warnings())


def test_positions_without_a_unit(array):
    """Beside metric heights the side is not known; beside others it is in the same unit."""
    metric = FileSurface(path=array(units={"height": "nm"}))
    assert "does not state its side in metres; L = 1 m is assumed" in metric.warnings()[0]
    plain = FileSurface(path=array(units={}), scale=1e-9)
    assert plain.sides == pytest.approx((3e-9, 8e-9))


def test_a_factor_of_metric_heights_gives_a_warning(array):
    warnings = FileSurface(path=array(), scale=1e-9).warnings()
    assert any("surface.scale multiplies metres" in warning for warning in warnings)


def test_a_unit_without_positions_gives_a_warning(array):
    """The array is read as it is."""
    surface = FileSurface(path=array(axes={}))
    assert surface.heights(16) == pytest.approx(HEIGHTS)
    assert re.search("state a unit, which is not read: set surface.scale", surface.warnings()[0])


def test_a_leading_axis_of_one_point_is_dropped(array):
    read = read_topography(array(HEIGHTS[None], {"time": [7.0], "y": Y, "x": X}))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))


def test_marks_of_missing_heights_are_found_before_units_are_converted(array):
    heights = HEIGHTS.copy()
    heights[2, 3] = 9.97e36
    assert read_topography(array(heights)).missing_count == 1


def test_every_mark_of_missing_heights_counts(array):
    heights = HEIGHTS.copy()
    heights[2, 3:5] = -9999, -8888

    def mark(file):
        file["height"].attrs["missing_value"] = [-9999.0, -8888.0]

    assert read_topography(array(heights, extra=mark)).missing_count == 2


@pytest.mark.parametrize(("number", "size"), [(1, 2**64 - 16), (1, 2**13), (0, 0)])
def test_a_damaged_list_of_positions_is_refused(array, number, size):
    """With the first and the last of these, HDF5 2.0 looks for the end of the list for ever."""
    path = array()
    content = bytearray(path.read_bytes())
    first = content.index(b"GCOL") + 16  # number (2 bytes), references (2), 0 (4), size (8)
    content[first : first + 16] = struct.pack("<HHIQ", number, 1, 0, size)
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged: a heap of texts and lists"):
        read_topography(path)


def test_a_damaged_scale_does_not_end_the_process(array):
    """Its class is no longer that of a scale."""
    path = array()
    path.write_bytes(path.read_bytes().replace(b"DIMENSION_SCALE", b"DIMENSION_SCALF"))
    assert read_topography(path).heights.shape == (12, 16)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_a_field_of_a_study_has_the_sides_and_the_boundary_of_its_contact(
    boundary, rows_of, tmp_path
):
    np.save(tmp_path / "heights.npy", 1e-9 * HEIGHTS)
    spec = f"""
        surface = {{ kind = "file", path = "heights.npy", length = 8e-6, length_y = 3e-6 }}
        elastomer.kind = "half-space"
        elastomer.E_star = 1e6
        grid = {{ points = 16, boundary = "{boundary}" }}
        load.p_star = 0.1
        output.fields = ["height"]
    """
    rows_of(text=spec)
    read = read_topography(tmp_path / "study.h5")
    assert np.ptp(read.heights - 1e-9 * HEIGHTS) < 1e-20
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))
    assert (read.metric_sides, read.metric_heights) == (True, True)
    assert read.periodic == (boundary == "periodic")


@pytest.mark.parametrize(
    "unit", [np.array([b"um"]), np.array(["um"], h5py.string_dtype()), np.bytes_("um")]
)
def test_attributes_may_be_text_of_any_kind(array, unit):
    def name_scale(file):
        file["x"].attrs["NAME"] = "x"

    read = read_topography(array(units=dict.fromkeys(UNITS, unit), extra=name_scale))
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))


def test_an_empty_attribute_states_no_unit(array):
    read = read_topography(array(units=dict.fromkeys(UNITS, h5py.Empty("S1"))))
    assert (read.spacing, read.metric_sides) == ((0.25, 0.5), False)
