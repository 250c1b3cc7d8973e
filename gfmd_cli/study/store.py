"""The study file: the results of tasks in one HDF5 file, replaced as a whole.

While tasks run, each writes a record, a study of one task, to the folder beside the study
(NAME.parts). Collecting is concatenating: a new study is written from the old one and the records,
aside, and renamed. So a reader never meets a half-written study and never stops a run.

What belongs to a study is decided task by task: any number of specs can share one, also at the same
time. A result leaves a study only for one of the same task with at least the same output.
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from gfmd_cli.errors import InputError, Interrupted, SpaceError, StudyError
from gfmd_cli.files.atomic import check_place, exists, new_file, target_of
from gfmd_cli.files.checksums import Version, file_version
from gfmd_cli.files.hdf5 import new_hdf5
from gfmd_cli.files.locks import AS_LONG_AS_NEEDED, WaitOptions, locked
from gfmd_cli.spec.models import Spec
from gfmd_cli.status import Status
from gfmd_cli.study import unfinished_work
from gfmd_cli.study.measure import task_row
from gfmd_cli.study.provenance import origin
from gfmd_cli.study.reading import StudyFile, damage_named, open_study
from gfmd_cli.study.result import Entry, Outcome, TaskResult
from gfmd_cli.study.tasks import Task
from gfmd_cli.study.writing import write_study

EARLIER = "earlier_specs"
"""Attribute with the texts of the specs before the last one, as JSON."""
_Results = dict[str, tuple[Entry, Callable[[], TaskResult]]]
"""Entry, and a function that reads the whole result, by the id of the task."""


class Study:
    """A study file and the unfinished work beside it.

    Raises InputError for a link to itself and for a path without a name, such as "." or "/".
    """

    def __init__(self, path: Path, wait_options: WaitOptions = AS_LONG_AS_NEEDED) -> None:
        self._wait_options = wait_options
        self.path = target_of(path)
        if os.path.islink(self.path):
            raise InputError(f"{path}: a symbolic link that leads to itself")
        if not self.path.name:
            raise InputError(f"{path}: a folder, where a study file (NAME.h5) is expected")
        self._entries: dict[tuple[Path, Version], Entry] = {}
        """The records read so far, by path and version."""
        self._held: os.stat_result | None = None
        """The lock in the folder of unfinished work that this process has, inside `work`."""
        is_usual = self.path.suffix == ".h5"
        self.parts = self.path.with_suffix(".parts" if is_usual else f"{self.path.suffix}.parts.d")

    @contextmanager
    def work(self, tasks: list[Task]) -> Iterator[list[str]]:
        """The folder of unfinished work; others may work in it as well, also on other tasks.

        Yields what was found damaged, and set aside. The last one to leave removes the folder
        unless something is left to do there. Raises InputError, and SpaceError, also where the
        folder was renamed or deleted meanwhile.
        """
        check_place(self.path)
        unfinished_work.check_own(self.parts)
        in_use = self.parts / "in-use"
        with locked(in_use, wait=False) as alone:
            if alone:  # what was being written by a process that was killed
                for path in self.parts.glob(".*"):
                    with suppress(OSError):
                        path.unlink()
        with locked(in_use, shared=True, wait_options=self._wait_options):
            self._held = in_use.stat()
            with self._collecting():
                _, damaged = self._sound_records()
            try:
                yield damaged
            finally:  # which folder is gone says more than what became of the tasks
                self._check_held()
                self._held = None
        # whoever collects for too long leaves later, and removes the folder
        with suppress(Interrupted), self._collecting(), locked(in_use, wait=False) as alone:
            if alone and self._is_complete(tasks):
                unfinished_work.remove_parts(self.parts)

    def outcomes(self) -> dict[str, Outcome]:
        """What is stored of each task that is solved, collected or not, by its id."""
        records, _ = self.records()  # before the study, which may take them in meanwhile
        outcomes: dict[str, Outcome] = {}
        if exists(self.path):
            with open_study(self.path) as file:
                tasks = zip(file.task_ids, file.statuses, file.stored, strict=True)
                outcomes = {
                    name: Outcome(status, out) for name, status, out in tasks if status.is_solved
                }
        for entry in records.values():
            if entry.task_id not in outcomes or entry.stored >= outcomes[entry.task_id].stored:
                outcomes[entry.task_id] = Outcome(entry.row["status"], entry.stored)
        return outcomes

    def collect(self, spec: Spec, tasks: list[Task], text: str) -> list[str]:
        """Write all records into the study file, then drop them; inside `work`.

        The study begins with the tasks of the spec; solved tasks of other specs follow.

        Returns what was found damaged; its task is solved again by the next run. Raises
        SpaceError, StudyError where the study itself is damaged.
        """
        self._check_held()
        with self._collecting():
            records, damaged = self._sound_records()
            with ExitStack() as stack:
                old = stack.enter_context(open_study(self.path)) if exists(self.path) else None
                attributes = origin(spec, text)
                attributes[EARLIER] = json.dumps(_earlier_specs(old, text))
                results = self._stored_results(records, old)
                entries = _entries(tasks, results)
                fresh = stack.enter_context(new_file(self.path, aside=self.parts))
                file = stack.enter_context(new_hdf5(fresh))
                write_study(file, attributes, entries, lambda i: results[entries[i].task_id][1]())
            for path in records:
                path.unlink(missing_ok=True)
            self._entries.clear()
        return damaged

    def move_aside(self) -> list[Path]:
        """Rename the study and its folder of unfinished work; return their new paths.

        Raises InputError where another run works there, SpaceError for a read-only study.
        """
        check_place(self.path)
        number, target = 1, self.path
        while exists(target) or exists(Study(target).parts):
            target = self.path.with_name(f"{self.path.stem}.{number}{self.path.suffix}")
            number += 1
        new_paths = []
        if exists(self.parts):
            unfinished_work.check_own(self.parts)
            with locked(self.parts / "in-use", wait=False) as alone:
                if not alone:
                    raise InputError(f"{self.path}: another run works on this study; wait for it")
                new_paths.append(_renamed(self.parts, Study(target).parts))
        if exists(self.path):
            new_paths.append(_renamed(self.path, target))
        return new_paths

    def records(self) -> tuple[dict[Path, Entry], dict[Path, StudyError]]:
        """The records that are not collected yet, and what is wrong with the damaged ones.

        Each is read once: records are never changed, but replaced.
        """
        entries, damaged = {}, {}
        for path in self.record_paths():
            try:
                version = path, file_version(path, follow=False)
                if version not in self._entries:
                    self._entries[version] = unfinished_work.read_record_entry(path)
                entries[path] = self._entries[version]
            except FileNotFoundError:  # it has just been collected
                continue
            except StudyError as error:
                if os.path.lexists(path):  # likewise
                    damaged[path] = error
        return entries, damaged

    def _sound_records(self) -> tuple[dict[Path, Entry], list[str]]:
        """The records by path; a damaged one is set aside, with a message."""
        entries, damaged = self.records()
        messages = []
        for path, error in damaged.items():
            bad = unfinished_work.set_aside(path)
            messages.append(f"{error}; set aside as {bad.name}, its task is solved again")
        return entries, messages

    def _is_complete(self, tasks: list[Task]) -> bool:
        """Whether no task is missing, and no record or unfinished checkpoint is left."""
        if self.damaged_paths() or self.record_paths() or not self.path.exists():
            return False
        with open_study(self.path) as file:
            if not all(status.is_solved for status in file.statuses):
                return False
        lacking = {task.id for task in without_result(tasks, self.outcomes())}
        solved = {task.id for task in tasks} - lacking
        return set(unfinished_work.checkpoint_ids(self.parts)) <= solved

    def damaged_paths(self) -> list[Path]:
        """The damaged files that were set aside."""
        return self._parts_named(".bad")

    def record_paths(self) -> list[Path]:
        """The records that are not collected yet."""
        return self._parts_named(unfinished_work.SUFFIX)

    def _parts_named(self, suffix: str) -> list[Path]:
        """The unfinished work with this suffix. Raises OSError where the folder cannot be read."""
        return sorted(path for path in unfinished_work.listed(self.parts) if path.suffix == suffix)

    def _check_held(self) -> None:
        """Raise SpaceError where the folder of unfinished work is no longer that of `work`."""
        lock: os.stat_result | None = None
        with suppress(OSError):  # also a file in place of the folder, or a stale handle of NFS
            lock = (self.parts / "in-use").stat()
        if self._held and not (lock and os.path.samestat(lock, self._held)):
            raise SpaceError(
                f"{self.parts}: renamed or deleted during the run, with all results that were not "
                "collected yet; give it back its name and run again"
            )

    def _stored_results(self, records: dict[Path, Entry], old: StudyFile | None) -> _Results:
        """The solved tasks of the records and of the study so far."""
        results: _Results = {}

        def result_of(old: StudyFile, index: int) -> TaskResult:
            with damage_named(self.path):
                return old.result(index)

        if old is not None:
            for index, status in enumerate(old.statuses):
                if status.is_solved:
                    results[old.task_ids[index]] = old.entry(index), partial(result_of, old, index)
        for path, entry in records.items():
            before = results.get(entry.task_id)
            if before is None or entry.stored >= before[0].stored:
                results[entry.task_id] = entry, partial(unfinished_work.read_record, path)
        return results

    def _collecting(self) -> Any:
        """Keep other collectors out."""
        return locked(self.parts / "collecting", wait_options=self._wait_options)


def _renamed(path: Path, target: Path) -> Path:
    """Rename a file or folder; return its new path. Raises SpaceError where that cannot be done."""
    try:
        return path.rename(target)
    except OSError as error:
        raise SpaceError(f"{path}: cannot be renamed to {target}: {error.strerror}") from error


def without_result(tasks: Iterable[Task], outcomes: dict[str, Outcome]) -> list[Task]:
    """The tasks to solve: those that are not stored with all their output.

    What is stored of them with less output is kept: they store it as well.
    """
    nothing = Outcome(Status.MISSING, frozenset())
    return [
        replace(task, output=task.output.with_names(outcomes.get(task.id, nothing).stored))
        for task in tasks
        if task.id not in outcomes or not task.output.names() <= outcomes[task.id].stored
    ]


def _earlier_specs(old: StudyFile | None, text: str) -> list[str]:
    """The texts of all specs that a study was collected with, but for the present one."""
    if old is None:
        return []
    texts = [*json.loads(old.attributes[EARLIER]), old.attributes["spec_text"]]
    return [earlier for earlier in dict.fromkeys(texts) if earlier != text]


def _entries(tasks: list[Task], results: _Results) -> list[Entry]:
    """The tasks of a spec, solved or not, as the spec describes them; then the other results."""
    own: dict[str, Entry] = {}
    for task in tasks:
        missing = Entry(task.id, task.scene_id, frozenset(), {"status": Status.MISSING})
        entry = results[task.id][0] if task.id in results else missing
        own[task.id] = entry._replace(row=task_row(task, entry.row))
    return [*own.values(), *(entry for name, (entry, _) in results.items() if name not in own)]
