"""Compilation of kernels, and the folder where their machine code is cached."""

import os
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit

from gfmd_cli.files.cache import private_folder
from gfmd_cli.files.checksums import digest

NUMBA_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "no_cfunc_wrapper": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract", "nsz"},
}


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call, and cache the machine code if a folder can be written.

    Numba looks for a folder when a function is decorated: NUMBA_CACHE_DIR, the folder of the
    source, the user's cache. If none can be written, a private temporary folder is used.
    """
    if not _is_cache_known():
        _take_private_folder()
    try:
        compiled = njit(cache=True, **NUMBA_OPTIONS)(function)
    except RuntimeError:  # no folder can be written
        if not _take_private_folder():
            return njit(**NUMBA_OPTIONS)(function)
        compiled = njit(cache=True, **NUMBA_OPTIONS)(function)
    if hasattr(compiled, "_cache"):  # not with NUMBA_DISABLE_JIT
        with suppress(OSError, AttributeError):  # a source in a zip file; another Numba
            compiled._cache._cache_file._source_stamp = _stamp(function)
        _tolerate_faults(compiled._cache)
    return compiled


def part_of_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that only kernels of the same file call, as a part of each of them.

    It is always inlined. Otherwise kernels that are loaded from the cache would share one copy of
    it, and its last bits would depend on which of them is loaded first.
    """
    return njit(no_cpython_wrapper=True, forceinline=True, **NUMBA_OPTIONS)(function)


def _is_cache_known() -> bool:
    """Whether there is a cache of the user; without a home, Numba would make a folder "~" here."""
    named = "NUMBA_CACHE_DIR" in os.environ or "XDG_CACHE_HOME" in os.environ
    return named or os.path.expanduser("~") != "~"


def _stamp(function: Callable[..., Any]) -> str:
    """What the machine code of a kernel follows from: code of another stamp is compiled anew.

    Numba itself compares date and size of the file. But a kernel also contains numbers from other
    files, which an upgrade may change alone, and some installers give all files the same date.
    """
    numbers = {
        name: repr(value)
        for name, value in function.__globals__.items()
        if isinstance(value, int | float | np.generic)
    }
    options = NUMBA_OPTIONS | {"fastmath": sorted(NUMBA_OPTIONS["fastmath"])}
    return digest([_text(function.__code__.co_filename), numbers, options])


@cache
def _text(file: str) -> str:
    """The content of a source file."""
    return Path(file).read_text(encoding="utf-8")


@cache
def _take_private_folder() -> bool:
    """Let this process and its workers cache in a private folder; return whether they can."""
    folder = private_folder()
    place = "each run compiles anew" if folder is None else f"compiled code is kept in {folder}"
    warnings.warn(f"no cache folder can be written: {place}", RuntimeWarning, stacklevel=3)
    if folder is None:
        os.environ["XDG_CACHE_HOME"] = os.devnull
    else:
        os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = str(folder)
    return folder is not None


def _tolerate_faults(store: Any) -> None:
    """Compile anew, without an error, if the disk is full or a file of the cache is damaged."""
    load, save = store.load_overload, store.save_overload

    def load_or_forget(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # files cut short raise anything
            with suppress(OSError):
                store.flush()
            return None

    def save_if_possible(*arguments: Any) -> None:
        with suppress(OSError):
            save(*arguments)

    store.load_overload, store.save_overload = load_or_forget, save_if_possible
