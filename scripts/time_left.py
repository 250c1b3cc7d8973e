"""How right the time left is that a run tells: the estimate over the truth, as the run goes on.

    python scripts/time_left.py configs/demo.toml [--set key=value]

One line a tenth of the run's wall time.
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
    for tenth in range(1, 10):
        when, left = min(estimates, key=lambda word: abs(word[0] - tenth * end / 10))
        print(f"  {when / end:5.0%}  told {left:8.1f} s  true {end - when:8.1f} s  "
              f"ratio {left / (end - when):5.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
