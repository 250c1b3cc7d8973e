"""What `gfmd export` writes, read back by other programs' libraries."""

import csv
import io
import re
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np
import pytest
import xarray

from gfmd_cli.analysis.export import _cell, _padded, as_dataset
from gfmd_cli.study.columns import COLUMNS, DETAIL_COLUMNS, MAIN_COLUMNS, TASK
from gfmd_cli.study.reading import open_study, read_rows

SPEC = """
[surface]
kind = "self-affine"
cutoff = 0.1
length = 2.0
h_std = 1e-3
[elastomer]
kind = "half-space"
E_star = 1e6
[grid]
points = [32, 48]
[load]
p_star = [0.1, 0.5]
[output]
patches = true
percolation = true
stiffness = true
gap_distribution = true
spectra = true
fields = ["u", "sigma", "height"]
"""
ARRAYS = {"height": "height", "displacement": "u", "stress": "sigma"}


@pytest.fixture(scope="module")
def study(output_of, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    (folder / "spec.toml").write_text(SPEC)
    output_of("run", folder / "spec.toml", "-o", folder / "s.h5", "-q", "-j", "1")
    return folder / "s.h5"


@pytest.fixture(scope="module")
def line_study(output_of, tmp_path_factory):
    folder = tmp_path_factory.mktemp("line")
    text = SPEC[: SPEC.index("[surface]")] + '[surface]\nkind = "ridge"\n'
    (folder / "spec.toml").write_text(
        text + SPEC[SPEC.index("[elastomer]") :].replace("[32, 48]", "64").replace(", 0.5]", "]")
    )
    output_of("run", folder / "spec.toml", "-o", folder / "s.h5", "-q", "-j", "1")
    return folder / "s.h5"


@pytest.mark.parametrize("suffix", ["csv", "nc", "vti"])
def test_a_link_to_an_output_stays_a_link(output_of, study, tmp_path, suffix):
    link = tmp_path / f"link.{suffix}"
    link.symlink_to("file")
    task = ("--task", "0") if suffix == "vti" else ()
    output_of("export", study, "-o", link, *task)
    assert link.is_symlink()
    assert (tmp_path / "file").stat().st_size > 0


def test_csv_has_the_columns_of_the_layout(output_of, study, tmp_path):
    output_of("export", study, "-o", tmp_path / "s.csv")
    text = (tmp_path / "s.csv").read_text()
    assert text == output_of("export", study)
    rows = list(csv.DictReader(io.StringIO(text)))
    by_hand = [column.name for column in (*MAIN_COLUMNS, *DETAIL_COLUMNS)]
    assert list(rows[0])[: len(by_hand)] == by_hand
    assert {"cutoff", "hurst", "E_star"} < set(rows[0]) - set(by_hand)
    for row, stored in zip(rows, read_rows(study), strict=True):
        assert int(row["patches"]) == stored["patches"]
        assert float(row["stiffness"]) == stored["stiffness"]


def test_a_dataset_has_columns_distributions_scenes_and_curves(study):
    dataset, rows = as_dataset(study), read_rows(study)
    assert {c.name for c in (*MAIN_COLUMNS, *DETAIL_COLUMNS)} <= {*dataset.variables}
    for column in (c for c in (TASK, *COLUMNS) if c.name in dataset.variables):
        variable = dataset[column.name]
        np.testing.assert_array_equal(variable.values, [row[column.name] for row in rows])
        assert variable.dims == ("task",)
        assert variable.attrs["long_name"] == column.meaning
    assert dataset.pr_sigma.dims == ("task", "sigma")
    assert dataset.pr_gap_log.dims == ("task", "gap_log")
    assert dataset.gap.attrs["edges"].size == dataset.gap.size + 1
    total = dataset.pr_gap_zero + dataset.pr_gap_beyond + dataset.pr_gap.sum("gap") * 0.05
    np.testing.assert_allclose(total, 1, rtol=1e-12)
    assert set(dataset.scene.values) == {0, 1}
    with open_study(study) as file:
        shells = [file.shells(scene) for scene in range(2)]
    for scene in range(2):
        expected = shells[scene].q
        q = dataset.scenes_q[scene].values
        np.testing.assert_array_equal(q[: expected.size], expected)
        assert np.all(np.isnan(q[expected.size :]))
    with h5py.File(study) as file:
        for name in ("u", "sigma"):
            variance = [file[f"fields/{task}/{name}"][()].var() for task in range(4)]
            power = dataset[f"spectra_{name}"].sum("spectra_shell")
            np.testing.assert_allclose(power, variance, rtol=1e-10)
    assert dataset.spectra_q.attrs["units"] == "m-1"


def test_netcdf_opens_labelled_in_xarray_as_the_dataset_was(output_of, study, tmp_path):
    output_of("export", study, "-o", tmp_path / "s.nc")
    with xarray.open_dataset(tmp_path / "s.nc", engine="h5netcdf") as dataset:
        expected = as_dataset(study)
        xarray.testing.assert_equal(dataset.load(), expected)
        assert dataset.attrs["Conventions"] == expected.attrs["Conventions"]
        assert dataset.a_r.attrs == expected.a_r.attrs


def test_netcdf_opens_in_the_netcdf_library(output_of, study, tmp_path):
    netcdf = pytest.importorskip("netCDF4")
    output_of("export", study, "-o", tmp_path / "s.nc")
    with netcdf.Dataset(tmp_path / "s.nc") as dataset:
        assert dataset.data_model == "NETCDF4"
        assert dataset["pr_gap"].dimensions == ("task", "gap")
        assert (
            dataset["sigma_p"].long_name
            == "standard deviation of the contact pressure / Delta_sigma"
        )
        expected = [row["a_r"] for row in read_rows(study)]
        np.testing.assert_array_equal(dataset["a_r"][:], expected)
        assert list(dataset["status"][:]) == ["converged"] * 4


def parsed(path):
    """Attributes of an image and its arrays, by the format's description."""
    content = path.read_bytes()
    head, appended = content.split(b'<AppendedData encoding="raw">\n_', 1)
    tree = ElementTree.fromstring(head + b"</VTKFile>")
    image = tree.find("ImageData")
    arrays = {}
    for array in image.iter("DataArray"):
        assert array.get("type") == "Float64"
        start = int(array.get("offset"))
        size = int.from_bytes(appended[start : start + 8], "little")
        arrays[array.get("Name")] = np.frombuffer(appended[start + 8 : start + 8 + size], "<f8")
    return image.attrib, arrays


def test_an_image_holds_the_fields_of_a_task(output_of, study, tmp_path):
    output_of("export", study, "-o", tmp_path / "s.vti", "--task", 2)
    image, arrays = parsed(tmp_path / "s.vti")
    assert image["WholeExtent"] == "0 47 0 47 0 0"
    assert float(image["Spacing"].split()[0]) == pytest.approx(2 / 48, rel=1e-15)
    with h5py.File(study) as file:
        for name, field in ARRAYS.items():
            stored = file[f"fields/2/{field}"][()]
            np.testing.assert_array_equal(arrays[name].reshape(stored.shape), stored)


def test_an_image_of_a_line_scene_takes_the_only_task(output_of, line_study, tmp_path):
    output_of("export", line_study, "-o", tmp_path / "s.vti")
    image, arrays = parsed(tmp_path / "s.vti")
    assert image["WholeExtent"] == "0 63 0 0 0 0"
    assert arrays["stress"].size == 64


def test_an_image_opens_in_vtk(output_of, study, tmp_path):
    xml = pytest.importorskip("vtkmodules.vtkIOXML")
    numpy_support = pytest.importorskip("vtkmodules.util.numpy_support")
    output_of("export", study, "-o", tmp_path / "s.vti", "--task", 1)
    reader = xml.vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "s.vti"))
    reader.Update()
    image = reader.GetOutput()
    assert image.GetDimensions() == (32, 32, 1)
    with h5py.File(study) as file:
        for name, field in ARRAYS.items():
            array = image.GetPointData().GetArray(name)
            stored = file[f"fields/1/{field}"][()]
            np.testing.assert_array_equal(numpy_support.vtk_to_numpy(array), stored.ravel())
            unit = array.GetInformation().Get(array.UNITS_LABEL())
            assert unit == ("Pa" if name == "stress" else "m")
            x, y, _ = image.GetPoint(image.ComputePointId((3, 5, 0)))
            assert (x, y) == pytest.approx((3 * 2 / 32, 5 * 2 / 32))
            assert array.GetValue(image.ComputePointId((3, 5, 0))) == stored[5, 3]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "a.xyz"), r"unknown suffix '\.xyz'; allowed: \.csv, \.nc, \.vti"),
        (("-o", "a"), "unknown suffix ''"),
        (("-o", "a.vti"), "4 tasks have fields; choose --task, one of 0, 1, 2, 3"),
        (("-o", "a.vti", "--task", "9"), "--task: 9 has no fields in .*allowed: 0, 1, 2, 3"),
        (("-o", "a.nc", "--task", "1"), "--task: chooses fields"),
    ],
)
def test_what_cannot_be_written_is_refused_in_one_message(
    output_of, study, tmp_path, words, message
):
    place = [str(tmp_path / word) if word.startswith("a") else word for word in words]
    output = output_of("export", study, *place, status=2)
    assert re.search(message, output)
    assert len(output.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_an_exported_file_in_the_place_of_a_study_is_told(output_of, study, tmp_path):
    output_of("export", study, "-o", tmp_path / "s.nc")
    output = output_of("analyze", tmp_path / "s.nc", status=74)
    assert "s.nc: a netCDF file, as of `gfmd export`, not the study" in output
    assert "damaged" not in output


@pytest.mark.parametrize("words", [("a.csv",), ("a.nc",), ("a.vti", "--task", "0")])
def test_a_place_that_cannot_be_written_is_status_73(output_of, study, tmp_path, words):
    (tmp_path / "file").write_text("")
    output = output_of("export", study, "-o", tmp_path / "file" / words[0], *words[1:], status=73)
    assert "cannot be written" in output


def test_a_study_without_fields_makes_no_image(output_of, tmp_path):
    (tmp_path / "spec.toml").write_text(SPEC)
    output_of(
        "run", tmp_path / "spec.toml", "-o", tmp_path / "s.h5", "-q", "--set", "output={}",
        "--set", "load.p_star=0.5", "--set", "grid.points=32",
    )  # fmt: skip
    output = output_of("export", tmp_path / "s.h5", "-o", tmp_path / "s.vti", status=2)
    assert "contains no fields" in output
    assert "spectra_q" not in as_dataset(tmp_path / "s.h5")


def test_a_study_that_is_not_finished_is_exported_as_far_as_it_goes(output_of, study, tmp_path):
    spec = study.parent / "spec.toml"
    output_of("run", spec, "-o", tmp_path / "s.h5", "-q", "-j", "1", "--shard", "1/4")
    dataset = as_dataset(tmp_path / "s.h5")
    assert list(dataset.status.values) == ["missing", "converged", "missing", "missing"]
    assert np.isnan(dataset.spectra_u[0]).all()
    assert dataset.spectra_u[1].notnull().any()


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@sum(a1)", "\tx", "\rx"])
def test_text_that_looks_like_a_formula_is_quoted_in_csv(text):
    assert _cell(text) == f"'{text}"
    assert _cell("half-space") == "half-space"
    assert _cell(-1.5) == "-1.5"


def test_curves_of_unequal_length_are_padded():
    column = next(column for column in COLUMNS if column.name == "u_g")
    curves = [{"u_g": np.array([1.0, 2.0, 3.0])}, {"u_g": np.array([4.0])}, {}]
    (padded,) = _padded("curve", ("task", "q"), (column,), curves).values()
    np.testing.assert_array_equal(padded[1], [[1, 2, 3], [4, np.nan, np.nan], [np.nan] * 3])
