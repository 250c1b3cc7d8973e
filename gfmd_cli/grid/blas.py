"""BLAS on one thread.

The matrix products of a solve are small, and sums of products must not depend on the number of
threads. The threads of BLAS do not speed them up; where other processes use the cores, the threads
wait for each other up to thirty times as long as one thread computes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

from threadpoolctl import ThreadpoolController

_lock = Lock()
_active: list[Any] = []
"""One entry, the limit, per running call: the threads of a process share the libraries."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread until the last of all such calls of this process has ended."""
    with _lock:
        limit = _active[0] if _active else _libraries().limit(limits=1, user_api="blas")
        _active.append(limit)
    try:
        yield
    finally:
        with _lock:
            _active.pop()
            if not _active:
                limit.restore_original_limits()


@cache
def _libraries() -> ThreadpoolController:
    """The BLAS libraries of this process. Cached, because the search takes milliseconds."""
    return ThreadpoolController()
