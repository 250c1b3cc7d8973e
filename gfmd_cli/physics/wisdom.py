"""FFTW's wisdom, kept as text in the user's cache directory, so that plans are measured once.

One process plans at a time and then tells the others: all processes of a machine compute with the
same plans, and so to the same bits.
"""

import fcntl
import hashlib
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import pyfftw

T = TypeVar("T")


def processor() -> str:
    """The model name of the processor: a plan measured on one is a bad one on another."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor()


def _paths() -> list[Path]:
    """Files of the wisdom in double and in single precision."""
    cache_home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    key = hashlib.sha256(f"{processor()} {pyfftw.__version__}".encode()).hexdigest()[:12]
    return [cache_home / "gfmd" / f"{name}-{key}.txt" for name in ("fftw", "fftwf")]


def _take_in(paths: list[Path]) -> None:
    """Know what others measured; a file that FFTW refuses is as good as none."""
    known = [b"", b"", b""]  # the third: of long double
    for i, path in enumerate(paths):
        with suppress(OSError):
            known[i] = path.read_bytes()
    pyfftw.import_wisdom(tuple(known))


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Inside, no other process plans; where the folder cannot be written, that is not assured."""
    with ExitStack() as stack:
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context((folder / "lock").open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def planned(plan: Callable[[tuple[str, ...]], T]) -> T:
    """`plan` with the flags of a planner: of what is known, else measured, and kept for all."""
    with suppress(RuntimeError):  # not known
        return plan(("FFTW_MEASURE", "FFTW_WISDOM_ONLY"))
    paths = _paths()
    with _alone(paths[0].parent):
        _take_in(paths)
        before = pyfftw.export_wisdom()
        found = plan(("FFTW_MEASURE",))
        for path, old, new in zip(paths, before, pyfftw.export_wisdom(), strict=False):
            if new == old:
                continue
            fresh = path.with_suffix(f".{os.getpid()}")
            with suppress(OSError):  # a cache that cannot be written costs time only
                fresh.write_bytes(new)
                fresh.replace(path)
    return found
