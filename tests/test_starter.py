import json
import os
import re
import shlex
import sys
import tomllib

import h5py
import numpy as np
import pytest
from spectrum_fits import gaussian_roughness

from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.tasks import plan

SCAN = "configs/data/di-3.di"


@pytest.fixture
def gfmd(tmp_path, monkeypatch, pytestconfig, output_of):
    """Runs a command in an empty folder that has the scan."""
    scan = (pytestconfig.rootpath / SCAN).read_bytes()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scan.di").write_bytes(scan)
    return output_of


def holed(path, shape=(20, 16)):
    heights = np.random.default_rng(0).normal(size=shape)
    heights[3, 3:5] = np.nan
    np.save(path, heights)


@pytest.mark.parametrize("words", [(), ("--from", "scan.di"), ("--from", "holed.npy")])
def test_what_init_writes_runs(gfmd, tmp_path, words):
    if "scan.di" in words:
        pytest.importorskip("SurfaceTopography")
    holed(tmp_path / "holed.npy")
    result = gfmd("init", "first.toml", *words)
    assert result.endswith("next: gfmd run first.toml\n")
    short = () if words else ("--set", "load.p_star=0.1", "--set", "grid.points=128")
    assert "converged" in gfmd("run", "first.toml", *short)
    assert all(row["status"] == "converged" for row in read_rows(tmp_path / "first.h5"))


@pytest.mark.parametrize(
    ("stem", "name"),
    [("probe 3 (größe)", "probe-3-gr-e"), ("(ä)", "study"), (120 * "a", 100 * "a")],
)
def test_files_of_any_name_have_a_study_of_a_valid_name(gfmd, tmp_path, stem, name):
    holed(tmp_path / f"{stem}.npy")
    result = gfmd("init", f"{stem}.toml", "--from", f"{stem}.npy")
    _, command = result.split("next: ")
    gfmd(*shlex.split(command)[1:], "--set", "load.p_star=0.1")
    assert (tmp_path / f"{name}.h5").exists()


def test_an_oblong_scan_with_holes_is_solved_as_it_is(gfmd, tmp_path):
    holed(tmp_path / "holed.npy", (21, 16))
    result = gfmd("init", "first.toml", "--from", "holed.npy", "--set", "surface.periodic=false")
    done = "16 x 21 points, 2 missing heights filled in, plane subtracted, free boundary"
    assert done in result
    gfmd("run", "first.toml", "--set", "load.p_star=0.1")
    (row,) = read_rows(tmp_path / "first.h5")
    assert (row["points"], row["points_y"], row["boundary"]) == (16, 21, "free")
    assert (row["length"], row["length_y"]) == pytest.approx((1.0, 21 / 16))
    assert done in row["preparation"]


@pytest.mark.parametrize(
    ("overrides", "boundary", "edges", "points"),
    [
        ((), "free", "none", 16),
        (("elastomer={kind='plate', E_star=1, thickness=1}",), "periodic", "mirror", 32),
        (("elastomer={kind='power', n=[1, 3]}",), None, None, None),
        (("grid.boundary=periodic",), "periodic", "mirror", 32),
        (("surface.edges=window",), "periodic", "window", 16),
        (("surface.periodic=true",), "periodic", "none", 16),
        (("solver.kind=fire",), "periodic", "mirror", 32),
        (("output.spectra=true",), "free", "none", 16),
        (("accuracy.mean_gap=0.5",), "free", "none", 16),
    ],
)
def test_a_scan_is_free_where_that_is_available_and_else_mirrored(
    tmp_path, overrides, boundary, edges, points
):
    holed(tmp_path / "h.npy", (16, 16))
    path = tmp_path / "spec.toml"
    path.write_text(
        '[surface]\nkind = "file"\npath = "h.npy"\nperiodic = false\n[elastomer]\n'
        'kind = "half-space"\nE_star = 1\n[grid]\npoints = 16\n[load]\npressure = 0.1\n'
    )
    tasks = plan(read_spec(path, overrides)[0])
    settings = [(task.boundary, task.surface.edges or "none", task.points) for task in tasks]
    if boundary is None:  # n = 1 and n = 3
        assert settings == [("free", "none", 16), ("periodic", "mirror", 32)]
        assert len({task.id for task in tasks}) == 2
    else:
        assert settings == [(boundary, edges, points)]


def test_a_mirrored_map_has_no_free_boundary(gfmd, tmp_path):
    holed(tmp_path / "h.npy", (16, 16))
    keys = ("--set", "surface.edges=mirror", "--set", "grid.boundary=free")
    message = gfmd("init", "new.toml", "--from", "h.npy", *keys, status=2)
    assert "leave out one of them" in message
    assert not (tmp_path / "new.toml").exists()


@pytest.mark.parametrize("boundary", ["free", "periodic"])
def test_init_warns_of_the_map_as_its_runs_use_it(gfmd, tmp_path, boundary):
    """A step at the border matters in a periodic cell, a tilt if the map ends at its borders."""
    np.save(tmp_path / "h.npy", np.add.outer(np.sin(np.arange(64)), 3.0 * np.arange(64)))
    printed = gfmd("init", "new.toml", "--from", "h.npy", "--set", f"grid.boundary={boundary}")
    for text in (printed, (tmp_path / "new.toml").read_text()):
        assert ("step across the border" in text) == (boundary == "periodic")
        assert ("a tilt makes up" in text) == (boundary == "free")


@pytest.mark.parametrize("words", [(), ("--from", "scan.di")])
def test_each_key_that_is_commented_out_is_valid(gfmd, tmp_path, words):
    pytest.importorskip("SurfaceTopography")
    gfmd("init", "first.toml", *words)
    table, keys = "", 0
    for line in (tmp_path / "first.toml").read_text().splitlines():
        if header := re.fullmatch(r"#?\[(\w+)\]", line):
            table = header[1]
        elif key := re.match(r"#(\w+) = (.*?)  *# ", line):
            alone = table in ("load", "accuracy")
            pair = f"{table}={{{key[1]}={key[2]}}}" if alone else f"{table}.{key[1]}={key[2]}"
            read_spec(tmp_path / "first.toml", (pair,))
            keys += 1
    assert keys >= 5


MATRIX = """\
# Channel: Height
# Width: 12 µm
# Height: 16 µm
# Value units: nm
1 1.5 3
-2 -3 -6
0 0 0
9 9 92
"""


def test_a_map_of_few_points_is_interpolated(gfmd, tmp_path):
    """Three columns with a header, as Gwyddion writes them, are a matrix."""
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "small.txt").write_text(MATRIX, encoding="utf-8")
    gfmd("init", "first.toml", "--from", "small.txt")
    assert "interpolated: 8 are needed" in (tmp_path / "first.toml").read_text()
    gfmd("run", "first.toml", "--set", "load.p_star=0.1")
    (row,) = read_rows(tmp_path / "first.h5")
    assert (row["points"], row["points_y"], row["boundary"]) == (9, 12, "free")
    assert (row["length"], row["length_y"]) == pytest.approx((12e-6, 16e-6))
    assert row["status"] == "converged"


@pytest.mark.parametrize(
    "words", [(), ("--set", "elastomer.kind=half-space"), ("--set", "elastomer.E_star=[2e9, 1e6]")]
)
def test_the_pressures_that_init_writes_suit_the_elastomer(gfmd, tmp_path, words):
    """From p* = 0.003 to 0.3, to a power of ten, of the first elastomer."""
    np.save(tmp_path / "map.npy", np.random.default_rng(5).normal(0, 1e-9, size=(32, 32)))
    gfmd("init", "s.toml", "--from", "map.npy", "--set", "surface.length=1e-5", *words)
    (first, *_) = plan(read_spec(tmp_path / "s.toml")[0])
    assert first.elastomer.E_star == 2e9
    delta_sigma = build_scene(first.surface, first.elastomer, first.points).delta_sigma
    assert 0.0009 < first.p_star(delta_sigma) < 0.01
    note = " for the first elastomer" in (tmp_path / "s.toml").read_text()
    assert note is any("[" in word for word in words)


def test_surface_uses_the_points_of_a_spec(gfmd, tmp_path):
    """A punch, whose rms gradient depends on the grid."""
    (tmp_path / "p.toml").write_text(
        '[surface]\nkind = "punch"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = [32, 64]\n[load]\np_star = 0.1\n"
    )
    (record,) = json.loads(gfmd("surface", "p.toml", "--json"))
    assert record["points"] == [64, 64]


def test_one_of_several_maps_has_to_be_chosen(gfmd, tmp_path):
    first, second = np.random.default_rng(0).normal(size=(2, 16, 16))
    with h5py.File(tmp_path / "two.h5", "w") as file:
        file["first"], file["second"] = first, second
    for words in (("surface", "two.h5"), ("init", "spec.toml", "--from", "two.h5")):
        message = "choose one by surface.dataset; its height maps: first, second"
        assert message in gfmd(*words, status=2)
    gfmd("init", "spec.toml", "--from", "two.h5", "--set", "surface.dataset=second")
    (surface,) = read_spec(tmp_path / "spec.toml")[0].surface
    assert surface.dataset == "second"
    assert "HDF5, second" in gfmd("surface", "two.h5", "--set", "surface.dataset=second")


def test_init_shows_only_keys_of_the_kind_that_was_given(gfmd, tmp_path):
    gfmd("init", "--set", "surface.kind=punch")
    text = (tmp_path / "study.toml").read_text()
    assert "random" not in text
    assert "#h_std" not in text
    assert "#length" in text


def test_init_replaces_nothing(gfmd, tmp_path):
    (tmp_path / "study.toml").write_text("mine")
    assert "the file exists" in gfmd("init", status=2)
    assert (tmp_path / "study.toml").read_text() == "mine"


@pytest.mark.parametrize("pair", ["foo.bar=1", "elastomer.kind=slab", "load.p_star=-1"])
def test_init_names_the_option_that_is_wrong(gfmd, pair):
    """The file is not written, so that none of its lines can be named."""
    assert gfmd("init", "--set", pair, status=2).startswith(f"gfmd: --set {pair}: ")


def test_a_scan_that_will_not_do_is_refused_as_it_is(gfmd, tmp_path):
    np.save(tmp_path / "h.npy", np.full((16, 16), np.nan))
    assert "all of the 256 heights" in gfmd("init", "a.toml", "--from", "h.npy", status=2)
    assert not (tmp_path / "a.toml").exists()


@pytest.mark.parametrize("edges", ["window", "mirror"])
def test_the_fit_that_surface_prints_can_be_run(gfmd, tmp_path, edges):
    """A random surface from it has the rms height of the fit, and the rms gradient of the scan.

    The fit is to tapered edges: of the mirrored scan, the gradient at the edges has less weight.
    """
    pytest.importorskip("SurfaceTopography")
    result = gfmd("surface", "scan.di", "--set", f"surface.edges={edges}")
    table = result[result.index("  [surface]") :].replace("\n  ", "\n").strip()
    (tmp_path / "fit.toml").write_text(
        f'{table}\n[elastomer]\nkind = "half-space"\n[grid]\npoints = 512\n[load]\np_star = 1\n'
    )
    printed = re.search(r"lambda_s = .*, rms height (\S+) m", result).group(1)
    scan, random = (
        re.search(r"rms height (\S+) m, rms gradient (\S+),", text).groups()
        for text in (result, gfmd("surface", "fit.toml"))
    )
    assert float(random[0]) == pytest.approx(float(printed), rel=0.02)
    assert float(random[1]) == pytest.approx(float(scan[1]), rel=0.04)


def test_surface_summarises_a_line(gfmd, tmp_path):
    """A cosine wave of amplitude 1: Pq = 1 / sqrt(2), Pt = 2, Pku = 3 / 2."""
    (tmp_path / "wave.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\np_star = 1\n"
    )
    (record,) = json.loads(gfmd("surface", "wave.toml", "--json"))
    assert (record["Pq"], record["Pt"], record["Pku"]) == pytest.approx((0.5**0.5, 2, 1.5))
    assert record["q"] == pytest.approx([2 * np.pi])
    assert record["spectrum"] == pytest.approx([0.25])  # L |h(q)|^2
    text = gfmd("surface", "wave.toml")  # in reduced units
    assert "Pq 0.70711, " in text
    assert "half-space: p* = 1 is p = 2.2214 E_star" in text  # q / (2 sqrt 2)
    assert not re.search(r"\d m\b|1/m|\[m\]", text)


def test_several_surfaces_give_one_table_and_one_figure(gfmd, tmp_path):
    pytest.importorskip("matplotlib")
    holed(tmp_path / "holed.npy", (16, 16))
    np.save(tmp_path / "line.npy", np.random.default_rng(1).normal(size=64))
    result = gfmd("surface", "holed.npy", "line.npy", "--figure", "both.svg")
    header, first, second = [line.split() for line in result.splitlines()][:3]
    records = json.loads(gfmd("surface", "holed.npy", "line.npy", "--json"))
    assert float(first[1]) == pytest.approx(records[0]["Sq"], rel=1e-3)
    assert second[1:9] == ["-"] * 8
    assert {"Sq", "Pq"} <= set(header)
    drawn = (tmp_path / "both.svg").read_text()
    assert drawn.count("clipPath") > 3
    gfmd("surface", "holed.npy", "line.npy", "--figure", "both.svg")
    assert (tmp_path / "both.svg").read_text() == drawn
    assert "allowed: .png, .pdf, .svg" in gfmd(
        "surface", "holed.npy", "--figure", "a.jpg", status=2
    )


def test_the_table_of_several_surfaces_shows_whether_a_fit_is_good(gfmd, tmp_path):
    """One surface is self-affine, the other one has noise, in lines that are a part of it."""
    draw = np.random.default_rng(3)
    good = gaussian_roughness(draw, 256, 0.8, 10.0, 64.0)[:128, :128]
    np.save(tmp_path / "good.npy", good)
    np.save(tmp_path / "bad.npy", good + 0.2 * good.std() * draw.normal(size=(128, 1)))
    words = ("good.npy", "bad.npy", "--set", "surface.periodic=false")
    header, *lines = gfmd("surface", *words).splitlines()[:3]
    fits = [json.loads(gfmd("surface", *words, "--json"))[i] for i in (0, 1)]
    for line, fit in zip(lines, fits, strict=True):
        assert header.split()[-1] == "scatter"
        assert float(line.split()[-1]) == pytest.approx(fit["scatter"], rel=0.01)
        assert "+-" in line
    assert fits[0]["scatter"] < 1.5
    assert fits[1]["scatter"] > 3


def test_a_scan_in_nanometres_that_does_not_repeat_gives_warnings_and_is_mended(gfmd, tmp_path):
    """Tilted by 300 nm, 2 nm rough, 1 um wide."""
    rough = 2 * SelfAffine(cutoff=1 / 8).heights(32)
    np.save(tmp_path / "nm.npy", rough + np.linspace(0, 300, 32))
    result = gfmd("surface", "nm.npy")
    warnings = ("does not state its side", "heights and side are in metres", "across the border")
    for warning in warnings:
        assert warning in result
    mended = [f"surface.{key}" for key in ("scale=1e-9", "length=1e-6", "periodic=false")]
    words = [word for key in mended for word in ("--set", key)]
    result = gfmd("surface", "nm.npy", *words)
    assert "warning:" not in result
    assert "L = 1e-06 m" in result
    gfmd("init", "first.toml", "--from", "nm.npy", *words)
    (surface,) = read_spec(tmp_path / "first.toml")[0].surface
    assert (surface.scale, surface.length, surface.periodic) == (1e-9, 1e-6, False)
    assert "NOTE" not in (tmp_path / "first.toml").read_text()


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ("surface.scael=1", "unknown key 'scael' - did you mean 'scale'"),
        ("surface.scale=[1,2]", "with one value"),
        ("grid.points=64", "takes only keys of the table surface"),
        ("surface.path=other.npy", "surface.path: the command names the scan, h.npy"),
        ("surface={kind='file', path='other.npy'}", "the command names the scan, h.npy"),
    ],
)
def test_a_wrong_word_on_a_scan_is_refused(gfmd, tmp_path, pair, message):
    np.save(tmp_path / "h.npy", np.random.default_rng(0).normal(size=(16, 16)))
    assert message in gfmd("surface", "h.npy", "--set", pair, status=2)
    if pair.startswith("surface"):
        assert message in gfmd("init", "--from", "h.npy", "--set", pair, status=2)


def test_an_exponent_that_is_no_roughness_is_said_to_be_changed(gfmd, tmp_path):
    """C(q) ~ q^-5: H = 1.5."""
    m = np.hypot(np.fft.fftfreq(64, 1 / 64)[:, None], np.fft.rfftfreq(64, 1 / 64))
    amplitude = np.where((m > 0) & (m < 25), np.maximum(m, 1) ** -2.5, 0)
    phases = np.exp(2j * np.pi * np.random.default_rng(0).random(m.shape))
    height = np.fft.irfft2(amplitude * phases)
    np.save(tmp_path / "h.npy", height)
    assert "which is outside 0.01 to 1" in gfmd("surface", "h.npy")


def test_the_name_of_a_scan_adds_no_line_to_the_spec(gfmd, tmp_path):
    name = 'a\n[solver]\nkind = "fire"\n.npy'
    y, x = np.mgrid[:16, :16] * (2 * np.pi / 16)
    np.save(tmp_path / "h.npy", np.cos(x) * np.cos(y))
    (tmp_path / "h.npy").rename(tmp_path / name)
    gfmd("init", "spec.toml", "--from", name)
    spec = tomllib.loads((tmp_path / "spec.toml").read_text(encoding="utf-8"))
    assert "solver" not in spec
    assert spec["surface"]["path"] == name


@pytest.mark.skipif(sys.platform == "darwin", reason="names of files are UTF-8 on macOS")
def test_a_scan_whose_name_a_spec_cannot_contain_is_refused(gfmd, tmp_path):
    np.save(tmp_path / "h.npy", np.random.default_rng(0).normal(size=(16, 16)))
    name = os.fsdecode(b"h\xff.npy")
    (tmp_path / "h.npy").rename(tmp_path / name)
    assert "the name is not UTF-8" in gfmd("init", "spec.toml", "--from", name, status=2)
    assert not (tmp_path / "spec.toml").exists()
