"""gfmd: elastic contact of rough surfaces, for bodies of any stiffness k(q)."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gfmd_cli.api import Result, compare, dataset, rows, run, solve

__all__ = ["Result", "compare", "dataset", "rows", "run", "solve"]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """The calls of the Python API, loaded when first asked for: the command line starts quickly."""
    if name in __all__:
        return getattr(import_module("gfmd_cli.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
