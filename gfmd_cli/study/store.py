"""The study file: all records of a spec in one HDF5 file, labelled, replaced as a whole.

While tasks run, each commits a record beside the study (in NAME.parts); collecting them
rewrites the study file aside and renames it. A reader never meets a half-written study and never
stops a run.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from gfmd_cli.errors import StudyError
from gfmd_cli.study.files import locked, new_file, new_hdf5, write_whole
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import open_study, spec_of, texts_of
from gfmd_cli.study.record import SUFFIX, Record, read_record, read_status, record_path
from gfmd_cli.study.spec import Spec, refuse_other
from gfmd_cli.study.tasks import Task, plan
from gfmd_cli.study.writing import write_study


class Study:
    """A study file and the unfinished work beside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = path.with_suffix(".parts")

    def check_spec(self, spec: Spec) -> None:
        """Refuse, with the difference, a study that was made from another spec.

        A spec that has more than all tasks of a study makes it grow, unless there is unfinished
        work of the old one.
        """
        message = "made from another spec; take another name (-o) or the old spec."
        with suppress(OSError, ValueError):
            begun = json.loads((self.parts / "spec.json").read_bytes())
            refuse_other(begun, spec, f"{self.parts}: {message}")
        if not self.path.exists():
            return
        with open_study(self.path) as file:
            stored, known = spec_of(file), set(texts_of(file, "task_id"))
        if stored != spec.resolved() and not known <= {task.id for task in plan(spec)}:
            refuse_other(stored, spec, f"{self.path}: {message}")

    @contextmanager
    def work(self, spec: Spec) -> Iterator[list[str]]:
        """The folder of unfinished work, bound to this spec; others may work in it as well.

        Yields what was found damaged, and set aside. The last one to leave removes the folder of
        a complete study. Raises InputError for another spec, SpaceError.
        """
        in_use = self.parts / "in-use"
        with locked(in_use, wait=False) as alone:
            if alone:  # what was being written by a process that was killed
                for path in self.parts.glob(".*"):
                    path.unlink(missing_ok=True)
        with locked(in_use, shared=True):
            with self._collecting():
                self.check_spec(spec)
                write_whole(self.parts / "spec.json", json.dumps(spec.resolved()).encode())
                _, damaged = self._records()
            yield damaged
        with self._collecting(), locked(in_use, wait=False) as alone:
            if alone and self._is_complete():
                shutil.rmtree(self.parts, ignore_errors=True)

    def held(self) -> dict[str, str]:
        """Status by task id of all that is solved, collected or not."""
        states = {}
        for path in self.record_paths():  # before the study, which may take them in meanwhile
            with suppress(StudyError):
                states[path.stem] = read_status(path)
        return self.collected() | states

    def collected(self) -> dict[str, str]:
        """Status by task id of all that the study file holds."""
        if not self.path.exists():
            return {}
        with open_study(self.path) as file:
            ids, states = texts_of(file, "task_id"), texts_of(file, "status")
        return {i: s for i, s in zip(ids, states, strict=True) if s != MISSING}

    def collect(self, spec: Spec, tasks: list[Task], text: str) -> list[str]:
        """Write all records into the study file, then drop them; inside `work`.

        Returns what was found damaged; its task is solved again by the next run. Raises
        SpaceError, StudyError where the study itself is damaged.
        """
        with self._collecting():
            found, damaged = self._records()
            with new_file(self.path, aside=self.parts) as fresh, new_hdf5(fresh) as file:
                old = open_study(self.path) if self.path.exists() else nullcontext()
                with old as former:
                    write_study(file, spec, tasks, text, found, self.parts, former)
            for name in found:
                record_path(self.parts, name).unlink(missing_ok=True)
        return damaged

    def uncollected(self) -> bool:
        """Whether records wait to be collected."""
        return bool(self.record_paths())

    def _records(self) -> tuple[dict[str, Record], list[str]]:
        """Whole records by task id, without fields; a damaged one is set aside, and said."""
        found, damaged = {}, []
        for path in self.record_paths():
            try:
                found[path.stem] = read_record(path, with_fields=False)
            except StudyError as error:
                bad = path.with_suffix(".bad")
                while bad.exists():
                    bad = bad.with_suffix(".again.bad")
                path.replace(bad)
                damaged.append(f"{error}; set aside as {bad.name}, its task is solved again")
        return found, damaged

    def _is_complete(self) -> bool:
        """Whether nothing is left to do, and nothing to look at."""
        if any(self.parts.glob("*.bad")) or self.record_paths() or not self.path.exists():
            return False
        with open_study(self.path) as file:
            return MISSING not in texts_of(file, "status")

    def record_paths(self) -> list[Path]:
        """The records that are not collected yet."""
        return sorted(self.parts.glob(f"*{SUFFIX}"))

    def _collecting(self) -> Any:
        """Keep other collectors out."""
        return locked(self.parts / "collecting")
