"""Paired lists: values that go together, instead of all combinations."""

import textwrap
import tomllib

import jsonschema
import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.spec.parse import read_tables
from gfmd_cli.spec.schema import spec_schema
from gfmd_cli.study.measure import planned
from gfmd_cli.study.tasks import plan

BASE = """\
[surface]
kind = "self-affine"
cutoff = [0.2, 0.1, 0.05]
hurst = [0.3, 0.5, 0.8]
seed = [0, 1]
[elastomer]
kind = "half-space"
E_star = [1e6, 1e7, 1e8]
[grid]
points = [16, 32, 64]
[load]
pressure = [1e2, 1e3, 1e4]
"""


def tasks_of(text):
    return plan(read_tables(tomllib.loads(BASE + text)))


def values(tasks, *names):
    rows = [planned(task) | {"load": task.load, "points": task.points} for task in tasks]
    return [tuple(row[name] for name in names) for row in rows]


def test_lists_of_two_tables_go_together():
    tasks = tasks_of('[sweep]\npaired = ["surface.cutoff", "grid.points"]')
    assert len(tasks) == 3 * 3 * 2 * 3 * 3
    assert set(values(tasks, "cutoff", "points")) == {(0.2, 16), (0.1, 32), (0.05, 64)}
    assert [task.index for task in tasks] == list(range(len(tasks)))


def test_lists_of_one_table_go_together():
    tasks = tasks_of('[sweep]\npaired = ["surface.cutoff", "surface.hurst", "grid.points"]')
    assert len(tasks) == 3 * 2 * 3 * 3
    assert set(values(tasks, "cutoff", "hurst")) == {(0.2, 0.3), (0.1, 0.5), (0.05, 0.8)}


def test_loads_go_with_parameters_and_groups_multiply():
    tasks = tasks_of(
        '[[sweep]]\npaired = ["surface.cutoff", "grid.points"]\n'
        '[[sweep]]\npaired = ["elastomer.E_star", "load.pressure"]\n'
    )
    assert len(tasks) == 3 * 3 * 2 * 3
    assert set(values(tasks, "E_star", "load")) == {(1e6, 1e2), (1e7, 1e3), (1e8, 1e4)}


def test_paired_tasks_are_those_of_the_product():
    """A pair selects tasks; it does not change them."""
    plain = BASE.replace("cutoff = [0.2, 0.1, 0.05]", "cutoff = 0.2")
    every = plan(read_tables(tomllib.loads(plain)))
    text = plain + '[sweep]\npaired = ["elastomer.E_star", "load.pressure"]'
    paired = plan(read_tables(tomllib.loads(text)))
    assert {task.id for task in paired} < {task.id for task in every}
    assert len(every) == 3 * len(paired)


def test_only_grids_that_are_paired_must_resolve_their_surface():
    with pytest.raises(InputError, match="do not resolve"):
        plan(read_tables(tomllib.loads(BASE)))
    assert tasks_of('[sweep]\npaired = ["surface.cutoff", "grid.points"]')


def test_equal_values_in_a_paired_list_stay_in_their_places():
    text = BASE.replace("[0.2, 0.1, 0.05]", "[0.2, 0.2, 0.1]")
    text += '[sweep]\npaired = ["surface.cutoff", "grid.points"]'
    tasks = plan(read_tables(tomllib.loads(text)))
    assert set(values(tasks, "cutoff", "points")) == {(0.2, 16), (0.2, 32), (0.1, 64)}


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ('["surface.cutoff", "surface.seed"]', "surface.cutoff has 3, surface.seed has 2"),
        ('["surface.cutoff", "surface.rolloff"]', "surface.rolloff has no list"),
        ('["surface.cutoff"]', "must have 2 or more values"),
        ('["surface.cutoff", "surface.cutoff"]', "named twice"),
        ('["surface.cutoff", "output.fields"]', "TABLE one of surface, elastomer, grid"),
        ('["surface.cutoff", "load.p_star"]', "load.p_star has no list"),
        ('"surface.cutoff"', "valid list"),
    ],
)
def test_bad_pairs_are_named(sweep, words):
    with pytest.raises(InputError, match="sweep") as error:
        tasks_of(f"[sweep]\npaired = {sweep}")
    assert words in str(error.value)


@pytest.mark.parametrize("table", ["[sweep]", "[[sweep]]"])
def test_the_schema_knows_paired_lists(table):
    data = tomllib.loads(BASE + f'{table}\npaired = ["surface.cutoff", "grid.points"]')
    jsonschema.validate(data, spec_schema())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data | {"sweep": {"pairs": []}}, spec_schema())


SCANS = """\
[study]
name = "scans"
[surface]
kind = "file"
path = ["rough.npy", "smooth.npy"]
length = 1e-5
[elastomer]
kind = "half-space"
E_star = 1e9
[grid]
points = [32, 16]
[load]
pressure = [1e6, 1e7]
[sweep]
paired = ["surface.path", "grid.points"]
"""


def test_several_scans_make_one_study_with_a_group_of_rows_each(tmp_path, monkeypatch, output_of):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    for name, points in {"rough": 32, "smooth": 16}.items():
        np.save(f"{name}.npy", 1e-8 * rng.normal(size=(points, points)))
    (tmp_path / "scans.toml").write_text(SCANS)
    output = output_of("run", "scans.toml", "-j", "1")
    assert "path=rough.npy length=10 µm, 32 points a side" in output
    assert "path=smooth.npy length=10 µm, 16 points a side" in output
    assert "scans.h5: 4 converged" in output


def test_a_message_tells_combinations_from_tasks():
    """1500 pairs are 1500 tasks, chosen from 1500^2 combinations."""
    text = f"""
        surface = {{kind = "self-affine", cutoff = 0.2, seed = {list(range(1500))}}}
        elastomer.kind = "half-space"
        grid.points = 16
        load.p_star = {[0.001 * i for i in range(1, 1501)]}
        sweep.paired = ["surface.seed", "load.p_star"]
    """
    with pytest.raises(InputError, match=r"2250000 combinations, from which \[sweep\] chooses"):
        plan(read_tables(tomllib.loads(textwrap.dedent(text))))
