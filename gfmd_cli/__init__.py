"""gfmd: elastic contact of rough surfaces, for elastomers of any stiffness k(q)."""

import sys
from importlib import import_module

if sys.platform == "win32":
    raise ImportError(
        "gfmd needs Linux or macOS; on Windows, use the Windows Subsystem for Linux (WSL)"
    )

TYPE_CHECKING = False  # that of `typing`, whose import would delay the handlers of signals
if TYPE_CHECKING:
    from gfmd_cli.api import Result, compare, dataset, rows, run, solve

__all__ = ["Result", "compare", "dataset", "rows", "run", "solve"]
__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """A name of the Python API, imported at its first use so that the command line starts fast."""
    if name in __all__:
        return getattr(import_module("gfmd_cli.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """The names of the Python API, also those that are not imported yet."""
    return sorted([*__all__, "__doc__", "__version__"])
