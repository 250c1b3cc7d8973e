"""A script as a user writes it: `make check` checks its types, tests/test_api.py runs it.

A line with `type: ignore` is a mistake that mypy has to find: it reports an ignore without one.
"""

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

from gfmd_cli import Result, compare, rows, run, solve

SPEC = {
    "surface": {"kind": "self-affine", "cutoff": 0.05},
    "elastomer": {"kind": "half-space"},
    "grid": {"points": 64},
    "load": {"p_star": 0.1},
}


def largest(result: Result) -> float:
    assert_type(result.a_r, float)
    assert_type(result.gap, NDArray[np.floating])
    assert_type(result.contact, NDArray[np.bool_])
    return float(np.max(result.pressure)) / result.nominal_pressure


def main(folder: Path) -> float:
    result = assert_type(solve(SPEC), Result)
    again = solve(SPEC | {"surface": {"periodic": True}}, heights=result.height)
    study = assert_type(run(SPEC, folder / "study.h5", jobs=1), Path)
    areas = [float(row["a_r"]) for row in rows(study)]
    assert areas == [result.a_r]
    for curve in compare(study).curves:
        assert_type(curve.predict(np.array([0.1])).a_r, NDArray[np.floating])
    return largest(result) / largest(again)


def mistakes() -> None:
    """Not run."""
    run(3)  # type: ignore[arg-type]
    solve(SPEC, theads=2)  # type: ignore[call-arg]
    print(solve(SPEC).area)  # type: ignore[attr-defined]
