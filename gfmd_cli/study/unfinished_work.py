"""The folder of unfinished work beside a study: records, checkpoints, plans, locks.

A record is a study of one task, with a checksum of the whole file at its end. Others may be able to
write to the folder, so that nothing in it is trusted: only regular files are opened, links are not
followed, and a damaged file is set aside.
"""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from gfmd_cli.errors import InputError, SpaceError, StudyError
from gfmd_cli.files.atomic import new_file, write_whole
from gfmd_cli.files.checksums import check_seal, digest, seal
from gfmd_cli.files.hdf5 import new_hdf5
from gfmd_cli.files.regular import open_regular, read_regular
from gfmd_cli.study.reading import StudyFile, open_study
from gfmd_cli.study.result import Entry, TaskResult
from gfmd_cli.study.writing import write_study

SUFFIX = ".record"
FAILURE_SUFFIX = ".failed"
MAX_FAILURE_BYTES = 2**16  # of a message; a choice
OWN_FILES = re.compile(
    r"(in-use|collecting|planning)(\..*)?|wisdom-.*\.json|.*\.(record|bad|failed)|\..*"
)
"""Files that gfmd makes in the folder."""
LOCKS = ("in-use", "in-use.owner", "collecting", "collecting.owner")
"""Kept while the rest of the folder is deleted, and then deleted in this order."""
OWN_FOLDERS = re.compile(r"[0-9a-f]{16}")
"""Checkpoints, by the id of the task."""
IN_CHECKPOINT = re.compile(r"pointer|lock(\..*)?|[ab][0-9]*|\..*")


def check_own(parts: Path) -> None:
    """Refuse a folder that is not gfmd's. Raises InputError, SpaceError where none can be made."""
    if parts.is_symlink() or parts.is_file():
        raise SpaceError(f"{parts}: not a folder; move it away or choose another name (-o)")
    for path in listed(parts):
        own = OWN_FOLDERS if _is_folder(path) else OWN_FILES
        is_own = own.fullmatch(path.name) or path.suffix == ".bad"  # a folder set aside
        if not is_own and os.path.lexists(path):  # another process may have deleted it
            raise InputError(
                f"{parts}: needed for unfinished work, but holds {path.name!r}, which is not "
                "gfmd's; move it away or take another name (-o)"
            )


def remove_parts(parts: Path) -> None:
    """Delete what gfmd made in the folder, and the folder if nothing else is in it.

    The locks that this process holds are deleted last, `collecting` after `in-use`: a process that
    can take `collecting` can then take both, and delete what it made in the meantime.
    """
    for path in listed(parts):
        if _is_folder(path):
            if OWN_FOLDERS.fullmatch(path.name):
                delete_checkpoint(path)
        elif path.name not in LOCKS and OWN_FILES.fullmatch(path.name):
            path.unlink(missing_ok=True)
    for name in LOCKS:
        (parts / name).unlink(missing_ok=True)
    with suppress(OSError):
        parts.rmdir()


def listed(folder: Path) -> list[Path]:
    """What is in a folder; nothing where there is none: perhaps it has just been deleted."""
    try:
        return list(folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def _is_folder(path: Path) -> bool:
    """Whether a path is a folder, not a link to one."""
    return os.path.isdir(path) and not os.path.islink(path)


def delete_checkpoint(folder: Path) -> None:
    """Delete the files of a checkpoint, its pointer first, then the folder if it is empty."""
    for path in (folder / "pointer", *listed(folder)):
        if IN_CHECKPOINT.fullmatch(path.name):
            with suppress(OSError):
                path.unlink()
    with suppress(OSError):
        folder.rmdir()


def record_path(parts: Path, task_id: str, stored: Iterable[str]) -> Path:
    """Path of the record of a task; its name tells apart what [output] stores of it."""
    return parts / f"{task_id}-{digest(sorted(stored))[:8]}{SUFFIX}"


def checkpoint_ids(parts: Path) -> list[str]:
    """The ids of the tasks that have a checkpoint in the folder."""
    return [
        path.name for path in listed(parts) if path.is_dir() and OWN_FOLDERS.fullmatch(path.name)
    ]


def write_record(parts: Path, result: TaskResult) -> Path:
    """Write the record of a task, whole or not at all. Raises SpaceError."""
    path = record_path(parts, result.entry.task_id, result.entry.stored)
    with new_file(path) as fresh:
        with new_hdf5(fresh) as file:
            write_study(file, {}, [result.entry], lambda _: result, labelled=False)
        seal(fresh)
    return path


@contextmanager
def open_record(path: Path) -> Iterator[StudyFile]:
    """An undamaged record, for reading. Raises StudyError."""
    try:
        with open_regular(path) as opened:
            check_seal(opened)
            with open_study(path, opened) as record:
                if record.task_ids != [path.stem.partition("-")[0]]:
                    raise StudyError(f"{path}: damaged record: it is of another task")
                yield record
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: damaged record: {error}") from error


def read_record_entry(path: Path) -> Entry:
    """All of a record but its arrays, which are checked. Raises StudyError."""
    with open_record(path) as record:
        status = record.statuses[0]
        if not status.is_solved:
            raise ValueError(f"status {status}")
        return record.result(0, in_memory=False).entry


def read_record(path: Path) -> TaskResult:
    """The whole content of a record. Raises StudyError."""
    with open_record(path) as record:
        return record.result(0)


def note_failure(parts: Path, task_id: str, message: str) -> None:
    """Keep the error that ended a task, for `read_failure`, if there is space for it."""
    with suppress(SpaceError):
        text = message.encode(errors="replace")[:MAX_FAILURE_BYTES]
        write_whole(parts / f"{task_id}{FAILURE_SUFFIX}", text)


def forget_failure(parts: Path, task_id: str) -> None:
    """Delete what `note_failure` has kept of a task."""
    with suppress(OSError):
        (parts / f"{task_id}{FAILURE_SUFFIX}").unlink()


def read_failure(parts: Path, task_id: str) -> str:
    """The error that ended the last run of a task, on one line; "" where none is known."""
    try:
        content = read_regular(parts / f"{task_id}{FAILURE_SUFFIX}", MAX_FAILURE_BYTES)
    except OSError:
        return ""
    return " ".join(content.decode(errors="replace").split())


def set_aside(path: Path, bad: Path | None = None) -> Path:
    """Rename a damaged file to *.bad, which no earlier one has; return the new path."""
    bad = bad or path.with_suffix(".bad")
    while os.path.lexists(bad):
        bad = bad.with_suffix(".again.bad")
    return path.replace(bad)
