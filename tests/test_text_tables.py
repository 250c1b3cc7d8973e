"""Which text files can be tables of heights, found out in a few seconds whatever their length."""

import re
import time
from io import BytesIO

import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.maps import text_tables
from gfmd_cli.maps.text_tables import columns, shorter_or_longer_row
from gfmd_cli.maps.topography import read_topography
from gfmd_cli.physics.file_surface import FileSurface

RNG = np.random.default_rng(0)


def text(values, separator=" ", header=b"", end=b"\n"):
    """A table in a file."""
    lines = (separator.join(f"{value:.6g}" for value in row).encode() for row in values)
    return header + b"".join(line + end for line in lines)


def formats_of(file):
    """The formats of tables that a file can have."""
    return text_tables.table_formats(file, columns(file))


def on_grid(n, m):
    """Positions and heights of n x m points."""
    x, y = np.meshgrid(np.arange(n) * 0.1, np.arange(m) * 0.2)
    return np.column_stack([x.ravel(), y.ravel(), RNG.normal(size=n * m)])


MATRIX, POINTS = RNG.normal(size=(300, 40)), on_grid(50, 40)
MAPS = {
    "a matrix": (text(MATRIX), {"asc"}),
    "a matrix with a header": (text(MATRIX, header=b"# Width: 10 um\n# Units: m\n"), {"asc"}),
    "two matrices": (2 * text(MATRIX, header=b"# Channel: a\n"), {"asc"}),
    "old line ends": (text(MATRIX, end=b"\r"), {"asc"}),
    "line ends of Windows": (text(MATRIX, end=b"\r\n"), {"asc"}),
    "empty lines between": (text(MATRIX, end=b"\n\n"), {"asc"}),
    "points": (text(POINTS), {"xyz"}),
    "points in any order": (text(RNG.permutation(POINTS)), {"xyz"}),
    "points between commas": (text(POINTS, ","), {"xyz"}),
    "points after a line of numbers": (text(POINTS, header=b"50 40\n"), {"xyz"}),
    "a profile": (text(POINTS[:, ::2]), {"xyz"}),
    "a last line cut short": (text(MATRIX)[:-20], {"asc"}),
}


@pytest.mark.parametrize("case", MAPS)
@pytest.mark.parametrize("window", [2**12, 2**21])
def test_tables_of_heights_are_recognised(monkeypatch, case, window):
    monkeypatch.setattr(text_tables, "WINDOW_BYTES", window)
    content, formats = MAPS[case]
    assert formats_of(BytesIO(content)) == formats


def ragged(at):
    """A matrix with a number more in one line."""
    lines = text(MATRIX).splitlines(keepends=True)
    lines[at] = b"1.5 " + lines[at]
    return b"".join(lines)


OTHERS = {
    "nothing": b"",
    "one line": b"1.0 " * 10**6,
    "one number": b"1" * 10**6,
    "one column": b"1.0\n" * 10**6,
    "words": b"some words here\n" * 10**5,
    "zeros": bytes(10**6),
    "a line with a number more": ragged(250),
    "a last line with a number more": ragged(299),
    "a table that ends in one line": text(MATRIX) + b"1 " * 10**6 + b"\n",
    "as many columns as lines": b"".join(b"1 " * i + b"\n" for i in range(1, 1000)),
    "points anywhere": text(RNG.random((30_000, 3))),
}


@pytest.mark.parametrize("case", OTHERS)
@pytest.mark.parametrize("window", [2**14, 2**21])
def test_other_texts_are_no_tables(monkeypatch, case, window):
    monkeypatch.setattr(text_tables, "WINDOW_BYTES", window)
    assert formats_of(BytesIO(OTHERS[case])) == set()


def test_positions_may_stand_after_the_heights(tmp_path, monkeypatch):
    monkeypatch.setattr(text_tables, "GRID_LINES", 100)
    path = tmp_path / "map.txt"
    path.write_bytes(text(POINTS[:, [2, 0, 1]], header=b"z [nm] x [um] y [um]\n"))
    heights = 1e-9 * POINTS[:, 2].reshape(40, 50)
    assert read_topography(path).heights == pytest.approx(heights, rel=1e-5, abs=1e-14)


@pytest.mark.parametrize("mark", ["1e30", "3.4e38", "-9.97e36"])
@pytest.mark.parametrize("columns", [2, 3, 40])
def test_marks_of_missing_heights_are_in_the_unit_of_the_file(tmp_path, columns, mark):
    table = {2: POINTS[:50, ::2], 3: POINTS, 40: MATRIX}[columns]
    header = b"# Width: 8 um\n# Height: 60 um\n# Value units: nm\n"
    header = header if columns == 40 else b"x [um] y [um] z [nm]\n"
    header = b"x [um] z [nm]\n" if columns == 2 else header
    lines = text(table, header=header).splitlines(keepends=True)
    lines[10] = b" ".join([*lines[10].split()[:-1], mark.encode()]) + b"\n"
    path = tmp_path / "map.txt"
    path.write_bytes(b"".join(lines))
    topography = read_topography(path)
    assert topography.missing_count == 1
    assert np.abs(topography.heights).max() < 1e-8


def test_missing_points_of_a_profile_are_missing_heights(tmp_path):
    x = 0.5 * np.arange(200)
    heights = RNG.normal(size=200)
    present = np.delete(np.arange(200), [50, 51, 120])
    path = tmp_path / "profile.txt"
    path.write_bytes(text(np.column_stack([x, heights])[present], header=b"x [um] z [nm]\n"))
    topography = read_topography(path)
    assert np.flatnonzero(topography.missing).tolist() == [50, 51, 120]
    assert topography.spacing == pytest.approx((5e-7,))
    expected = 1e-9 * heights[present]
    assert topography.heights[present] == pytest.approx(expected, rel=1e-5, abs=1e-14)


def test_a_point_that_is_given_twice_is_named(tmp_path):
    path = tmp_path / "map.txt"
    path.write_bytes(text(np.vstack([POINTS, POINTS[77]])))
    with pytest.raises(InputError, match=r"the point x = 2\.7, y = 0\.2 is given 2 times"):
        read_topography(path)


@pytest.mark.parametrize("row", [5, 250, 299])
def test_a_row_of_a_matrix_with_another_length_is_named(tmp_path, row):
    lines = text(MATRIX).splitlines()
    lines[row] += b" 0.5"
    path = tmp_path / "map.txt"
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(InputError, match=f"line {row + 1} has 41 numbers, most rows 40"):
        read_topography(path)


def test_rows_of_few_numbers_are_no_matrix():
    assert shorter_or_longer_row(BytesIO(b"1 2\n3 4\n5 6 7\n")) == ""


def test_a_matrix_that_is_cut_off_in_a_row_is_refused(tmp_path):
    path = tmp_path / "map.txt"
    header = b"# Width: 8 um\n# Height: 60 um\n# Value units: nm\n"
    path.write_bytes(text(MATRIX, header=header).rstrip()[:-100])
    with pytest.raises(InputError, match=r"line 303 has 2\d numbers, most rows 40"):
        read_topography(path)


SEPARATORS = [(",", "."), (", ", "."), (";", "."), ("; ", "."), ("\t", ".")]
SEPARATORS += [(" ", ","), ("\t", ","), (";", ","), ("; ", ",")]


@pytest.mark.parametrize(("separator", "decimal"), SEPARATORS)
@pytest.mark.parametrize("end", ["", "at each end"])
@pytest.mark.parametrize("columns", [2, 3, 4, 40])
def test_separators_and_decimal_commas(tmp_path, separator, decimal, end, columns):
    """Profiles, points on a grid, and matrices, as spreadsheets and microscopes write them."""
    header = "# measured on 3,5 samples; twice\n" if columns == 40 else ""
    table = {2: POINTS[:50, ::2], 3: POINTS, 4: MATRIX[:, :4], 40: MATRIX}[columns]
    rows = (separator.join(f"{value:.9f}" for value in row).replace(".", decimal) for row in table)
    last = separator if end and columns > 3 else ""
    path = tmp_path / "table.csv"
    path.write_text(header + "".join(f"{row}{last}\n" for row in rows))
    heights = table[:, -1].reshape(-1, 50).squeeze() if columns < 4 else table
    assert read_topography(path).heights == pytest.approx(heights, abs=1e-9)


def in_nm(separator, shape):
    """Heights from 0.9 to 1.3 um as numbers in nm, or in um with three decimals."""
    heights = np.random.default_rng(0).integers(900, 1300, shape)
    return heights, lambda word: "\n".join(separator.join(map(word, row)) for row in heights)


@pytest.mark.parametrize("separator", [" ", "\t", ";", "; "])
@pytest.mark.parametrize("columns", [2, 3, 4, 30])
def test_separators_of_thousands_are_refused(tmp_path, separator, columns):
    _, table = in_nm(separator, (20, columns))
    (tmp_path / "h.txt").write_text("# by 5\n" + table("{:,}".format))
    with pytest.raises(InputError, match=r"1,\d\d\d beside 9\d\d: does the comma separate thous"):
        read_topography(tmp_path / "h.txt")
    (tmp_path / "h.txt").write_text(table(lambda nm: f"{1e4 * nm:,.1f}"))
    with pytest.raises(InputError, match="does the comma separate thousands"):
        read_topography(tmp_path / "h.txt")


@pytest.mark.parametrize("separator", [" ", ";"])
@pytest.mark.parametrize("offset", [0, 100])
def test_three_digits_after_each_comma_are_decimals(tmp_path, separator, offset):
    """With a warning, unless one number begins with zero."""
    heights, table = in_nm(separator, (20, 30))
    (tmp_path / "h.txt").write_text(
        table(lambda nm: f"{1e-3 * (nm + offset):.3f}".replace(".", ","))
    )
    read = read_topography(tmp_path / "h.txt")
    assert read.heights == pytest.approx(1e-3 * (heights + offset))
    warnings = FileSurface(path=tmp_path / "h.txt").warnings()
    assert any("are they thousands?" in each for each in warnings) == bool(offset)


def test_points_that_separate_thousands_give_a_warning(tmp_path):
    """But not three decimals of all numbers, nor numbers without the zeros at their ends."""
    heights, table = in_nm("\t", (20, 30))
    path = tmp_path / "h.txt"
    for word, is_suspect in (
        (lambda nm: f"{nm:,}".replace(",", "."), True),
        (lambda nm: f"{1e-3 * nm:.3f}", False),
        (lambda nm: f"{1e-3 * nm:.4g}", False),
        (str, False),
    ):
        path.write_text(table(word))
        notes = read_topography(path).notes
        assert any(re.search(r"1\.\d\d\d beside 9\d\d was", each) for each in notes) == is_suspect
    pairs = zip(range(100), heights.ravel(), strict=False)
    path.write_text("".join(f"{x} {1e-3 * height + 1:.3f}\n" for x, height in pairs))
    assert not any("beside" in each for each in read_topography(path).notes)


HEADERS = {
    "X;Y;valid\n[mm];[um];[1/0]": ";",
    "Scan Parameters,\nStylus,tip\nScan Data\n\nLateral mm,Raw um,": ",",
    "Scan Parameters,\nStylus,3°\nScan Data\n\nLateral mm,Raw µm,": ",",
}


@pytest.mark.parametrize("header", HEADERS)
def test_profiles_with_a_header_of_an_instrument(tmp_path, header):
    """The readers of such files need their separators."""
    rows = (HEADERS[header].join((f"{x:.6f}", f"{y:.6f}", "1")) for x, y in POINTS[:50, ::2])
    (tmp_path / "profile.csv").write_text("\n".join([header, *rows]), encoding="latin-1")
    heights = read_topography(tmp_path / "profile.csv").heights
    assert heights == pytest.approx(1e-6 * POINTS[:50, 2], abs=1e-12)


def test_points_that_a_table_lacks_are_missing_heights(tmp_path):
    lacking = np.delete(POINTS, [7, 900], axis=0)
    marked = POINTS.copy()
    marked[[7, 900], 2] = np.nan
    for name, points in (("lacking.txt", lacking), ("marked.txt", marked)):
        (tmp_path / name).write_bytes(text(points))
    read, same = (read_topography(tmp_path / name) for name in ("lacking.txt", "marked.txt"))
    assert read.missing_count == 2
    np.testing.assert_array_equal(read.missing, same.missing)
    np.testing.assert_array_equal(read.heights, same.heights)
    assert read.spacing == pytest.approx(same.spacing)


def test_a_table_of_positions_that_is_cut_off_is_refused(tmp_path):
    """The last height would be wrong: its last digits are lost."""
    (tmp_path / "points.txt").write_bytes(text(POINTS[:-3])[:-3])
    with pytest.raises(InputError, match="of the 50 x 40 points of a grid, and its last line"):
        read_topography(tmp_path / "points.txt")
    (tmp_path / "whole.txt").write_bytes(text(POINTS).rstrip())
    assert read_topography(tmp_path / "whole.txt").missing_count == 0


THREE_COLUMNS = {
    "scattered points": RNG.random((300, 3)),
    "many scattered points": RNG.random((1000, 3)),
    "a grid of which more than half is missing": POINTS[RNG.random(len(POINTS)) < 0.4],
    "two profiles": np.column_stack([np.arange(40.0), RNG.random((40, 2))]),
}


@pytest.mark.parametrize("case", THREE_COLUMNS)
def test_three_columns_that_are_no_grid_are_refused(tmp_path, case):
    """They are not a matrix of heights of three columns."""
    (tmp_path / "points.txt").write_bytes(text(THREE_COLUMNS[case]))
    with pytest.raises(InputError, match="three columns that are not the points"):
        read_topography(tmp_path / "points.txt")


def test_three_columns_with_stated_sides_are_a_matrix(tmp_path):
    header = "# Channel: a\n# Width: 3 µm\n# Height: 4 µm\n# Value units: m\n"
    (tmp_path / "small.txt").write_bytes(text(MATRIX[:4, :3], header=header.encode()))
    heights = read_topography(tmp_path / "small.txt").heights
    assert heights == pytest.approx(MATRIX[:4, :3], rel=1e-5)


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
@pytest.mark.parametrize("comma", [False, True])
def test_headers_in_latin_1_are_read(tmp_path, encoding, comma):
    header = "# Width: 30 µm\n# Height: 20 µm\n# turned by 3°\n# Value units: µm\n"
    table = text(MATRIX[:20, :30]).replace(b".", b"," if comma else b".")
    (tmp_path / "h.txt").write_bytes(header.encode(encoding) + table)
    read = read_topography(tmp_path / "h.txt")
    assert read.heights == pytest.approx(1e-6 * MATRIX[:20, :30], rel=1e-5)
    assert read.spacing == pytest.approx((1e-6, 1e-6))


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_the_header_of_a_profile_in_latin_1_is_read(tmp_path, encoding):
    header = "# Channel: 3°\n# Lateral units: µm\n# Value units: nm\n"
    (tmp_path / "h.txt").write_bytes(header.encode(encoding) + text(POINTS[:50, ::2]))
    read = read_topography(tmp_path / "h.txt")
    assert read.heights == pytest.approx(1e-9 * POINTS[:50, 2], rel=1e-4)


def test_a_long_table_may_end_in_latin_1(tmp_path):
    matrix = RNG.random((600, 600))
    (tmp_path / "h.txt").write_bytes(text(matrix) + "# Ende: µm\n".encode("latin-1"))
    assert (tmp_path / "h.txt").stat().st_size > text_tables.WINDOW_BYTES
    assert read_topography(tmp_path / "h.txt").heights == pytest.approx(matrix, rel=1e-5)


LONG = {
    "a matrix that breaks off in the middle": (text(MATRIX), text(MATRIX[:, 1:])),
    "points anywhere": (text(RNG.random((10_000, 3))),) * 2,
    "four columns, then five": (text(MATRIX[:, :4]), text(MATRIX[:, :5])),
}


@pytest.mark.parametrize("case", LONG)
def test_a_long_table_that_is_no_map_takes_no_longer_than_a_short_one(tmp_path, case):
    first, second = LONG[case]
    seconds = []
    for size in (2**26, 2**28):
        with (tmp_path / "table").open("wb") as file:
            for block in (first, second):
                for _ in range(size // 2 // 2**24):
                    file.write(block * (2**24 // len(block)))
        begun = time.process_time()
        with (tmp_path / "table").open("rb") as file:
            assert formats_of(file) == set()
        seconds.append(time.process_time() - begun)
    assert max(seconds) < 5
    assert seconds[1] < 3 * seconds[0] + 0.5


def labelled(heights, kind):
    """A table of heights with positions in its first row, in its first column, or in both."""
    rows, columns = heights.shape
    x, y = 0.5 * np.arange(columns), 0.5 * np.arange(rows)[:, None]
    if kind == "row":
        return np.vstack([x, heights])
    if kind == "column":
        return np.hstack([y, heights])
    return np.vstack([np.hstack([0.0, x]), np.hstack([y, heights])])


@pytest.mark.parametrize("kind", ["row", "column", "both"])
def test_positions_beside_the_heights_are_refused(tmp_path, kind):
    heights = np.random.default_rng(0).standard_normal((9, 7))
    path = tmp_path / "map.csv"
    np.savetxt(path, labelled(heights, kind), delimiter=",")
    with pytest.raises(InputError, match="positions or numbers, not heights"):
        FileSurface(path=path).smallest_grid()


def test_a_tilted_plane_with_roughness_in_one_row_is_a_map(tmp_path):
    """Its rows are evenly spaced, and so are those beside them."""
    heights = np.add.outer(0.1 * np.arange(9), np.arange(7.0))
    heights[4, 3] += 1.0
    path = tmp_path / "map.txt"
    np.savetxt(path, heights)
    assert FileSurface(path=path).smallest_grid() == 7


def test_a_fourth_column_beside_positions_is_refused(tmp_path):
    """Columns x, y, height and quality."""
    y, x = np.indices((8, 6))
    values = np.random.default_rng(0).standard_normal((2, 48))
    path = tmp_path / "map.txt"
    np.savetxt(path, np.column_stack([x.ravel(), y.ravel(), *values]))
    with pytest.raises(InputError, match="one of 4 columns is sorted"):
        FileSurface(path=path).smallest_grid()


@pytest.mark.parametrize("separator", [" ", ",", ";"])
@pytest.mark.parametrize(("columns_read", "place"), [(40, 7), (3, 1), (3, 2), (2, 1)])
def test_underscores_in_numbers_are_refused(tmp_path, columns_read, place, separator):
    """Python alone takes 1_2 as 12."""
    table = {2: POINTS[:50, ::2], 3: POINTS, 40: MATRIX}[columns_read]
    lines = text(table, separator).split(b"\n")
    words = lines[10].split(separator.encode())
    words[place] = b"1_2"
    lines[10] = separator.encode().join(words)
    (tmp_path / "h.txt").write_bytes(b"\n".join(lines))
    with pytest.raises(InputError, match=r"h\.txt:11: '.*1_2.* write NaN for a missing height"):
        read_topography(tmp_path / "h.txt")


def test_lines_are_counted_as_python_splits_them():
    """Also with characters that end no line, and line ends of all kinds."""
    some = list(b'1 2.\t\n\r\n\x0b\x0ca,;"\x01\xc2')
    for size in range(1, 500):
        content = bytes(RNG.choice(some, size).tolist())
        lines = content.splitlines()
        expected = [len(line.split()) if text_tables.is_numeric(line) else 0 for line in lines]
        assert text_tables._counts(content).tolist() == expected
