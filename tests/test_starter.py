import re

import numpy as np
import pytest
from click.testing import CliRunner

from gfmd_cli.cli import main
from gfmd_cli.study.parse import read_spec
from gfmd_cli.study.reading import read_rows

SCAN = "configs/data/di-3.di"


@pytest.fixture
def gfmd(tmp_path, monkeypatch, pytestconfig):
    """Runs a command in an empty folder that has the scan."""
    scan = (pytestconfig.rootpath / SCAN).read_bytes()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scan.di").write_bytes(scan)

    def call(*words, status=0):
        done = CliRunner().invoke(main, [str(word) for word in words])
        assert done.exit_code == status, done.output
        return done.output

    return call


def holed(path, shape=(20, 16)):
    heights = np.random.default_rng(0).normal(size=shape)
    heights[3, 3:5] = np.nan
    np.save(path, heights)


@pytest.mark.parametrize("words", [(), ("--from", "scan.di"), ("--from", "holed.npy")])
def test_what_init_writes_runs(gfmd, tmp_path, words):
    if "scan.di" in words:
        pytest.importorskip("SurfaceTopography")
    holed(tmp_path / "holed.npy")
    told = gfmd("init", "first.toml", *words)
    assert told.endswith("next: gfmd run first.toml\n")
    short = () if words else ("--set", "load.p_star=0.1", "--set", "grid.points=128")
    assert "converged" in gfmd("run", "first.toml", *short)
    assert all(row["status"] == "converged" for row in read_rows(tmp_path / "first.h5"))


def test_a_scan_with_holes_is_said_to_be_filled_and_cropped(gfmd, tmp_path):
    holed(tmp_path / "holed.npy")
    gfmd("init", "first.toml", "--from", "holed.npy")
    (surface,) = read_spec(tmp_path / "first.toml")[0].surface
    assert surface.crop
    assert surface.missing == "fill"
    assert "20 x 16 points, cropped to 16 x 16, 2 missing heights filled in" in (
        surface.preparation()
    )


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


def test_init_replaces_nothing(gfmd, tmp_path):
    (tmp_path / "study.toml").write_text("mine")
    assert "exists already" in gfmd("init", status=2)
    assert (tmp_path / "study.toml").read_text() == "mine"


def test_a_scan_that_will_not_do_is_refused_as_it_is(gfmd, tmp_path):
    np.save(tmp_path / "h.npy", np.full((16, 16), np.nan))
    assert "at most 20% can be filled in" in gfmd("init", "a.toml", "--from", "h.npy", status=2)
    assert not (tmp_path / "a.toml").exists()


def test_the_fit_that_surface_prints_can_be_run(gfmd, tmp_path):
    """A random surface from it has the rms height and gradient of the scan."""
    pytest.importorskip("SurfaceTopography")
    told = gfmd("surface", "scan.di")
    table = told[told.index("  [surface]") :].replace("\n  ", "\n").strip()
    (tmp_path / "fit.toml").write_text(
        f'{table}\n[elastomer]\nkind = "half-space"\n[grid]\npoints = 512\n[load]\np_star = 1\n'
    )
    seen, found = (
        np.array(re.search(r"rms height (\S+) m, rms gradient (\S+),", text).groups(), float)
        for text in (told, gfmd("surface", "fit.toml"))
    )
    np.testing.assert_allclose(found, seen, rtol=0.02)


def test_surface_refuses_a_line(gfmd, tmp_path):
    (tmp_path / "wave.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\np_star = 1\n"
    )
    assert "is a line" in gfmd("surface", "wave.toml", status=2)


def test_a_scan_in_nanometres_that_does_not_repeat_is_remarked_on_and_mended(gfmd, tmp_path):
    """Tilted by 300 nm, 2 nm rough, 1 um wide."""
    rough = np.random.default_rng(0).normal(size=(32, 32)) * 2
    np.save(tmp_path / "nm.npy", rough + np.linspace(0, 300, 32))
    told = gfmd("surface", "nm.npy")
    for remark in ("names no side", "are heights and side in metres", "step across the border"):
        assert remark in told
    mended = [f"surface.{key}" for key in ("scale=1e-9", "length=1e-6", "periodic=false")]
    words = [word for key in mended for word in ("--set", key)]
    told = gfmd("surface", "nm.npy", *words)
    assert "note:" not in told
    assert "L = 1e-06 m" in told
    gfmd("init", "first.toml", "--from", "nm.npy", *words)
    (surface,) = read_spec(tmp_path / "first.toml")[0].surface
    assert (surface.scale, surface.length, surface.periodic) == (1e-9, 1e-6, False)
    assert "NOTE" not in (tmp_path / "first.toml").read_text()


@pytest.mark.parametrize(
    ("pair", "told"),
    [
        ("surface.scael=1", "unknown key 'scael' - did you mean 'scale'"),
        ("surface.scale=[1,2]", "with one value"),
        ("grid.points=64", "takes surface.key=value"),
    ],
)
def test_a_wrong_word_on_a_scan_is_refused(gfmd, tmp_path, pair, told):
    np.save(tmp_path / "h.npy", np.random.default_rng(0).normal(size=(16, 16)))
    assert told in gfmd("surface", "h.npy", "--set", pair, status=2)


def test_an_exponent_that_is_no_roughness_is_said_to_be_changed(gfmd, tmp_path):
    y, x = np.mgrid[:64, :64] * (2 * np.pi / 64)
    height = sum(np.cos(m * x) * np.cos(m * y) * m**-4.0 for m in range(1, 20))
    height += 1e-9 * np.random.default_rng(0).normal(size=height.shape)
    np.save(tmp_path / "h.npy", height)
    assert "is no roughness" in gfmd("surface", "h.npy")
