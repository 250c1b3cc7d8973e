"""What [output] asks for beside the scalars, from the spec to the study, tables and records."""

import json
import re
import shutil

import h5py
import numpy as np
import pytest
from specs import power_spec

from gfmd_cli import compare, solve
from gfmd_cli.analysis.tables import study_tables
from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.observables import LINEAR_EDGES, LOGARITHMIC_EDGES
from gfmd_cli.physics.patches import AREA_EDGES
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.spec.models import ON_REQUEST, OutputTable
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.columns import COLUMNS as COLUMNS_OF_A_STUDY
from gfmd_cli.study.columns import HISTOGRAMS, TASK_GROUPS
from gfmd_cli.study.measure import optional_columns
from gfmd_cli.study.observables import OPTIONAL_OBSERVABLES, SolvedContact
from gfmd_cli.study.reading import open_study, read_rows
from gfmd_cli.study.run import RunOptions, run_study

pytestmark = pytest.mark.usefixtures("estimated_plans")
SPEC = power_spec(
    n=[0, 2],
    points=48,
    p_star=[0.1, 1.0, 50.0],
    more="""\
[output]
fields = ["u", "sigma", "height"]
""",
)
ALL = tuple(f"output.{name}=true" for name in ON_REQUEST)
FIELDS = ("u", "sigma", "height")
COLUMNS = (
    "patches",
    "patch_area_mean",
    "patch_area_largest",
    "stiffness",
    "percolates_x",
    "percolates_y",
)


def study_of(output_of, folder, *overrides, text=SPEC):
    (folder / "spec.toml").write_text(text)
    options = [word for override in overrides for word in ("--set", override)]
    output_of("run", folder / "spec.toml", "-o", folder / "s.h5", "-q", "-j", "1", *options)
    return folder / "s.h5"


@pytest.fixture(scope="module")
def study(output_of, tmp_path_factory):
    return study_of(output_of, tmp_path_factory.mktemp("all"), *ALL)


def test_patches_make_up_the_contact_area(study):
    for row in read_rows(study):
        assert row["patches"] * row["patch_area_mean"] == pytest.approx(row["a_r"], rel=1e-12)
        assert row["patch_area_mean"] <= row["patch_area_largest"] <= row["a_r"] * (1 + 1e-12)
        assert row["pr_patch_area"] @ np.diff(AREA_EDGES) == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("p_star", [0.1, 50])
def test_patches_larger_than_the_bins_are_counted_in_the_last_one(p_star):
    row = solve({
        "surface": {"kind": "self-affine", "cutoff": 0.2, "length_y": 2.0},
        "elastomer": {"kind": "power", "n": 1},
        "grid": {"points": 32},
        "load": {"p_star": p_star},
        "output": {"patches": True},
    }).columns  # fmt: skip
    assert row["pr_patch_area"] @ np.diff(AREA_EDGES) == pytest.approx(1, rel=1e-12)
    assert (row["pr_patch_area"][-1] > 0) == (row["patch_area_largest"] == 2) == (p_star == 50)


def test_full_contact_is_one_rigid_patch_that_seals(study):
    for row in read_rows(study):
        if row["p_star"] == 50:
            assert row["a_r"] == 1
            assert (row["patches"], row["patch_area_largest"]) == (1, 1.0)
            assert (row["stiffness"], row["percolates_x"], row["percolates_y"]) == (np.inf, 0, 0)
            assert row["pr_gap_zero"] == 1


def test_under_small_loads_the_gap_leaks_and_yields(study):
    for row in read_rows(study):
        if row["p_star"] == 0.1:
            assert (row["percolates_x"], row["percolates_y"]) == (1, 1)
            assert 0 < row["stiffness"] < 2


def test_the_gap_distribution_is_normalised_and_has_the_mean_gap(study):
    linear, logarithmic = LINEAR_EDGES, LOGARITHMIC_EDGES
    for row in read_rows(study):
        inside = row["pr_gap"] @ np.diff(linear)
        assert row["pr_gap_zero"] + inside + row["pr_gap_beyond"] == pytest.approx(1, rel=1e-12)
        share = row["pr_gap_log"] @ np.diff(logarithmic)
        assert row["pr_gap_zero"] + share + row["pr_gap_below"] == pytest.approx(1, rel=1e-12)
        assert row["pr_gap_zero"] == pytest.approx(row["a_r"], abs=2e-3)
        moment = row["pr_gap"] @ (np.diff(linear) * 0.5 * (linear[1:] + linear[:-1]))
        assert moment == pytest.approx(row["u_g"], abs=0.5 * (linear[1] - linear[0]))


def test_spectra_sum_up_to_the_variance_of_the_stored_fields(study):
    with h5py.File(study) as file:
        for task in file["spectra"]:
            for name in FIELDS:
                power = file[f"spectra/{task}/{name}"][()].sum()
                field = file[f"fields/{task}/{name}"][()]
                assert power == pytest.approx(field.var(), rel=1e-10)
            assert file[f"spectra/{task}/u"].dims[0][0].name.endswith("shell")
            assert file[f"autocorrelations/{task}/u"][0] == 1.0
            r = file[f"autocorrelations/{task}/r"][()]
            assert r[1] == pytest.approx(1 / 48 * (1 + np.sqrt(2)) / 2, rel=1e-12)


def test_analyze_tells_the_columns_in_a_table_and_in_records(output_of, study):
    text = output_of("analyze", study)
    assert text.count("mean patch") == 2  # two elastomers, in reduced units
    assert "[Pa" not in text
    along = re.findall(r"  (yes|no) +(yes|no)$", text, re.MULTILINE)
    assert along == 2 * [("yes", "yes"), ("no", "no"), ("no", "no")]
    caption = " ".join(text.partition("Observables:")[2].split())
    assert "1 (yes) if the gap (4-connected points) percolates along x, 0 (no) if not" in caption
    assert "The same along y; blank for a line contact." in caption
    records = json.loads(output_of("analyze", study, "--json"))
    for record, row in zip(records, read_rows(study), strict=True):
        expected = {name: row[name] if np.isfinite(row[name]) else None for name in COLUMNS}
        assert {name: record[name] for name in COLUMNS} == expected


@pytest.mark.parametrize(
    "key",
    [
        "output.stiffness=true",
        "output.true_contact=true",
        "surface.seed=[0, 1]",
        "accuracy={mean_gap=0.5}",
    ],
)
def test_every_table_has_the_pressure_in_pascals_where_it_was_given(output_of, tmp_path, key):
    study = study_of(output_of, tmp_path, "load={pressure=[2.5]}", "elastomer.n=1", key)
    tables = study_tables(compare(study))
    assert len(tables) == 2
    for table in tables:
        column = next(column for column in table.columns if column.unit == "Pa")
        assert [column.cell(record) for record in table.records] == ["2.5"] * len(table.records)


def test_patches_of_a_line_are_lengths(output_of, tmp_path):
    line = "surface={kind='wave', amplitude=1e-8, length=2e-6}"
    study = study_of(output_of, tmp_path, line, "output={patches=true}", "elastomer.n=1")
    text = output_of("analyze", study)
    assert "/ L " in text
    assert "[m]" in text
    assert "L^2 " not in text.partition("\n\n")[2].partition("Observables")[2].partition("\n\n")[2]
    assert "[m^2]" not in text


def test_nothing_is_there_that_was_not_asked_for(output_of, tmp_path):
    plain = study_of(output_of, tmp_path)
    with h5py.File(plain) as file:
        groups = set(file)
        assert not set(ON_REQUEST) & set(json.loads(file.attrs["spec"])["output"])
    assert not {h.name for h in HISTOGRAMS if h.output_key != "histogram"} & groups
    assert (
        not {*(group.name for group in TASK_GROUPS[2:]), "pr_gap_zero", "gap", "patch_area"}
        & groups
    )
    row = read_rows(plain)[0]
    assert (row["patches"], row["percolates_x"], row["percolates_y"]) == (-1, -1, -1)
    assert np.isnan(row["stiffness"])
    assert "patches" not in output_of("analyze", plain)
    assert json.loads(output_of("analyze", plain, "--json"))[0]["patches"] is None


@pytest.mark.parametrize("name", ON_REQUEST[1:])
def test_each_can_be_asked_for_alone(output_of, tmp_path, name):
    path = study_of(output_of, tmp_path, f"output.{name}=true", "elastomer.n=1", "load.p_star=0.2")
    (row,) = read_rows(path)
    assert (row["patches"] > 0) == (name == "patches")
    assert (row["percolates_x"] >= 0) == (name == "percolation")
    assert np.isfinite(row["stiffness"]) == (name == "stiffness")
    assert ("pr_gap" in row) == (name == "gap_distribution")
    output_of("analyze", path)


def test_what_was_collected_first_is_kept_when_more_is_added(output_of, tmp_path, study):
    """Rows, distributions and curves pass from the old study file to the new one."""
    spec, target = tmp_path / "spec.toml", tmp_path / "s.h5"
    spec.write_text(SPEC)
    options = [word for override in ALL for word in ("--set", override)]
    for shard in ("0/3", "1/3", "2/3"):
        output_of("run", spec, "-o", target, "-q", "-j", "1", "--shard", shard, *options)
    for row, expected in zip(read_rows(target), read_rows(study), strict=True):
        for name in set(row) - {"seconds"}:
            np.testing.assert_array_equal(row[name], expected[name], err_msg=name)
    with open_study(target) as file, open_study(study) as whole:
        for group in TASK_GROUPS[2:]:
            for task in range(6):
                arrays = file.arrays(group.name, task)
                expected = whole.arrays(group.name, task)
                assert list(arrays) == [column.name for column in group.columns]
                for name, values in expected.items():
                    np.testing.assert_array_equal(arrays[name], values)


def test_line_scenes_have_them_but_for_a_second_axis(output_of, tmp_path):
    study = study_of(
        output_of,
        tmp_path,
        *ALL,
        'surface={kind="ridge"}',
        "grid.points=128",
        "load.p_star=[0.01,0.1]",
    )
    with open_study(study) as file:
        for row in file.rows:
            fields = file.arrays("fields", row["task"])
            u, sigma, h = (fields[name] for name in FIELDS)
            touching = (u == h) & (sigma > 0)
            begins = np.count_nonzero(touching & ~np.roll(touching, 1))
            assert (row["patches"], row["percolates_x"], row["percolates_y"]) == (begins, 0, -1)
            assert row["stiffness"] > 0
            assert file.arrays("spectra", row["task"])["u"].sum() == pytest.approx(u.var())
            assert file.arrays("autocorrelations", row["task"])["r"].size == 65


def test_grids_chosen_by_accuracy_have_spectra_of_their_own(output_of, tmp_path):
    study = study_of(output_of,
        tmp_path, "output.spectra=true", 'grid.points="auto"', "accuracy.mean_gap=0.03",
        "load.p_star=[0.1,1.0]", "elastomer.n=2",
    )  # fmt: skip
    rows = read_rows(study)
    with h5py.File(study) as file:
        for row in rows:
            waves = file[f"spectra/{row['task']}/waves"][()].sum()
            assert waves == pytest.approx(row["points"] ** 2 - 1)


@pytest.mark.parametrize("name", ON_REQUEST)
def test_processes_that_share_a_grid_are_refused(tmp_path, name):
    (tmp_path / "spec.toml").write_text(SPEC)
    spec, text = read_spec(tmp_path / "spec.toml", (f"output.{name}=true",))
    with pytest.raises(InputError, match=f"output.{name}: takes whole grids"):
        run_study(spec, text, tmp_path / "s.h5", print, RunOptions(ranks=object()))


def test_an_older_study_without_the_keys_goes_on(output_of, tmp_path):
    """Its stored spec and the names of its tasks are those that this version makes."""
    first = study_of(output_of, tmp_path, "load.p_star=0.1")
    shutil.copy(first, tmp_path / "copy.h5")
    again = output_of(
        "run", tmp_path / "spec.toml", "-o", tmp_path / "copy.h5", "--set", "load.p_star=0.1"
    )
    assert "2 converged" in again
    with h5py.File(first) as file:
        output = json.loads(file.attrs["spec"])["output"]
    assert output == {
        "histogram": True, "fields": ["u", "sigma", "height"], "cross_section": False,
    }  # fmt: skip


def test_every_observable_is_a_column_that_a_key_of_output_turns_on():
    for observable in OPTIONAL_OBSERVABLES:
        assert observable.output_key in ON_REQUEST
        assert observable.output_key in OutputTable.model_fields
        assert observable.column in COLUMNS_OF_A_STUDY


def test_without_contact_there_is_no_area_of_a_patch():
    contact = build_scene(SelfAffine(cutoff=0.1), Power(n=1), 48).contact(0.1)
    u = np.full(contact.grid.shape, contact.height.max() + 1)
    output = OutputTable(patches=True, histogram=False)
    row = optional_columns(output, SolvedContact(contact, u, np.zeros_like(u)))
    assert row.pop("pr_patch_area").sum() == 0
    assert row == {"patches": 0}
