"""Processor seconds that the compilation of each kernel takes in the first solve on a machine.

    NUMBA_CACHE_DIR=$(mktemp -d) python scripts/first_run.py
    NUMBA_CACHE_DIR=$(mktemp -d) python scripts/first_run.py --boundary free

Default surface, 512^2, n = 1, p* = 0.1; docs/performance.md has the sums. The cache of compiled
code must be empty, as above.
"""

import argparse
import time
from typing import Any

from numba.core.dispatcher import Dispatcher

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact


class Timed:
    """Times the compilation of functions that are called from Python, with all their parts."""

    def __init__(self) -> None:
        self.depth, self.total = 0, 0.0
        self.compile = Dispatcher.compile

    def __call__(self, dispatcher: Any, signature: Any) -> Any:
        self.depth += 1
        begun = time.process_time()
        try:
            return self.compile(dispatcher, signature)
        finally:
            self.depth -= 1
            if self.depth == 0:
                seconds = time.process_time() - begun
                self.total += seconds
                print(f"{dispatcher.py_func.__name__:24}{seconds:6.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--boundary", choices=SCENES, default="periodic")
    build = SCENES[parser.parse_args().boundary]
    timed = Timed()
    Dispatcher.compile = lambda dispatcher, signature: timed(dispatcher, signature)
    contact = build(SelfAffine(), Power(n=1), 512).contact(0.1)
    solve_contact(contact, Auto(tolerance=1e-4))
    print(f"{'all kernels':24}{timed.total:6.2f}")
    begun = time.process_time()
    solve_contact(contact, Auto(tolerance=1e-4))
    print(f"{'a second solve':24}{time.process_time() - begun:6.2f}")


if __name__ == "__main__":
    main()
