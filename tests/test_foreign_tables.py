"""Tables as spreadsheets, stages and geographic programs write them: rounded, quoted, marked."""

import re
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps import map_warnings
from gfmd_cli.maps.microscope_files import _height_channel
from gfmd_cli.maps.topography import Region, read_topography
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine

pytest.importorskip("SurfaceTopography")
HEIGHTS = np.random.default_rng(2).normal(size=(12, 300)).round(6)


@pytest.fixture
def saved(tmp_path):
    """Writes a file of this content."""

    def write(content, encoding="utf-8"):
        path = tmp_path / "map.txt"
        path.write_bytes(content.encode(encoding))
        return path

    return write


def _rough(hurst, points=128):
    """A part of a self-affine surface [1e-9 m], without roll-off."""
    field = SelfAffine(hurst=hurst, cutoff=0.01, rolloff=1.0).heights_on(Grid(4 * points))
    return 1e-9 * field[:points, :points] / field.std()


def points(along_x, along_y, digits=3, separator=" "):
    """Points (x, y, height) in text."""
    rows = (
        (f"{x:.{digits}f}", f"{y:.{digits}f}", f"{HEIGHTS[j, i]:.6f}")
        for j, y in enumerate(along_y)
        for i, x in enumerate(along_x)
    )
    return "".join(separator.join(row) + "\n" for row in rows)


def matrix(separator=",", quote="", decimal=".", heights=HEIGHTS):
    rows = (
        [f"{quote}{value:.6f}{quote}".replace(".", decimal) for value in row] for row in heights
    )
    return "".join(separator.join(row) + "\n" for row in rows)


@pytest.mark.parametrize("digits", [2, 3, 5])
@pytest.mark.parametrize("separator", [" ", ";"])
def test_rounded_positions_are_even(saved, digits, separator):
    """The first distance, 0.33, is that of no other pair of many points."""
    text = points(np.arange(300) / 3, 7 + np.arange(12) / 3, digits, separator)
    read = read_topography(saved("x [um] y [um] z [nm]\n" + text))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((1e-6 / 3, 1e-6 / 3), rel=2e-3)


@pytest.mark.parametrize("spacing", [0.0213, 0.0391, 0.069])
@pytest.mark.parametrize("is_profile", [False, True])
def test_positions_of_few_digits_are_even(saved, spacing, is_profile):
    """The rounding is up to a quarter of the spacing."""
    along_x, along_y = spacing * np.arange(-150, 150), spacing * np.arange(1 if is_profile else 12)
    text = points(along_x, along_y, digits=2)
    if is_profile:
        text = "".join("{} {}\n".format(*line.split()[::2]) for line in text.splitlines())
    read = read_topography(saved(text))
    np.testing.assert_array_equal(read.heights, HEIGHTS[0] if is_profile else HEIGHTS)
    assert read.spacing[-1] == pytest.approx(spacing, rel=2e-3)
    assert read.spacing[0] == pytest.approx(spacing, rel=0.05)


def test_positions_of_few_digits_in_powers_of_ten_are_even(saved):
    """The largest are rounded most."""
    rows = (
        f"{3.91e-7 * i:.2e} {3.91e-7 * j:.2e} {HEIGHTS[j, i]:.6f}\n"
        for j in range(12)
        for i in range(0, 30)
    )
    read = read_topography(saved("".join(rows)))
    np.testing.assert_array_equal(read.heights, HEIGHTS[:, :30])


@pytest.mark.parametrize("digits", [1, 2])
def test_positions_of_few_digits_that_are_uneven_are_refused(saved, digits):
    """Their rounding, at most a tenth of the spacing, does not explain the deviation."""
    bent = 0.51 * (np.arange(40) + 0.25 * np.sin(np.arange(40) / 6))
    with pytest.raises(InputError, match="along x are not evenly spaced: they deviate"):
        read_topography(saved(points(bent, 0.5 * np.arange(12), digits)))


def test_positions_of_a_stage_that_jitters_are_even(saved):
    jitter = np.random.default_rng(1).uniform(-0.02, 0.02, (12, 300, 2))
    y, x = np.indices(HEIGHTS.shape)
    table = np.column_stack([(x + jitter[..., 0]).ravel(), (y + jitter[..., 1]).ravel()])
    rows = np.column_stack([table, HEIGHTS.ravel()])
    read = read_topography(saved("".join(" ".join(map(str, row)) + "\n" for row in rows)))
    np.testing.assert_array_equal(read.heights, HEIGHTS)
    assert read.spacing == pytest.approx((1.0, 1.0), rel=1e-3)


@pytest.mark.parametrize(
    ("order", "header", "separator"),
    [
        ("yxz", "y [mm] x [um] z [nm]", " "),
        ("zxy", "z_nm,x_um,y_mm", ","),
        ("zyx", "# height (nm)  Y position (mm)  X position (um)", "\t"),
        ("yxz", "Y;X;Value\n[mm];[um];[nm]", ";"),
        ("zxy", "nm um mm\nz x y", " "),
    ],
)
def test_the_header_states_the_order_of_the_columns(saved, order, header, separator):
    y, x = np.indices(HEIGHTS.shape)
    columns = {"x": 0.5 * x, "y": 0.25 * y, "z": HEIGHTS}
    rows = zip(*(columns[name].ravel() for name in order), strict=True)
    read = read_topography(
        saved(f"{header}\n" + "".join(separator.join(map(str, row)) + "\n" for row in rows))
    )
    assert read.heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.25e-3, 0.5e-6))


def test_a_profile_may_begin_with_its_heights(saved):
    rows = "".join(f"{HEIGHTS[0, i]} {0.5 * i}\n" for i in range(300))
    read = read_topography(saved("z [nm] x [um]\n" + rows))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS[0], rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.5e-6,))


@pytest.mark.parametrize(
    ("unit", "metres"), [("inch", 0.0254), ("in", 0.0254), ("km", 1e3), ("cm", 1e-2)]
)
def test_other_units_of_length_are_converted(saved, unit, metres):
    text = points(np.arange(300), np.arange(12))
    read = read_topography(saved(f"x [{unit}] y [{unit}] z [{unit}]\n{text}"))
    assert read.heights == pytest.approx(metres * HEIGHTS)
    assert read.spacing == pytest.approx((metres, metres))


@pytest.mark.parametrize("header", ["x [foo] y [foo] z [foo]", "# Lateral units: foo"])
def test_an_unknown_unit_in_a_header_is_refused(saved, header):
    text = points(np.arange(300), np.arange(12))
    with pytest.raises(InputError, match="header of the table states the unit 'foo'; known are km"):
        read_topography(saved(f"{header}\n{text}"))


@pytest.mark.parametrize("header", ["", "# version 3 (beta), at 12:30 pm\n", "X Y Z [1]\n"])
def test_a_header_without_units_states_none(saved, header):
    read = read_topography(saved(header + points(np.arange(300), np.arange(12))))
    assert (read.metric_sides, read.spacing) == (False, pytest.approx((1.0, 1.0)))


@pytest.mark.parametrize("header", ["# profile of 20 um", "Unit: um\nx z", "x z\n# um"])
def test_a_unit_that_is_not_that_of_a_column_of_a_profile_is_refused(saved, header):
    with pytest.raises(InputError, match=r"each of the 2 columns, as 'x \[um\] z \[nm\]' does"):
        read_topography(saved(f"{header}\n0 1\n1 4\n2 3\n3 1\n"))


@pytest.mark.parametrize("sentence", ["# measured in nm steps", "# by a tip of 20 um"])
def test_a_unit_in_a_sentence_beside_units_of_all_columns_is_not_read(saved, sentence):
    text = points(np.arange(300), np.arange(12))
    for names, example in (("x [um] y [um] z [nm]", ""), ("x y z", "x [um] y [um] z [nm]")):
        for header in (f"{names}\n{sentence}\n", f"{sentence}\n{names}\n"):
            path = saved(header + text)
            if example:
                with pytest.raises(InputError, match=re.escape(example)):
                    read_topography(path)
            else:
                assert read_topography(path).spacing == pytest.approx((1e-6, 1e-6))


def test_a_profile_of_one_point_is_refused(saved):
    with pytest.raises(InputError, match="1 points; at least 2 along each axis are needed"):
        read_topography(saved("1 2\n"))


def test_units_of_the_positions_alone_leave_the_heights_to_scale(saved):
    text = points(np.arange(300), np.arange(12))
    surface = FileSurface(path=saved(f"x [um] y [um] z\n{text}"))
    assert surface.sides == pytest.approx((12e-6, 300e-6))
    assert any("but not of its heights" in each for each in surface.warnings())


@pytest.mark.parametrize("mark", ["BAD", "nan", "Inf"])
def test_known_marks_are_missing_heights_in_every_table(saved, mark):
    number = f"{HEIGHTS[5, 7]:.6f}"
    for text in (points(np.arange(300), np.arange(12)), matrix(" ")):
        assert text.count(number) == 1
        read = read_topography(saved(text.replace(number, mark)))
        assert np.argwhere(read.missing).tolist() == [[5, 7]]


def test_a_mark_of_two_words_in_a_matrix_is_refused(saved):
    """Its row has a word more than the others."""
    text = matrix(" ").replace(f"{HEIGHTS[5, 7]:.6f}", "No Data")
    with pytest.raises(InputError, match=r"map\.txt:6: 'No' in a row of the table"):
        read_topography(saved(text))


@pytest.mark.parametrize("size", ["300 12", "12\t300"])
def test_a_matrix_below_its_size(saved, size):
    np.testing.assert_array_equal(read_topography(saved(f"{size}\n{matrix(' ')}")).heights, HEIGHTS)
    with pytest.raises(InputError, match="line 1 has 2 numbers, most rows 300"):
        read_topography(saved(f"300 13\n{matrix(' ')}"))


def test_a_second_matrix_without_a_line_between_is_refused(saved):
    """The reader would join maps whose headers do not name different channels."""
    one = f"# Width: 20 um\n# Height: 6 um\n# Value units: nm\n{matrix(' ')}"
    with pytest.raises(InputError, match=r"map\.txt:16: words between two rows of the table"):
        read_topography(saved(2 * one))
    two = f"# Channel: a\n{one}# Channel: b\n{one}"
    assert read_topography(saved(two)).heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)


def test_lines_of_comments_below_the_header_of_positions_are_left_out(saved):
    """As the last line of Zygo's tables."""
    read = read_topography(saved(points(np.arange(300), np.arange(12)) + "#\n"))
    np.testing.assert_array_equal(read.heights, HEIGHTS)


def test_the_side_of_a_part_of_positions_without_unit_gives_a_warning(saved):
    path = saved(points(np.arange(300), np.arange(12)))
    part = Region.model_validate({"x": [0, 30]})
    (warning,) = (
        each
        for each in FileSurface(path=path, region=part, length=3e-6).warnings()
        if "surface.length" in each and "part" in each
    )
    assert "30 of 300 points; if the whole map has this side, set 3e-07" in warning


def test_many_scattered_points_are_refused_as_such(saved):
    rows = np.random.default_rng(1).random((30_000, 3)).round(4)
    with pytest.raises(InputError, match="three columns that are not the points"):
        read_topography(saved("".join(" ".join(map(str, row)) + "\n" for row in rows)))


@pytest.mark.parametrize("position", ["nan", "inf"])
def test_a_position_that_is_not_finite_is_refused(saved, position):
    table = f"{position} 0 1\n{points(np.arange(20), np.arange(12))}"
    with pytest.raises(InputError, match="a position in the table is missing or infinite"):
        read_topography(saved(table))


def test_uneven_positions_are_refused_with_their_deviation(saved):
    bent = np.arange(40) + 0.1 * np.sin(np.arange(40) / 6)
    with pytest.raises(InputError, match=r"along x are not evenly.* deviate by up to 0\.\d+ of"):
        read_topography(saved(points(bent, np.arange(12))))
    with pytest.raises(InputError, match="positions along y are not evenly spaced"):
        read_topography(saved(points(np.arange(40), np.arange(12) ** 1.5)))


@pytest.mark.parametrize("mark", ["---", "***", "No Data"])
def test_a_mark_far_below_the_first_point_is_named(saved, mark):
    lines = points(np.arange(300), np.arange(12)).splitlines()
    lines[1000] = " ".join([*lines[1000].split()[:2], mark])
    with pytest.raises(InputError, match=r"map\.txt:1001: .*write NaN for a missing height"):
        read_topography(saved("\n".join(lines)))


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", ",")]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_quoted_numbers(saved, separator, decimal, encoding):
    path = saved(matrix(separator, '"', decimal), encoding)
    np.testing.assert_array_equal(read_topography(path).heights, HEIGHTS)


def test_quoted_positions(saved):
    text = points(np.arange(300), np.arange(12), separator='","').replace("\n", '"\n"')
    path = saved('"x [um]","y [um]","z [nm]"\n"' + text.removesuffix('"'), "utf-8-sig")
    assert read_topography(path).heights == pytest.approx(1e-9 * HEIGHTS, rel=1e-9, abs=0)


def test_quoted_decimal_commas_between_commas_are_refused(saved):
    with pytest.raises(InputError, match="has a comma in quotes and one as separator"):
        read_topography(saved(matrix(",", '"', ",")))


@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("separator", [",", ";"])
def test_an_empty_cell_is_refused_as_such(saved, separator, quote):
    lines = matrix(separator, quote).splitlines()
    cells = lines[0].split(separator)
    cells[1] = 2 * quote
    with pytest.raises(InputError, match="an empty cell in a row of numbers; write NaN"):
        read_topography(saved("\n".join([separator.join(cells), *lines[1:]])))


def test_a_numbered_profile_has_the_units_of_its_header(saved):
    rows = "".join(f'"{i + 1}","{0.277 * i:.3f}","{HEIGHTS[0, i]:.6f}"\n' for i in range(300))
    read = read_topography(saved('"No.","Horz. [um]","Height [nm]"\n' + rows))
    assert read.heights == pytest.approx(1e-9 * HEIGHTS[0], rel=1e-9, abs=0)
    assert read.spacing == pytest.approx((0.277e-6,))


@pytest.mark.parametrize("separator", ["\t", ";"])
def test_blanks_that_separate_thousands_are_refused(saved, separator):
    """They would double the columns."""
    rows = ([f"1 {abs(100 * value):03.0f},5" for value in row] for row in HEIGHTS)
    with pytest.raises(InputError, match=r"1 \d\d\d,5: blanks separate thousands"):
        read_topography(saved("\n".join(separator.join(row) for row in rows)))


@pytest.mark.parametrize("quote", ["", '"'])
def test_units_in_a_header_that_is_not_read_give_a_warning(saved, quote):
    header = '"XY calibration","138.5","nm/pixel"\n"Unit","µm"\n"Height"\n'
    path = saved(header.replace('"', quote) + matrix(",", quote))
    (warning, *_) = FileSurface(path=path).warnings()
    assert "states units (nm, µm), which are not read: set surface.length and" in warning


def test_the_unit_of_a_single_column_gives_a_warning(saved):
    """As NanoScope exports heights, one below the other."""
    path = saved("Height_Sensor(nm)\t\n" + "".join(f"{height}\n" for height in HEIGHTS[0]))
    assert any("states units (nm), which" in each for each in FileSurface(path=path).warnings())


def test_a_time_in_a_header_is_no_unit(saved):
    path = saved("# measured at 3:15 pm\n" + matrix(" "))
    assert not any("states units" in each for each in FileSurface(path=path).warnings())


@pytest.mark.parametrize("name", ["scan.tif", "scan.tiff"])
def test_an_image_without_heights_is_refused_as_such(tmp_path, name):
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.arange(4096, dtype=np.uint16).reshape(64, 64)).save(tmp_path / name)
    with pytest.raises(InputError, match="no height channel, as in an image of grey values"):
        read_topography(tmp_path / name)


@pytest.mark.parametrize("digits", [".1f", ".2f", ".4f", ".4e"])
@pytest.mark.parametrize("thousands", ["", "."])
def test_decimal_commas_between_commas_are_refused(saved, digits, thousands):
    """123,4,-5,6 are two numbers; as four they would be a map of twice the width."""
    rows = (
        ",".join(f"{value:,{digits}}".translate({44: thousands, 46: ","}) for value in row)
        for row in 3000 * HEIGHTS
    )
    with pytest.raises(InputError, match="that a comma or blank has divided"):
        read_topography(saved("\n".join(rows)))


@pytest.mark.parametrize("decimals", ["", ".20", ",20"])
def test_blanks_that_separate_thousands_beside_commas_are_refused(saved, decimals):
    """1,6 045.20 is not the height 45.2 at x = 1.6."""
    heights = (5000 + 900 * HEIGHTS[0]).clip(1000)
    rows = (f"{i},{height:_.0f}{decimals}" for i, height in enumerate(heights))
    with pytest.raises(InputError, match="that a comma or blank has divided"):
        read_topography(saved("\n".join(rows).replace("_", " ")))


def test_numbers_of_one_length_may_begin_with_zeros(saved):
    heights = np.random.default_rng(3).integers(1000, size=(12, 40))
    text = "\n".join(",".join(f"{value:04d}" for value in row) for row in heights)
    assert np.array_equal(read_topography(saved(text)).heights, heights)
    marked = read_topography(saved(text.replace(f"{heights[2, 3]:04d}", "NaN")))
    assert np.array_equal(marked.missing, heights == heights[2, 3])


def test_grey_values_of_three_digits_in_every_second_column_are_heights(saved):
    heights = np.random.default_rng(3).integers(100, 256, size=(12, 40))
    heights[4, 6] = 98
    text = "\n".join(",".join(map(str, row)) for row in heights)
    assert np.array_equal(read_topography(saved(text)).heights, heights)


@pytest.mark.parametrize("separator", [" ", ","])
@pytest.mark.parametrize("is_profile", [False, True])
def test_numbers_of_points_may_begin_with_zeros(saved, separator, is_profile):
    rows, columns = (1, 200) if is_profile else (12, 40)
    heights = HEIGHTS[:rows, :columns]
    places = product(range(rows), range(columns))
    words = ([f"{j:03d}", f"{i:03d}"][: 2 - is_profile] for i, j in places)
    lines = (
        separator.join([*place, f"{height:.6f}"])
        for place, height in zip(words, heights.ravel(), strict=True)
    )
    read = read_topography(saved("\n".join(lines)))
    assert read.heights == pytest.approx(heights.squeeze(), abs=1e-6)


def test_a_byte_order_mark_hides_no_point(saved):
    """Positions such as 2 and 1,5 have no constant number of columns between commas."""
    rows = (f"{i / 2:g} {height:.6f}\n" for i, height in enumerate(HEIGHTS[0]))
    read = read_topography(saved("".join(rows).replace(".", ","), "utf-8-sig"))
    assert read.heights == pytest.approx(HEIGHTS[0])


GRID = "NCOLS 300\nnrows 12\nxllcorner 5.0\nyllcorner 0\ncellsize 0.5\n"


@pytest.mark.parametrize("stated", ["NODATA_value -9999\n", "nodata_value -9999.00\n", ""])
@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_an_esri_grid_has_sides_and_no_height_without_data(saved, stated, decimal, encoding):
    marked = HEIGHTS.copy()
    marked[-4, 4] = -9999
    header = (GRID + stated).replace(".", decimal)
    text = header + matrix(" ", decimal=decimal, heights=marked)
    read = read_topography(saved(text, encoding))
    assert np.argwhere(read.missing).tolist() == [[3, 4]]
    assert read.heights[~read.missing] == pytest.approx(np.delete(HEIGHTS[::-1], 3 * 300 + 4))
    assert (read.spacing, read.metric_sides, read.periodic) == ((0.5, 0.5), False, False)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("12", "13", "300 x 12 heights, but the header states 300 x 13"),
        ("cellsize 0.5\n", "", "has no cellsize"),
    ],
)
def test_a_wrong_header_of_an_esri_grid_is_refused(saved, old, new, reason):
    with pytest.raises(InputError, match=reason):
        read_topography(saved(GRID.replace(old, new) + matrix(" ")))


@pytest.mark.parametrize("word", ["1_2", "x"])
@pytest.mark.parametrize(("old", "line"), [(" 0.5\n", 5), (" {}\n", 7)])
def test_a_word_in_an_esri_grid_that_is_no_number_is_named(saved, old, line, word):
    text = GRID + matrix(" ")
    second = text.splitlines(keepends=True)[6]
    old = old.format(second.split()[-1])
    with pytest.raises(InputError, match=rf":{line}: '{word}' is not a number"):
        read_topography(saved(text.replace(old, f" {word}\n", 1)))


@pytest.mark.parametrize("parts", [(50, 250), (100,) * 3, (299, 1)])
def test_a_row_of_an_esri_grid_may_have_several_lines(saved, parts):
    rows = (np.split(row, np.cumsum(parts)[:-1]) for row in HEIGHTS)
    text = "".join(matrix(" ", heights=[part]) for row in rows for part in row)
    assert read_topography(saved(GRID + text)).heights == pytest.approx(HEIGHTS[::-1])


def test_an_esri_grid_is_the_map_of_its_points(saved):
    """Its first row is the northern one, so that the y of the rows decreases."""
    points = (
        f"{5 + j / 2} {11 - i} {height}\n" for (i, j), height in np.ndenumerate(HEIGHTS[:, ::20])
    )
    of_points = read_topography(saved("".join(points)))
    text = GRID.replace("300", "15") + matrix(" ", heights=HEIGHTS[:, ::20])
    assert read_topography(saved(text)).heights == pytest.approx(of_points.heights)


@pytest.mark.parametrize("shape", [(300, 12), (9, 400), (4, 900)])
def test_an_esri_grid_whose_rows_begin_within_lines_is_refused(saved, shape):
    """Also one of interchanged rows and columns: a line of 12 could be a part of a row of 300."""
    reason = f"{shape[1]} x {shape[0]} heights, but the header states 300 x 12"
    with pytest.raises(InputError, match=reason):
        read_topography(saved(GRID + matrix(" ", heights=HEIGHTS.reshape(shape))))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
@pytest.mark.parametrize(
    "first", ["aBCR-1.0", "aISO-1.0", "aNIST-1.0", "DSAA", "Zygo XYZ Data File - Format 1"]
)
def test_text_formats_with_scales_that_are_not_read_are_refused(saved, first, encoding):
    content = f"{first}\nZscale = 1e-9\n*\n" + matrix(" ")
    with pytest.raises(InputError, match="in text, whose header is not read; save it") as error:
        read_topography(saved(content, encoding))
    assert ("binary form" in str(error.value)) == (first != "DSAA")  # of Surfer, none is read


def test_points_of_zygo_with_pixels_and_micrometres_are_refused_as_such(saved):
    """Positions are numbers of pixels, heights are in um, and the header has the distance in m."""
    header = "Zygo XYZ Data File - Format 1\n0 0 0 0\n0 0.5 6.328e-07 0 1 0 5.067e-05 0\n#\n"
    with pytest.raises(InputError, match="a file of Zygo in text, whose header is not read"):
        read_topography(saved(header + points(np.arange(300), np.arange(12), 0) + "#\n"))


SIZED = "# Width: 20 um\n# Height: 12 um\n# Value units: nm\n"


@pytest.mark.parametrize(("digits", "sides"), [(2, ""), (3, ""), (4, ""), (9, SIZED)])
@pytest.mark.parametrize("is_row", [True, False])
def test_positions_beside_a_matrix_are_refused(saved, digits, sides, is_row):
    """Rounded ones, too, unless the header states the sides; a height beside them is missing."""
    heights = np.random.default_rng(0).normal(size=(40, 40))
    heights[1, 7] = heights[7, -2] = np.nan
    positions = np.round(np.arange(40) / 25.6, digits)
    heights[(0, slice(None)) if is_row else (slice(None), -1)] = positions
    word = "row" if is_row else "column"
    with pytest.raises(InputError, match=f"a {word} of the table is .* positions or numbers"):
        read_topography(saved(sides + matrix(" ", heights=heights)))


def test_a_smooth_slope_is_not_taken_for_positions(saved):
    """With a grain of dust beside a border."""
    slope = np.arange(40.0) + 0.02 * np.random.default_rng(0).normal(size=(40, 40))
    slope[1, 20] += 10
    for sides in ("", SIZED):
        assert read_topography(saved(sides + matrix(" ", heights=slope))).heights.shape == (40, 40)


def test_a_strip_of_a_slope_is_a_map(saved):
    """All its columns rise."""
    slope = np.arange(64.0)[:, None] + 0.1 * np.random.default_rng(0).normal(size=(64, 8))
    for sides in ("", SIZED):
        assert read_topography(saved(sides + matrix(" ", heights=slope))).heights.shape == (64, 8)


def test_points_with_normals_or_colours_are_refused(saved):
    y, x = np.indices((12, 30))
    table = np.column_stack([x.ravel(), y.ravel(), np.random.default_rng(0).normal(size=(360, 4))])
    with pytest.raises(InputError, match="one of 6 columns is sorted"):
        read_topography(saved(matrix(" ", heights=table)))


@pytest.mark.parametrize("side", ["0 um", "-3 um"])
def test_a_side_that_is_not_positive_is_refused_as_such(saved, side):
    with pytest.raises(InputError, match="they must be positive"):
        read_topography(saved(SIZED.replace("12 um", side) + matrix(" ")))


@pytest.mark.parametrize("line", ["# Max Height: 2.0 um", "# pixel size = 0.25 um"])
def test_another_line_of_the_header_changes_no_side(saved, line):
    other = SIZED + "# Pixel: 0.1 um\n# Tip: 8 nm\n"
    for header in (SIZED, other, other.replace("# Width", "# Scan Width")):
        assert FileSurface(path=saved(header + matrix(" "))).sides == pytest.approx((12e-6, 20e-6))
    with pytest.raises(InputError, match="another line makes them"):
        read_topography(saved(SIZED + line + "\n" + matrix(" ")))


@pytest.mark.parametrize(
    ("rows", "is_cut_off"), [(96, False), (70, True), (92, True), (48, False), (24, False)]
)
def test_a_table_with_fewer_rows_than_its_sides_may_be_cut_off(saved, rows, is_cut_off):
    """A scan may have a half or a quarter of the lines."""
    heights = np.random.default_rng(0).normal(size=(rows, 96))
    sides = "# Width: 96 um\n# Height: 96 um\n# Value units: nm\n"
    notes = read_topography(saved(sides + matrix(" ", heights=heights))).notes
    expected = f"96 x {rows} heights make pixels of 1e-06 m x {96e-6 / rows:.3g} m: is the table"
    assert [expected in note for note in notes] == [True] * is_cut_off


def test_units_of_sides_that_are_not_read_give_a_warning(saved):
    header = "# Width [um]: 20\n# Height [um]: 12\n# Tip: 8 mm\n# Value units: nm\n"
    (note,) = read_topography(saved(header + matrix(" "))).notes
    assert "states units (um, um), which are not read" in note


@pytest.mark.parametrize(
    ("factor", "unit_y", "words"), [("0.1", "um", "Scale Data = 0.1"), ("1", "nm", "Unit Y")]
)
def test_a_header_of_nova_that_is_not_read_is_refused(saved, factor, unit_y, words):
    def header(factor, unit_y):
        units = f"Unit X = um\nUnit Y = {unit_y}\nUnit Data = nm\nScale Data = {factor}\n"
        return f"NX = 300\nNY = 12\n{units}Scale X = 0.1\nScale Y = 0.1\nStart of Data :\n"

    for good in (header("1", "um"), header("1,0", "\u00b5m")):
        assert read_topography(saved(good + matrix(" "))).heights.shape == (12, 300)
    with pytest.raises(InputError, match=words):
        read_topography(saved(header(factor, unit_y) + matrix(" ")))


def wyko(is_in_nm, *blocks):
    """A Wyko table: 12 positions along its x, with 300 heights each, and pixels of 2 um."""
    sizes = f"Wyko ASCII Data File Format 0\t{is_in_nm}\t1\nX Size\t12\nY Size\t300\n"
    header = ["Block Name\tType\tLength\tValue", "Pixel_size\t7\t4\t0.002", *blocks]
    return sizes + "\n".join([*header, "RAW_DATA\t3\t48\t", ""]) + matrix("\t")


@pytest.mark.parametrize(
    "blocks",
    [
        (),
        ("Wavelength\t7\t4\t600",),
        ("Mult\t7\t4\t2",),
        ("Wavelength\t7\t4\t600", "Mult\t6\t2\t2"),
    ],
)
def test_heights_in_wavelengths_that_are_not_converted_are_refused(saved, blocks):
    """They would be 300 times too small."""
    good = read_topography(saved(wyko(0, "Wavelength\t7\t4\t600", "Mult\t7\t4\t2")))
    np.testing.assert_allclose(good.heights, 300e-9 * HEIGHTS, rtol=1e-12)
    assert good.spacing == pytest.approx((2e-6, 2e-6))
    in_nm = read_topography(saved(wyko(1, *blocks)))
    np.testing.assert_allclose(in_nm.heights, 1e-9 * HEIGHTS, rtol=1e-12)
    with pytest.raises(InputError, match="in units of the wavelength"):
        read_topography(saved(wyko(0, *blocks)))


@pytest.mark.parametrize("separator", ["\t", ",", ";"])
def test_empty_cells_at_the_ends_of_rows_that_drift_are_refused(saved, separator):
    rows = [separator.join(f"{value:.4f}" for value in row) for row in HEIGHTS]
    drift = [separator * (i % 3) + row + separator * (2 - i % 3) for i, row in enumerate(rows)]
    with pytest.raises(InputError, match="an empty cell"):
        read_topography(saved("\n".join(drift)))
    margins = [separator + row + separator for row in rows]  # the same in every row
    margins[-1] = margins[-1].removesuffix(separator)
    empty = separator * 300  # as of a spreadsheet
    for text in ("\n".join(margins), "\n".join([*rows, empty])):
        assert read_topography(saved(text)).heights.shape == HEIGHTS.shape


def test_points_below_a_header_with_two_lengths_are_points(saved):
    lengths = "# Width: 20 um\n# Distance: 15 mm\n"
    text = points(np.arange(15) / 4, np.arange(12) / 4)
    assert read_topography(saved(f"{lengths}x [um] y [um] z [nm]\n{text}")).heights.shape == (
        12,
        15,
    )
    x = np.arange(30)[::-1] ** 1.1
    profile = "".join(f"{a} {b}\n" for a, b in zip(x, HEIGHTS[0], strict=False))
    assert read_topography(saved(f"{lengths}x [um] z [nm]\n{profile}")).heights.ndim == 1


def test_a_channel_of_a_signal_is_not_taken_as_the_heights():
    def channels(*names):
        kind = SimpleNamespace(value="height")
        return [SimpleNamespace(channel_id=name, data_kind=kind, unit="m") for name in names]

    def chosen(*names, dataset=None):
        found = channels(*names)
        reader = SimpleNamespace(channels=found, default_channel=found[0], format=lambda: "gwy")
        return _height_channel(reader, dataset).channel_id

    assert chosen("Deflection Error", "Height") == "Height"
    assert chosen("Height", "Deflection Error") == "Height"
    assert chosen("Intensity", "RAW_DATA") == "RAW_DATA"
    assert chosen("Deflection Error", "Height", dataset="Deflection Error") == "Deflection Error"
    assert chosen("Topography (phase-shift)", "Intensity") == "Topography (phase-shift)"
    assert chosen("Form error") == "Form error"
    with pytest.raises(InputError, match="seem to be signals: AmplitudeRetrace, PhaseRetrace"):
        chosen("AmplitudeRetrace", "PhaseRetrace")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: np.where(np.arange(64) < 10, 0.0, h), "10 lines along y of equal heights each"),
        (
            lambda h: np.where(np.add.outer(np.arange(64), np.arange(64)) < 36, 0.0, h),
            "16% of the heights are exactly 0",
        ),
        (
            lambda h: h + 1e-6 * (np.arange(h.size).reshape(h.shape) % 137 == 70),
            "points lie above or below all neighbours",
        ),
        (lambda h: h, ""),
    ],
)
def test_unfinished_scans_and_single_points_give_a_warning(tmp_path, change, words):
    np.save(tmp_path / "h.npy", change(_rough(0.8, 64)))
    warnings = FileSurface(path=tmp_path / "h.npy", length=1e-5, periodic=False).warnings()
    assert (len(warnings) == 1 and words in warnings[0]) if words else not warnings


@pytest.mark.parametrize(("points", "warned"), [(64, True), (1024, False)])
def test_a_border_step_matters_more_on_few_points(tmp_path, points, warned):
    """Four times the usual step, as one of 64 or of 1024 steps in each row."""
    ramp = np.linspace(0, 6, points) + np.random.default_rng(0).normal(size=(points, points))
    np.save(tmp_path / "h.npy", 1e-9 * ramp)
    warnings = FileSurface(path=tmp_path / "h.npy", length=1e-5).warnings()
    assert any("step across the border" in each for each in warnings) is warned


@pytest.mark.parametrize("hurst", [0.1, 0.8, 1.0])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h, x: h, None),
        (lambda h, x: h + 1e-9 * np.random.default_rng(1).normal(size=(len(h), 1)), "along x are"),
        (lambda h, x: (h + 1e-9 * np.random.default_rng(1).normal(size=(len(h), 1))).T, "along y"),
        (lambda h, x: h + 1e-9 * np.sign(np.sin(8 * np.pi * x))[:, None], None),  # grooves
        (lambda h, x: h + 2e-8 * (x[:, None] ** 2 + x**2), "parabolic form"),
        (lambda h, x: h - 2e-8 * x**2, "parabolic form"),
    ],
)
def test_shifted_lines_and_a_bow_give_a_warning(tmp_path, hurst, change, words):
    np.save(tmp_path / "h.npy", change(_rough(hurst), np.linspace(-1, 1, 128)))
    for map_of in ({"periodic": False}, {"level": "plane", "edges": "mirror"}):
        surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, **map_of)
        found = [w for w in surface.warnings() if "shifted" in w or "parabolic" in w]
        assert (len(found) == 1 and words in found[0]) if words else not found
    level = surface.model_copy(update={"level": "curvature"})
    assert not any("parabolic" in w for w in level.warnings())


def test_one_wave_in_a_periodic_map_is_no_bow(tmp_path):
    x = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    np.save(tmp_path / "h.npy", 1e-7 * (np.cos(x)[:, None] + np.cos(x)))
    assert not FileSurface(path=tmp_path / "h.npy", length=1e-5).warnings()


def _raised(heights, lines, by=5e-9):
    heights = heights.copy()
    heights[lines] += by
    return heights


def _scarred(heights):
    """Twenty strokes of eight points along x, 3 nm high."""
    heights = heights.copy()
    for row, column in np.random.default_rng(3).integers(2, 118, (20, 2)):
        heights[row, column : column + 8] += 3e-9
    return heights


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: _raised(h, [50]), "lines along x jump at 2 places"),
        (lambda h: _raised(h, slice(50, None), 2e-9), "lines along x jump at 1 place,"),
        (lambda h: np.where(h == h[3, 3], np.nan, _raised(h, [50, 90])), "jump at 4 places"),
        (lambda h: _scarred(h), "next lines along x by more than 3 times"),
        (lambda h: _scarred(h.T).T, "next lines along y by more than 3 times"),
        (lambda h: h[np.arange(128) // 2 * 2], "64 of 128 lines along x are equal"),
        (lambda h: h + 1e-7 * np.arange(128), "subtracts a slope of 1.3, an angle of 52 degrees"),
        (lambda h: np.minimum(h, np.quantile(h, 0.995)), "heights are exactly the maximum"),
    ],
)
def test_artefacts_of_scans_give_a_warning(tmp_path, change, words):
    np.save(tmp_path / "h.npy", change(_rough(0.8)))
    warnings = FileSurface(path=tmp_path / "h.npy", length=1e-5, periodic=False).warnings("free")
    assert any(words in warning for warning in warnings), warnings


@pytest.mark.parametrize("hurst", [0.3, 0.8])
@pytest.mark.parametrize("turned", [False, True])
def test_tiles_of_a_stitched_scan_give_a_warning(tmp_path, hurst, turned):
    """Their offset is twice the rms difference of neighbours."""
    sound = _rough(hurst)
    for offset in (0.0, 2.0 * np.diff(sound, axis=0).std()):
        stitched = _raised(sound, slice(50, None), offset)
        np.save(tmp_path / f"{offset}.npy", stitched.T if turned else stitched)
        surface = FileSurface(path=tmp_path / f"{offset}.npy", length=1e-5, periodic=False)
        words = f"the lines along {'xy'[turned]} jump at"
        assert any(words in warning for warning in surface.warnings()) == (offset > 0)


@pytest.mark.parametrize("rows", [4, 8])
@pytest.mark.parametrize("hurst", [0.1, 0.8])
def test_oblong_pixels_are_no_shifted_lines(tmp_path, rows, hurst):
    np.save(tmp_path / "h.npy", _rough(hurst, 256)[::rows])
    surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, length_y=1e-5, periodic=False)
    assert not any("lines" in warning for warning in surface.warnings())


def test_both_sides_of_a_part_are_told(tmp_path):
    np.save(tmp_path / "h.npy", _rough(0.8))
    part = {"periodic": False, "region": Region(y=(0, 64))}
    surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, length_y=1e-5, **part)
    (warning,) = surface.warnings()
    assert "surface.length_y = 1e-05 m is the side of the part" in warning
    assert "64 of 128 points" in warning


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (
            np.stack([np.arange(40.0), np.sin(np.arange(40.0))], axis=1),
            "an array of 2 x 40 numbers",
        ),
        (np.random.default_rng(0).normal(size=(3, 100)), "an array of 100 x 3 numbers"),
        (np.c_[np.arange(50.0), np.random.default_rng(0).normal(size=(50, 50))], "a column of the"),
    ],
)
def test_an_array_with_positions_is_refused(tmp_path, array, words):
    np.save(tmp_path / "h.npy", array)
    with pytest.raises(InputError, match=words):
        read_topography(tmp_path / "h.npy")


@pytest.mark.parametrize("end", ["\r", "\n"])
def test_line_ends_of_old_programs_are_read(saved, end):
    """Below a header with such line ends, or with new ones."""
    path = saved(f"# Width: 4 um{end}# Height: 4 um{end}" + "\r".join(["1 2 3 5", "2 4 1 0"] * 8))
    assert read_topography(path).heights.shape == (16, 4)


@pytest.mark.parametrize("first", [-2, -257, -3])
def test_heights_that_begin_as_text_in_utf_16_are_read(tmp_path, first):
    heights = np.random.default_rng(0).integers(0, 500, size=(1201, 1201)).astype(">i2")
    heights[0, 0] = first
    (tmp_path / "N00E000.hgt").write_bytes(heights.tobytes())
    np.testing.assert_array_equal(read_topography(tmp_path / "N00E000.hgt").heights, heights)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("is_end", [False, True])
def test_a_mirrored_map_has_no_repeated_lines(number, is_end):
    """Also where few lines, or none, are left beyond the line at which it is mirrored."""
    heights = np.random.default_rng(0).normal(size=(12, 20))
    mirrored = np.vstack([heights[::-1], heights])[11 - number :]
    repeated = np.vstack([heights[number : number + 1]] * 4 + [heights])
    for lines, is_repeated in ((mirrored, False), (repeated, True)):
        warning = map_warnings.repeated_lines(lines[::-1] if is_end else lines)
        assert ("are equal to the line before" in warning) == is_repeated
