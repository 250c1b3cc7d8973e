"""Every key of surface, elastomer, grid and solver is a column; labels show what the spec gives."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.export import as_dataset
from gfmd_cli.physics.elastomers import Plate, Slab
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.spec.check import MODELS, kinds_of
from gfmd_cli.spec.models import SWEPT
from gfmd_cli.study.columns import (
    COLUMNS,
    DETAIL_COLUMNS,
    HISTOGRAMS,
    MAIN_COLUMNS,
    PARAMETERS,
    ROW_COLUMNS,
    SCENE,
    TASK,
    TASK_GROUPS,
    TASK_ID,
)
from gfmd_cli.study.reading import read_rows, tell_files_apart
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.tasks import plan

SPEC = """
[surface]
kind = "self-affine"
hurst = [0.3, 0.8]
cutoff = 0.2
seed = [0, 1]
[elastomer]
kind = "half-space"
E_star = [1.0, 2e6]
[grid]
points = 16
[load]
p_star = [0.1, 1.0]
"""
TOLERANCES = "\n[solver]\ntolerance = [1e-6, 1e-4]\nkind = 'pcg'\n"


def values(study, name):
    return [row[name] for row in study]


def test_every_key_of_every_kind_has_exactly_one_column():
    keys = {
        (table, key)
        for table in SWEPT
        for model in kinds_of(table).values() or [MODELS[table]]
        for key in model.model_fields
    }
    assert {(each.table, each.key) for each in PARAMETERS} == keys
    assert len({each.column for each in PARAMETERS}) == len(PARAMETERS) == len(keys)


def test_no_column_has_the_name_of_another_data_set_of_a_study_file():
    columns = [column.name for column in (*ROW_COLUMNS, TASK, TASK_ID, SCENE)]
    others = {name for each in HISTOGRAMS for name in (each.name, each.axis)}
    others |= {"scenes", *(group.name for group in TASK_GROUPS)}
    assert len(set(columns)) == len(columns)
    assert not set(columns) & others


def test_units_and_meaning_of_a_column_are_those_of_the_key():
    columns = {column.name: column for column in COLUMNS}
    assert columns["tension"][1:] == ("elastomer.tension: Tension", "N/m", float)
    assert columns["hurst"].units == "1"
    assert columns["spectrum"][2:] == ("", str)
    assert columns["max_steps"].kind is columns["nested"].kind is int


def test_swept_parameters_are_columns_also_where_they_equal_their_default(rows_of):
    rows = rows_of()
    assert values(rows, "hurst") == [hurst for hurst in (0.3, 0.8) for _ in range(8)]
    assert values(rows, "E_star") == 4 * [1.0, 1.0, 2e6, 2e6]
    assert values(rows, "seed") == 2 * (4 * [0] + 4 * [1])
    assert {row["cutoff"] for row in rows} == {0.2}
    assert {row["rolloff"] for row in rows} == {0.5}  # the default
    assert {row["spectrum"] for row in rows} == {"rolloff"}
    assert {(row["surface_kind"], row["elastomer_kind"]) for row in rows} == {
        ("self-affine", "half-space")
    }
    assert {row["n"] for row in rows} == {1.0}
    assert {row["nested"] for row in rows} == {1}


def test_a_parameter_that_the_kind_does_not_have_is_blank(rows_of):
    spec = SPEC.replace('kind = "half-space"\nE_star = [1.0, 2e6]', 'kind = "power"\nn = 2')
    (row, *_) = rows_of("load.p_star=0.1", "surface.hurst=0.5", "surface.seed=0", text=spec)
    assert np.all(np.isnan([row[name] for name in ("E_star", "tension", "surface_h_std")]))
    assert row["elastomer_path"] == row["dataset"] == ""
    assert row["crop"] == -1
    assert (row["n"], row["k_n"]) == (2.0, 1.0)


def test_a_measured_column_keeps_its_name_and_the_key_gets_that_of_its_table(rows_of):
    (row,) = rows_of(
        *("surface.hurst=0.5", "surface.seed=0", "surface.h_std=2e-6", "surface.length=3e-5"),
        *("elastomer.E_star=1.0", "load.p_star=0.1"),
    )
    assert row["surface_h_std"] == 2e-6
    assert row["h_std"] == pytest.approx(2e-6, rel=1e-12, abs=0)
    assert row["surface_length"] == row["length"] == 3e-5


def test_what_is_swept_stands_in_labels_and_progress(spec_of, rows_of):
    surfaces = {row["surface"] for row in rows_of()}
    assert len([text for text in surfaces if "hurst=0.8" in text.split()]) == 2
    assert "self-affine hurst=0.8 cutoff=0.2 seed=0" in surfaces
    task = plan(spec_of())[8]
    assert task.elastomer.label == "half-space E_star=1 Pa"
    assert task.label == "half-space E_star=1 Pa hurst=0.8 seed=0 16 p*=0.1"


def test_a_sweep_of_the_solver_stands_in_the_label_of_a_task(spec_of):
    one = ("surface.hurst=0.5", "surface.seed=0", "elastomer.E_star=1.0", "load.p_star=0.1")
    labels = [task.label for task in plan(spec_of(*one, text=SPEC + TOLERANCES))]
    assert labels == [
        f"half-space E_star=1 Pa tolerance={t} 16 p*=0.1" for t in ("1e-06", "0.0001")
    ]


def test_a_label_has_no_key_that_the_spec_leaves_out():
    assert SelfAffine(cutoff=0.1).label == "self-affine cutoff=0.1"
    assert SelfAffine(cutoff=0.1, seed=0).label == "self-affine cutoff=0.1 seed=0"
    assert SelfAffine(cutoff=0.1, seed=0).label_without({"seed"}) == "self-affine cutoff=0.1"
    assert Slab(thickness=1 / 3).label == "slab thickness=0.333333333333"


def test_rows_of_one_ensemble_differ_in_their_seed_only(rows_of, tmp_path):
    rows = rows_of("elastomer.E_star=1.0", "load.p_star=0.1")
    assert values(rows, "ensemble") == [
        f"self-affine hurst={hurst} cutoff=0.2" for hurst in (0.3, 0.3, 0.8, 0.8)
    ]
    groups = ensembles(compare(tmp_path / "study.h5"))
    assert [[row["seed"] for row in group.rows] for group in groups] == [[0, 1], [0, 1]]
    assert [group.rows[0]["hurst"] for group in groups] == [0.3, 0.8]


def test_tasks_that_are_not_solved_yet_have_their_parameters(spec_of, rows_of, tmp_path):
    spec = spec_of("elastomer.E_star=1.0")
    run_study(spec, SPEC, tmp_path / "s.h5", lambda _: None, RunOptions(shard=(0, 4), jobs=1))
    rows = read_rows(tmp_path / "s.h5")
    assert values(rows, "hurst") == 4 * [0.3] + 4 * [0.8]
    assert {row["status"] for row in rows} == {"converged", "missing"}


def test_a_study_that_grows_names_the_new_sweep_in_its_old_rows_too(rows_of):
    one = ("surface.hurst=0.8", "surface.seed=0", "elastomer.E_star=1.0", "load.p_star=0.1")
    spec = SPEC.replace("hurst = [0.3, 0.8]\n", "")
    (before,) = rows_of(*one[1:], text=spec)
    assert before["surface"] == "self-affine cutoff=0.2 seed=0"
    new, old = rows_of("surface.hurst=[0.3, 0.8]", *one[1:])
    assert old["surface"] == "self-affine hurst=0.8 cutoff=0.2 seed=0"
    assert (old["a_r"], old["seconds"]) == (before["a_r"], before["seconds"])
    assert new["hurst"] == 0.3


def test_the_treatment_of_a_map_is_in_its_columns_where_the_file_decides_it(tmp_path):
    np.save(tmp_path / "h.npy", np.random.default_rng(0).normal(size=(16, 16)))
    periodic = FileSurface(path=tmp_path / "h.npy").parameters()
    assert (periodic["periodic"], periodic["level"], periodic["edges"]) == (True, "none", "none")
    scan = FileSurface(path=tmp_path / "h.npy", periodic=False, edges="mirror").parameters()
    assert (scan["periodic"], scan["level"], scan["edges"]) == (False, "plane", "mirror")


def test_thickness_is_that_of_the_key():
    (thickness,) = (each for each in PARAMETERS if each.key == "thickness")
    assert thickness.cell(Plate(thickness=1e-6).parameters()) == 1e-6
    assert thickness.cell(Slab(thickness=0.1).parameters()) == 0.1


def test_csv_json_and_data_set_have_the_same_parameters(gfmd):
    assert gfmd("run", "spec.toml", "-o", "s.h5", "-q", "-j", "1").exit_code == 0
    rows = list(csv.DictReader(io.StringIO(gfmd("export", "s.h5").output)))
    by_hand = [column.name for column in (*MAIN_COLUMNS, *DETAIL_COLUMNS)]
    assert list(rows[0])[: len(by_hand)] == by_hand
    names = list(rows[0])[len(by_hand) :]
    assert {"hurst", "rolloff", "cutoff", "E_star", "max_steps"} <= set(names)
    assert not {"tension", "radius", "surface_path"} & set(names)
    assert [float(row["hurst"]) for row in rows] == [0.3] * 8 + [0.8] * 8
    records = json.loads(gfmd("analyze", "s.h5", "--json").output)
    assert set(names) <= set(records[0])
    assert {record["E_star"] for record in records} == {1.0, 2e6}
    data = as_dataset(Path("s.h5"))
    assert {*names, "surface", "elastomer", "seed", "n", "points"} <= set(data.coords)
    assert data.hurst.attrs["long_name"].startswith("surface.hurst: Hurst exponent")
    mean = data.where(data.hurst == 0.8, drop=True).a_r
    assert mean.sizes["task"] == 8


def test_parameters_are_coordinates_in_netcdf(gfmd):
    xarray = pytest.importorskip("xarray")
    assert gfmd("run", "spec.toml", "-o", "s.h5", "-q", "-j", "1").exit_code == 0
    assert gfmd("export", "s.h5", "-o", "s.nc").exit_code == 0
    with xarray.open_dataset("s.nc", engine="h5netcdf") as data:
        assert {"hurst", "E_star", "surface", "spectrum"} <= set(data.coords)
        assert data.E_star.attrs["units"] == "Pa"


@pytest.mark.parametrize(
    ("contents", "marked"), [("aba", [False] * 3), ("aab", [True, False, True])]
)
def test_files_of_one_name_and_other_contents_are_told_apart(contents, marked):
    """Files x, y and x again with these contents; twice, as an older study has marks already."""
    rows = [
        {"surface": name, "ensemble": name, "surface_sha256": 64 * content}
        | {"elastomer": "springs", "elastomer_short": "springs", "elastomer_sha256": ""}
        for name, content in zip("xyx", contents, strict=True)
    ]
    for _ in range(2):
        tell_files_apart(rows)
        for name, content, row, is_marked in zip("xyx", contents, rows, marked, strict=True):
            label = f"{name} sha256={8 * content}" if is_marked else name
            assert (row["surface"], row["ensemble"], row["elastomer"]) == (label, label, "springs")
