"""Cache of results that depend on the content of files."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])
_caches: list[Any] = []


def file_cache(maxsize: int) -> Callable[[Function], Function]:
    """Cache the results of a function or method until `forget_files` is called."""

    def cached(function: Function) -> Function:
        keep = lru_cache(maxsize)(function)
        _caches.append(keep)

        @wraps(function)
        def call(*arguments: Any, **options: Any) -> Any:
            return keep(*arguments, **options)

        return cast(Function, call)

    return cached


def forget_files() -> None:
    """Drop all cached results: files may change, and other plans give other last bits."""
    for cache in _caches:
        cache.cache_clear()
