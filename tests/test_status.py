import json
import signal
import sys
import time
from pathlib import Path
from threading import Thread

import pytest
from specs import power_spec

from gfmd_cli.errors import Interrupted
from gfmd_cli.files.locks import locked
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import Status
from gfmd_cli.study.columns import empty_row
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import plan

SPEC = power_spec(n=[0, 1], points=64, p_star=[0.1, 1.0], cutoff=0.05, name="small")


def answer(done):
    assert done.exit_code == 0, done.output
    return json.loads(done.output)


def everything():
    """Names, contents and times of all files."""
    paths = sorted(Path().rglob("*"))
    return {p: (p.stat().st_mtime_ns, p.read_bytes() if p.is_file() else b"") for p in paths}


def uncollected(spec="spec.toml", shard=(0, 2), stop_at=None):
    """Run a shard that leaves its records, and the state of the task `stop_at`, lying."""
    resolved, text = read_spec(Path(spec), ())

    def report(progress):
        if stop_at is None or (progress.task == stop_at and progress.event == "step"):
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(Interrupted):
        run_study(resolved, text, Path("small.h5"), report, RunOptions(shard=shard, jobs=1))


def test_of_nothing_all_is_missing_and_nothing_is_written(gfmd):
    before = everything()
    state = answer(gfmd("status", "spec.toml", "--json"))
    assert (state["tasks"], state["missing"], state["missing_tasks"]) == (4, 4, [0, 1, 2, 3])
    assert state["next"] == "gfmd run spec.toml"
    assert everything() == before


def test_a_finished_study_is_to_be_analyzed(gfmd):
    gfmd("run", "spec.toml", "-o", "a b.h5")
    for words in (("spec.toml", "-o", "a b.h5"), ("a b.h5",)):
        done = gfmd("status", *words)
        assert done.exit_code == 0
        assert done.output == "a b.h5: 4 tasks: 4 converged\nnext: gfmd analyze 'a b.h5'\n"


def test_what_did_not_converge_is_counted_apart(gfmd):
    gfmd("run", "spec.toml", "--set", "solver.max_steps=1")
    state = answer(gfmd("status", "small.h5", "--json"))
    assert state["statuses"] == {"converged": 2, "max_steps": 2}
    assert (state["converged"], state["missing"]) == (2, 0)


def test_tasks_that_did_not_converge_are_listed_up_to_a_limit(gfmd, monkeypatch):
    gfmd("run", "spec.toml", "--set", "solver.max_steps=1")
    status = ("status", "spec.toml", "--set", "solver.max_steps=1")
    lines = gfmd(*status).output.splitlines()
    assert [line for line in lines if line.endswith(": max_steps")] == [
        "  task 2 power n=1 64 p*=0.1: max_steps",
        "  task 3 power n=1 64 p*=1: max_steps",
    ]
    monkeypatch.setattr(sys.modules["gfmd_cli.cli.status"], "MAX_TASKS", 1)
    assert "max_steps\n  and 1 more task\n" in gfmd(*status).output


def test_each_shard_is_told_where_asked_for(gfmd):
    gfmd("run", "spec.toml", "--shard", "1/3")
    state = answer(gfmd("status", "spec.toml", "--shards", "3", "--json"))
    assert state["shards"] == [{"missing": 2}, {"converged": 1}, {"missing": 1}]
    lines = gfmd("status", "small.h5", "--shards", "3").output.splitlines()
    assert lines[1:4] == [
        "  shard 0/3: 2 missing", "  shard 1/3: 1 converged", "  shard 2/3: 1 missing",
    ]  # fmt: skip
    assert lines[4] == "next: gfmd run SPEC -o small.h5"


def test_records_and_saved_states_are_seen_before_they_are_collected(gfmd):
    uncollected(stop_at=2)  # task 0 has its record, task 2 a state
    before = everything()
    state = answer(gfmd("status", "spec.toml", "--json"))
    assert (state["records"], state["missing_tasks"]) == (1, [1, 2, 3])
    (saved,) = state["saved"]
    assert (saved["task"], saved["points"]) == (2, 64)
    assert saved["residual"] > 0
    lines = gfmd("status", "spec.toml").output
    assert "  task 2 power n=1 64 p*=0.1: state of step " in lines
    assert "1 record not collected yet" in lines
    assert everything() == before


def test_a_saved_state_of_a_study_is_named_by_elastomer_and_load(gfmd):
    gfmd("run", "spec.toml", "--shard", "1/3")
    uncollected(stop_at=2)
    assert "  task 2 power n=1 p*=0.1: state of step " in gfmd("status", "small.h5").output


def test_collecting_brings_the_records_in_and_solves_nothing(gfmd):
    uncollected(stop_at=2)
    assert not Path("small.h5").exists()
    done = gfmd("collect", "spec.toml")
    assert done.exit_code == 1
    assert "1 converged, 3 missing" in done.output
    assert len(gfmd("export", "small.h5").output.splitlines()) == 2
    assert answer(gfmd("status", "spec.toml", "--json"))["saved"]  # to go on from
    gfmd("run", "spec.toml")
    done = gfmd("collect", "spec.toml")
    assert done.exit_code == 0
    assert "next: gfmd analyze small.h5" in done.output


def test_collecting_nothing_writes_nothing(gfmd):
    before = everything()
    assert gfmd("collect", "spec.toml").exit_code == 1
    assert everything() == before


def test_damaged_records_are_told_and_left_alone(gfmd):
    gfmd("run", "spec.toml", "--shard", "0/2")
    parts = Path("small.parts")
    (parts / f"{'0' * 16}.record").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    (parts / f"{'1' * 16}.bad").write_bytes(b"")
    before = everything()
    state = answer(gfmd("status", "spec.toml", "--json"))
    assert state["damaged"] == [f"{'1' * 16}.bad", f"{'0' * 16}.record"]
    assert "damaged, to be solved again: 1111" in gfmd("status", "small.h5").output
    assert everything() == before


def test_status_neither_waits_for_a_collector_nor_stops_it(gfmd):
    gfmd("run", "spec.toml", "--shard", "0/2")
    with locked(Path("small.parts/collecting")):
        assert answer(gfmd("status", "spec.toml", "--json"))["missing"] == 2


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        (("none.toml",), 2, "cannot be read"),
        (("none.h5",), 2, "no such study"),
        (("bad.h5",), 74, "not a readable study"),
        (("small.h5", "--set", "grid.points=32"), 2, "need a spec"),
        (("spec.toml", "--shards", "5"), 2, "must be from 1 to 4"),
        (("spec.toml", "--set", "grid.points=33"), 2, "use 40 or more"),
    ],
)
def test_bad_usage_is_one_message(gfmd, words, status, message):
    gfmd("run", "spec.toml", "--shard", "0/2")
    Path("bad.h5").write_bytes(b"nothing")
    done = gfmd("status", *words)
    assert done.exit_code == status
    assert message in done.output
    assert "Traceback" not in done.output


def test_a_stopped_shard_leaves_its_records_to_others(gfmd):
    uncollected(stop_at=2)
    assert len(list(Path("small.parts").glob("*.record"))) == 1
    assert gfmd("run", "spec.toml", "--shard", "1/2").exit_code == 0
    assert answer(gfmd("status", "spec.toml", "--json"))["records"] == 0
    assert len(gfmd("export", "small.h5").output.splitlines()) == 4


def test_a_lock_holds_though_its_folder_is_removed_and_made_again(tmp_path):
    folder, results = tmp_path / "parts", []

    def wait_for_it():
        with locked(folder / "lock"):
            results.append((folder / "lock").exists())

    waiting = Thread(target=wait_for_it)
    with locked(folder / "lock"):
        waiting.start()
        time.sleep(0.2)  # it waits for the lock of a file that will be gone
        assert results == []
        (folder / "lock").unlink()
        folder.rmdir()
    waiting.join(20)
    assert results == [True]


def test_a_record_that_is_collected_meanwhile_is_not_missed(gfmd, monkeypatch):
    uncollected(stop_at=2)
    spec, text = read_spec(Path("spec.toml"), ())
    study = Study(Path("small.h5"))
    listed = study.record_paths()
    study.collect(spec, plan(spec), text)
    monkeypatch.setattr(study, "record_paths", lambda: listed)  # as seen before
    assert study.outcomes() == {plan(spec)[0].id: ("converged", spec.output.names())}


@pytest.mark.parametrize("status", Status)
def test_every_status_is_explained_by_the_columns_of_a_row(status):
    assert status.explain(empty_row())


@pytest.mark.parametrize(("residual", "advice"), [(1e-5, "solver.tolerance"), (5.0, "pressure")])
def test_a_looser_tolerance_is_advised_only_where_one_can_help(residual, advice):
    text = Status.ROUNDING.explain(empty_row() | {"residual": residual})
    assert [word for word in ("solver.tolerance", "pressure") if word in text] == [advice]


@pytest.mark.parametrize(("kind", "other"), [("auto", False), ("fire", True)])
def test_another_solver_is_advised_only_to_those_who_chose_one(kind, other):
    text = Status.MAX_STEPS.explain(empty_row() | {"solver_kind": kind})
    assert "raise solver.max_steps" in text
    assert ('solver.kind = "auto"' in text) is other


def test_the_error_that_ended_a_task_is_told_until_the_study_is_complete(gfmd):
    Path("spec.toml").write_text(SPEC.replace("p_star = [0.1, 1.0]", "contact_area = [0.1, 1e-4]"))
    assert answer(gfmd("status", "spec.toml", "--json"))["next"] == "gfmd run spec.toml"
    assert gfmd("run", "spec.toml").exit_code == 1
    told = answer(gfmd("status", "spec.toml", "--json"))["next"]
    assert told == "gfmd run spec.toml    # when the causes of the failures are removed"
    (parts,) = Path().glob("*.parts")
    for path in ("spec.toml", "small.h5"):
        state = answer(gfmd("status", path, "--json"))
        assert [failure["task"] for failure in state["failed"]] == [1, 3]
        assert all("load.contact_area" in failure["message"] for failure in state["failed"])
        assert "task 1" in gfmd("status", path).output
    assert "gfmd status small.h5" in gfmd("analyze", "small.h5").output
    Path("spec.toml").write_text(SPEC)
    assert answer(gfmd("status", "spec.toml", "--json"))["failed"] == []
    assert gfmd("run", "spec.toml").exit_code == 0
    assert not parts.exists()
