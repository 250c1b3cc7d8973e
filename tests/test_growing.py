"""A study grows task by task: nothing that it holds is lost, and nothing is solved twice."""

import json
import re
import signal
import sys
import threading
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest

import gfmd_cli
from gfmd_cli.cli.run import _print_results
from gfmd_cli.errors import InputError, Interrupted, StudyError
from gfmd_cli.files.locks import locked
from gfmd_cli.report.page import report
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import Status
from gfmd_cli.study import columns as layout
from gfmd_cli.study.columns import COLUMNS
from gfmd_cli.study.reading import open_study, read_rows
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import plan
from gfmd_cli.study.unfinished_work import write_record

SPEC = """\
[study]
name = "grown"
[surface]
kind = "self-affine"
cutoff = 0.2
seed = [0, 1]
[elastomer]
kind = "power"
n = [0, 1]
[grid]
points = 16
[load]
p_star = { from = 0.1, to = 1.0, per_decade = 2 }
"""
PARAMETERS = ("seed", "n", "p_star")
NUMBERS = [c.name for c in COLUMNS if c.kind is not str and c.name != "seconds"]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs SPEC with overrides; returns the path, how many tasks were solved, and the warnings."""
    monkeypatch.chdir(tmp_path)

    def run(*overrides, name="grown.h5", text=SPEC, report=None, **options):
        Path("spec.toml").write_text(text)
        spec, _ = read_spec(Path("spec.toml"), overrides)
        events = []

        def note(event):
            events.append(event)
            if report is not None:
                report(event)

        outcome = run_study(spec, text, Path(name), note, RunOptions(jobs=1, **options))
        assert set(outcome) == {"converged"}
        warnings = [event.message for event in events if event.event == "warning"]
        assert "damaged" not in " ".join(warnings)
        return Path(name), sum(event.event == "end" for event in events), warnings

    return run


def by_parameters(path):
    """The numbers of each task by its parameters."""
    return {
        tuple(row[name] for name in PARAMETERS): [row[name] for name in NUMBERS]
        for row in read_rows(path)
    }


def times(path):
    """The time that each result took, by which it is known again."""
    return {tuple(row[name] for name in PARAMETERS): row["seconds"] for row in read_rows(path)}


WAYS = {
    "a longer sequence": ("load.p_star={from=0.1, to=3.0, per_decade=2}",),
    "one more seed, in front": ("surface.seed=[2, 0, 1]",),
    "another elastomer": ("elastomer.n=[0, 1, 2]",),
    "other tasks than before": ("elastomer.n=3", "surface.seed=5"),
    "a part of what is there and more": ("surface.seed=[1, 2]", "elastomer.n=1"),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_study_keeps_its_results_and_solves_what_is_missing(run, way):
    path, _, _ = run()
    before, known = times(path), by_parameters(path)
    _, solved, _ = run(*WAYS[way])
    fresh, _, _ = run(*WAYS[way], name="fresh.h5")
    expected = by_parameters(fresh)
    assert solved == len(set(expected) - set(before))
    after = times(path)
    assert set(after) == set(before) | set(expected)
    assert {task: after[task] for task in before} == before
    np.testing.assert_equal(by_parameters(path), expected | known)
    order = [tuple(row[name] for name in PARAMETERS) for row in read_rows(path)]
    assert order[: len(expected)] == list(expected)
    assert not Path("grown.parts").exists()


def test_a_study_grown_five_times_is_that_of_all_specs_at_once(run):
    path, _, _ = run("surface.seed=0", "elastomer.n=0", "load.p_star=0.1")
    steps = [
        ("surface.seed=0", "elastomer.n=0"),
        ("surface.seed=0", "elastomer.n=[1, 0]"),
        ("surface.seed=0", "elastomer.n=1", "output.fields=['u']"),
        ("surface.seed=[1, 0]", "output.patches=true"),
        ("surface.seed=1", "load.p_star=3.0", "output.histogram=false"),
    ]
    solved = [run(*step)[1] for step in steps]
    assert solved == [2, 3, 3, 12, 2]
    whole, _, _ = run("load.p_star=[3.0]", "surface.seed=1", "output.patches=true", name="whole.h5")
    run("output.patches=true", "output.fields=['u']", name="whole.h5")
    np.testing.assert_equal(
        without_patches(by_parameters(path)), without_patches(by_parameters(whole))
    )


def without_patches(tasks):
    """Numbers that do not depend on the output asked for."""
    columns = [i for i, name in enumerate(NUMBERS) if "patch" not in name]
    return {task: [row[i] for i in columns] for task, row in tasks.items()}


def test_a_spec_that_asks_for_less_changes_nothing(run):
    path, _, _ = run()
    before = path.read_bytes()
    _, solved, _ = run("surface.seed=0", "output.histogram=false")
    assert solved == 0
    assert path.read_bytes() == before


def test_more_output_is_added_to_what_is_stored(run):
    path, _, _ = run("output.fields=['u']", "output.histogram=false")
    _, solved, _ = run(
        "output.fields=['sigma', 'contact_pressure']", "elastomer.n=1", "output.spectra=true"
    )
    assert solved == 6
    for row in read_rows(path):
        again = row["n"] == 1
        with open_study(path) as study:
            fields = {"u", "sigma", "contact_pressure"} if again else {"u"}
            assert set(study.arrays("fields", row["task"])) == fields
            assert bool(study.arrays("spectra", row["task"])) == again
            # the histogram, which is on by default, is that of the tasks solved again
            assert np.isnan(row["pr_sigma"]).all() != again
        if again:
            with h5py.File(path) as file:
                pressure = file[f"fields/{row['task']}/contact_pressure"][()]
            assert pressure.std() / row["delta_sigma"] == pytest.approx(row["sigma_p"], rel=1e-12)
    assert run("output.fields=['u', 'sigma']", "elastomer.n=1")[1] == 0


def test_a_study_names_the_specs_that_it_was_made_from(run):
    other = SPEC.replace("seed = [0, 1]", "seed = 7")
    path, _, _ = run()
    run(text=other)
    run("surface.seed=[0, 1, 2]")
    with open_study(path) as study:
        assert study.attributes["spec_text"] == SPEC
        assert json.loads(study.attributes["earlier_specs"]) == [other]


def test_overwriting_keeps_the_old_study_under_another_name(run):
    path, _, _ = run()
    before = path.read_bytes()
    _, solved, warnings = run(overwrite=True)
    assert solved == 12
    assert "grown.1.h5" in warnings[0]
    assert Path("grown.1.h5").read_bytes() == before
    assert run(overwrite=True)[2] == ["grown.h5: the old one is kept as grown.2.h5"]


def test_overwriting_keeps_unfinished_work_beside_the_old_study(run):
    run(shard=(0, 2))
    run("surface.seed=3", overwrite=True)
    assert Path("grown.1.parts").is_dir()
    assert not Path("grown.parts").exists()
    assert run(name="grown.1.h5")[1] == 6


def test_a_study_at_work_is_not_overwritten(run):
    run(shard=(0, 2))
    Path("grown.parts").mkdir(exist_ok=True)
    at_work = locked(Path("grown.parts/in-use"), shared=True)
    with at_work, pytest.raises(InputError, match="another run works"):
        run(overwrite=True)
    with pytest.raises(InputError, match="--shard"):
        run(overwrite=True, shard=(0, 2))


def stop_at(number):
    """A report that stops the run when so many tasks have ended."""
    ended = []

    def report(event):
        ended.append(event.event)
        if ended.count("end") == number:
            signal.raise_signal(signal.SIGTERM)

    return report


def test_what_another_spec_has_not_finished_stays_and_goes_on(run):
    with pytest.raises(Interrupted):
        run(report=stop_at(4))
    run("surface.seed=4")
    assert len(read_rows(Path("grown.h5"))) == 4 + 6
    assert run()[1] == 12 - 4


def test_the_saved_state_of_another_spec_is_kept(run, monkeypatch):
    """A stopped solve of one spec goes on although another spec is completed meanwhile."""
    monkeypatch.setattr("gfmd_cli.study.run_task.REPORT_EVERY", 0.0)
    slow = ("elastomer.n=2", "surface.seed=0", "load.p_star=0.1", "solver.kind='fire'")

    def stop_at_a_step(event):
        if event.event == "step" and event.step >= 3:
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(Interrupted):
        run(*slow, report=stop_at_a_step)
    (pointer,) = Path("grown.parts").glob("*/pointer")
    run("surface.seed=4")
    assert pointer.exists()
    steps = []
    run(*slow, report=lambda event: steps.append(event.step) if event.event == "step" else None)
    assert steps[0] >= 3
    assert not Path("grown.parts").exists()


def test_two_specs_at_the_same_time_lose_nothing(run):
    """Tasks in common, and tasks of their own; the shards of one collect those of the other."""
    path, _, _ = run("surface.seed=0", "load.p_star=0.1")  # compiles, and plans transforms
    errors = []

    def work(*overrides):
        try:
            spec, text = read_spec(Path("spec.toml"), overrides)
            for shard in range(3):
                run_study(
                    spec, text, path, lambda event: None, RunOptions(jobs=1, shard=(shard, 3))
                )
        except BaseException as error:
            errors.append(error)

    specs = [("surface.seed=[0, 1]",), ("surface.seed=[1, 2]",), ("elastomer.n=[0, 2]",)]
    threads = [threading.Thread(target=work, args=overrides) for overrides in specs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    rows = read_rows(path)
    read = [read_spec(Path("spec.toml"), overrides)[0] for overrides in specs]
    expected = {task.id for spec in read for task in plan(spec)}
    assert {row["task_id"] for row in rows} == expected
    assert {row["status"] for row in rows} == {"converged"}
    assert len(rows) == len(expected)
    assert not Study(path).parts.exists()


def test_the_last_of_many_to_leave_removes_the_folder(tmp_path, monkeypatch):
    """Whatever is deleted, or made anew, between two steps of another one."""
    monkeypatch.setattr(Study, "_is_complete", lambda study, tasks: True)
    interval = sys.getswitchinterval()
    errors = []

    def work():
        try:
            with Study(tmp_path / "any.h5").work([]):
                pass
        except BaseException as error:
            errors.append(error)

    sys.setswitchinterval(1e-5)
    try:
        for _ in range(300):
            threads = [threading.Thread(target=work) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            assert errors == []
            assert not (tmp_path / "any.parts").exists()
    finally:
        sys.setswitchinterval(interval)


def test_a_record_with_less_output_replaces_nothing(run):
    """Two runs of one task at the same time, with other output: what is stored stays."""
    path, _, _ = run("surface.seed=0", "elastomer.n=1", "load.p_star=0.1", "output.fields=['u']")
    other = ("surface.seed=0", "elastomer.n=1", "load.p_star=0.1", "output.fields=['sigma']")
    spec, text = read_spec(Path("spec.toml"), other)
    study, tasks = Study(path), plan(spec)
    run(*other, name="other.h5")
    with open_study(Path("other.h5")) as study_file:
        late = study_file.result(0)
    with study.work(tasks):
        write_record(study.parts, late)
        study.collect(spec, tasks, text)
    with open_study(path) as full:
        assert set(full.arrays("fields", 0)) == {"u"}
    assert run(*other)[1] == 1
    with open_study(path) as full:
        assert set(full.arrays("fields", 0)) == {"u", "sigma"}


def test_a_result_keeps_the_version_that_solved_it(run, monkeypatch):
    """Also where an upgraded program adds contacts; before, studies had no such column."""
    monkeypatch.setattr(gfmd_cli, "__version__", "0.0.8")
    run("surface.seed=0")
    monkeypatch.setattr(gfmd_cli, "__version__", "0.0.9")
    path, solved, _ = run("surface.seed=[0, 1]")
    versions = {row["seed"]: row["gfmd_version"].split()[0] for row in read_rows(path)}
    assert versions == {0: "0.0.8", 1: "0.0.9"}
    page = report(path)
    assert "Contacts by version that solved them" in page
    assert re.search(rf"0\.0\.8[^;]*: {solved}; 0\.0\.9[^;]*: {solved}", page)


def test_a_study_without_versions_grows(run, monkeypatch):
    columns = [column for column in COLUMNS if column.name != "gfmd_version"]
    with monkeypatch.context() as older:
        older.setattr(layout, "COLUMNS", tuple(columns))
        run("surface.seed=0")
    path, *_ = run("surface.seed=[0, 1]")
    assert [bool(row["gfmd_version"]) for row in read_rows(path)] == [False] * 6 + [True] * 6


def test_tasks_without_a_result_are_no_contacts_of_other_specs(run, capsys):
    """A spec means other tasks at the end of a run where its map was replaced meanwhile."""
    path, *_ = run(shard=(0, 3))
    replaced, _ = read_spec(Path("spec.toml"), ("surface.seed=9",))
    _print_results(replaced, path, RunOptions(), Counter({Status.CONVERGED: 4}), {})
    said = capsys.readouterr().out
    assert "also contains 4 contacts of other specs" in said
    assert "nan" not in said


@pytest.mark.parametrize("place", ["fields/0/u", "a_r"])
def test_a_damaged_study_that_grows_is_named_damaged(run, place):
    """Its data are read while the new file is written, whose errors are those of a full disk."""
    path, *_ = run("output.fields=['u']", "surface.seed=0", "elastomer.n=0")
    with h5py.File(path) as file:
        data = file[place]
        offset = data.id.get_chunk_info(0).byte_offset if data.chunks else data.id.get_offset()
    content = bytearray(path.read_bytes())
    content[offset + 4] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(StudyError, match=r"grown\.h5: not a readable study, or damaged"):
        run("surface.seed=1", "elastomer.n=0")
