"""Seconds of grids chosen by accuracy against one uniform grid that is as good everywhere.

    python scripts/accuracy_gain.py --max-points 3200      # the table of docs/performance.md

The default study, mean gap to 1 % and contact area to 5 %: each elastomer and pressure on the
coarsest grid that meets both, against all of them on the finest grid that one of them needed.
"""

import argparse
import tempfile
from pathlib import Path

from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

SPEC = """\
[surface]
kind = "self-affine"
[elastomer]
kind = "power"
n = [0, 0.5, 1, 2, 3]
[grid]
points = "auto"
[load]
p_star = [0.01, 0.1, 1.0]
[solver]
tolerance = 1e-5
[accuracy]
mean_gap = 0.01
contact_area = 0.05
"""


def rows_of(folder: Path, name: str, *overrides: str) -> list[dict]:
    spec = folder / "spec.toml"
    spec.write_text(SPEC)
    path = folder / name
    resolved, text = read_spec(spec, overrides)
    run_study(resolved, text, path, lambda progress: None, RunOptions(jobs=1))
    return read_rows(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--max-points", type=int, default=4096)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        chosen = rows_of(folder, "auto.h5", f"accuracy.max_points={options.max_points}")
        finest = max(row["points"] for row in chosen)
        uniform = rows_of(folder, "uniform.h5", f"grid.points={finest}")
    print(f"   n      p*  points      s   at {finest}: s     a_r (continuum)    u_g      status")
    for row, fine in zip(chosen, uniform, strict=True):
        area, bar = row["a_r_continuum"], row["a_r_continuum_error"]
        print(
            f"{row['n']:4g} {row['p_star']:7g} {row['points']:7d} {row['seconds']:6.2f} "
            f"{fine['seconds']:12.2f}   {area:.5f} +- {bar:.5f}  "
            f"{row['u_g']:.5f} +- {row['u_g_error']:.5f}  {row['status']}"
        )
    spent, whole = (sum(row["seconds"] for row in rows) for rows in (chosen, uniform))
    print(f"sum {spent:.1f} s against {whole:.1f} s: {whole / spent:.1f} times faster")


if __name__ == "__main__":
    main()
