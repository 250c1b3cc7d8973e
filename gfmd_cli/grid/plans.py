"""Plans of Fourier transforms: measured once and stored, or estimated.

Measuring compares hundreds of plans, which takes some tenths of a second for each grid and
precision, however short the transforms are. An estimated plan is found in some milliseconds; with
estimated plans, a solve on a large grid takes up to 30 % longer (docs/performance.md). Estimated
plans are the same in every run, stored or not.

FFTW's wisdom (what it has measured or estimated) is stored as text: beside the study of a run, so
that a resumed run uses the plans of the first one, and in the user's cache for other runs. One
process at a time measures plans and stores them for the others, so that all processes of a machine
compute the same bits. The wisdom of each group of transforms is stored on its own, and all
processes make their plans from this text alone, also that which has measured: FFTW takes parts of a
plan from what it knows of other transforms, so that a plan would depend on which of them are known.
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
from threading import RLock
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import pyfftw

from gfmd_cli.errors import SpaceError
from gfmd_cli.files.atomic import remove_temporary, write_whole
from gfmd_cli.files.cache import cache_folder
from gfmd_cli.files.locks import AS_LONG_AS_NEEDED, WaitOptions, locked
from gfmd_cli.files.regular import read_regular

T = TypeVar("T")
Planner = Callable[..., Any]
"""Makes a plan on one thread from source, target, axes and direction."""
Wisdom = dict[str, list[str]]
"""Texts in double and in single precision by the key of a group of transforms."""
PLANNING_SECONDS = (30.0, 1e-6)  # time limit of a search for a plan: constant, and per grid point
MIN_MEASURED_POINTS = 2**17  # of a grid; plans of smaller ones are estimated
"""A compromise. On 256^2, solves take 4 to 8 % longer than if all plans were measured, and planning
takes less time by that of 28 to 51 solves. With 2^18, plans of 400^2 are estimated, too: solves on
both grids take 6 % less to 14 % more time, and planning less by that of up to 67 solves (two runs
of `scripts/plan_times.py --points 256 400 --measured-from 0 65536 131072 262144 --repeats 25`)."""
MAX_WISDOM_BYTES = 2**24  # of a file of wisdom
MAX_CACHED_LINES = 20000  # of wisdom; a new size adds some 50 and reads and writes all
KEY = re.compile("[0-9a-f]{16}")
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
    """The model name of the processor: a plan measured on one is a bad one on another.

    Without a name (ARM), the numbers of the vendor and the model.
    """
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        for keys in (("model name",), ("CPU implementer", "CPU part")):
            found = [line.partition(":")[2].strip() for line in lines if line.startswith(keys)]
            if found:
                return " ".join(dict.fromkeys(found))
    return platform.processor()


def _here() -> dict[str, str]:
    """The processor and the versions on which plans depend."""
    return {"processor": processor(), "fftw": pyfftw.fftw_version, "pyfftw": pyfftw.__version__}


_without_lock: set[Path] = set()  # folders that this process could not lock
_planner = RLock()  # FFTW does not protect its wisdom, which all threads share
os.register_at_fork(
    before=_planner.acquire, after_in_parent=_planner.release, after_in_child=_planner.release
)
"""A fork waits until no thread plans: in its process the lock would never be released."""


class _Planning(NamedTuple):
    """How the run in a thread plans its transforms."""

    folder: Path | None = None
    """Where wisdom is kept; None for the cache."""
    estimated: bool = False
    wait_options: WaitOptions = AS_LONG_AS_NEEDED
    """For other processes that measure."""


_CACHED = _Planning()
_planning: ContextVar[_Planning] = ContextVar("planning", default=_CACHED)
"""Planning of the present thread: a process may run several studies side by side."""
_known: dict[_Planning, Wisdom] = {}
"""What this process has read or measured for each run; the wisdom of another one may differ."""
_estimates: Wisdom = {}
"""What this process has estimated, which is the same for all runs."""


def plan_with(
    folder: Path | None, *, estimated: bool = False, wait_options: WaitOptions = AS_LONG_AS_NEEDED
) -> str | None:
    """From now on store wisdom in `folder`, which starts with that of the cache, or only estimate.

    This holds for the calling thread. Returns a warning if the folder's wisdom is damaged.
    """
    _planning.set(_Planning(folder, estimated, wait_options))
    with _planner:
        _known.clear()
        _without_lock.clear()
        if folder is None or are_estimated():
            return None
        with _planning_lock(folder):
            wisdom = read_wisdom(folder)
            damaged = wisdom is None and os.path.lexists(_path(folder))
            if wisdom is None and (known := read_wisdom(cache_folder())) is not None:
                _write(folder, known)
    if not damaged:
        return None
    return f"{_path(folder)}: damaged; transforms are planned anew, last bits may differ"


def are_estimated() -> bool:
    """Whether plans are estimated: as the run of this thread asks, or the environment."""
    return _planning.get().estimated or os.environ.get("GFMD_PLANS") == "estimated"


def plans() -> str:
    """How this run plans: "estimated", or "measured" with the digest of its wisdom."""
    if are_estimated():
        return "estimated"
    known = read_wisdom(_planning.get().folder or cache_folder())
    return f"measured {_digest(known)}" if known else "estimated"


def planned_transforms(make: Callable[[Planner], T], size: int, *, is_temporary: bool = False) -> T:
    """The transforms that `make` plans. Plans that are not known yet are measured and stored.

    Plans of temporary grids are estimated and stored: an estimate takes up to 20 ms. Those of fewer
    points than `MIN_MEASURED_POINTS` are estimated in each process. The time limit of a measurement
    increases with the number of grid points, `size`.
    """
    is_stored = size >= MIN_MEASURED_POINTS and not are_estimated()
    effort = "FFTW_MEASURE" if is_stored and not is_temporary else "FFTW_ESTIMATE"
    limit = PLANNING_SECONDS[0] + PLANNING_SECONDS[1] * size
    fftw = partial(pyfftw.FFTW, planning_timelimit=limit, flags=(effort,))
    with _planner:
        key = _key(make, effort)
        known = _known.setdefault(_planning.get(), {}) if is_stored else _estimates
        with suppress(KeyError, RuntimeError):  # not known
            return _by_wisdom(known[key], make, fftw)
        return (_stored if is_stored else _searched)(known, key, make, fftw)


def _key(make: Callable[[Planner], Any], effort: str) -> str:
    """The key of a group of transforms: of the layout and axes of all arrays that it transforms."""
    problems = [effort]

    def record(source: Any, target: Any, *others: Any) -> Any:
        is_in_place = source.ctypes.data == target.ctypes.data
        for array in (source, target):
            offset = array.ctypes.data % pyfftw.simd_alignment
            problems.append(f"{array.dtype.str} {array.shape} {array.strides} {offset}")
        problems.append(f"{is_in_place} {others}")
        return SimpleNamespace(execute=None)

    make(record)
    return hashlib.sha256("\n".join(problems).encode()).hexdigest()[:16]


def _by_wisdom(texts: list[str], make: Callable[[Planner], T], fftw: partial[Any]) -> T:
    """The transforms that `make` plans, from their wisdom. Raises RuntimeError if it lacks one."""
    pyfftw.forget_wisdom()
    # Importing a text takes 0.25 ms. One without plans, each of which is in brackets, is left out.
    double, single = (text.encode() if text.count("(") > 1 else b"" for text in texts)
    pyfftw.import_wisdom((double, single, b""))  # third: of long double
    return make(partial(fftw, flags=(*fftw.keywords["flags"], "FFTW_WISDOM_ONLY")))


def _searched(known: Wisdom, key: str, make: Callable[[Planner], T], fftw: partial[Any]) -> T:
    """The transforms that `make` plans; their wisdom is added to `known`."""
    pyfftw.forget_wisdom()
    transforms = make(fftw)
    known[key] = _export()
    with suppress(RuntimeError):  # the time limit has ended the search
        transforms = _by_wisdom(known[key], make, fftw)
    return transforms


def _stored(known: Wisdom, key: str, make: Callable[[Planner], T], fftw: partial[Any]) -> T:
    """The same, stored unless another process has stored them."""
    of_study = _planning.get().folder
    folder = of_study or cache_folder()
    with _planning_lock(folder) as alone:
        stored = read_wisdom(folder) or {}
        known.update(stored)
        with suppress(KeyError, RuntimeError):
            return _by_wisdom(stored[key], make, fftw)
        transforms = _searched(known, key, make, fftw)
        if of_study is None:
            _add_to_cache(key, known[key], alone)
        else:
            _write(folder, stored | {key: known[key]})
    if of_study is not None:
        with _planning_lock(cache_folder()) as alone:
            _add_to_cache(key, known[key], alone)
    return transforms


def _add_to_cache(key: str, texts: list[str], alone: bool) -> None:
    """Store what this process has measured in the cache; `alone` says whether this is locked."""
    if alone:
        remove_temporary(_path(cache_folder()))
    cached = read_wisdom(cache_folder()) or {}
    _write(cache_folder(), _limited(cached | {key: cached.get(key, texts)}))


def read_wisdom(folder: Path) -> Wisdom | None:
    """The wisdom of a folder; None if it is damaged, missing or of another machine."""
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        data = json.loads(read_regular(_path(folder), MAX_WISDOM_BYTES))
        wisdom: Wisdom = data["wisdom"]
        texts = [text for double, single in wisdom.values() for text in (double, single)]
        known = data["for"] == _here() and data["sha256"] == _digest(wisdom)
        if known and all(map(KEY.fullmatch, wisdom)) and all(map(WISDOM.fullmatch, texts)):
            return wisdom
    return None


def _path(folder: Path) -> Path:
    key = hashlib.sha256(json.dumps(_here()).encode()).hexdigest()[:12]
    return folder / f"wisdom-{key}.json"


def _digest(wisdom: Wisdom) -> str:
    return hashlib.sha256(json.dumps(wisdom).encode()).hexdigest()


def _export() -> list[str]:
    return [text.decode("ascii") for text in pyfftw.export_wisdom()[:2]]


def _limited(wisdom: Wisdom) -> Wisdom:
    """The groups that were added last, of at most `MAX_CACHED_LINES`."""
    kept, lines = len(wisdom), 0
    for texts in reversed(wisdom.values()):
        lines += sum(text.count("\n") for text in texts)
        if lines > MAX_CACHED_LINES:
            break
        kept -= 1
    return dict(list(wisdom.items())[kept:])


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
                stack.enter_context(
                    locked(folder / "planning", wait_options=_planning.get().wait_options)
                )
            except SpaceError:  # it may have taken minutes: not again
                _without_lock.add(folder)
                is_locked = False
        yield is_locked
