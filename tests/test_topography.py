"""Height maps read from files, and what is refused before it is read."""

import re
import struct
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import h5py
import numpy as np
import pytest
from scipy.io import netcdf_file, savemat

from gfmd_cli import solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps import height_map, microscope_files
from gfmd_cli.maps.map_preparation import level
from gfmd_cli.maps.topography import Region, read_topography
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine

SCAN = Path(__file__).parents[1] / "configs" / "data" / "di-3.di"


@pytest.fixture
def heights():
    return np.random.default_rng(1).normal(size=(16, 16))


@pytest.fixture
def npy(tmp_path, heights):
    def write(array=heights, **options):
        path = tmp_path / "h.npy"
        np.save(path, array, **options)
        return path

    return write


@pytest.fixture
def hdf5(tmp_path):
    """Writes an HDF5 file of the given datasets; `fill` may add what is not a plain array."""

    def write(fill=lambda file: None, **datasets):
        path = tmp_path / "h.h5"
        with h5py.File(path, "w") as file:
            for name, array in datasets.items():
                file[name] = array
            fill(file)
        return path

    return write


# reading arrays


def test_a_saved_array_is_read_back_unchanged(npy, heights):
    read = read_topography(npy())
    np.testing.assert_array_equal(read.heights, heights)
    assert (read.spacing, read.periodic, read.source) == (None, None, "npy, float64")


@pytest.mark.parametrize("dtype", ["int16", "uint8", "float32", ">f8"])
def test_every_real_type_becomes_double_precision(npy, heights, dtype):
    stored = (10 * abs(heights)).astype(dtype)
    read = read_topography(npy(np.asfortranarray(stored))).heights
    np.testing.assert_array_equal(read, stored)
    assert read.dtype == np.float64
    assert read.dtype.isnative
    assert read.flags.c_contiguous


def test_the_only_map_of_an_hdf5_file_needs_no_name(hdf5, heights):
    numbers = {"a": np.ones((1, 1)), "b": np.ones((1, 16)), "x": np.arange(16.0)}
    read = read_topography(hdf5(**numbers, h=heights.astype("f4")))
    np.testing.assert_array_equal(read.heights, heights.astype("f4"))
    assert (read.spacing, read.periodic, read.source) == (None, None, "HDF5, h, float32")


def test_a_dataset_is_read_by_its_name(hdf5, heights):
    path = hdf5(**{"scan/h": heights, "other": 0 * heights})
    np.testing.assert_array_equal(read_topography(path, "/scan/h").heights, heights)


def test_hdf5_is_known_by_its_content(hdf5, heights):
    path = hdf5(h=heights)
    np.testing.assert_array_equal(
        read_topography(path.rename(path.with_suffix(".nc"))).heights, heights
    )


# refusing files


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((4, 16, 16)), "two dimensions, a line profile one"),
        (np.zeros(()), "two dimensions, a line profile one"),
        (np.zeros((16, 1)), "at least 2 along each axis"),
        (np.zeros((0, 0)), "0 x 0 points"),
        (np.zeros(1), "1 points; at least 2"),
        (np.zeros((16, 16), complex), "complex128"),
        (np.zeros((16, 16), bool), "bool"),
        (np.full((16, 16), "1.0"), "<U3"),
        (np.zeros((16, 16), [("h", "f8")]), "real numbers"),
    ],
)
def test_what_is_no_map_of_real_numbers_is_refused(npy, array, message):
    with pytest.raises(InputError, match=f"h.npy: .*{message}"):
        read_topography(npy(array))


def test_pickled_objects_are_refused_unread(npy):
    class Bomb:
        def __reduce__(self):
            return (pytest.fail, ("it went off",))

    path = npy(np.full((16, 16), Bomb(), dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match=r"cannot be read .*objects"):
        read_topography(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 9.97e36])
def test_missing_heights_are_counted_and_located(npy, heights, value):
    heights[3, 5] = heights[9, 0] = value
    read = read_topography(npy(heights))
    assert list(zip(*np.nonzero(read.missing), strict=True)) == [(3, 5), (9, 0)]
    with pytest.raises(InputError, match=r"2 of 256 heights .* first at x = 5, y = 3; .*fill"):
        FileSurface(path=npy(heights), missing="refuse").smallest_grid()


def test_heights_marked_as_missing_in_hdf5_are_located(hdf5):
    stored = np.arange(256).reshape(16, 16)

    def mark(file):
        file["h"].attrs["_FillValue"] = np.array([18])

    read = read_topography(hdf5(mark, h=stored))
    assert list(zip(*np.nonzero(read.missing), strict=True)) == [(1, 2)]
    np.testing.assert_array_equal(read.missing, stored == 18)


@pytest.mark.parametrize("factor", [1.0, 1e6])
def test_distances_of_a_profile_are_compared_with_each_other(tmp_path, factor):
    x = np.concatenate([np.arange(60) * 1e-8, 6e-7 + np.arange(20) * 1e-7])
    height = 5e-8 * np.cos(2 * np.pi * x / 2e-6)
    for name, order in (("up", slice(None)), ("down", slice(None, None, -1))):
        path = tmp_path / f"{name}.txt"
        np.savetxt(path, factor * np.column_stack([x, height])[order])
        read = read_topography(path)
        even = x[0] + np.arange(80) * (x[-1] - x[0]) / 79
        np.testing.assert_allclose(
            read.heights, factor * np.interp(even, x, height), atol=1e-12, rtol=0
        )
        assert "interpolated at equal distances" in read.source
    even = np.arange(80) * 1e-8
    np.savetxt(tmp_path / "even.txt", factor * np.column_stack([even, height])[::-1])
    read = read_topography(tmp_path / "even.txt")
    np.testing.assert_allclose(read.heights, factor * height)
    assert read.spacing == pytest.approx((factor * 1e-8,))


def test_positions_of_a_profile_in_no_order_are_refused(tmp_path):
    x = np.random.default_rng(0).permutation(100) * 1e-8
    np.savetxt(tmp_path / "mixed.txt", np.column_stack([x, np.sin(1e7 * x)]))
    with pytest.raises(InputError, match="positions along a profile must increase or decrease"):
        read_topography(tmp_path / "mixed.txt")


@pytest.mark.parametrize(
    ("is_mark", "words"),
    [
        (True, r"\d+ heights \(\d+%\) are exactly 0, far from all others"),
        (False, r"\d+ heights \(\d+%\) are exactly the maximum, \d+\.\d+: clipped"),
    ],
)
@pytest.mark.parametrize("share", [0.02, 0.3])
def test_marks_and_clipped_heights_at_many_points_give_a_warning(npy, is_mark, words, share):
    """Zeros among heights of 10 +- 0.5, and heights above a limit of the instrument."""
    draw = np.random.default_rng(4)
    heights = 10 + 0.5 * draw.normal(size=(40, 40))
    if is_mark:
        heights[draw.random(heights.shape) < share] = 0.0
    else:
        heights = np.minimum(heights, np.quantile(heights, 1 - share))
    assert re.search(words, "\n".join(FileSurface(path=npy(heights)).warnings()))


def test_a_mark_at_most_points_gives_a_warning(npy):
    """A round sample in a square frame, with a mark around it."""
    y, x = np.mgrid[:60, :60]
    heights = np.random.default_rng(4).normal(size=(60, 60))
    heights[np.hypot(y - 30, x - 30) > 20] = -9999.0
    (warning,) = [r for r in FileSurface(path=npy(heights)).warnings() if "far from" in r]
    assert re.match(r"\d+ heights \(6\d%\) are exactly -9999, far from all others", warning)


@pytest.mark.parametrize("case", ["rounded", "wave", "flat with bumps"])
def test_other_equal_heights_are_not_clipped(npy, case):
    heights = np.random.default_rng(5).normal(size=(40, 40))
    heights = {
        "rounded": np.round(heights * 1.5),
        "wave": np.tile(np.cos(np.arange(40) * np.pi / 10), (40, 1)),
        "flat with bumps": np.maximum(heights, 0.3),
    }[case]
    warnings = FileSurface(path=npy(heights)).warnings()
    assert not any("clipped" in each or "far from" in each for each in warnings)


@pytest.mark.parametrize("mark", [-9999.0, 50.0])
def test_marks_of_missing_heights_and_spikes_give_a_warning(npy, heights, mark):
    heights[3, 5] = mark
    (warning,) = [r for r in FileSurface(path=npy(heights)).warnings() if "far from" in r]
    assert warning.startswith(f"1 height is exactly {mark:g}, far from all others")


@pytest.mark.parametrize(("others", "is_spike"), [(7, False), (8, True)])
def test_a_spike_needs_eight_other_heights(npy, others, is_spike):
    heights = np.append(np.random.default_rng(6).normal(size=others), 50.0)
    warnings = FileSurface(path=npy(heights)).warnings()
    assert any("far from" in warning for warning in warnings) == is_spike


@pytest.mark.parametrize("spikes", [(50.0, -50.0), (50.0, 55.0), (-50.0, -51.0, -52.0)])
def test_a_few_different_spikes_give_a_warning(npy, heights, spikes):
    heights[3, : len(spikes)] = spikes
    (warning,) = [r for r in FileSurface(path=npy(heights)).warnings() if "far from" in r]
    assert warning.startswith(f"{len(spikes)} heights, from {min(spikes):g} to {max(spikes):g}")


def test_a_taper_without_a_window_gives_a_warning(npy, heights):
    for edges, count in (("mirror", 1), ("window", 0)):
        warnings = FileSurface(path=npy(heights), periodic=False, edges=edges, taper=0.2).warnings()
        assert sum("surface.taper has no effect" in warning for warning in warnings) == count


@pytest.mark.parametrize(("rounding", "is_coarse"), [(1.0, True), (0.25, False)])
def test_rounded_heights_give_a_warning(npy, rounding, is_coarse):
    """In steps as large as the rms difference of neighbours; a quarter of that is fine."""
    heights = build_scene(SelfAffine(cutoff=0.05), HalfSpace(), 128).height
    step = rounding * np.diff(heights, axis=1).std()
    warnings = FileSurface(path=npy(np.round(heights / step) * step), scale=1e-6).warnings()
    found = [warning for warning in warnings if "neighbouring heights are equal" in warning]
    assert len(found) == is_coarse
    assert not is_coarse or f"smallest step is {1e-6 * step:.3g} m" in found[0]


def test_nearly_all_heights_that_are_equal_are_not_said_to_be_all(npy):
    heights = np.zeros((64, 64))
    heights[30:33, 30:33] = 1e-3
    warnings = FileSurface(path=npy(heights)).warnings()
    assert any(each.startswith("over 99% of the neighbouring heights") for each in warnings)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("rounding", [0.0, 1.0])
def test_a_map_that_is_constant_along_an_axis_is_not_rounded(npy, axis, rounding):
    """A profile that is extended to a map; its own rounding is still found."""
    line = np.random.default_rng(0).normal(size=64).cumsum()
    line = np.round(line / rounding) * rounding if rounding else line
    heights = np.stack([line] * 32, axis=axis)
    warnings = FileSurface(path=npy(heights)).warnings()
    assert any("neighbouring heights are equal" in each for each in warnings) == bool(rounding)


def test_the_heights_of_a_microscope_are_fine_enough():
    assert not any("are equal" in warning for warning in FileSurface(path=SCAN).warnings())


def test_a_side_that_replaces_that_of_the_file_gives_a_warning():
    assert not any("replaces" in warning for warning in FileSurface(path=SCAN).warnings())
    warnings = FileSurface(path=SCAN, length=1e-3).warnings()
    assert any("replaces the side of the file" in warning for warning in warnings)


@pytest.mark.parametrize("keys", [{"length_y": 12.8e-6}, {"length": 16e-6, "length_y": 6.4e-6}])
def test_a_side_along_y_that_replaces_that_of_the_file_gives_a_warning(tmp_path, keys):
    path = tmp_path / "map.txt"
    header = "Width: 8 um\nHeight: 6.4 um\nValue units: nm"
    np.savetxt(path, np.random.default_rng(0).normal(size=(64, 80)), header=header)
    wrong = "surface.length_y = {length_y:g} m replaces the side of the file".format(**keys)
    assert any(wrong in warning for warning in FileSurface(path=path, **keys).warnings())
    for same in ({"length_y": 6.4e-6}, {"length": 16e-6, "length_y": 12.8e-6}):
        assert not any("length_y" in each for each in FileSurface(path=path, **same).warnings())


@pytest.mark.parametrize("mark", [np.float64(-9999.9), np.float64(1e20), np.float32(-9999.9)])
def test_a_mark_of_another_precision_is_found(hdf5, heights, mark):
    heights = heights.astype(np.float32)
    heights[1, 2] = mark

    def write_mark(file):
        file["h"].attrs["missing_value"] = mark

    read = read_topography(hdf5(write_mark, h=heights))
    assert list(zip(*np.nonzero(read.missing), strict=True)) == [(1, 2)]


@pytest.mark.parametrize(
    ("attributes", "missing"),
    [
        ({"valid_min": -1.0}, [(1, 2)]),
        ({"valid_max": [2.0]}, [(3, 0)]),
        ({"valid_range": [-1.0, 2.0]}, [(1, 2), (3, 0)]),
        ({"valid_min": -1.0, "valid_max": np.float64(0.1)}, [(1, 2), (3, 0)]),
    ],
)
def test_heights_out_of_the_valid_range_of_netcdf_are_missing(hdf5, attributes, missing):
    heights = np.full((5, 4), 0.1, np.float32)  # which is more than 0.1 in double precision
    heights[1, 2], heights[3, 0] = -99, 99
    read = read_topography(hdf5(lambda file: file["h"].attrs.update(attributes), h=heights))
    assert list(zip(*np.nonzero(read.missing), strict=True)) == missing


def test_a_valid_range_that_is_no_range_is_refused(hdf5, heights):
    def write_range(file):
        file["h"].attrs["valid_range"] = 1.0

    with pytest.raises(InputError, match=r"valid_range must be 2 numbers, got \[1.0\]"):
        read_topography(hdf5(write_range, h=heights))


def test_packed_netcdf_heights_are_refused(hdf5, heights):
    def pack(file):
        file["h"].attrs["scale_factor"] = 0.5

    with pytest.raises(InputError, match=r"packed .scale_factor"):
        read_topography(hdf5(pack, h=heights))


@pytest.fixture
def limit_bytes(monkeypatch):
    def limit(max_bytes):
        for module in (height_map, microscope_files):
            monkeypatch.setattr(module, "MAX_MAP_BYTES", max_bytes)

    return limit


def test_a_map_beyond_the_size_limit_is_refused(npy, hdf5, heights, limit_bytes):
    for path in (npy(), hdf5(h=heights)):
        limit_bytes(2047)
        with pytest.raises(InputError, match="take 2048 bytes; at most 2047"):
            read_topography(path)
        limit_bytes(2048)
        assert read_topography(path).heights.shape == (16, 16)


def test_no_file_a_directory_and_an_empty_file_are_told_apart(tmp_path):
    (tmp_path / "empty.npy").touch()
    for name, message in (
        ("none.npy", "no such file"),
        ("", "a directory"),
        ("empty.npy", "empty"),
    ):
        with pytest.raises(InputError, match=message):
            read_topography(tmp_path / name)


def test_a_file_without_permission_is_bad_input(npy, monkeypatch):
    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(np.lib.format, "open_memmap", refuse)
    with pytest.raises(InputError, match=r"cannot be read: .*Permission denied"):
        read_topography(npy())


def test_a_truncated_array_is_bad_input(npy):
    path = npy()
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match=r"h\.npy: cannot be read"):
        read_topography(path)


def test_a_truncated_hdf5_file_is_bad_input(hdf5, heights):
    path = hdf5(h=heights)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match=r"h\.h5: cannot be read"):
        read_topography(path)


def test_an_array_file_takes_no_dataset_name(npy):
    with pytest.raises(InputError, match="leave out dataset 'h'"):
        read_topography(npy(), "h")


def test_a_text_of_one_map_takes_no_dataset_name(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "h.txt"
    grid = "ncols 4\nnrows 3\ncellsize 1\n" + "1 2 3 5\n" * 3
    points = "".join(f"{x} {y} {x * y % 5}\n" for y in range(6) for x in range(6))
    for text, what in ((grid, "ESRI grid"), (points, "table of positions")):
        path.write_text(text)
        read_topography(path)
        with pytest.raises(InputError, match=f"{what} holds one map; leave out dataset 'h'"):
            read_topography(path, "h")


def test_a_file_of_words_alone_has_no_map(hdf5):
    with pytest.raises(InputError, match="no numeric dataset with one or two dimensions"):
        read_topography(hdf5(operator="somebody"))


def test_two_maps_and_an_unknown_name_list_the_candidates(hdf5, heights):
    path = hdf5(a=heights, b=heights, x=np.arange(16.0))
    for dataset, message in ((None, "several datasets"), ("c", "no dataset 'c'")):
        with pytest.raises(InputError, match=f"{message}.*: a, b$"):
            read_topography(path, dataset)


@pytest.mark.parametrize("name", ["height", "Topography", "scan/z"])
def test_a_map_whose_name_means_heights_is_preferred(hdf5, heights, name):
    read = read_topography(hdf5(**{"error": 0 * heights, name: heights, "zz": 0 * heights}))
    np.testing.assert_array_equal(read.heights, heights)
    assert f"HDF5, {name}," in read.source


def test_two_maps_whose_names_mean_heights_are_listed_alone(hdf5, heights):
    path = hdf5(**{"error": heights, "a/height": heights, "b/height": heights})
    with pytest.raises(InputError, match=r"several datasets: .*: a/height, b/height$"):
        read_topography(path)


def test_arrays_of_matlab_are_chosen_by_name(tmp_path, heights):
    """Scalars and positions are no maps."""
    pytest.importorskip("SurfaceTopography")
    arrays = {"a": 3.0, "x": np.arange(16.0), "b": 0 * heights}
    savemat(tmp_path / "two.mat", arrays | {"z": heights})
    assert read_topography(tmp_path / "two.mat").source == "mat, z"
    savemat(tmp_path / "one.mat", arrays)
    assert read_topography(tmp_path / "one.mat").source == "mat, b"
    savemat(tmp_path / "other.mat", arrays | {"c": heights})
    with pytest.raises(InputError, match=r"several datasets: .*: b, c$"):
        read_topography(tmp_path / "other.mat")


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_the_rows_of_a_matrix_of_matlab_run_along_y(tmp_path, heights, version):
    """Version 7.3 is HDF5 with the columns first."""
    path, matrix = tmp_path / "h.mat", heights[:10]
    if version == "5":
        pytest.importorskip("SurfaceTopography")
        savemat(path, {"z": matrix})
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["z"] = matrix.T
            file["z"].attrs["MATLAB_class"] = np.bytes_("double")
    read = read_topography(path)
    np.testing.assert_array_equal(read.heights, matrix)
    assert read.periodic is None
    assert FileSurface(path=path, length=16e-6).sides == pytest.approx((10e-6, 16e-6))


@pytest.mark.parametrize(("axes", "units"), [("yx", {}), ("xy", {"units": "nm"})])
def test_a_classic_netcdf_file_of_other_programs_is_refused(tmp_path, heights, axes, units):
    """The reader of such files would transpose the first map, and take the second in metres."""
    pytest.importorskip("SurfaceTopography")
    with netcdf_file(tmp_path / "h.nc", "w") as file:
        for name, points in zip(axes, heights.shape, strict=True):
            file.createDimension(name, points)
            file.createVariable(name, "d", (name,))[:] = np.arange(points)
        variable = file.createVariable("heights", "d", tuple(axes))
        variable[:] = heights
        for name, value in units.items():
            setattr(variable, name, value)
    with pytest.raises(InputError, match=r"classic netCDF file .* save it as netCDF 4"):
        read_topography(tmp_path / "h.nc")


@pytest.mark.parametrize("link", [h5py.SoftLink("/h"), h5py.ExternalLink("other.h5", "/h")])
def test_links_to_a_dataset_are_not_followed(hdf5, heights, link):
    def add(file):
        file["link"] = link

    with pytest.raises(InputError, match="no dataset 'link'"):
        read_topography(hdf5(add, h=heights), "link")


def test_heights_kept_in_other_files_are_refused(hdf5, tmp_path):
    (tmp_path / "secret").write_bytes(bytes(2048))

    def external(file):
        file.create_dataset("h", (16, 16), "f8", external=[(tmp_path / "secret", 0, 2048)])

    def virtual(file):
        layout = h5py.VirtualLayout((16, 16), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "h", (16, 16))
        file.create_virtual_dataset("h", layout)

    for fill in (external, virtual):
        with pytest.raises(InputError, match="stored in other files"):
            read_topography(hdf5(fill))


@pytest.mark.parametrize("values", [1, 4])
def test_points_in_the_order_of_their_measurement_are_no_map(hdf5, values):
    """Files of JPK and pycroscopy have one row of values for each point of a scan."""

    def fill(file):
        file["Position_Indices"] = np.indices((16, 16)).reshape(2, -1).T
        file["Height"] = np.zeros((256, values))
        file["Height"].attrs["Position_Indices"] = file["Position_Indices"].ref

    with pytest.raises(InputError, match="'Height' has points in the order of their measurement"):
        read_topography(hdf5(fill), dataset="Height")


def test_a_dataset_that_claims_more_than_is_stored_is_refused(hdf5):
    def claim(file):
        file.create_dataset("h", (4096, 4096), "f8", chunks=(64, 64))

    with pytest.raises(InputError, match="claims 134217728 bytes"):
        read_topography(hdf5(claim))


# microscope files


def test_a_microscope_scan_is_read_in_metres():
    pytest.importorskip("SurfaceTopography")
    scan = read_topography(SCAN)
    assert scan.heights.shape == (256, 256)
    assert scan.spacing == pytest.approx((10e-6 / 256,) * 2)
    assert scan.periodic is False
    assert scan.source == "di, ZSensor"
    assert level(scan.heights, "mean").std() == pytest.approx(226.4e-9, rel=1e-3)
    assert level(scan.heights, "plane").std() == pytest.approx(35.22e-9, rel=1e-3)


def test_a_scan_is_turned_to_rows_along_y():
    library = pytest.importorskip("SurfaceTopography.IO")
    with library.open_topography(str(SCAN)) as reader:
        along_x = reader.topography().heights()
    np.testing.assert_allclose(read_topography(SCAN).heights.T, 1e-9 * along_x, rtol=1e-12)


def test_another_height_channel_is_read_by_its_name():
    pytest.importorskip("SurfaceTopography")
    assert read_topography(SCAN, "Height").source == "di, Height"


def test_a_channel_that_holds_no_heights_lists_those_that_do():
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(InputError, match=r"no height channel 'Phase'.*: ZSensor, Height$"):
        read_topography(SCAN, "Phase")


def test_a_scan_beyond_the_size_limit_is_refused(limit_bytes):
    pytest.importorskip("SurfaceTopography")
    for limit in (SCAN.stat().st_size - 1, 256 * 256 * 8 - 1):
        limit_bytes(limit)
        with pytest.raises(InputError, match=f"at most {limit}"):
            read_topography(SCAN)


def write_text_map(path, height="2 um", first="1"):
    lines = ["# Width: 2 um", f"# Height: {height}", "# Value units: nm"]
    rows = [" ".join(str(10 * i + j) for j in range(8)) for i in range(8)]
    rows[0] = first + rows[0][1:]
    path.write_text("\n".join(lines + rows) + "\n")
    return path


def test_a_text_map_is_read_in_metres(tmp_path):
    pytest.importorskip("SurfaceTopography")
    read = read_topography(write_text_map(tmp_path / "h.txt"))
    expected = np.add.outer(10 * np.arange(8), np.arange(8))
    expected[0, 0] = 1
    np.testing.assert_allclose(read.heights, 1e-9 * expected, rtol=1e-12)
    assert read.spacing == pytest.approx((2e-6 / 8,) * 2)


def test_a_map_without_size_and_unit_has_no_length(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "h.txt"
    np.savetxt(path, np.arange(64.0).reshape(8, 8))
    read = read_topography(path)
    np.testing.assert_array_equal(read.heights, np.arange(64.0).reshape(8, 8))
    assert read.spacing is None


def test_a_point_of_a_scan_may_have_two_sides(tmp_path):
    pytest.importorskip("SurfaceTopography")
    read = read_topography(write_text_map(tmp_path / "h.txt", height="2.5 um"))
    assert read.spacing == pytest.approx((3.125e-7, 2.5e-7))


def test_missing_points_of_a_scan_are_located(tmp_path):
    pytest.importorskip("SurfaceTopography")
    read = read_topography(write_text_map(tmp_path / "h.txt", first="nan"))
    assert np.argwhere(read.missing).tolist() == [[0, 0]]


@pytest.mark.parametrize("content", [b"no heights here\n", bytes(2 * 8 * 8), b"\x00\xff" * 999])
def test_an_unknown_format_is_refused(tmp_path, content):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.dat").write_bytes(content)
    with pytest.raises(InputError, match="not in a known topography format"):
        read_topography(tmp_path / "h.dat")


def test_an_array_is_known_by_its_content(npy, heights):
    path = npy()
    read = read_topography(path.rename(path.with_suffix(".dat")))
    np.testing.assert_array_equal(read.heights, heights)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("h.sur", b"DSCOMPRESSED" + bytes(500), "compressed file of MountainsMap; save it without"),
        ("h.zip", None, "a compressed file: unpack it"),
    ],
)
def test_a_compressed_file_is_refused_as_such(tmp_path, heights, name, content, message):
    pytest.importorskip("SurfaceTopography")
    if content is None:
        with ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("scan.txt", str(heights.tolist()))
    else:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_topography(tmp_path / name)


@pytest.mark.parametrize("mark", [-3.4028235e38, 3.4028235e38, np.nan])
def test_marks_of_missing_heights_in_an_sdf_file_in_nanometres_are_found(tmp_path, heights, mark):
    """In metres the mark is 3.4e29, less than a mark in the unit of a file."""
    pytest.importorskip("SurfaceTopography")
    in_nm = heights[:12].astype("<f4")
    in_nm[3, 4] = mark
    header = b"bISO-1.0" + b"instrument" + 2 * b"010120261200"
    header += struct.pack("<HHddddBBB", 16, 12, 1e-6, 2e-6, 1e-9, -1.0, 0, 3, 0)
    (tmp_path / "h.sdf").write_bytes(header + in_nm.tobytes())
    read = read_topography(tmp_path / "h.sdf")
    assert np.argwhere(read.missing).tolist() == [[3, 4]]
    assert read.spacing == pytest.approx((2e-6, 1e-6))
    assert read.heights[~read.missing] == pytest.approx(1e-9 * np.delete(in_nm, 3 * 16 + 4))


def test_the_distances_of_a_nanofocus_file_are_nanometres(tmp_path):
    pytest.importorskip("SurfaceTopography")
    levels = np.arange(16 * 12, dtype="<u2").reshape(12, 16) ** 2
    header = bytearray(3468)
    struct.pack_into("<2d", header, 16, 2.0, 3.0)  # of the heights, in um
    struct.pack_into("<2I2d", header, 1368, 16, 12, 312.5, 250.0)
    (tmp_path / "h.nms").write_bytes(bytes(header) + levels.tobytes())
    read = read_topography(tmp_path / "h.nms")
    assert read.spacing == pytest.approx((250e-9, 312.5e-9))
    assert (read.metric_sides, read.periodic) == (True, False)
    assert read.heights == pytest.approx(1e-6 * (2 + levels / 65535), abs=1e-10)


@pytest.mark.parametrize(
    "comment", [b"", b"hello", b"Created by TrueMap v6\r\n", b"Created by another program 1.2\r\n"]
)
def test_a_truemap_file_has_a_comment_of_any_length(tmp_path, heights, comment):
    pytest.importorskip("SurfaceTopography")
    in_mm = 1e-3 * heights[:12].astype("<f4")
    magic = b"Binary TrueMap Data File v2.0\r\n\0"
    header = struct.pack("<2I4f", 16, 12, 1.6, 2.4, 0.0, 0.0)
    (tmp_path / "h.tmd").write_bytes(magic + comment + b"\0" + header + in_mm.tobytes())
    read = read_topography(tmp_path / "h.tmd")
    assert read.spacing == pytest.approx((2e-4, 1e-4))
    assert read.heights == pytest.approx(1e-3 * in_mm)


def test_a_truemap_file_of_the_first_version_is_refused_as_such(tmp_path):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.tmd").write_bytes(b"Binary TrueMap Data File\r\n\0" + bytes(900))
    with pytest.raises(InputError, match=r"TrueMap before version 2\.0"):
        read_topography(tmp_path / "h.tmd")


def mountains_map(unit, levels, padding=b"\0"):
    """A file of MountainsMap: points 0.1 and 0.2 apart, levels of 0.001, all in a unit."""
    rows, columns = levels.shape
    header = bytearray(512)
    header[:12] = b"DIGITAL SURF"
    struct.pack_into("<Hii", header, 98, 32, int(levels.min()), int(levels.max()))
    struct.pack_into("<iiI3f", header, 108, columns, rows, levels.size, 0.1, 0.2, 1e-3)
    for place in range(180, 276, 16):
        header[place : place + 16] = unit.ljust(16, padding)
    return bytes(header) + levels.astype("<i4").tobytes()


@pytest.mark.parametrize("padding", [b"\0", b" "])
@pytest.mark.parametrize("unit", [b"um", b"\xb5m", b"\xe6m", b"\xc2\xb5m", b"\xce\xbcm", b"\xecm"])
def test_micrometres_of_mountainsmap_are_read_in_every_encoding(tmp_path, unit, padding):
    pytest.importorskip("SurfaceTopography")
    levels = np.arange(12 * 16).reshape(12, 16) ** 2
    (tmp_path / "h.sur").write_bytes(mountains_map(unit, levels, padding))
    read = read_topography(tmp_path / "h.sur")
    assert read.spacing == pytest.approx((2e-7, 1e-7))
    assert read.heights == pytest.approx(1e-9 * levels)


def test_a_unit_that_is_not_known_is_the_reason_of_the_refusal(tmp_path):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.sur").write_bytes(mountains_map(b"inch", np.eye(16, dtype=int)))
    with pytest.raises(
        InputError, match=r"Unknown unit 'inch'.*save it with lengths in m, um or nm"
    ):
        read_topography(tmp_path / "h.sur")


def test_an_x3p_file_with_its_heights_in_its_index_is_refused_as_such(tmp_path):
    pytest.importorskip("SurfaceTopography")
    lateral = "<AxisType>I</AxisType><DataType>D</DataType><Increment>1e-7</Increment>"
    axes = f"<CX>{lateral}</CX><CY>{lateral}</CY><CZ><AxisType>A</AxisType></CZ>"
    record = "<Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType>"
    size = "<SizeX>16</SizeX><SizeY>16</SizeY><SizeZ>1</SizeZ>"
    heights = "<DataList>" + 256 * "<Datum>0;0;1e-7</Datum>" + "</DataList>"
    with ZipFile(tmp_path / "h.x3p", "w") as archive:
        archive.writestr(
            "main.xml",
            f"<ISO5436_2><Record1>{record}<Axes>{axes}</Axes></Record1><Record3>"
            f"<MatrixDimension>{size}</MatrixDimension>{heights}</Record3></ISO5436_2>",
        )
    with pytest.raises(InputError, match=r"heights in main\.xml, which are not read"):
        read_topography(tmp_path / "h.x3p")


def test_an_archive_of_arrays_is_refused(tmp_path, heights):
    pytest.importorskip("SurfaceTopography")
    np.savez(tmp_path / "h.npz", heights)
    with pytest.raises(InputError, match=r"save the map as a \.npy file"):
        read_topography(tmp_path / "h.npz")


def test_a_truncated_scan_is_refused(tmp_path):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.di").write_bytes(SCAN.read_bytes()[:100_000])
    with pytest.raises(InputError, match=r"h\.di: "):
        read_topography(tmp_path / "h.di")


def test_the_reason_of_a_reader_that_fails_is_told(tmp_path):
    """A .top file by its name, whose header says nothing."""
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.x3p").write_bytes(b"PK\x03\x04" + bytes(400))
    with pytest.raises(InputError, match=r"recognises the format .*x3p: .*damaged, or a variant"):
        read_topography(tmp_path / "h.x3p")


def test_without_surfacetopography_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    monkeypatch.delitem(sys.modules, "SurfaceTopography.IO", raising=False)
    with pytest.raises(InputError, match=r'pip install "\.\[topography\]"'):
        read_topography(SCAN)


def test_arrays_are_read_without_loading_surfacetopography(npy):
    code = (
        "import sys; from pathlib import Path; "
        "from gfmd_cli.maps.topography import read_topography; "
        f"read_topography(Path({str(npy())!r})); "
        "assert not {'SurfaceTopography', 'h5py'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# regions, holes and lines


@pytest.mark.parametrize(
    ("region", "rows", "columns"),
    [
        ({"x": [2, 10], "y": [1, 9]}, slice(1, 9), slice(2, 10)),
        ({"x": [2, 10]}, slice(None), slice(2, 10)),
        ({"y": [0, 2]}, slice(0, 2), slice(None)),
        ({}, slice(None), slice(None)),
    ],
)
def test_a_region_is_cut_out_of_the_map(npy, region, rows, columns):
    heights = np.arange(9.0 * 13).reshape(9, 13)
    read = read_topography(npy(heights), region=Region.model_validate(region))
    np.testing.assert_array_equal(read.heights, heights[rows, columns])
    assert read.shape == (9, 13)


def test_a_region_in_metres_uses_the_spacing_of_each_axis(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = write_text_map(tmp_path / "h.txt", height="4 um")  # points 0.5 um along y, 0.25 along x
    region = Region.model_validate({"x": [0.5e-6, 2e-6], "y": [1e-6, 4e-6], "unit": "m"})
    read = read_topography(path, region=region)
    np.testing.assert_array_equal(read.heights, read_topography(path).heights[2:, 2:])


@pytest.mark.parametrize(
    ("region", "message"),
    [
        ({"x": [0, 14]}, r"the map has x = 0 to 13 pixels, 13 points"),
        ({"y": [3, 4]}, r"a region has at least 2"),
        ({"x": [0, 1e-6], "unit": "m"}, "does not state its sides: give the region in pixels"),
    ],
)
def test_a_region_beyond_the_map_is_refused(npy, region, message):
    path = npy(np.zeros((9, 13)))
    with pytest.raises(InputError, match=f"h.npy: surface.region: .*{message}"):
        read_topography(path, region=Region.model_validate(region))


def test_a_region_of_a_profile_has_no_y(npy):
    region = Region.model_validate({"x": [2, 6], "y": [0, 2]})
    with pytest.raises(InputError, match=r"surface\.region: a line profile has no y"):
        read_topography(npy(np.arange(9.0)), region=region)


def test_a_map_upside_down_has_the_opposite_heights(npy, heights):
    heights[2, 3] = np.nan
    upright, turned = read_topography(npy(heights)), read_topography(npy(heights), flip=True)
    np.testing.assert_array_equal(turned.heights, -upright.heights)
    np.testing.assert_array_equal(turned.missing, upright.missing)


def test_a_map_without_any_height_is_refused(npy):
    with pytest.raises(InputError, match="all of the 256 heights"):
        read_topography(npy(np.full((16, 16), np.nan)))


def test_holes_are_filled_and_do_not_tilt_the_map(npy):
    """Levelling uses the known heights, so that a plane with holes becomes zero."""
    y, x = np.mgrid[:16, :16].astype(float)
    plane = 3 + x - 2 * y
    plane[:9, :12] = np.nan
    surface = FileSurface(path=npy(plane), periodic=False, edges="none")
    np.testing.assert_allclose(surface.heights_on(Grid(16)), 0, atol=1e-12, rtol=0)


def test_an_oblong_map_is_used_as_it_is_and_its_middle_as_asked(npy):
    heights = np.arange(9.0 * 13).reshape(9, 13)
    whole = FileSurface(path=npy(heights), length=2.6)
    assert whole.sides == pytest.approx((1.8, 2.6))
    np.testing.assert_array_equal(whole.heights(13), heights)
    middle = FileSurface(path=npy(heights), crop=True).heights(8)
    np.testing.assert_array_equal(middle, heights[:8, 2:10])


def test_an_array_of_one_dimension_is_a_line_profile(npy):
    line = np.random.default_rng(2).normal(size=20)
    surface = FileSurface(path=npy(line), length=2e-6)
    assert (surface.dimension, surface.smallest_grid(), surface.sides) == (1, 20, (2e-6,))
    np.testing.assert_array_equal(surface.heights(20), line)


@pytest.mark.parametrize("length_y", [1e-30, 1e30])
@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_a_map_of_too_different_sides_is_refused(npy, boundary, length_y):
    heights = np.random.default_rng(0).normal(size=(16, 16))
    surface = {"kind": "file", "path": str(npy(heights)), "length_y": length_y}
    tables = {"surface": surface, "elastomer": {"kind": "half-space"}, "load": {"p_star": 0.1}}
    with pytest.raises(
        InputError, match=r"length_y = 1e.* m is out of range: the side along x has"
    ):
        solve(tables | {"grid": {"points": 16, "boundary": boundary}})


def test_a_line_profile_has_no_side_along_y(npy):
    surface = FileSurface(path=npy(np.arange(20.0) % 7), length_y=1e-6)
    with pytest.raises(InputError, match=r"surface\.length_y = 1e-06: a line profile has no side"):
        _ = surface.sides


def test_the_only_line_of_an_hdf5_file_needs_no_name(hdf5):
    line = np.arange(16.0)
    np.testing.assert_array_equal(read_topography(hdf5(h=line)).heights, line)


def test_a_profile_ends_at_its_last_known_heights(tmp_path):
    heights = np.random.default_rng(7).normal(size=40)
    heights[17] = np.nan
    path, values = tmp_path / "profile.txt", np.pad(heights, (3, 7), constant_values=np.nan)
    path.write_text("".join(f"{0.5 * i:g} {value}\n" for i, value in enumerate(values)))
    surface = FileSurface(path=path)
    assert surface.sides == pytest.approx((20.0,))
    assert surface.measured_map()[0].size == 40
    assert surface.missing_count() == 1
    (warning,) = [each for each in surface.warnings("free") if "missing" in each]
    expected = "heights of the profile are missing, 3 at the start and 7 at the end: only"
    assert warning.startswith(expected)


@pytest.mark.parametrize("periodic", [True, False])
def test_filled_ends_of_an_array_give_a_warning(npy, periodic):
    """In a periodic profile they lie between known heights."""
    heights = np.random.default_rng(8).normal(size=200)
    heights[-4:] = np.nan
    warnings = FileSurface(path=npy(heights), periodic=periodic).warnings()
    ends = [each for each in warnings if "heights of the profile are missing, 4 at the end" in each]
    assert len(ends) == (not periodic)


def test_two_columns_are_positions_and_heights(tmp_path):
    """Positions at unequal distances: heights are interpolated linearly at equal ones."""
    pytest.importorskip("SurfaceTopography")
    x = np.array([0.0, 1.0, 1.5, 3.0, 4.0, 6.0, 7.0, 8.0])
    np.savetxt(tmp_path / "line.txt", np.stack([x, 2 * x + 1], axis=1))
    read = read_topography(tmp_path / "line.txt")
    assert read.spacing == pytest.approx((8 / 7,))
    np.testing.assert_allclose(np.diff(read.heights), 16 / 7, rtol=1e-12)
    assert "equal distances" in read.source


def test_a_side_without_a_unit_is_in_that_of_the_heights(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = (f"{x}e-8 {y}e-8 {(x * y) % 5}e-9" for y in range(16) for x in range(16))
    (tmp_path / "h.xyz").write_text("\n".join(rows))
    read = read_topography(tmp_path / "h.xyz")
    assert not read.metric_sides
    assert read.spacing == pytest.approx((1e-8, 1e-8))
    plain = FileSurface(path=tmp_path / "h.xyz")
    assert plain.sides[1] == pytest.approx(16e-8)
    assert FileSurface(path=tmp_path / "h.xyz", scale=1e-3).sides[1] == pytest.approx(16e-11)
    assert FileSurface(path=tmp_path / "h.xyz", length=2.0).sides == (2.0, 2.0)


@pytest.mark.parametrize(
    "header", ["# x[um] y[um] z[nm]", "X (µm)\tY (µm)\tZ (nm)", "x_um,y_um,height_nm"]
)
def test_a_table_of_positions_has_the_units_of_its_header(tmp_path, header):
    pytest.importorskip("SurfaceTopography")
    heights = np.random.default_rng(3).normal(size=(12, 16))
    rows = (f"{0.5 * x} {0.25 * y} {heights[y, x]}" for y in range(12) for x in range(16))
    (tmp_path / "h.xyz").write_text(header + "\n" + "\n".join(rows), encoding="utf-8")
    read = read_topography(tmp_path / "h.xyz")
    assert read.heights == pytest.approx(1e-9 * heights)
    assert read.spacing == pytest.approx((0.25e-6, 0.5e-6))
    assert (read.metric_sides, read.metric_heights) == (True, True)


def test_a_profile_has_the_units_of_its_header(tmp_path):
    pytest.importorskip("SurfaceTopography")
    x, heights = 0.5 * np.arange(32), np.random.default_rng(4).normal(size=32)
    np.savetxt(tmp_path / "p.txt", np.column_stack([x, heights]), header="x [mm]  z [um]")
    read = read_topography(tmp_path / "p.txt")
    assert read.heights == pytest.approx(1e-6 * heights)
    assert read.spacing == pytest.approx((0.5e-3,))


def test_a_header_with_units_of_some_columns_is_refused(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = (f"{x} {y} {(x * y) % 5}" for y in range(16) for x in range(16))
    (tmp_path / "h.xyz").write_text("x y z [nm]\n" + "\n".join(rows))
    with pytest.raises(InputError, match="not one for each of the 3 columns"):
        read_topography(tmp_path / "h.xyz")


def test_positions_without_a_unit_give_a_warning(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = (f"{x} {y} {(x * y) % 5}" for y in range(16) for x in range(16))
    (tmp_path / "h.xyz").write_text("\n".join(rows))
    warnings = FileSurface(path=tmp_path / "h.xyz").warnings()
    assert any("does not state the unit of its positions" in each for each in warnings)


@pytest.mark.parametrize("mark", ["NA", "***", "--"])
def test_a_row_of_marks_in_a_matrix_is_refused(tmp_path, mark):
    """The reader would leave the row out and join the rows around it."""
    pytest.importorskip("SurfaceTopography")
    rows = [" ".join(f"{x * y % 7}.5" for x in range(12)) for y in range(12)]
    rows[5] = " ".join([mark] * 12)
    (tmp_path / "h.txt").write_text("\n".join(rows))
    with pytest.raises(InputError, match=re.escape(f"h.txt:6: {mark!r} in a row")):
        read_topography(tmp_path / "h.txt")


def test_two_matrices_in_one_file_are_refused(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = [" ".join(f"{x * y % 7}.5" for x in range(12)) for y in range(12)]
    (tmp_path / "h.txt").write_text("\n".join([*rows, "", *rows]))
    with pytest.raises(InputError, match=r"h\.txt:13: an empty line in the table"):
        read_topography(tmp_path / "h.txt")
    (tmp_path / "spaced.txt").write_text("\n\n".join(rows))
    assert read_topography(tmp_path / "spaced.txt").shape == (12, 12)


def test_a_factor_of_the_heights_that_also_multiplies_the_sides_is_a_warning(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = (f"{x} {y} {(x * y) % 5}" for y in range(16) for x in range(16))
    (tmp_path / "h.xyz").write_text("\n".join(rows))
    scaled = {"path": tmp_path / "h.xyz", "scale": 1e-9}
    warning = "surface.scale also multiplies the sides.*L = 1.6e-08 m; set surface.length"
    assert re.search(warning, "\n".join(FileSurface(**scaled).warnings()))
    for keys in ({"length": 16e-6}, {"scale": 1.0}):
        warnings = FileSurface(**(scaled | keys)).warnings()
        assert not any("also multiplies" in each for each in warnings)


@pytest.mark.parametrize("unit", ["\N{MICRO SIGN}m", "um", "\N{GREEK SMALL LETTER MU}m"])
def test_sides_keep_their_unit_where_the_heights_have_none(tmp_path, heights, unit):
    pytest.importorskip("SurfaceTopography")
    header = f"# Width: 20.00 {unit}\n# Height: 10.00 {unit}\n"
    rows = (" ".join(map(str, row)) for row in heights)
    (tmp_path / "h.txt").write_text(header + "\n".join(rows), encoding="utf-8")
    surface = FileSurface(path=tmp_path / "h.txt", scale=1e-9)
    assert surface.sides == pytest.approx((10e-6, 20e-6))
    assert surface.heights(16) == pytest.approx(1e-9 * level(heights, "plane"))
    assert surface.warnings() == []
    (warning, *_) = FileSurface(path=tmp_path / "h.txt").warnings()
    assert "not of its heights" in warning


@pytest.mark.parametrize(("stated", "other"), [("Width", "Height"), ("Height", "Width")])
@pytest.mark.parametrize("unit", ["", "# Value units: nm\n"])
def test_a_header_with_one_side_is_refused(tmp_path, heights, stated, other, unit):
    pytest.importorskip("SurfaceTopography")
    rows = (" ".join(map(str, row)) for row in heights)
    (tmp_path / "h.txt").write_text(f"# {stated}: 20 um\n{unit}" + "\n".join(rows))
    with pytest.raises(InputError, match=rf"h\.txt: .*\({stated}\) alone; add .*# {other}: 20 um"):
        read_topography(tmp_path / "h.txt")


def test_a_profile_with_two_sides_is_refused(tmp_path, heights):
    pytest.importorskip("SurfaceTopography")
    column = "\n".join(map(str, heights.ravel()))
    (tmp_path / "h.txt").write_text(f"# Width: 20 um\n# Height: 12 um\n{column}\n")
    with pytest.raises(InputError, match=r"h\.txt: .* two sides, but the table has one column"):
        read_topography(tmp_path / "h.txt")


@pytest.mark.parametrize("mark", ["NA", "No data", "1.#QNAN", ""])
@pytest.mark.parametrize("by_rows", [True, False, None])
def test_positions_beside_a_mark_are_refused(tmp_path, heights, mark, by_rows):
    """The reader would take all rows up to it as the header: of a grid, whole rows or columns."""
    pytest.importorskip("SurfaceTopography")
    points = [(x, y, heights[y, x]) for y in range(16) for x in range(10)]
    if by_rows is None:
        points = [(x, heights[0, x]) for x in range(16)]
    elif not by_rows:
        points = sorted(points)
    lines = [" ".join(map(str, point)) for point in points]
    end = 10 if by_rows is None else 3 * (10 if by_rows else 16)
    lines[end - 1] = lines[end - 1].rpartition(" ")[0] + f" {mark}"
    (tmp_path / "h.txt").write_text("# x and height\n" + "\n".join(lines) + "\n")
    with pytest.raises(InputError, match=rf"h\.txt:{end + 1}: .* write NaN for a missing height"):
        read_topography(tmp_path / "h.txt")


def test_sides_do_not_get_the_unit_of_the_heights(tmp_path, heights):
    pytest.importorskip("SurfaceTopography")
    rows = "\n".join(" ".join(map(str, row)) for row in heights)
    header = "# Width: 20\n# Height: 15\n"
    path = tmp_path / "h.txt"
    path.write_text(f"{header}# Value units: nm\n{rows}")
    with pytest.raises(InputError, match=r"h\.txt: .* heights, nm, but not of the sides"):
        read_topography(path)
    path.write_text(header + rows)  # one unknown unit of all lengths
    assert read_topography(path).spacing == pytest.approx((15 / 16, 20 / 16))


@pytest.mark.parametrize("unit", ["", "# Value units: nm\n"])
def test_a_table_without_sides_gives_a_warning(tmp_path, heights, unit):
    pytest.importorskip("SurfaceTopography")
    rows = (" ".join(map(str, row)) for row in heights)
    (tmp_path / "h.txt").write_text(f"# Channel: a\n{unit}" + "\n".join(rows))
    warnings = FileSurface(path=tmp_path / "h.txt").warnings()
    assert "does not state its side in metres; L = 1 m is assumed" in warnings[0]


@pytest.mark.parametrize(("depth", "width"), [(2000, 0), (0, 11000)])
def test_the_search_for_a_map_in_many_groups_is_bounded(tmp_path, depth, width):
    path = tmp_path / "groups.h5"
    with h5py.File(path, "w") as file:
        file["map"] = np.cos(np.arange(256.0).reshape(16, 16))
        group = file
        for _ in range(depth):
            group = group.create_group("g")
        for i in range(width):
            file.create_group(f"g{i}")
    with pytest.raises(InputError, match=r"choose one by surface\.dataset"):
        read_topography(path)
    assert read_topography(path, "map").heights.shape == (16, 16)


@pytest.mark.parametrize(("line", "word"), [(1, "*"), (6, "---")])
def test_a_row_of_a_text_table_is_never_skipped(tmp_path, line, word):
    """SurfaceTopography skips it, which shifts the rows below."""
    pytest.importorskip("SurfaceTopography")
    heights = np.random.default_rng(0).standard_normal((8, 12))
    rows = [[f"{value:.9e}" for value in row] for row in heights]
    rows[line - 1][0] = word
    path = tmp_path / "h.txt"
    path.write_text("\n".join(" ".join(row) for row in rows))
    with pytest.raises(InputError, match=rf"h\.txt:{line}: .* is not a number; write NaN"):
        read_topography(path)


def test_words_around_a_text_table_are_no_rows(tmp_path):
    pytest.importorskip("SurfaceTopography")
    heights = np.random.default_rng(0).standard_normal((8, 12))
    rows = "\n".join(" ".join(f"{value:.9e}" for value in row) for row in heights)
    path = tmp_path / "h.txt"
    header = "# " + " ".join(["word"] * 11)  # as many words as columns
    path.write_text(f"{header}\n{rows}\nend of data\n")
    assert read_topography(path).heights.shape == (8, 12)


def test_a_table_whose_end_was_never_written_is_refused(tmp_path):
    """After a crash a file can end in zero bytes in the place of its last rows."""
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "h.txt"
    np.savetxt(path, np.random.default_rng(0).normal(size=(16, 16)))
    content = path.read_bytes()
    rows = content.splitlines(keepends=True)
    path.write_bytes(b"".join(rows[:9]).ljust(len(content), b"\0"))
    with pytest.raises(InputError, match=r"h\.txt:10: zero bytes in the table"):
        read_topography(path)


def test_a_text_that_looks_like_a_microscope_file_is_refused(tmp_path):
    """UTF-32 passes for a binary format, with sides of 1e-320 m."""
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "h.txt"
    rows = "\n".join(" ".join(map(str, row)) for row in np.eye(32))
    path.write_text(rows, encoding="utf-32")
    with pytest.raises(InputError, match=r"h\.txt: "):
        read_topography(path)
