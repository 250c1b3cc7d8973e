"""Plans of Fourier transforms: measured once and stored; or estimated, which gives the same plans.

FFTW's wisdom (what it has measured) is stored as text: beside the study of a run, so that a resumed
run uses the plans of the first one, and in the user's cache for other runs. One process at a time
measures plans and stores them for the others, so that all processes of a machine compute the same
bits.
"""

import hashlib
import json
import os
import platform
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import cache, partial
from math import ceil
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple, TypeVar

import pyfftw

from gfmd_cli.errors import SpaceError
from gfmd_cli.files.atomic import remove_temporary, write_whole
from gfmd_cli.files.cache import cache_folder
from gfmd_cli.files.locks import AS_LONG_AS_NEEDED, Waits, locked
from gfmd_cli.files.regular import read_regular

T = TypeVar("T")
Plan = Callable[..., Any]
"""Makes a plan on one thread from source, target, axes and direction."""
Wisdom = list[str]
"""Text in double and in single precision."""
PLANNING_SECONDS = (30.0, 1e-6)  # time limit of a search for a plan: constant, and per grid point
MAX_WISDOM_BYTES = 2**24  # of a file of wisdom
MAX_CACHED_LINES = 10000  # in each precision; a new size adds some 20 and reads and writes all
WISDOM = re.compile(
    r"\([\w. -]+( #x[0-9a-f]{1,8}){4}\n"
    r"(  \(\w+ \d{1,4}( #x[0-9a-f]{1,5}){2} #x1?[0-9a-f]{1,2}( #x[0-9a-f]{1,8}){4}\)\n)*"
    r"\)\n"
)
"""Text that FFTW reads; flags of more than 20, 20 and 9 bits (its planner.h) abort the process."""


def fast_length(points: float) -> int:
    """The smallest number of points, at least `points`, that is fast to transform."""
    return int(pyfftw.next_fast_len(ceil(points)))


@cache
def processor() -> str:
    """The model name of the processor: a plan measured on one is a bad one on another."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def _here() -> dict[str, str]:
    """The processor and the versions on which plans depend."""
    return {"processor": processor(), "fftw": pyfftw.fftw_version, "pyfftw": pyfftw.__version__}


_without_lock: set[Path] = set()  # folders that this process could not lock
_planner = Lock()  # FFTW does not protect its wisdom, which all threads share
_always_estimated = os.environ.get("GFMD_PLANS") == "estimated"


class _Planning(NamedTuple):
    """How the run in a thread plans its transforms."""

    folder: Path | None = None
    """Where wisdom is kept; None for the cache."""
    estimated: bool = False
    waits: Waits = AS_LONG_AS_NEEDED
    """For other processes that measure."""


_CACHED = _Planning()
_planning: ContextVar[_Planning] = ContextVar("planning", default=_CACHED)
"""Planning of the present thread: a process may run several studies side by side."""
_wisdom_of = _CACHED  # the run whose plans FFTW knows; those of another one may differ


def plan_with(
    folder: Path | None, *, estimated: bool = False, waits: Waits = AS_LONG_AS_NEEDED
) -> str | None:
    """From now on store wisdom in `folder`, which starts with that of the cache, or only estimate.

    This holds for the calling thread. The process forgets its own wisdom. Returns a warning if the
    folder's wisdom is damaged.
    """
    _planning.set(_Planning(folder, estimated, waits))
    with _planner:
        _forget_wisdom()
        _without_lock.clear()
    if folder is None or _is_estimated():
        return None
    with _planning_lock(folder):
        wisdom = read_wisdom(folder)
        damaged = wisdom is None and _path(folder).exists()
        if wisdom is None and (known := read_wisdom(cache_folder())) is not None:
            _write(folder, known)
    if not damaged:
        return None
    return f"{_path(folder)}: damaged; transforms are planned anew, last bits may differ"


def _forget_wisdom() -> None:
    """Forget all that FFTW knows, from now on for the run of this thread."""
    global _wisdom_of
    pyfftw.forget_wisdom()
    _wisdom_of = _planning.get()


def _is_estimated() -> bool:
    return _planning.get().estimated or _always_estimated


def plans() -> str:
    """How this run plans: "estimated", or "measured" with the digest of its wisdom."""
    if _is_estimated():
        return "estimated"
    known = read_wisdom(_planning.get().folder or cache_folder())
    return f"measured {_digest(known) if known else ''}".strip()


def planned_transforms(make: Callable[[Plan], T], size: int = 0) -> T:
    """The transforms that `make` plans. Plans that are not known yet are measured and stored.

    The time limit of a measurement increases with the number of grid points, `size`.
    """
    fftw = partial(pyfftw.FFTW, planning_timelimit=PLANNING_SECONDS[0] + PLANNING_SECONDS[1] * size)
    with _planner:
        if _wisdom_of != _planning.get():  # a run in another thread has planned since
            _forget_wisdom()
        if _is_estimated():
            return make(partial(fftw, flags=("FFTW_ESTIMATE",)))
        with suppress(RuntimeError):  # not known
            return make(partial(fftw, flags=("FFTW_MEASURE", "FFTW_WISDOM_ONLY")))
        return _measured(make, partial(fftw, flags=("FFTW_MEASURE",)))


def _measured(make: Callable[[Plan], T], fftw: Plan) -> T:
    """The transforms that `make` plans, measured unless another process has measured them."""
    of_study = _planning.get().folder
    folder = of_study or cache_folder()
    with _planning_lock(folder) as alone:
        _import(read_wisdom(folder))
        before = _export()
        transforms = make(fftw)
        is_new = _export() != before
        if is_new and of_study is not None:
            _write(folder, _export())
        elif is_new:
            _add_to_cache(alone)
    if is_new and of_study is not None:
        with _planning_lock(cache_folder()) as alone:
            _add_to_cache(alone)
    return transforms


def _add_to_cache(alone: bool) -> None:
    """Store what this process knows in the cache; `alone` says whether the cache is locked."""
    if alone:
        remove_temporary(_path(cache_folder()))
    _write(cache_folder(), _joined(read_wisdom(cache_folder()), _export()))


def read_wisdom(folder: Path) -> Wisdom | None:
    """The wisdom of a folder; None if it is damaged, missing or of another machine."""
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        data = json.loads(read_regular(_path(folder), MAX_WISDOM_BYTES))
        double, single = data["wisdom"]
        known = data["for"] == _here() and data["sha256"] == _digest([double, single])
        if known and WISDOM.fullmatch(double) and WISDOM.fullmatch(single):
            return [double, single]
    return None


def _path(folder: Path) -> Path:
    key = hashlib.sha256(json.dumps(_here()).encode()).hexdigest()[:12]
    return folder / f"wisdom-{key}.json"


def _digest(wisdom: Wisdom) -> str:
    return hashlib.sha256("\n".join(wisdom).encode()).hexdigest()


def _export() -> Wisdom:
    return [text.decode("ascii") for text in pyfftw.export_wisdom()[:2]]


def _joined(wisdom: Wisdom | None, more: Wisdom) -> Wisdom:
    """Both; if they have more than `MAX_CACHED_LINES`, those lines that were added last.

    A plan is a line, with flags and problem from word 3. Of two for one problem the first is kept.
    """
    joined = []
    for old, new in zip(wisdom or more, more, strict=True):
        first, *lines, last = old.splitlines()
        known = {tuple(line.split()[2:]) for line in lines}
        lines += [line for line in new.splitlines()[1:-1] if tuple(line.split()[2:]) not in known]
        joined.append("\n".join([first, *lines[-MAX_CACHED_LINES:], last]) + "\n")
    return joined


def _import(wisdom: Wisdom | None) -> None:
    """Add what other processes measured to the wisdom of this one."""
    if wisdom is not None:
        double, single = wisdom
        pyfftw.import_wisdom((double.encode(), single.encode(), b""))  # third: of long double


def _write(folder: Path, wisdom: Wisdom) -> None:
    """Store wisdom, unless the folder cannot be written, which only costs time."""
    data = {"for": _here(), "sha256": _digest(wisdom), "wisdom": wisdom}
    with suppress(SpaceError):
        write_whole(_path(folder), json.dumps(data, indent=1).encode("ascii"))


@contextmanager
def _planning_lock(folder: Path) -> Iterator[bool]:
    """Keep other processes from planning inside the block; yields whether the folder is locked.

    The cache is made where it is missing, the folder beside a study is not.
    """
    with ExitStack() as stack:
        if folder != _planning.get().folder:
            with suppress(OSError):
                folder.mkdir(parents=True, exist_ok=True)
        is_locked = os.path.isdir(folder) and folder not in _without_lock  # Path.is_dir can raise
        if is_locked:
            try:
                stack.enter_context(locked(folder / "planning", waits=_planning.get().waits))
            except SpaceError:  # it may have taken minutes: not again
                _without_lock.add(folder)
                is_locked = False
        yield is_locked
