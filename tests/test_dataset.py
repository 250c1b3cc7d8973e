"""A study as a labelled data set: tasks are selected by their parameters."""

from pathlib import Path

import numpy as np
import pytest
import xarray

from gfmd_cli import dataset
from gfmd_cli.errors import GfmdError, InputError
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

SPEC = """\
[surface]
kind = "self-affine"
cutoff = 0.2
hurst = [0.5, 0.8]
seed = [0, 1]
[[elastomer]]
kind = "power"
n = [0, 1]
[[elastomer]]
kind = "slab"
thickness = 0.1
[grid]
points = 16
[load]
p_star = { from = 0.1, to = 1.0, per_decade = 2 }
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    (folder / "spec.toml").write_text(SPEC)
    spec, text = read_spec(folder / "spec.toml")
    run_study(spec, text, folder / "study.h5", lambda event: None, RunOptions(jobs=1))
    return folder / "study.h5"


@pytest.fixture(scope="module", params=["study.h5", "study.nc"])
def data(study, request, output_of):
    """The data set of the study, and that of its netCDF file."""
    path = study.with_name(request.param)
    if path.suffix == ".nc":
        output_of("export", study, "-o", path)
    return dataset(path)


def test_tasks_are_selected_by_their_parameters(data, study):
    chosen = data.sel(hurst=0.8, n=1)
    expected = [row for row in read_rows(study) if (row["hurst"], row["n"]) == (0.8, 1.0)]
    assert chosen.a_r.dims == ("task",)
    assert chosen.a_r.values.tolist() == [row["a_r"] for row in expected]
    assert len(expected) == 2 * 3


def test_selections_can_follow_each_other_and_combine_lists_and_ranges(data):
    assert data.sel(hurst=0.8).sel(n=[0, 1]).sizes["task"] == 12
    assert data.sel(n=[0, 1], seed=1, p_star=slice(0.2, None)).sizes["task"] == 2 * 2 * 2
    assert data.sel(elastomer_kind="slab").thickness.values.tolist() == [0.1] * 12
    assert data.isel(task=slice(0, 3)).sel(p_star=0.1).sizes["task"] == 1
    assert set(data.sel(cutoff=0.2).cutoff.values) == {0.2}


def test_the_nearest_value_is_taken_on_request(data):
    near = data.sel(p_star=0.3, n=1, method="nearest").p_star.values
    assert near == pytest.approx([0.1 * 10**0.5] * 4, rel=1e-12)
    with pytest.raises(KeyError, match=r"p_star = 0\.3"):
        data.sel(p_star=0.3)


def test_a_selection_can_be_sorted_and_grouped(data):
    curve = data.sel(hurst=0.8, n=1, seed=0).sortby("p_star").a_r
    assert (curve.diff("task") > 0).all()
    means = data.sel(n=[0, 1]).a_r.groupby("n").mean()
    assert means.sel(n=1) < means.sel(n=0)


def selected(values, label, method=None):
    from gfmd_cli.analysis.parameter_index import ParameterIndex

    variable = ParameterIndex({"a": xarray.Variable("task", values)})
    return variable.sel({"a": label}, method=method).dim_indexers["task"].tolist()


def test_the_ends_of_a_range_are_compared_up_to_rounding():
    loads = np.array([0.07, 0.7000000000000001, 0.8])
    assert selected(loads, slice(None, 0.7)) == [0, 1]
    assert selected(np.array([0.1, 0.7 - 1e-16]), slice(0.7, None)) == [1]


def test_whole_numbers_are_compared_exactly():
    seeds = np.array([1700000000, 1700000001, 1700000002])
    assert selected(seeds, 1700000001) == [1]
    assert selected(seeds, slice(1700000001, None)) == [1, 2]


def test_blank_parameters_are_in_no_range_and_are_not_the_nearest():
    assert selected(np.array([-1, 3, 7]), slice(None, 5)) == [1]
    assert selected(np.array([-1, 3, 7]), 0, "nearest") == [1]
    assert selected(np.array([np.nan, 3.0]), 0, "nearest") == [1]
    assert selected(np.array([-1, 3]), -1) == [0]
    with pytest.raises(KeyError):
        selected(np.array([np.nan, np.nan]), 0, "nearest")


def test_a_range_with_a_step_is_refused(data):
    with pytest.raises(ValueError, match="has no step"):
        data.sel(hurst=slice(0.1, 0.9, 2))


def test_only_known_ways_of_selecting_are_accepted(data):
    with pytest.raises(ValueError, match="only method='nearest'"):
        data.sel(n=1, method="pad")
    with pytest.raises(KeyError, match="hurts"):
        data.sel(hurts=0.8)


def test_a_file_that_is_no_netcdf_is_refused(tmp_path):
    path = Path(tmp_path / "none.nc")
    path.write_text("nothing")
    with pytest.raises(InputError, match=r"none\.nc: not a readable netCDF file"):
        dataset(path)


def test_a_selection_follows_new_names(data):
    renamed = data.rename(hurst="H", task="run").sel(H=0.8, n=1)
    assert renamed.a_r.dims == ("run",)
    assert renamed.a_r.values.tolist() == data.sel(hurst=0.8, n=1).a_r.values.tolist()


def test_selections_can_be_joined(data):
    parts = [data.sel(hurst=hurst)[["a_r", "u_g"]] for hurst in (0.8, 0.5)]
    joined = xarray.concat(parts, "task")
    assert joined.a_r.values.tolist() == [*parts[0].a_r.values, *parts[1].a_r.values]
    assert joined.sel(hurst=0.5, n=1).u_g.equals(parts[1].sel(n=1).u_g)


def test_single_tasks_have_no_index_and_can_be_joined(data):
    parts = [data.isel(task=task).a_r for task in (1, 0)]
    assert parts[0].hurst == data.hurst[1]
    joined = xarray.concat(parts, "task", coords="different", compat="equals")
    assert data.a_r.values[[1, 0]].tolist() == joined.values.tolist()


@pytest.mark.parametrize("name", ["x.nc", "x.h5"])
def test_a_file_that_cannot_be_looked_for_is_not_taken_for_missing(tmp_path, name):
    with pytest.raises(GfmdError, match=r"not a readable .*File name too long"):
        dataset(tmp_path / ("long" * 100) / name)


@pytest.mark.parametrize(("name", "what"), [("none.nc", "netCDF file"), ("none.h5", "study")])
def test_a_file_that_does_not_exist_is_named(tmp_path, name, what):
    with pytest.raises(InputError) as caught:
        dataset(tmp_path / name)
    assert str(caught.value) == f"{tmp_path / name}: no such {what}"
