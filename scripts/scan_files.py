"""Every measured surface in a folder: `gfmd init --from FILE`, then `gfmd run`, unedited.

    python scripts/scan_files.py FOLDER [--only WORDS] > table.md

FOLDER can be `test/file_format_examples` of the repository of SurfaceTopography. The table has a
row for each file of which SurfaceTopography itself reads a map or a line profile; names of all
other files follow. Seconds are those of both commands, in a process that has all packages loaded.
"""

import argparse
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from gfmd_cli.cli import main
from gfmd_cli.study.reading import read_rows

UNCHECKED = {".md", ".py"}  # suffixes of files that are no examples of a format


def shape_of(path: Path) -> tuple[int, ...] | None:
    """Points along x and y that SurfaceTopography reads; None where it reads no surface."""
    from SurfaceTopography import open_topography

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with open_topography(str(path)) as reader:
                channel = reader.default_channel
                unsized = channel.physical_sizes is None
                sizes = {"physical_sizes": (1.0,) * channel.dim} if unsized else {}
                return tuple(map(int, reader.topography(**sizes).nb_grid_pts))
    except Exception:  # a reader can raise any exception
        return None


def solved(path: Path, folder: Path) -> dict[str, Any]:
    """Boundary, points, contacts, seconds and status of a file, by both commands."""
    spec, study = folder / "scan.toml", folder / "scan.h5"
    runner, start = CliRunner(), time.perf_counter()
    for words in (["init", spec, "--from", path], ["run", spec, "-o", study, "-q"]):
        done = runner.invoke(main, [str(word) for word in words])
        if done.exit_code:
            return {"status": done.output.strip().splitlines()[0].replace(f"{path}", path.name)}
    seconds, rows = time.perf_counter() - start, read_rows(study)
    return {
        "boundary": rows[0]["boundary"],
        "grid": _extent((rows[0]["points"], rows[0]["points_y"])),
        "contacts": str(len(rows)),
        "s": f"{seconds:.1f}",
        "status": ", ".join(sorted({row["status"] for row in rows})),
    }


def _extent(shape: tuple[int, ...]) -> str:
    return " x ".join(str(n) for n in shape if n > 1)


def run() -> None:
    """Print the table, row by row, and the files without a surface."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="parts of the names of files")
    arguments = parser.parse_args()
    heads = ("boundary", "grid", "contacts", "s", "status")
    print("| file | points | " + " | ".join(heads) + " |\n" + "| --- " * (len(heads) + 2) + "|")
    unread = []
    for path in sorted(arguments.folder.iterdir()):
        if path.suffix in UNCHECKED or not any(word in path.name for word in arguments.only):
            continue
        shape = shape_of(path)
        if shape is None:
            unread.append(path.name)
            continue
        with tempfile.TemporaryDirectory() as folder:
            row = solved(path, Path(folder))
        cells = [path.name, _extent(shape), *(row.get(head, "") for head in heads)]
        print(f"| {' | '.join(cells)} |", flush=True)
    print(f"\nNot read by SurfaceTopography: {', '.join(unread) or 'none'}", file=sys.stderr)


if __name__ == "__main__":
    run()
