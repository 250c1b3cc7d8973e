import importlib.util
import json
import re
import shutil
import sys
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.report import maps, surface
from gfmd_cli.analysis.report.markup import Group, Html, join, table, tag
from gfmd_cli.analysis.report.page import report
from gfmd_cli.analysis.report.theme import DARK, LEGIBLE, LIGHT, PALETTE, contrast, toned
from gfmd_cli.analysis.report.units import SPACE, count, quantity, span
from gfmd_cli.cli import main
from gfmd_cli.physics.persson import Shells
from gfmd_cli.study.labelled import dataset
from gfmd_cli.study.layout import Column
from gfmd_cli.study.reading import ATTRIBUTES_SUM, attributes_sum, read_rows

SPEC = """\
[study]
name = "small"
[surface]
kind = "self-affine"
cutoff = 0.1
seed = [0, 1]
[elastomer]
kind = "power"
n = [0, 1]
[grid]
points = 64
[load]
p_star = [0.1, 1.0]
[output]
fields = ["u", "sigma", "height"]
cross_section = true
"""
BENCH = """\
[surface]
kind = "self-affine"
cutoff = 0.1
[elastomer]
kind = "power"
n = 1
[grid]
points = 64
[load]
p_star = 0.1
[solver]
kind = ["auto", "ccg"]
[output]
histogram = false
"""
LINE = """\
[surface]
kind = "wave"
amplitude = 0.1
[elastomer]
kind = "power"
n = 1
[grid]
points = 64
[load]
p_star = 0.3
[output]
fields = ["u", "sigma", "height"]
histogram = false
"""
HOSTILE = "</pre></style><script>alert(1)</script>\x00 & \"'"


def gfmd(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def solved(folder, text, *words):
    """A study of a spec, solved in a folder."""
    (folder / "spec.toml").write_text(text)
    path = folder / "study.h5"
    done = gfmd("run", folder / "spec.toml", "-o", path, "-q", *words)
    assert done.exit_code in (0, 1), done.output
    return path


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return solved(tmp_path_factory.mktemp("study"), SPEC)


@pytest.fixture(scope="module")
def whole(study):
    """The page of a study that has all there is, with a bench."""
    folder = study.parent
    (folder / "bench.toml").write_text(BENCH)
    done = gfmd("bench", folder / "bench.toml", "-o", folder / "bench.h5", "-q")
    assert done.exit_code == 0, done.output
    return report(study, folder / "bench.h5")


@pytest.fixture
def copied(study, tmp_path):
    """A copy of the study that may be spoiled."""
    return Path(shutil.copy(study, tmp_path / "copy.h5"))


VOID = ("meta",)


class Page(HTMLParser):
    """What a browser would make of a page: open elements, attributes, words."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.words = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, name, attributes):
        self.elements.append((name, dict(attributes)))
        if name not in VOID:
            self.open.append(name)

    def handle_endtag(self, name):
        assert self.open.pop() == name

    def handle_startendtag(self, name, attributes):
        self.elements.append((name, dict(attributes)))

    def handle_data(self, data):
        self.words.append(data)

    def all(self, name):
        return [attributes for element, attributes in self.elements if element == name]


def test_the_page_is_well_formed_and_names_its_parts(whole):
    page = Page(whole)
    ElementTree.fromstring(re.sub("<!DOCTYPE html>|<meta [^>]*>", "", whole))
    assert page.all("html") == [{"lang": "en"}]
    for name in ("title", "h1", "main", "nav", "header", "footer"):
        assert len(page.all(name)) == 1
    headings = [int(name[1]) for name, _ in page.elements if re.fullmatch("h[1-6]", name)]
    assert all(after <= before + 1 for before, after in pairwise(headings))
    for head in page.all("th"):
        assert head["scope"] in ("col", "row", "rowgroup")
    for drawing in page.all("svg"):
        assert drawing["role"] == "img"
        assert drawing["aria-label"]
    assert len(page.all("figcaption")) == len(page.all("figure")) == len(page.all("svg"))
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    targets = {a["href"][1:] for name in ("a", "use") for a in page.all(name)}
    assert targets <= set(ids)


def test_every_figure_and_table_is_there(whole):
    page = Page(whole)
    sections = [attributes["id"] for attributes in page.all("section")]
    assert sections == [
        "contact-area", "mean-gap", "stress-deviation", "stress-distribution", "error-bars",
        "maps-and-cross-sections", "surface-spectrum", "speed-against-error", "origin",
    ]  # fmt: skip
    assert len(page.all("figure")) == 5 + 2 + 3 * 6 + 1 + 1  # 6: three curves, two pressures
    assert len(page.all("details")) == 3 + 2 + 1 + 1 + 1 + 1 + 1
    text = " ".join(page.words)
    assert "All 8 contacts converged." in text
    assert "8 contacts: 2 elastic bodies (power n=0 and power n=1) on the surface" in text
    assert 'kind = "self-affine"' in text
    for told in ("numpy", "Git commit", "Python"):
        assert told in text


FURTHER = """\
[surface]
kind = "self-affine"
cutoff = 0.1
length = 2e-3
h_std = 1e-6
[elastomer]
kind = "half-space"
E_star = 1e9
[grid]
points = 32
[load]
p_star = [0.1, 1]
[output]
patches = true
stiffness = true
percolation = true
"""


def test_what_was_asked_for_beside_the_scalars_is_a_table_in_si_units(tmp_path):
    (tmp_path / "spec.toml").write_text(FURTHER)
    study = tmp_path / "s.h5"
    gfmd("run", tmp_path / "spec.toml", "-o", study, "-q")
    first = read_rows(study)[0]
    page = report(study)
    assert "Patches, stiffness, leakage" in Page(page).words
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page.partition("Patches, stiffness")[2])
    assert str(first["patches"]) in cells
    assert f"{first['patch_area_mean'] * 4e-6:.4g}" in cells
    assert f"{first['stiffness'] * first['delta_sigma'] / 1e-6:.4g}" in cells
    assert "yes" in cells


def test_a_fit_stands_beside_the_spectrum(whole):
    """H = 0.8 and lambda_r = L / 2 are the defaults of the surface."""
    told = whole.partition("Self-affine fit")[2]
    assert re.search(r"<td[^>]*>0\.[78]\d*( ± \S+)?</td>", told)


def test_results_stand_in_reduced_and_in_physical_units(whole, study):
    with h5py.File(study) as file:
        gap, reduced = file["mean_gap"][0], file["u_g"][0]
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", whole)
    assert f"{gap:.4g}" in cells
    assert f"{reduced:.4g}" in cells


def test_nothing_is_fetched_and_no_script_is_there(whole):
    page = Page(whole)
    outside = re.sub(r"<pre.*?</pre>", "", whole, flags=re.DOTALL)
    assert "http" not in outside.replace("http-equiv", "")
    assert "url(" not in re.sub(r"url\(#", "", outside)
    assert not page.all("script")
    assert not page.all("link")
    for image in page.all("image"):
        assert image["href"].startswith("data:image/png;base64,")
    assert page.all("meta")[2]["content"].startswith("default-src 'none'")


def test_the_same_study_gives_the_same_bytes(study, whole):
    assert report(study, study.parent / "bench.h5") == whole


def test_hostile_texts_are_text(copied):
    with h5py.File(copied, "r+") as file:
        machine = json.dumps({"node": HOSTILE, "cores": [HOSTILE], HOSTILE: 1})
        for name in ("title", "spec_text", "git_commit", "date"):
            file.attrs[name] = HOSTILE.replace("\0", "")
        file.attrs.update({"machine": machine, "packages": machine, "spec": "no JSON"})
        file.attrs[ATTRIBUTES_SUM] = attributes_sum(file)
        for name in ("elastomer", "surface", "status", "solver"):
            size = file[name].size
            del file[name]
            dataset(file, Column(name, str, "", ""), [f"$x$ {name} {HOSTILE}"] * size, [])
    text = report(copied)
    page = Page(text)
    assert not page.all("script")
    assert page.words.count("alert(1)") == 0
    assert HOSTILE.replace("\0", "\ufffd") in "".join(page.words)
    assert len(page.all("style")) == 1
    assert "\0" not in text


def test_text_is_escaped_unless_it_is_markup():
    assert join("<", Html("<b>"), None, 1) == "&lt;<b>1"
    assert tag("a", "&", href='"><script>') == '<a href="&quot;&gt;&lt;script&gt;">&amp;</a>'
    assert join("a\x00\x1b\r\n\udc80b") == "a\ufffd\ufffd\n?b"
    told = table("<", ["<", "", ""], [Group("<", [["<", 1.0, "0.1 ± 0.2"]])])
    assert "<<" not in told
    assert "<td>0.1 ± 0.2</td>" in told


def test_what_failed_or_is_missing_is_told(tmp_path):
    text = SPEC.replace("seed = [0, 1]", "").replace("p_star = [0.1, 1.0]", "p_star = [0.1, 0.3]")
    text = text.replace('fields = ["u", "sigma", "height"]\ncross_section = true', "")
    study = solved(tmp_path, text + "[solver]\nmax_steps = 1\n", "--shard", "0/2")
    words = "".join(Page(report(study)).words)
    assert "1 of 4 contacts did not reach their tolerance; 2 of 4 are not solved yet." in words
    assert "max_steps" in words
    assert "What failed or is missing" in words
    assert "cross_section = true" in words  # how to get it


def test_a_line_scene_shows_its_fields_as_a_cross_section(tmp_path):
    page = Page(report(solved(tmp_path, LINE)))
    labels = [drawing["aria-label"] for drawing in page.all("svg")]
    assert any(label.startswith("Cross-section along the cell") for label in labels)
    assert not any(label.startswith("Contact,") for label in labels)


def test_the_command_writes_beside_the_study_and_says_so(copied):
    done = gfmd("report", copied)
    assert done.exit_code == 0
    assert done.output.strip() == str(copied.with_suffix(".html"))
    assert copied.with_suffix(".html").read_text("utf-8").startswith("<!DOCTYPE html>")


def test_bad_calls_end_in_one_message(copied, tmp_path):
    (tmp_path / "text.h5").write_text("text")
    (tmp_path / "taken").write_text("a file")
    for words, status in (
        (["missing.h5"], 2),
        ([tmp_path / "text.h5"], 74),
        ([copied, "--bench", tmp_path / "missing.h5"], 2),
        ([copied, "--bench", copied], 74),
        ([copied, "-o", copied], 2),
        ([copied, "-o", tmp_path / "taken" / "page.html"], 73),
    ):
        done = gfmd("report", *words)
        assert done.exit_code == status, words
        assert len(done.output.splitlines()) == 1
    assert h5py.is_hdf5(copied)


def test_missing_matplotlib_is_told(copied, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in [name for name in sys.modules if name.startswith("gfmd_cli.analysis")]:
        monkeypatch.delitem(sys.modules, name)
    done = gfmd("report", copied)
    assert done.exit_code == 2
    assert "pip install gfmd-cli[plot]" in done.output
    assert not copied.with_suffix(".html").exists()


def test_a_map_keeps_the_area_and_the_mean_stress(study):
    with h5py.File(study) as file:
        fields = {name: file["fields/4"][name] for name in ("sigma", "u", "height")}
        area, pressure = file["a_r"][4], file["pressure"][4]
        touching, stress = maps._thumbnails(fields)
        assert touching.mean() == pytest.approx(area, rel=1e-12)
        assert stress.mean() == pytest.approx(pressure, rel=1e-6)


def test_a_peak_of_stress_leaves_the_rest_of_the_contact_visible(study):
    row = read_rows(study)[0]
    stress = np.where(np.arange(64 * 64).reshape(64, 64) % 3, np.linspace(0.01, 1, 64), 0.0)
    stress[5, 5] = 1e3
    sheet = maps._stress_sheet(stress, stress > 0, row)
    (image,) = sheet.axes.images
    assert image.norm.vmax == pytest.approx(1.0, rel=0.02)
    drawn = image.to_rgba(image.get_array(), bytes=True)[..., :3]
    colours = {kind: {f"#{bytes(pixel).hex()}" for pixel in drawn[chosen]}
               for kind, chosen in (("none", stress == 0), ("contact", stress > 0))}  # fmt: skip
    assert colours["none"] == {"#000000"}
    assert all(contrast(colour, "#000000") >= LEGIBLE for colour in colours["contact"])
    assert maps.BEYOND in colours["contact"]
    assert toned(maps.BEYOND, LIGHT) == toned(maps.BEYOND, DARK) == maps.BEYOND


@pytest.mark.parametrize("step", [1, 2, 3])
def test_pixels_are_means_over_squares(step):
    block = np.arange(35.0).reshape(5, 7)
    means = maps._means(block, step)
    assert means.shape == (-(-5 // step), -(-7 // step))
    assert means[0, 0] == block[:step, :step].mean()
    assert means[-1, -1] == block[(5 - 1) // step * step :, (7 - 1) // step * step :].mean()


@pytest.mark.parametrize(("dimension", "kind"), [(1, "wave"), (2, "self-affine")])
def test_a_flat_spectrum_is_found_flat(dimension, kind):
    """Every mode of the lattice has C(q) = 3: the density is 3 L^d in every band."""
    points, length = 32, 2.0
    lattice = np.fft.fftfreq(points, 1 / points)
    squares = sum(np.meshgrid(*[lattice**2] * dimension)) if dimension == 2 else lattice**2
    radius, modes = np.unique(squares[squares > 0], return_counts=True)
    q = 2 * np.pi / length * np.sqrt(radius)
    blank = np.ones_like(q)
    shells = Shells(q, 3.0 * modes, blank, blank, blank, 1.0 * modes)
    row = {"surface": kind, "length": length, "points": points}
    found = surface.spectrum(row, shells)
    assert found.q.size > 6
    kept = found.q < 2 * np.pi / length * (points / 2 - 1)
    assert found.density[kept] == pytest.approx(3 * length**dimension, rel=1e-12)


def test_colours_are_legible_on_both_papers():
    for name in ("ink", "muted", "link", "good", "bad"):
        for paper in ("paper", "panel"):
            for one, other in zip(PALETTE[name], PALETTE[paper], strict=True):
                assert contrast(one, other) >= 4.5
    for colour in ("#332288", "#999933", "#ee7733", "#666666"):
        for paper in (LIGHT, DARK):
            assert contrast(toned(colour, paper), paper) >= LEGIBLE
    assert contrast("#000000", "#ffffff") == pytest.approx(21)


def test_values_are_told_with_units():
    assert quantity(1.234e-9, "m") == f"1.23{SPACE}nm"
    assert span([1e5, 1e8], "Pa") == f"100{SPACE}kPa to 100{SPACE}MPa"
    assert span([7e6, 1.2e8, np.nan], "Pa") == f"7 to 120{SPACE}MPa"
    assert span([2e-6]) == f"2{SPACE}×{SPACE}10⁻⁶"
    assert span([]) == "unknown"
    assert [count(n, "body") for n in (1, 2)] == ["1 body", "2 bodies"]


def test_the_style_sheet_is_installed_with_the_package():
    folder = Path(importlib.util.find_spec("gfmd_cli.analysis.report").origin).parent
    assert (folder / "style.css").is_file()


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_fields_without_a_finite_stress_are_drawn(copied, value):
    with h5py.File(copied, "r+") as file:
        for place in ("fields/0", "cross_sections/0"):
            file[place]["sigma"][...] = value
    assert "Stress; black: none" in report(copied)


def test_key_numbers_and_tables_are_of_the_continuum_where_that_is_known(tmp_path):
    text = SPEC.replace("[0, 1]\n[grid]", "1\n[grid]").replace("seed = [0, 1]", "")
    path = solved(tmp_path, text + "[accuracy]\ncontact_area = 0.2\n")
    rows = read_rows(path)
    page = Page(report(path))
    words = page.words
    start = words.index("Contact area", words.index("Pressure"))
    assert words[start + 1] == span(row["a_r_continuum"] for row in rows)
    assert words[start + 1] != span(row["a_r"] for row in rows)
    told = " ".join("".join(words).split())
    assert "share of the nominal area, in the continuum" in told
    (curve,) = compare(path).curves
    ratios = span(curve.column("a_r_continuum") / curve.prediction.a_r)
    assert words[words.index("Area / Persson theory") + 1] == ratios


def test_values_on_the_grid_are_not_said_to_be_of_the_continuum(whole):
    assert "in the continuum" not in whole.partition("</dl>")[0]


def test_two_grids_of_one_contact_add_the_continuum(tmp_path):
    text = SPEC.replace("[0, 1]\n[grid]\npoints = 64", "1\n[grid]\npoints = [64, 128]")
    text = text.replace("seed = [0, 1]", "").replace("[0.1, 1.0]", "0.3")
    page = Page(report(solved(tmp_path, text)))
    labels = [drawing["aria-label"] for drawing in page.all("svg")]
    assert "Distribution of the stress in the continuum, with error bars and edge laws" in labels
