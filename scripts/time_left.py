"""The remaining time that a run prints, divided by the true remaining time.

    python scripts/time_left.py configs/demo.toml [--set key=value]

At each tenth of the wall time of the run, the estimate that is nearest in time. A table of
docs/performance.md.
"""

import argparse
import tempfile
import time
from pathlib import Path

from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.run import RunOptions, run_study


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spec", type=Path)
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--jobs", type=int)
    arguments = parser.parse_args()
    spec, text = read_spec(arguments.spec, tuple(arguments.set))
    estimates, begun = [], time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        run_study(
            spec,
            text,
            Path(folder) / "study.h5",
            lambda progress: estimates.append((time.monotonic() - begun, progress.seconds_left)),
            RunOptions(jobs=arguments.jobs),
        )
    end = estimates[-1][0]
    print(f"{arguments.spec} {' '.join(arguments.set)}: {end:.1f} s")
    earlier = [estimate for estimate in estimates if estimate[0] < end]
    for tenth in range(1, 10):
        when, left = min(earlier, key=lambda estimate: abs(estimate[0] - tenth * end / 10))
        print(f"{10 * tenth} %: {left / (end - when):.2f}", end="\n" if tenth == 9 else ", ")


if __name__ == "__main__":
    main()
