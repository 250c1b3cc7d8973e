import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.physics.preparation import fill_missing, level, make_periodic
from gfmd_cli.physics.surface import FileSurface
from gfmd_cli.physics.topography import read_topography

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


def border_jump(heights):
    return max(abs(heights[0] - heights[-1]).max(), abs(heights[:, 0] - heights[:, -1]).max())


def inner_step(heights):
    return max(abs(np.diff(heights, axis=axis)).max() for axis in (0, 1))


# reading arrays


def test_a_saved_array_is_read_back_unchanged(npy, heights):
    read = read_topography(npy())
    np.testing.assert_array_equal(read.heights, heights)
    assert (read.length, read.periodic, read.source) == (None, None, "npy, float64")


@pytest.mark.parametrize("dtype", ["int16", "uint8", "float32", ">f8"])
def test_every_real_type_becomes_double_precision(npy, heights, dtype):
    stored = (10 * abs(heights)).astype(dtype)
    read = read_topography(npy(np.asfortranarray(stored))).heights
    np.testing.assert_array_equal(read, stored)
    assert read.dtype == np.float64
    assert read.dtype.isnative
    assert read.flags.c_contiguous


def test_the_only_map_of_an_hdf5_file_needs_no_name(hdf5, heights):
    read = read_topography(hdf5(x=np.arange(16.0), h=heights.astype("f4")))
    np.testing.assert_array_equal(read.heights, heights.astype("f4"))
    assert (read.length, read.periodic, read.source) == (None, None, "HDF5, h, float32")


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
    ("array", "told"),
    [
        (np.zeros((4, 16, 16)), "two dimensions"),
        (np.zeros(16), "two dimensions"),
        (np.zeros((16, 18)), "16 x 18 points"),
        (np.zeros((17, 17)), "17 x 17 points"),
        (np.zeros((6, 6)), "at least 8"),
        (np.zeros((0, 0)), "0 x 0 points"),
        (np.zeros((16, 16), complex), "complex128"),
        (np.zeros((16, 16), bool), "bool"),
        (np.full((16, 16), "1.0"), "<U3"),
        (np.zeros((16, 16), [("h", "f8")]), "real numbers"),
    ],
)
def test_what_is_no_square_map_of_real_numbers_is_refused(npy, array, told):
    with pytest.raises(InputError, match=f"h.npy: .*{told}"):
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
    with pytest.raises(InputError, match=r"2 of 256 heights .* row 3, column 5"):
        read_topography(npy(heights))


def test_heights_marked_as_missing_in_hdf5_are_located(hdf5):
    stored = np.arange(256).reshape(16, 16)

    def mark(file):
        file["h"].attrs["_FillValue"] = np.array([18])

    with pytest.raises(InputError, match=r"1 of 256 heights .* row 1, column 2"):
        read_topography(hdf5(mark, h=stored))


def test_packed_netcdf_heights_are_refused(hdf5, heights):
    def pack(file):
        file["h"].attrs["scale_factor"] = 0.5

    with pytest.raises(InputError, match=r"packed .scale_factor"):
        read_topography(hdf5(pack, h=heights))


def test_a_map_beyond_the_size_limit_is_refused(npy, hdf5, heights):
    for path in (npy(), hdf5(h=heights)):
        with pytest.raises(InputError, match="take 2048 bytes; at most 2047"):
            read_topography(path, max_bytes=2047)
        assert read_topography(path, max_bytes=2048).heights.shape == (16, 16)


def test_no_file_a_directory_and_an_empty_file_are_told_apart(tmp_path):
    (tmp_path / "empty.npy").touch()
    for name, told in (("none.npy", "no such file"), ("", "a directory"), ("empty.npy", "empty")):
        with pytest.raises(InputError, match=told):
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


def test_two_maps_and_an_unknown_name_list_the_candidates(hdf5, heights):
    path = hdf5(a=heights, b=heights, x=np.arange(16.0))
    for dataset, told in ((None, "name one dataset"), ("c", "no dataset 'c'")):
        with pytest.raises(InputError, match=f"{told}.*: a, b$"):
            read_topography(path, dataset)


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
        with pytest.raises(InputError, match="kept in other files"):
            read_topography(hdf5(fill))


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
    assert scan.length == pytest.approx(10e-6)
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


def test_a_scan_beyond_the_size_limit_is_refused():
    pytest.importorskip("SurfaceTopography")
    for limit in (SCAN.stat().st_size - 1, 256 * 256 * 8 - 1):
        with pytest.raises(InputError, match=f"at most {limit}"):
            read_topography(SCAN, max_bytes=limit)


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
    assert read.length == pytest.approx(2e-6)


def test_a_map_without_size_and_unit_has_no_length(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / "h.txt"
    np.savetxt(path, np.arange(64.0).reshape(8, 8))
    read = read_topography(path)
    np.testing.assert_array_equal(read.heights, np.arange(64.0).reshape(8, 8))
    assert read.length is None


def test_a_scan_of_an_oblong_area_is_refused(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = write_text_map(tmp_path / "h.txt", height="2.5 um")
    with pytest.raises(InputError, match=r"3.125e-07 x 2.5e-07 wide .relative difference 2.0e-01"):
        read_topography(path)


def test_missing_points_of_a_scan_are_located(tmp_path):
    pytest.importorskip("SurfaceTopography")
    path = write_text_map(tmp_path / "h.txt", first="nan")
    with pytest.raises(InputError, match=r"1 of 64 heights .* row 0, column 0"):
        read_topography(path)


@pytest.mark.parametrize("content", [b"no heights here\n", bytes(2 * 8 * 8), b"\x00\xff" * 999])
def test_an_unknown_format_is_refused(tmp_path, content):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.dat").write_bytes(content)
    with pytest.raises(InputError, match="no known topography format"):
        read_topography(tmp_path / "h.dat")


def test_an_array_is_known_by_its_content(npy, heights):
    path = npy()
    read = read_topography(path.rename(path.with_suffix(".dat")))
    np.testing.assert_array_equal(read.heights, heights)


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


def test_without_surfacetopography_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    monkeypatch.delitem(sys.modules, "SurfaceTopography.IO", raising=False)
    with pytest.raises(InputError, match=r"pip install gfmd-cli\[topography\]"):
        read_topography(SCAN)


def test_arrays_are_read_without_loading_surfacetopography(npy):
    code = (
        "import sys; from pathlib import Path; "
        "from gfmd_cli.physics.topography import read_topography; "
        f"read_topography(Path({str(npy())!r})); "
        "assert not {'SurfaceTopography', 'h5py'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# levelling and edges


@pytest.mark.parametrize(("degree", "removed"), [("mean", 1), ("plane", 3), ("curvature", 6)])
def test_levelling_removes_its_polynomial_to_rounding(degree, removed):
    y, x = np.mgrid[:32, :32] / 32
    terms = [np.ones_like(x), x, y, x * x, x * y, y * y, x**3]
    trend = sum(c * t for c, t in zip((5, -2, 1, 3, -1, 2), terms[:removed], strict=False))
    assert abs(level(trend, degree)).max() < 1e-13
    assert level(terms[removed], degree).std() > 1e-3


def test_levelling_is_least_squares(heights):
    y, x = np.mgrid[:16, :16]
    design = np.stack([np.ones(256), x.ravel(), y.ravel()], axis=1)
    fit, *_ = np.linalg.lstsq(design, heights.ravel(), rcond=None)
    np.testing.assert_allclose(
        level(heights, "plane"), heights - (design @ fit).reshape(16, 16), atol=1e-13
    )


def test_levelling_keeps_its_input(heights):
    before = heights.copy()
    level(heights, "curvature")
    np.testing.assert_array_equal(heights, before)
    np.testing.assert_array_equal(level(heights, "none"), before)


def test_the_window_takes_the_border_to_the_mean():
    y, x = np.mgrid[:64, :64] / 64
    slope = 3 + x + 2 * y
    windowed = make_periodic(slope, "window")
    np.testing.assert_allclose(windowed[0], slope.mean())
    np.testing.assert_allclose(windowed[:, 0], slope.mean())
    assert border_jump(slope) > 10 * inner_step(slope)
    assert border_jump(windowed) <= inner_step(windowed)


def test_the_window_keeps_the_inner_heights_and_lowers_h_std(heights):
    windowed = make_periodic(heights, "window", taper=0.25)
    np.testing.assert_allclose(windowed[4:13, 4:13], heights[4:13, 4:13], atol=1e-14)
    assert windowed.std() < heights.std()


@pytest.mark.parametrize("taper", [0.0, 0.6, np.nan])
def test_a_taper_outside_its_range_is_refused(heights, taper):
    with pytest.raises(ValueError, match="taper"):
        make_periodic(heights, "window", taper)


def test_the_mirror_keeps_every_height_four_times(heights):
    mirrored = make_periodic(heights, "mirror")
    assert mirrored.shape == (32, 32)
    np.testing.assert_array_equal(mirrored[:16, :16], heights)
    np.testing.assert_array_equal(
        np.sort(mirrored, axis=None), np.repeat(np.sort(heights, None), 4)
    )
    np.testing.assert_array_equal(mirrored, mirrored[::-1, ::-1])
    assert border_jump(mirrored) == 0


def test_no_edge_treatment_leaves_the_heights(heights):
    assert make_periodic(heights, "none") is heights


# maps that are not square, or have holes


def test_the_middle_of_an_oblong_map_is_taken_as_asked(npy):
    heights = np.arange(9.0 * 13).reshape(9, 13)
    with pytest.raises(InputError, match=r"9 x 13 points.*surface.crop = true takes 8 x 8"):
        read_topography(npy(heights))
    read = read_topography(npy(heights), crop=True)
    np.testing.assert_array_equal(read.heights, heights[:8, 2:10])
    assert read.shape == (9, 13)


def test_a_cropped_scan_keeps_the_size_of_its_points(tmp_path):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "h.txt").write_text(
        "# Width: 3 um\n# Height: 2 um\n# Value units: nm\n"
        + "\n".join(" ".join(str(i * j % 7) for j in range(12)) for i in range(8))
    )
    read = read_topography(tmp_path / "h.txt", crop=True)
    assert read.heights.shape == (8, 8)
    assert read.length == pytest.approx(2e-6)


def test_holes_are_refused_with_the_remedy_or_filled(npy, heights):
    heights[3, 4:7] = np.nan
    with pytest.raises(InputError, match=r'3 of 256 heights .* surface.missing = "fill"'):
        read_topography(npy(heights))
    read = read_topography(npy(heights), fill=True)
    assert read.filled == 3
    known = np.isfinite(heights)
    np.testing.assert_array_equal(read.heights[known], heights[known])


def test_too_many_holes_are_not_filled(npy, heights):
    heights[:8] = np.nan
    with pytest.raises(InputError, match="at most 20% can be filled in"):
        read_topography(npy(heights), fill=True)


def test_a_hole_in_a_harmonic_surface_is_filled_exactly():
    """x y and x^2 - y^2 solve the discrete Laplace equation."""
    y, x = np.mgrid[:20, :20].astype(float)
    for exact in (x * y, x**2 - y**2, 3 + x - 2 * y):
        missing = np.zeros(exact.shape, dtype=bool)
        missing[5:12, 3:15] = missing[16, 16] = True
        holed = np.where(missing, np.nan, exact)
        np.testing.assert_allclose(fill_missing(holed, missing), exact, atol=1e-10)


def test_a_filled_hole_lies_between_its_rim(heights):
    """The maximum principle, at the border of the map, too."""
    missing = np.random.default_rng(3).random(heights.shape) < 0.15
    missing[0, 0] = missing[-1, 5:8] = True
    filled = fill_missing(np.where(missing, np.nan, heights), missing)
    assert filled.min() == heights[~missing].min()
    assert filled.max() == heights[~missing].max()


def test_a_side_without_a_unit_is_in_that_of_the_heights(tmp_path):
    pytest.importorskip("SurfaceTopography")
    rows = (f"{x}e-8 {y}e-8 {(x * y) % 5}e-9" for y in range(16) for x in range(16))
    (tmp_path / "h.xyz").write_text("\n".join(rows))
    read = read_topography(tmp_path / "h.xyz")
    assert not read.metres
    assert read.length == pytest.approx(16e-8)
    plain = FileSurface(path=tmp_path / "h.xyz")
    assert plain.cell == pytest.approx(16e-8)
    assert FileSurface(path=tmp_path / "h.xyz", scale=1e-3).cell == pytest.approx(16e-11)
    assert FileSurface(path=tmp_path / "h.xyz", length=2.0).cell == 2.0
