"""Tables of numbers in text files: what kind of height map a file can be.

The readers of such files parse them to the end, and some start again several hundred times, so that
a large table that is not a map would take hours. Here lines are counted in parts of the file, which
takes some seconds at most.
"""

import codecs
import os
import re
from collections.abc import Iterator
from io import BytesIO
from itertools import chain, dropwhile, islice, takewhile, zip_longest
from typing import Any, BinaryIO

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.maps.array_coordinates import metres_per_unit
from gfmd_cli.units import count

WINDOW_BYTES = 2**21  # bytes read at a time: 32768 heights of 25 digits take less than half of it
MAX_WINDOWS = 32  # of a file; those of a larger one leave gaps
SCANNED_BYTES = 2**26  # in which a row of another length is looked for; a choice
HEADER_LINES = 200  # that may differ from the table: as many as SurfaceTopography skips
SAMPLE_BYTES = 2**16  # at the end of each window; a choice
MIN_DIGIT_FRACTION = 0.2  # smallest fraction of digits among the characters of a table; a choice
GRID_LINES = 20_000  # whose positions are compared; a choice
SIZE_BYTES = 100  # of a line with two numbers
MATRIX_COLUMNS = 4  # fewer are positions: the rule of SurfaceTopography
LATIN_1 = b"Scan Parameters"  # begins a table of Dektak, which its reader takes as Latin-1
OWN_HEADERS = LATIN_1, b"X;Y;valid"  # of profiles that SurfaceTopography knows
MISSING = b"bad", b"nan", b"inf", b"infinite"
"""Marks of missing heights, in any case; those of SurfaceTopography."""
AMBIGUOUS_UNITS = "pm", "in"  # which end a time and begin a phrase
SIDE = re.compile(rb"#\s*\S+\s*[:=]\s*([\d.]+(?:[eE][-+]?\d+)?)\s*(\S+)\s*$")
"""A line such as "# Width: 20 um", in any language."""
THOUSANDS = re.compile(rb"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")
POINTED = re.compile(rb"[-+]?[1-9]\d{0,2}\.\d{3}")
WHOLE = re.compile(rb"[-+]?\d{1,3}")
MIN_POINTED = 50  # numbers such as 1.023: of fewer, all may have three decimals by chance
NUMBER_CHARACTERS = b' "\t+-.,;0123456789eEdDinfaINFA'
"""Characters of lines without words."""
BLANK, LINE_END, DIGIT, LETTER = range(4)
KINDS = bytes(
    BLANK
    if byte in b" \t"
    else LINE_END
    if byte in b"\r\n"
    else DIGIT
    if byte in NUMBER_CHARACTERS
    else LETTER
    for byte in range(256)
)
"""The kind of each byte: `DIGIT` for those of numbers, `LETTER` for those of words alone."""
UTF_16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
QUOTED_COMMAS = re.compile(rb'"[-+\d]*,[\d,.]*"[ \t]*,')  # beside commas between the numbers
GROUPED = re.compile(rb"[\t;]([-+]?\d{1,3}( \d{3})+([,.]\d*)?)(?=[\t;\r]|$)")
"""A cell such as 1 023 between tabs or semicolons."""
PADDED = re.compile(rb"[-+]?0\d+([,.]\d*)?([eE][-+]?\d+)?")
"""A number that begins with a zero, such as the second part of a divided 12,0345 or 12 034."""
EMPTY = re.compile(rb"([,;])[ \t]*\1.*\d")
"""An empty cell between commas or semicolons, with a number in the same row after it."""
OLD_LINE_END = re.compile(rb"\r(?!\n)")
SEPARATORS = b"\t", b";", b","
"""Separators of cells; a comma beside one of the others is a decimal comma."""
SIDE_LABELS = (
    "x-length|Width|Šířka|Breite|Anchura|Largeur|Larghezza|幅|폭|Largura|Ширина|"
    "y-length|Height|Výška|Höhe|Altura|Hauteur|Altezza|高さ|높이|Высота"
)
"""Labels of the sides of a matrix in a header, in all languages of Gwyddion."""
OF_SIDES = re.compile(rf"^\W*({SIDE_LABELS})\b")


def part(file: BinaryIO, position: int = 0, size: int = -1) -> bytes:
    """What a file has from a position on, by default all of it."""
    file.seek(position)
    return file.read(size)


def is_numeric(line: bytes) -> bool:
    """Whether a line has no words."""
    return not line.translate(None, NUMBER_CHARACTERS)


def table_formats(file: BinaryIO, width: int) -> set[str]:
    """The formats of tables that a file of so many columns can have.

    "asc" is a matrix of heights between blanks; "xyz" are the positions and heights of a profile or
    of points on a grid, between blanks, commas or semicolons.
    """
    if width >= MATRIX_COLUMNS:
        return {"asc"}
    return {"xyz"} if width == 2 or (width == 3 and _is_grid(file)) else set()


def is_number(word: bytes) -> bool:
    """Whether a word is a number, NaN or infinite; 1_000 is one in Python alone."""
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def is_height(word: bytes) -> bool:
    """Whether a word is a number, or a known mark of a missing height."""
    return is_number(word) or word.lower() in MISSING


def is_unit(word: str) -> bool:
    """Whether a word of a header is a known unit of length."""
    return metres_per_unit(word) is not None and word not in AMBIGUOUS_UNITS


def sides_in(lines: list[bytes]) -> list[float]:
    """Lengths [m] that a header states; two of them are the sides of a matrix."""
    matches = filter(None, map(SIDE.match, lines))
    sides = [(side[1], metres_per_unit(side[2].decode(errors="replace"))) for side in matches]
    return [float(value) * unit for value, unit in sides if is_number(value) and unit is not None]


def lines_above(file: BinaryIO, width: int) -> list[bytes]:
    """The lines above the first row of so many numbers, without empty ones."""

    def is_above(line: bytes) -> bool:
        cells = re.split(rb"[\s,;]+", line.strip(b" \t\r\n,;"))
        return len(cells) < width or not _counts(line).any()

    file.seek(0)
    lines = takewhile(is_above, islice(file, HEADER_LINES + 1))
    return [line for line in lines if line.strip()]


def unread_units(lines: list[bytes], *, of_sides: bool) -> str:
    """A warning about units of length in a header, or only in its lines of sides; "" if none."""
    texts = [line.decode(errors="replace") for line in lines]
    if of_sides:
        texts = list(filter(OF_SIDES.match, texts))
    units = [word for word in re.split(r"[\s,;:=/_()\[\]\"#]+", " ".join(texts)) if is_unit(word)]
    if not units:
        return ""
    return (
        f"the header of the table states units ({', '.join(units)}), which are not read: set "
        "surface.length and surface.scale"
    )


def without_size(file: BinaryIO, width: int) -> BinaryIO:
    """A matrix without a first line that states its numbers of rows and columns."""
    file.seek(0)
    size = [int(word) for word in file.readline(SIZE_BYTES).split() if word.isdigit()]
    if len(size) == 2 and width in size and width >= MATRIX_COLUMNS:
        content = file.read()
        rows = sum(len(line.split()) == width for line in content.splitlines())
        if sorted(size) == sorted((rows, width)):
            return BytesIO(content)
    return file


def shorter_or_longer_row(file: BinaryIO) -> str:
    """The first row of a matrix that has another number of heights than most; "" without one.

    Only the first `SCANNED_BYTES` are looked at.
    """
    lines = part(file, 0, SCANNED_BYTES)
    counts = _counts(lines if len(lines) < SCANNED_BYTES else lines[: lines.rfind(b"\n")])
    rows = counts[counts > 0]
    width = int(np.bincount(rows[rows >= MATRIX_COLUMNS], minlength=1).argmax())
    if width == 0 or (rows == width).all():
        return ""
    first = int(np.argmax((counts > 0) & (counts != width)))
    return f"line {first + 1} has {count(int(counts[first]), 'number')}, most rows {width}"


def with_blanks(file: BinaryIO) -> tuple[BinaryIO, str]:
    """A matrix whose numbers are separated by commas or semicolons, rewritten with blanks.

    Decimal commas become points.

    A comma between two digits is a decimal one where blanks or semicolons separate the numbers.
    Any other file is returned as it is: the readers of positions know commas and semicolons.

    Returns the table, and a warning or "". Raises InputError if the commas can separate thousands.
    """
    warning = ""
    start = part(file, 0, WINDOW_BYTES)
    table = start[len(start) // 2 :]  # without most headers
    width = columns(file)
    whole = start.splitlines()[: -1 if len(start) == WINDOW_BYTES else None]
    rows = list(filter(is_numeric, whole)) if width else []
    if cell := next(filter(None, map(GROUPED.search, rows)), None):
        raise InputError(f"{cell[1].decode()}: blanks separate thousands; save the numbers without")
    has_others = any(b";" in row or b"\t" in row for row in rows)
    separators = SEPARATORS[:-1] if has_others else SEPARATORS
    is_shifted = width >= MATRIX_COLUMNS and any(_has_empty_cells(rows, by) for by in separators)
    if is_shifted or any(map(EMPTY.search, rows)):
        raise InputError("an empty cell in a row of numbers; write NaN for a missing height")
    is_decimal = False
    if b"," in table or b";" in table:
        numbers = columns(file, b" \t;")
        is_decimal = numbers > 1 and re.search(rb"\d,\d", table) is not None
        if numbers == 1:
            numbers = columns(file, b",")
        if is_decimal:
            rows = list(filter(is_numeric, whole))
            warning = _warning_of_thousands(rows, numbers)
        if is_decimal or numbers >= MATRIX_COLUMNS:
            text = part(file).replace(b";", b" ")
            file = BytesIO(text.replace(b",", b"." if is_decimal else b" "))
    else:
        warning = _warning_of_points(rows)
    _check_is_not_divided(rows, b" \t;" if is_decimal else b" \t;,")
    return file, warning


def _check_is_not_divided(rows: list[bytes], separators: bytes) -> None:
    """Raise InputError where a decimal comma or a blank has divided the numbers of a table.

    Then some numbers begin with zeros, beside others of another length, or every second cell
    between commas is one digit, the decimal of the cell before; of more digits, some begin with
    zeros. In the first columns such numbers have no number before them: they are indices as 007.
    """
    blanks = bytes.maketrans(separators, b" " * len(separators))
    table = zip_longest(*(row.translate(blanks).split() for row in rows), fillvalue=b"")
    parts = dropwhile(lambda column: any(map(PADDED.fullmatch, column)), table)
    words = [word for word in chain(*parts) if word and not word[-1:].isalpha()]  # no NaN
    padded = next(filter(PADDED.fullmatch, words), None)
    cells = [row.split(b",") for row in rows] if b"," in separators else []
    decimals = [cell for row in cells for cell in row[1::2]]
    is_wide = bool(cells) and len(cells[0]) >= MATRIX_COLUMNS
    is_regular = all(len(cell) == 1 and cell.isdigit() for cell in decimals)
    if padded is None and is_wide and is_regular:
        padded, words = decimals[0], [cell for row in cells for cell in row[::2]]
    if padded is not None and len(set(map(len, words))) > 1:
        raise InputError(
            f"{padded.decode()} beside numbers of another length: part of a number that a comma "
            "or blank has divided? Save the numbers with decimal points, and without separators "
            "of thousands"
        )


def _has_empty_cells(rows: list[bytes], separator: bytes) -> bool:
    """Whether rows differ in which cells before their last number are empty.

    Cells that are empty in all rows are a margin, and those at the ends of rows shift nothing.
    """
    if not any(separator * 2 in row or row.startswith(separator) for row in rows):
        return False
    patterns = set()
    for row in rows:
        cells = [cell.strip() for cell in row.split(separator)]
        full = [i for i, cell in enumerate(cells) if cell]
        if len(full) >= MATRIX_COLUMNS and all(is_number(cells[i]) for i in full):
            patterns.add(tuple(i for i in range(full[-1]) if not cells[i]))
    return len(patterns) > 1


def _warning_of_thousands(rows: list[bytes], width: int) -> str:
    """Warning if each number of a table has a comma where it could separate thousands.

    One number such as 0,125 or 1,5 shows that the commas are decimal. Raises InputError if only
    some of the numbers have such a comma, as where it separates thousands.
    """
    cells = [re.split(rb"[\s;]+", row.strip(b" \t;")) for row in rows]
    numbers = [word for row in cells if len(row) == width for word in row if word[-1:].isdigit()]
    with_comma = [word for word in numbers if b"," in word]
    if not with_comma or not all(map(THOUSANDS.fullmatch, with_comma)):
        return ""
    first = with_comma[0].decode()
    others = [word for word in numbers if word.count(b",") != 1 or b"." in word]
    if others:
        raise InputError(
            f"{first} beside {others[0].decode()}: does the comma separate thousands or decimals? "
            "Save the numbers with decimal points and without separators of thousands"
        )
    return f"{first} and all other numbers were read with decimal commas; are they thousands?"


def _warning_of_points(rows: list[bytes]) -> str:
    """Warning if points seem to separate thousands: 1.023 beside 998, in one column.

    Where they are decimal, some number has another number of decimals.
    """
    words = [row.split() for row in rows] or [[]]
    cells = zip(*(row for row in words if len(row) == len(words[-1])), strict=True)
    pointed, whole = [], []
    for column in cells:
        with_point = [word for word in column if b"." in word]
        if 0 < len(with_point) < len(column):
            pointed += with_point
            whole += [word for word in column if b"." not in word]
    if len(pointed) < MIN_POINTED or not all(map(POINTED.fullmatch, pointed)):
        return ""
    if not all(map(WHOLE.fullmatch, whole)):
        return ""
    return (
        f"{pointed[0].decode()} beside {whole[0].decode()} was read with a decimal point; if the "
        "points separate thousands, save the numbers without them"
    )


def in_utf8(file: BinaryIO) -> BinaryIO:
    """A table in UTF-8 with usual line ends, without byte order mark and quotes.

    Any other file as it is.

    Raises InputError where commas separate the numbers and are also parts of them, in quotes.
    """
    start = part(file, 0, WINDOW_BYTES)
    end = part(file, max(0, file.seek(0, os.SEEK_END) - WINDOW_BYTES))
    is_plain = start.isascii() and b'"' not in start and end.isascii()
    is_plain = is_plain and not OLD_LINE_END.search(start)
    is_utf_16 = _is_utf_16(start)
    is_table = is_utf_16 or start.startswith(codecs.BOM_UTF8)
    if not (is_plain or is_table or start.startswith(LATIN_1)):
        is_table = columns(file) > 0 or columns(file, b" \t;") > 0  # also with decimal commas
    if not is_table:
        return file
    content = part(file).removeprefix(codecs.BOM_UTF8)
    if is_utf_16:
        content = content.decode("utf-16").encode()
    try:
        content.decode()
    except UnicodeDecodeError:
        content = content.decode("latin-1").encode()
    if commas := QUOTED_COMMAS.search(content):
        raise InputError(
            f"{commas[0].decode()} has a comma in quotes and one as separator; save the numbers "
            "with decimal points, or separate them by semicolons"
        )
    return BytesIO(OLD_LINE_END.sub(b"\n", content).replace(b'"', b""))


def _is_utf_16(start: bytes) -> bool:
    """Whether the start of a file is text in UTF-16: mostly ASCII, and without zeros.

    Others begin with the same two bytes, such as 16-bit heights of which the first is -2 or -257.
    """
    text = start.decode("utf-16", "replace") if start.startswith(UTF_16) else "\0"
    return "\0" not in text and 2 * len(text.encode("ascii", "ignore")) > len(text)


def columns(file: BinaryIO, separators: bytes = b" \t,;") -> int:
    """Columns of a table of numbers between separators, 0 for any other file.

    All lines after the first `HEADER_LINES` have this number, or, of a file with fewer lines, the
    last complete one. Lines with words do not count.
    """
    blanks = bytes.maketrans(separators, b" " * len(separators))
    width = 0
    for position, lines in _windows(file):
        sample = lines[len(lines) // 2 :][-SAMPLE_BYTES:]
        digits = sum(sample.count(b"%d" % digit) for digit in range(10))
        if b"\0" in lines or digits < MIN_DIGIT_FRACTION * len(sample):
            return 0
        counts = _counts(lines.translate(blanks))
        if not width:
            width = int(counts[counts > 0][-1]) if counts.any() else 0
        if position == 0:
            counts = counts[HEADER_LINES:] if counts.size > HEADER_LINES else counts[-1:]
        if ((counts != width) & (counts != 0)).any():
            return 0
    return width


def _windows(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Position and whole lines of parts of a file.

    It stops with one zero byte at a line longer than a window.
    """
    size = file.seek(0, os.SEEK_END)
    gap = max(0, size // MAX_WINDOWS - WINDOW_BYTES)
    position = 0
    while position < size:
        window = part(file, position, WINDOW_BYTES)
        begin = len(re.split(rb"[\r\n]", window, maxsplit=1)[0]) + 1 if position and gap else 0
        end = max(window.rfind(b"\n"), window.rfind(b"\r")) + 1
        if end <= begin and position + len(window) < size:
            yield position, b"\0"
            return
        if end > begin:
            yield position, window[begin:end]
        position += (end or len(window)) + gap


def _counts(lines: bytes) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Numbers between blanks in each line, 0 where there are words."""
    if not lines.endswith((b"\n", b"\r")):
        lines += b"\n"
    kinds = np.frombuffer(lines.replace(b"\r\n", b"\n").translate(KINDS), np.uint8)
    begins = kinds >= DIGIT
    begins[1:] &= kinds[:-1] < DIGIT
    first = np.append(0, np.flatnonzero(kinds[:-1] == LINE_END) + 1)
    counts = np.add.reduceat(begins, first, dtype=np.int64)
    counts[np.maximum.reduceat(kinds, first) == LETTER] = 0
    return counts


def _is_grid(file: BinaryIO) -> bool:
    """Whether three columns can be points on a grid: few different positions, in some lines."""
    size = file.seek(0, os.SEEK_END)
    blanks = bytes.maketrans(b",;", b"  ")
    for position, lines in _windows(file):
        rows = lines.translate(blanks).splitlines()[-GRID_LINES:]
        words = list(chain(*(row for row in map(bytes.split, rows) if len(row) == 3)))
        x, y = sorted(len(set(words[axis::3])) for axis in range(3))[:2]  # whatever their order
        points = size / len(lines) * lines.count(b"\n" if b"\n" in lines else b"\r")
        if position + len(lines) == size and len(rows) < GRID_LINES:
            return True  # a small file, which is read soon
        if x * y > 2 * points:
            return False
    return True
