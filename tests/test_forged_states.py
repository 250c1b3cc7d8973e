"""Saved states whose pointer was changed and given a valid checksum again."""

import json
import os
import shutil
import signal
import zlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from specs import power_spec

from gfmd_cli.errors import Interrupted
from gfmd_cli.files.checksums import sealed
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

SPEC = power_spec(n=1, points=32, p_star=0.1)
EXAMPLES = int(os.environ.get("GFMD_FORGERIES", "25"))  # `make test-kills` takes 200
WRONG = [None, True, -1, 2**70, "text", [], {}, [[[[]]]], {"a": {"a": {}}}]


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """A folder with a study that was stopped in its only task, and the row without a stop."""
    folder = tmp_path_factory.mktemp("stopped")
    (folder / "spec.toml").write_text(SPEC)
    spec, text = read_spec(folder / "spec.toml", ())
    run_study(spec, text, folder / "whole.h5", lambda progress: None, RunOptions(jobs=1))

    def stop(progress):
        if progress.event == "step":
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(Interrupted):
        run_study(spec, text, folder / "s.h5", stop, RunOptions(jobs=1))
    return folder, read_rows(folder / "whole.h5")[0]


def places(data, at=()):
    """The paths of all values in plain data."""
    inner = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in inner:
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from places(value, (*at, key))


def change(data, path, value):
    """Replace one value; "" in the place of a value removes it."""
    for key in path[:-1]:
        data = data[key]
    if value == "":
        del data[path[-1]]
    else:
        data[path[-1]] = value


forgeries = settings(max_examples=EXAMPLES)
"""A changed file is read by two calls of the command."""


@forgeries
@given(data=st.data())
def test_a_changed_pointer_never_ends_in_a_traceback(stopped, invoke, tmp_path, data):
    folder, whole = stopped
    place = tmp_path / "again"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(folder, place)
    (pointer,) = Path(place).glob("s.parts/*/pointer")
    content = bytearray(pointer.read_bytes()[:-8])
    if data.draw(st.booleans()):
        content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    else:
        plain = json.loads(content)
        path = data.draw(st.sampled_from(list(places(plain))))
        change(plain, path, data.draw(st.sampled_from([*WRONG, ""])))
        content = json.dumps(plain).encode()
    pointer.write_bytes(sealed(bytes(content)))
    known = invoke("status", place / "spec.toml", "-o", place / "s.h5")
    assert known.exit_code == 0, known.output
    done = invoke("run", place / "spec.toml", "-o", place / "s.h5", "-j", "1", "-q")
    assert done.exit_code == 0, done.output
    (row,) = read_rows(place / "s.h5")
    assert row["status"] == "converged"
    assert row["u_g"] == pytest.approx(whole["u_g"], rel=1e-4)


FORGED_STRESS = {
    "no stress": lambda stress: stress * 0,
    "the pressure": lambda stress: stress * 0 + 0.1,
    "without tension": lambda stress: np.maximum(stress, 0),
    "not a number": lambda stress: stress * np.nan,
    "infinite": lambda stress: stress * np.inf,
}


CLAIMS = {
    "exact": {"exact": True, "residual": 0.0},
    "updated": {"exact": False, "residual": 0.0, "rounding": 1e-12},
}


@pytest.fixture(scope="module")
def gap_by(tmp_path_factory):
    """The mean gap by a solver that is not stopped."""

    @cache
    def gap(solver):
        folder = tmp_path_factory.mktemp(solver)
        run_study(*written(folder, solver), folder / "s.h5", print, RunOptions(jobs=1))
        return read_rows(folder / "s.h5")[0]["u_g"]

    return gap


def written(folder, solver):
    """The spec with this solver, and its text."""
    (folder / "spec.toml").write_text(SPEC)
    return read_spec(folder / "spec.toml", [f"solver.kind={solver}"])


@pytest.mark.parametrize("claim", CLAIMS)
@pytest.mark.parametrize("case", FORGED_STRESS)
@pytest.mark.parametrize("solver", ["auto", "fire", "ccg", "polonsky-keer"])
def test_a_stress_that_claims_to_end_the_solve_is_measured(tmp_path, gap_by, solver, case, claim):
    spec, text = written(tmp_path, solver)

    def stop(progress):
        if progress.event == "step":
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(Interrupted):
        run_study(spec, text, tmp_path / "s.h5", stop, RunOptions(jobs=1))
    (pointer,) = tmp_path.glob("s.parts/*/pointer")
    plain = json.loads(pointer.read_bytes()[:-8])
    slot = plain["slots"][0]
    path = pointer.with_name(slot["parts"][0]["file"])
    values = np.fromfile(path).reshape(-1, 32, 32)
    assert list(slot["fields"])[:2] == ["u", "sigma"]
    values[1] = FORGED_STRESS[case](values[1])
    values.tofile(path)
    slot["state"] |= CLAIMS[claim]
    slot["parts"][0]["crc"] = zlib.crc32(path.read_bytes())
    pointer.write_bytes(sealed(json.dumps(plain).encode()))
    warnings = []
    run_study(
        spec, text, tmp_path / "s.h5",
        lambda progress: warnings.append(progress.message) if progress.message else None,
        RunOptions(jobs=1),
    )  # fmt: skip
    (row,) = read_rows(tmp_path / "s.h5")
    assert row["status"] == "converged"
    assert row["residual"] < 1e-6
    assert row["u_g"] == pytest.approx(gap_by(solver), rel=1e-4)
    assert len(warnings) == (case in ("not a number", "infinite"))
