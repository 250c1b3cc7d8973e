"""FFTW's wisdom, kept as text in the user's cache directory, so that plans are measured once."""

import hashlib
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import pyfftw

KNOWN = 0.01  # seconds; a plan made faster was known already, or is not worth keeping


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


@cache
def _load() -> None:
    """Take in what earlier processes measured; a file that FFTW refuses is as good as none."""
    known = [b"", b"", b""]  # the third: of long double
    for i, path in enumerate(_paths()):
        with suppress(OSError):
            known[i] = path.read_bytes()
    pyfftw.import_wisdom(tuple(known))


@contextmanager
def kept() -> Iterator[None]:
    """Plan inside with the wisdom known, and keep what was learnt."""
    _load()
    begun = time.perf_counter()
    yield
    if time.perf_counter() - begun < KNOWN:
        return
    for path, learnt in zip(_paths(), pyfftw.export_wisdom(), strict=False):
        fresh = path.with_suffix(f".{os.getpid()}")
        with suppress(OSError):  # a cache that cannot be written costs time only
            path.parent.mkdir(parents=True, exist_ok=True)
            fresh.write_bytes(learnt)
            fresh.replace(path)
