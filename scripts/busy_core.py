"""How long a pair of transforms takes on one thread and on two, and beside another process.

    python scripts/busy_core.py [--points 1024 2048 4096] [--precision double]

"FFTW" is its own way to share a transform among threads. The other process computes without end;
on a machine of two cores it takes half of them. Minima, and medians beside the other process: a
table of docs/performance.md.
"""

import argparse
import multiprocessing
import time
from collections.abc import Callable

import numpy as np
import pyfftw

from gfmd_cli.grid.fft_grid import Grid

SECONDS = 3.0  # for each number


def spin():
    while True:
        pass


def of_gfmd(points: int, precision: str, threads: int) -> Callable[[], object]:
    grid = Grid(points, precision=precision, threads=threads)
    field = np.random.default_rng(0).normal(size=grid.shape).astype(grid.real)
    grid.forward_into_work(field)
    return lambda: (grid.transform(), grid.transform_back())


def of_fftw(points: int, precision: str, threads: int) -> Callable[[], object]:
    real = np.dtype(np.float64 if precision == "double" else np.float32)
    work = pyfftw.empty_aligned((points, points // 2 + 1), np.result_type(real, np.complex64))
    values = work.view(real)[:, :points]
    keys = {"axes": (0, 1), "threads": threads, "flags": ("FFTW_MEASURE", "FFTW_DESTROY_INPUT")}
    forward = pyfftw.FFTW(values, work, direction="FFTW_FORWARD", **keys)
    backward = pyfftw.FFTW(work, values, direction="FFTW_BACKWARD", **keys)
    work[:] = 0.0
    return lambda: (forward.execute(), backward.execute())


def times(pair: Callable[[], object]) -> list[float]:
    """Milliseconds of each pair, for a while."""
    seconds, end = [], time.monotonic() + SECONDS
    while len(seconds) < 3 or time.monotonic() < end:
        begun = time.perf_counter()
        pair()
        seconds.append(1e3 * (time.perf_counter() - begun))
    return seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048, 4096])
    parser.add_argument("--precision", default="double", choices=["double", "single"])
    arguments = parser.parse_args()
    ways = {"gfmd, 1 thread": (of_gfmd, 1), "gfmd, 2": (of_gfmd, 2), "FFTW, 2": (of_fftw, 2)}
    for points in arguments.points:
        for name, (way, threads) in ways.items():
            pair = way(points, arguments.precision, threads)
            alone = min(times(pair))
            other = multiprocessing.Process(target=spin, daemon=True)
            other.start()
            beside = np.median(times(pair))
            other.kill()
            other.join()
            print(f"{points:5}²  {name:15} {alone:7.1f} ms   beside a process {beside:8.1f} ms")


if __name__ == "__main__":
    main()
