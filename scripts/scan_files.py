"""Every measured surface in a folder: `gfmd init --from FILE`, then `gfmd run`, unedited.

    python scripts/scan_files.py FOLDER [--only WORDS] [--limit SECONDS] > table.md

FOLDER can be `test/file_format_examples` of the repository of SurfaceTopography. The table has a
row for each file of which SurfaceTopography itself reads a map or a line profile; names of all
other files follow. Each file has a process of its own, in which most packages are loaded. Seconds
are those of both commands, as elapsed and as processor time; --limit stops a file. The table of
docs/map_evidence.md.
"""

import argparse
import sys
import tempfile
import time
import warnings
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from markdown_tables import print_head, print_row

import gfmd_cli.study.run  # noqa: F401  # loads the packages once
from gfmd_cli.cli import main
from gfmd_cli.study.reading import read_rows

UNCHECKED = {".md", ".py"}  # suffixes of files that are no examples of a format
HEADS = ("treatment", "contacts", "$a_r$", "residual", "status", "s", "CPU s")


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


def solved(path: Path, folder: str) -> dict[str, str]:
    """The cells of a file under their heads, by both commands."""
    runner, start = CliRunner(), (time.monotonic(), time.process_time())
    spec, study = Path(folder, "scan.toml"), Path(folder, "scan.h5")
    for words in (["init", spec, "--from", path], ["run", spec, "-o", study, "-q", "-j", 1]):
        done = runner.invoke(main, [str(word) for word in words])
        if done.exit_code and not study.exists():
            return {"status": done.output.strip().splitlines()[0].replace(f"{path}", path.name)}
    times = (time.monotonic() - start[0], time.process_time() - start[1])
    results = _results(read_rows(study))
    return dict(zip(HEADS, (*results, *(f"{t:.1f}" for t in times)), strict=True))


def solved_within(path: Path, folder: str, limit: float | None) -> dict[str, str]:
    """The cells of a file, solved in a process that is ended after `limit` seconds."""
    processes = get_context("fork")
    receiver, sender = processes.Pipe(duplex=False)
    process = processes.Process(target=lambda: sender.send(solved(path, folder)))
    process.start()
    sender.close()
    try:
        return (
            receiver.recv() if receiver.poll(limit) else {"status": f"not finished in {limit:g} s"}
        )
    except EOFError:
        return {"status": "the process has failed"}
    finally:
        process.kill()
        process.join()


def _results(rows: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Treatment, number of contacts, contact areas, largest residual and status of a study."""
    treatment = rows[0]["preparation"].split(" points, ")[-1].split(", interpolation")[0]
    areas = sorted(row["a_r"] for row in rows)
    return (
        treatment,
        str(len(rows)),
        f"{areas[0]:.2g} to {areas[-1]:.2g}",
        f"{max(row['residual'] for row in rows):.0e}",
        ", ".join(sorted({row["status"] for row in rows})),
    )


def run() -> None:
    """Print the table, row by row, and the files without a surface."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="parts of the names of files")
    parser.add_argument("--limit", type=float, help="seconds after which a file is given up")
    arguments = parser.parse_args()
    print_head("file", "points", *HEADS)
    unread = []
    for path in sorted(arguments.folder.iterdir()):
        if path.suffix in UNCHECKED or not any(word in path.name for word in arguments.only):
            continue
        shape = shape_of(path)
        if shape is None:
            unread.append(path.name)
            continue
        with tempfile.TemporaryDirectory() as folder:
            row = solved_within(path, folder, arguments.limit)
        points = " x ".join(str(n) for n in shape if n > 1)
        print_row(path.name, points, *(row.get(head, "") for head in HEADS))
    print(f"\nNot read by SurfaceTopography: {', '.join(unread) or 'none'}", file=sys.stderr)


if __name__ == "__main__":
    run()
