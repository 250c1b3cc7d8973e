import importlib.util
import json
import re
import shutil
import sys
from base64 import b64encode
from hashlib import sha256
from html.parser import HTMLParser
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from markupsafe import Markup
from specs import power_spec

from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.diff import diff
from gfmd_cli.analysis.table import Group, Table, TableColumn
from gfmd_cli.analysis.wording import SPACE, span, with_unit
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.surface_spectrum import spectrum
from gfmd_cli.report import maps, rendering
from gfmd_cli.report.data import read_report_data
from gfmd_cli.report.maps import STRESS_SCALE, profile_figure, read_profile
from gfmd_cli.report.page import report
from gfmd_cli.report.rendering import environment, typeset
from gfmd_cli.report.sections import stress_distribution
from gfmd_cli.report.summary import headline, key_numbers, warnings
from gfmd_cli.report.surface import surface_spectrum
from gfmd_cli.report.theme import DARK, LEGIBLE, LIGHT, PALETTE, contrast, toned
from gfmd_cli.study.column import Column
from gfmd_cli.study.reading import ATTRIBUTES_SUM, attributes_sum, open_study, read_rows
from gfmd_cli.study.writing import write_column

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
ONE = (
    SPEC.replace("seed = [0, 1]\n", "").replace("n = [0, 1]", "n = 1").replace("[0.1, 1.0]", "0.3")
)
BENCH = power_spec(
    n=1,
    points=64,
    p_star=0.1,
    more="""\
[solver]
kind = ["auto", "ccg"]
[output]
histogram = false
""",
)
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


def solved(invoke, folder, text, *words):
    """A study of a spec, solved in a folder."""
    (folder / "spec.toml").write_text(text)
    path = folder / "study.h5"
    done = invoke("run", folder / "spec.toml", "-o", path, "-q", *words)
    assert done.exit_code in (0, 1), done.output
    return path


@pytest.fixture(scope="module")
def study(invoke, tmp_path_factory):
    return solved(invoke, tmp_path_factory.mktemp("study"), SPEC)


@pytest.fixture(scope="module")
def whole(invoke, study):
    """The page of a study that has all there is, with a bench."""
    folder = study.parent
    (folder / "bench.toml").write_text(BENCH)
    done = invoke("bench", folder / "bench.toml", "-o", folder / "bench.h5", "-q")
    assert done.exit_code == 0, done.output
    return report(study, folder / "bench.h5")


@pytest.fixture(scope="module")
def one(invoke, tmp_path_factory):
    """A study of one contact: its page is drawn in a fifth of the time."""
    return solved(invoke, tmp_path_factory.mktemp("one"), ONE)


@pytest.fixture
def copied(one, tmp_path):
    """A copy of the study of one contact that may be spoiled."""
    return Path(shutil.copy(one, tmp_path / "copy.h5"))


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
    text = re.sub("<script>.*?</script>", "", whole, flags=re.DOTALL)
    ElementTree.fromstring(re.sub("<!DOCTYPE html>|<meta [^>]*>", "", text))
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
    links = [a["href"] for name in ("a", "use") for a in page.all(name) if "download" not in a]
    assert {link.removeprefix("#") for link in links} <= set(ids)


def test_every_figure_and_table_is_there(whole):
    page = Page(whole)
    sections = [attributes["id"] for attributes in page.all("section")]
    assert sections == [
        "contact-area", "mean-gap", "stress-deviation", "stress-distribution", "error-bars",
        "maps-and-cross-sections", "surface-spectrum", "speed-against-error", "provenance",
    ]  # fmt: skip
    assert len(page.all("figure")) == 5 + 2 + 4 * 6 + 1 + 1  # 6: three curves, two pressures
    assert len(page.all("details")) == 3 + 2 + 1 + 1 + 1 + 1 + 1
    text = " ".join(page.words)
    assert "All 8 contacts converged." in text
    assert "8 contacts: 2 elastomers (power n=0 and power n=1), surface" in text
    assert 'kind = "self-affine"' in text
    for words in ("numpy", "Git commit", "Python"):
        assert words in text


OBSERVABLES = """\
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


def test_optional_observables_are_a_table_in_si_units(output_of, tmp_path):
    (tmp_path / "spec.toml").write_text(OBSERVABLES)
    study = tmp_path / "s.h5"
    output_of("run", tmp_path / "spec.toml", "-o", study, "-q")
    first = read_rows(study)[0]
    page = report(study)
    assert "Optional observables" in Page(page).words
    table = page.partition("Observables:")[2]
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", table)
    assert str(first["patches"]) in cells
    assert f"{first['patch_area_mean'] * 4e-6:#.4g}" in cells
    assert f"{first['stiffness'] * first['delta_sigma'] / 1e-6:#.4g}" in cells
    assert "yes" in cells
    headings = re.sub("<[^>]+>", "", table)
    assert "mean patch\n/ L²" in headings
    assert "mean patch\n[m²]" in headings


def test_a_fit_stands_beside_the_spectrum(whole):
    """H = 0.8 and lambda_r = L / 2 are the defaults of the surface."""
    fit = whole.partition("Self-affine fit")[2].partition("</table>")[0]
    assert re.search(r"<td[^>]*>0\.[78]\d*( ± \S+)?</td>", fit)


def test_the_whole_table_is_in_the_page(invoke, whole, study):
    (link,) = (a for a in Page(whole).all("a") if "download" in a)
    text = unquote(link["href"].removeprefix("data:text/csv;charset=utf-8,"))
    assert text == invoke("export", study).output


def test_a_study_in_reduced_units_shows_no_pascal_and_no_metre(whole, study):
    with h5py.File(study) as file:
        gap, reduced = file["mean_gap"][0], file["u_g"][0]
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", whole.partition('id="mean-gap"')[2])
    assert f"{reduced:#.4g}" in cells
    assert f"{gap:#.4g}" not in cells
    results = re.sub("<[^>]+>", "", whole.partition('id="surface-spectrum"')[0])
    assert not re.search(r"\d.?[kMGm]?Pa\b|\[Pa\]|\[m\]", results)


def test_a_study_in_pascal_has_both_units(invoke, tmp_path):
    text = ONE.replace("p_star = 0.3", "pressure = 5e8").replace(
        'kind = "power"\nn = 1', 'kind = "half-space"\nE_star = 2e9'
    )
    path = solved(invoke, tmp_path, text.replace("cutoff = 0.1", "cutoff = 0.1\nh_std = 0.01"))
    (row,) = read_rows(path)
    page = report(path)
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", page.partition('id="mean-gap"')[2])
    assert {f"{row['mean_gap']:#.4g}", f"{row['u_g']:#.4g}"} <= set(cells)
    assert "500\xa0MPa" in Page(page).words


def test_heights_in_metres_without_a_modulus_show_metres_and_no_pascal(invoke, tmp_path):
    """At given p* the gap follows from the heights alone, but no stress in Pa does."""
    text = ONE.replace('kind = "power"\nn = 1', 'kind = "half-space"')
    path = solved(invoke, tmp_path, text.replace("cutoff = 0.1", "cutoff = 0.1\nh_std = 1e-6"))
    results = re.sub("<[^>]+>", "", report(path).partition('id="surface-spectrum"')[0])
    printed = invoke("analyze", path).output
    assert "h_std = 1e-06 m" in printed
    assert re.search(r"\d.?[µn]m\b", results)
    for shown in (results, printed):
        assert not re.search(r"\d.?[kMGmµn]?Pa\b|\[Pa\]", shown)


def test_si_units_are_those_of_contacts_in_which_they_mean_something(invoke, tmp_path):
    """A half-space in Pa beside an elastomer whose stiffness is not given."""
    elastomers = """\
[[elastomer]]
kind = "half-space"
E_star = 2e9
[[elastomer]]
kind = "power"
n = 2
"""
    text = ONE.replace("cutoff = 0.1", "cutoff = 0.1\nh_std = 1e-6\nlength = 1e-4")
    text = text.replace('[elastomer]\nkind = "power"\nn = 1\n', elastomers)
    path = solved(invoke, tmp_path, text)
    solid, reduced = read_rows(path)
    data = read_report_data(path, "")
    numbers = {name: (value, note) for name, value, note in key_numbers(data)}
    assert numbers["Pressure"] == (
        with_unit(solid["pressure"], "Pa"), "p* = 0.3; in Pa: 1 of 2 contacts"
    )  # fmt: skip
    assert numbers["Unit of stress"][0] == with_unit(solid["delta_sigma"], "Pa")
    assert numbers["Stress deviation"][0] == with_unit(
        solid["sigma_p"] * solid["delta_sigma"], "Pa"
    )
    assert "contacts" not in numbers["Mean gap"][1]  # all are in m
    assert with_unit(reduced["pressure"], "Pa") not in headline(data)
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", report(path))
    for printed in (cells, invoke("analyze", path).output.split()):
        assert f"{solid['pressure']:.4g}" in printed
        assert f"{reduced['pressure']:.4g}" not in printed


def test_a_density_of_several_seeds_is_called_their_mean(whole):
    groups = re.findall(r"<span>(.*): mean of 2 seeds", whole[whole.index("Middle of each bin") :])
    assert any(group.endswith("</var>* = 0.1") for group in groups)
    assert not any("seed=" in group for group in groups)


def test_two_studies_are_compared_on_one_page(invoke, one, tmp_path):
    options = ("--set", "surface.hurst=0.5", "--set", "output.fields=[]")
    other = solved(invoke, tmp_path, ONE, *options)
    other = other.rename(tmp_path / "other.h5")
    done = invoke("report", one, other, "-o", tmp_path / "both.html")
    assert done.exit_code == 0, done.output
    page = Page((tmp_path / "both.html").read_text("utf-8"))
    sections = [attributes["id"] for attributes in page.all("section")]
    assert sections[:2] == ["difference", "contact-area"]
    assert {"provenance-of-a", "provenance-of-b"} <= set(sections)
    words = [" ".join(word.split()) for word in page.words]
    assert "study.h5 and other.h5" in words
    for pair in diff(one, other).pairs:
        assert f"{pair.deviation('u_g').relative:+.2e}" in words
    assert "surface.hurst: 0.8 -> 0.5" in " ".join(words)
    labels = [drawing["aria-label"] for drawing in page.all("svg")]
    area = next(label for label in labels if label.startswith("Relative contact area over"))
    assert "A hurst=0.8" in area
    assert "B hurst=0.5" in area
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_warnings_stand_before_the_green_tick(copied):
    with h5py.File(copied, "r+") as file:
        for name, value in (("warnings", "few points"), ("a_r_verdict", "unknown")):
            del file[name]
            write_column(file, Column(name, "", "", str), [value], [])
    text = report(copied)
    words = [" ".join(word.split()) for word in Page(text).words]
    tick = words.index("✓")
    for line in ("few points (1 of 1 contact)", "has no error bar"):
        assert any(line in word for word in words[:tick]), line
    assert words[tick + 1] == "The contact converged."


def test_nothing_is_fetched_and_only_our_scripts_run(whole):
    page = Page(whole)
    outside = re.sub(r"<pre.*?</pre>|<script>.*?</script>", "", whole, flags=re.DOTALL)
    assert "http" not in outside.replace("http-equiv", "")
    assert "url(" not in re.sub(r"url\(#", "", outside)
    assert not page.all("link")
    for image in page.all("image"):
        assert image["href"].startswith("data:image/png;base64,")
    rules = dict(rule.split(" ", 1) for rule in page.all("meta")[2]["content"].split("; "))
    assert rules["default-src"] == "'none'"
    assert set(rules) == {"default-src", "script-src", "style-src", "img-src"}
    texts = re.findall(r"<script>(.*?)</script>", whole, flags=re.DOTALL)
    hashes = [b64encode(sha256(text.encode()).digest()).decode() for text in texts]
    assert rules["script-src"].split() == [f"'sha256-{digest}'" for digest in hashes]
    assert len(texts) == len(rendering.SCRIPTS)


def test_the_library_is_the_one_that_was_released():
    folder = files("gfmd_cli.report") / "assets"
    library = (folder / "plotly-basic.min.js").read_bytes()
    assert sha256(library).hexdigest() in (folder / "README.md").read_text("utf-8")
    assert b"v4.1.1" in library[:200]


def test_a_page_without_maps_is_below_five_megabytes(whole):
    without = re.sub('<section id="maps.*?</section>', "", whole, flags=re.DOTALL)
    assert len(without) < min(len(whole), 5_000_000)


def test_the_same_study_gives_the_same_bytes(study, whole):
    assert report(study, study.parent / "bench.h5") == whole


def test_hostile_texts_are_text(copied):
    with h5py.File(copied, "r+") as file:
        machine = json.dumps({"node": HOSTILE, "cores": [HOSTILE], HOSTILE: 1})
        for name in ("title", "spec_text", "git_commit", "date"):
            file.attrs[name] = HOSTILE.replace("\0", "")
        file.attrs.update({"machine": machine, "packages": machine, "spec": "no JSON"})
        file.attrs[ATTRIBUTES_SUM] = attributes_sum(file)
        for name in ("elastomer", "surface", "solver"):
            size = file[name].size
            del file[name]
            write_column(file, Column(name, "", "", str), [f"$x$ {name} {HOSTILE}"] * size, [])
    text = report(copied)
    page = Page(text)
    kinds = [script.get("type") for script in page.all("script")]
    assert kinds.count(None) == len(rendering.SCRIPTS)
    assert set(kinds) == {None, "application/json"}
    assert page.words.count("alert(1)") == 0
    assert HOSTILE.replace("\0", "\ufffd") in "".join(page.words)
    assert len(page.all("style")) == 1
    assert "\0" not in text


def test_text_is_escaped_unless_it_is_markup():
    page = environment().from_string('<a href="{{ text }}">{{ text }}{{ markup }}</a>')
    filled = page.render(text='"><&', markup=Markup("<b>"))
    assert filled == '<a href="&#34;&gt;&lt;&amp;">&#34;&gt;&lt;&amp;<b></a>'
    assert environment().from_string("{{ text }}").render(text="a\x00\x1b\r\n\udc80b") == (
        "a\ufffd\ufffd\n?b"
    )


def test_a_table_is_rendered_with_escaped_texts_and_scopes():
    columns = (TableColumn("<", "text"), TableColumn("a_r", "value", error="error"))
    content = Table("<", columns, [Group("<", [{"text": "<", "value": 0.1, "error": 0.2}])])
    macros = environment().get_template("macros.html")
    table = macros.module.table(content)
    assert "<<" not in table
    assert '<th scope="row" class="t">&lt;</th>' in table
    assert '<th scope="col"><var>a</var><sub>r</sub></th>' in table
    assert "<td>0.10 ± 0.20</td>" in table


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a_r up to p*", "<var>a</var><sub>r</sub> up to <var>p</var>*"),
        ("sigma_p / Delta_sigma", "<var>σ</var><sub>p</sub> / Δ<var>σ</var>"),
        ("sigma [m^2] +- 1", "<var>σ</var> [m²] ± 1"),
        ("up to per cent, sigma_x", "up to per cent, sigma_x"),
        ("<p*>", "&lt;<var>p</var>*&gt;"),
        ("set surface.h_std, h_std=1 µm", "set surface.h_std, h_std=1 µm"),
        ("path=a_r.npy, scans/L.npy", "path=a_r.npy, scans/L.npy"),
    ],
)
def test_symbols_are_typeset(text, expected):
    assert typeset(text) == expected


def test_the_unit_of_stress_of_a_slab_is_not_its_stress_in_full_contact(invoke, tmp_path):
    slabs = 'kind = "slab"\nE_star = 2e9\nthickness = [0.01, 0.1]'
    text = ONE.replace('kind = "power"\nn = 1', slabs)
    text = text.replace("cutoff = 0.1", "cutoff = 0.1\nh_std = 1e-6\nlength = 1e-3")
    words = "".join(Page(report(solved(invoke, tmp_path, text))).words)
    assert "rms stress in full contact; of a slab that of the half-space" in words


def test_what_failed_or_is_missing_is_told(invoke, tmp_path):
    text = SPEC.replace("seed = [0, 1]", "").replace("p_star = [0.1, 1.0]", "p_star = [0.1, 0.3]")
    text = text.replace('fields = ["u", "sigma", "height"]\ncross_section = true', "")
    study = solved(invoke, tmp_path, text + "[solver]\nmax_steps = 1\n", "--shard", "0/2")
    words = "".join(Page(report(study)).words)
    assert "1 of 4 contacts: tolerance not reached; 2 of 4 are" in words
    assert "max_steps" in words
    assert "Not converged or missing" in words
    assert "cross_section = true" in words  # how to get it


def test_the_cross_section_passes_through_the_row_with_most_load(study):
    row = read_rows(study)[0]
    with open_study(study) as file:
        fields = file.arrays("fields", row["task"])
        profile = read_profile(file, row)
    loads = np.maximum(fields["sigma"], 0.0).sum(axis=1)
    y = int(np.flatnonzero((fields["sigma"] == profile.values["sigma"]).all(axis=1))[0])
    assert loads[y] == loads.max()
    assert np.array_equal(profile.values["height"], fields["height"][y])
    assert f"y = {y / loads.size:.2f}" in profile.place
    assert profile.position[1] == pytest.approx(row["length"] / loads.size)


@pytest.mark.parametrize("is_turned", [False, True])
def test_at_a_free_border_the_cross_section_avoids_rows_near_it(invoke, tmp_path, is_turned):
    """A summit at the border carries most load; at the lower load it alone touches."""
    y, x = np.mgrid[:32, :32] / 32
    at_border, inside = (np.hypot(x - 0.5, y - summit) for summit in (0.0, 0.6))
    heights = np.maximum(0.6 - 8 * at_border, 0.3 - inside)
    heights = 1e-6 * np.maximum(heights, 0.0)
    np.save(tmp_path / "scan.npy", heights[::-1] if is_turned else heights)
    text = ONE.replace('"self-affine"\ncutoff = 0.1', '"file"\npath = "scan.npy"\nlevel = "none"')
    text = text.replace("[elastomer]", "length = 1e-4\nperiodic = false\n[elastomer]")
    study = solved(invoke, tmp_path, text.replace("p_star = 0.3", "p_star = [1e-3, 1.0]"))
    with open_study(study) as file:
        alone, both = (read_profile(file, row) for row in read_rows(study))
        loads = np.maximum(file.arrays("fields", 1)["sigma"], 0.0).sum(axis=1)
    border, inner = loads.argmax(), 6 + loads[6:-6].argmax()  # of 64 rows, twice those of the map
    assert border == (63 if is_turned else 0)
    assert inner // 2 == (12 if is_turned else 19)
    most = "that carries most load (y = "
    assert f"away from the borders {most}{with_unit(inner / 64 * 1e-4, 'm')})" in both.place
    assert f"the row {most}{with_unit(border / 64 * 1e-4, 'm')})" in alone.place


def test_alternative_texts_name_curves_and_contacts(whole):
    """Pictures of two contacts, and figures of two quantities, differ in their texts."""
    labels = [drawing["aria-label"] for drawing in Page(whole).all("svg")]
    (pressures,) = (label for label in labels if "over linear stress" in label)
    assert ": p* = " in pressures
    maps = [label for label in labels if label.startswith("Map of the")]
    assert len(set(maps)) == len(maps) > 0
    assert all("power n=" in label and "a_r = " in label for label in maps)


def test_a_line_scene_shows_its_fields_as_a_cross_section(invoke, tmp_path):
    path = solved(invoke, tmp_path, LINE)
    with open_study(path) as stored:
        profile = read_profile(stored, *read_rows(path))
    assert profile.position == pytest.approx(np.arange(-32, 32) / 64)  # from the crest
    page = Page(report(path))
    labels = [drawing["aria-label"] for drawing in page.all("svg")]
    assert any(label.startswith("Cross-section along the cell") for label in labels)
    assert not any(label.startswith("Map of") for label in labels)


def test_only_rough_surfaces_have_a_spectrum(invoke, tmp_path, whole):
    """The self-affine surface nearest to a single indenter means nothing."""
    anchor = 'id="surface-spectrum"'
    assert anchor in whole
    assert anchor not in report(solved(invoke, tmp_path, LINE))


def test_a_page_of_an_indenter_names_no_theory(invoke, tmp_path):
    text = ONE.replace('kind = "self-affine"\ncutoff = 0.1', 'kind = "parabola"')
    page = report(solved(invoke, tmp_path, text, "--set", "output.true_contact=true"))
    captions = re.findall("<(?:caption|summary|figcaption).*?</", page, flags=re.DOTALL)
    assert any("Middle of each bin" in caption for caption in captions)
    assert any("taken over the true contact" in caption for caption in captions)
    assert not any("heory" in caption for caption in captions)


def test_spectra_of_lines_and_of_areas_have_their_own_units(invoke, tmp_path):
    """C(q) of a profile is in m^3, that of a map in m^4."""
    rng = np.random.default_rng(0)
    heights = np.cumsum(rng.normal(size=64)) * 1e-8
    np.save(tmp_path / "profile.npy", heights - np.linspace(0, heights[-1], 64))
    profile = '[[surface]]\nkind = "file"\npath = "profile.npy"\nlength = 1e-5\nperiodic = false\n'
    text = ONE.replace("[surface]", f"{profile}[[surface]]").replace("n = 1", "n = 0")
    path = solved(invoke, tmp_path, text)
    page = report(path).partition('id="surface-spectrum"')[2]
    page = page.partition("</section>")[0]
    assert "Table behind the figure of lines" in page
    assert "Table behind the figure of areas" in page
    words = re.sub("<[^>]+>", "", page)
    assert ("C(q) [m³]" in words, "C(q) [m⁴]" in words) == (True, True)
    assert page.count('role="img"') == 2
    with h5py.File(path) as file:
        density = next(scene["map_spectrum/density"] for scene in file["scenes"].values())
        assert density.attrs["units"] == "m3"


def test_the_command_writes_beside_the_study_and_says_so(invoke, copied):
    done = invoke("report", copied)
    assert done.exit_code == 0
    assert done.output.strip() == str(copied.with_suffix(".html"))
    assert copied.with_suffix(".html").read_text("utf-8").startswith("<!DOCTYPE html>")


def test_bad_calls_end_in_one_message(invoke, copied, tmp_path):
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
        done = invoke("report", *words)
        assert done.exit_code == status, words
        assert len(done.output.splitlines()) == 1
    assert h5py.is_hdf5(copied)


def test_missing_matplotlib_is_told(invoke, copied, monkeypatch):
    parts = ("gfmd_cli.analysis", "gfmd_cli.report")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for name in [name for name in sys.modules if name.startswith(parts)]:
        monkeypatch.delitem(sys.modules, name)
    done = invoke("report", copied)
    assert done.exit_code == 2
    assert 'pip install ".[plot]"' in done.output
    assert not copied.with_suffix(".html").exists()


def test_a_map_keeps_the_area_the_mean_stress_and_the_mean_gap(study):
    with h5py.File(study) as file:
        area, pressure, gap = (file[name][4] for name in ("a_r", "pressure", "mean_gap"))
    with open_study(study) as stored:
        pixels = maps._thumbnails(stored, 4, step=2)
    touching, stress = pixels["contact"], pixels["stress"]
    assert touching.mean() == pytest.approx(area, rel=1e-12)
    assert stress.mean() == pytest.approx(pressure, rel=1e-6)
    assert pixels["gap"].mean() == pytest.approx(gap, rel=1e-9)


def test_a_peak_of_stress_leaves_the_rest_of_the_contact_visible(study):
    row = read_rows(study)[0]
    stress = np.where(np.arange(64 * 64).reshape(64, 64) % 3, np.linspace(0.01, 1, 64), 0.0)
    stress[5, 5] = 1e3
    stress *= row["delta_sigma"]
    plot = maps._scaled_figure(stress, stress > 0, row, STRESS_SCALE, "stress")
    (image,) = plot.axes.images
    assert image.norm.vmax == pytest.approx(1.0, rel=0.02)
    drawn = image.to_rgba(image.get_array(), bytes=True)[..., :3]
    colours = {kind: {f"#{bytes(pixel).hex()}" for pixel in drawn[chosen]}
               for kind, chosen in (("none", stress == 0), ("contact", stress > 0))}  # fmt: skip
    assert colours["none"] == {"#000000"}
    assert all(contrast(colour, "#000000") >= LEGIBLE for colour in colours["contact"])
    assert maps.BEYOND in colours["contact"]
    assert toned(maps.BEYOND, LIGHT) == toned(maps.BEYOND, DARK) == maps.BEYOND


def test_holes_that_the_elastomer_enters_are_not_drawn_as_contact(invoke, tmp_path):
    y, x = np.mgrid[:32, :32] / 32
    heights = 1e-7 * np.cos(2 * np.pi * x) * np.cos(2 * np.pi * y)
    heights[:4, :4] = np.nan
    np.save(tmp_path / "holed.npy", heights)
    surface = 'kind = "file"\npath = "holed.npy"\nlength = 1e-5\nmissing = "void"'
    text = ONE.replace('kind = "self-affine"\ncutoff = 0.1', surface)
    path = solved(invoke, tmp_path, text.replace("points = 64", "points = 32"))
    (row,) = read_rows(path)
    with open_study(path) as stored:
        fields = stored.arrays("fields", 0)
        figures = {name: figure for name, figure, _ in maps._map_figures(stored, row)}
    assert (fields["u"] < fields["height"]).any()
    (image,) = figures["gap"].axes.images
    touching = (fields["u"] == fields["height"]) & (fields["sigma"] > 0)
    np.testing.assert_array_equal(np.ma.getmaskarray(image.get_array()), touching)


def test_maps_and_cross_sections_of_an_indenter_count_from_its_crest(invoke, tmp_path):
    surface = 'kind = "parabola"\nlength = 1e-4\nradius = 1e-3'
    path = solved(invoke, tmp_path, ONE.replace('kind = "self-affine"\ncutoff = 0.1', surface))
    (row,) = read_rows(path)
    with open_study(path) as stored:
        figures = [figure for _, figure, _ in maps._map_figures(stored, row)]
        profile = read_profile(stored, row)
    assert len(figures) == 3
    for figure in figures:
        (image,) = figure.axes.images
        assert image.get_extent() == pytest.approx([-50, 50, -50, 50])  # micrometres
    assert profile.position[0] == pytest.approx(-50e-6)
    with h5py.File(path, "r+") as file:
        del file["fields/0"]
    with open_study(path) as stored:
        profile = read_profile(stored, row)
    assert profile.along == "the diagonal"
    assert profile.position[0] == pytest.approx(-50e-6 * np.sqrt(2))


@pytest.fixture(scope="module")
def oblong(invoke, tmp_path_factory):
    """A study in SI units of one contact on a cell of 100 um x 50 um with oblong pixels."""
    text = ONE.replace('kind = "power"\nn = 1', 'kind = "half-space"\nE_star = 2e9')
    sides = "length = 1e-4\nlength_y = 5e-5\nh_std = 1e-7"
    text = text.replace("cutoff = 0.1", f"cutoff = 0.1\n{sides}")
    text = text.replace("points = 64", "points = 64\npoints_y = 48")
    return solved(invoke, tmp_path_factory.mktemp("oblong"), text)


def in_si(label, values):
    """Values of an axis in the SI unit of its label, such as "gap (nm)"."""
    prefix = re.fullmatch(r".* \((.?)(m|Pa)\)", label)[1]
    unit = {"n": 1e-9, "µ": 1e-6, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}[prefix]
    return unit * np.asarray(values)


def test_maps_show_the_fields_in_the_units_of_their_axes(oblong):
    (row,) = read_rows(oblong)
    with open_study(oblong) as stored:
        fields = stored.arrays("fields", 0)
        figures, captions = {}, {}
        for name, figure, captions[name] in maps._map_figures(stored, row):
            figures[name] = figure
    sigma, gap = fields["sigma"], fields["u"] - fields["height"]
    touching = (gap == 0) & (sigma > 0)
    for figure in figures.values():
        (image,) = figure.axes.images
        left, right, bottom, top = image.get_extent()
        assert image.origin == "lower"
        assert in_si(figure.axes.get_xlabel(), [left, right]) == pytest.approx([0, 1e-4])
        assert in_si(figure.axes.get_ylabel(), [bottom, top]) == pytest.approx([0, 5e-5])
    (image,) = figures["contact"].axes.images
    assert np.array_equal(np.asarray(image.get_array())[..., 3], touching)
    for name, field, shown in (("stress", sigma, touching), ("gap", gap, ~touching)):
        (image,) = figures[name].axes.images
        drawn = image.get_array()
        label = image.colorbar.ax.get_ylabel()
        assert np.array_equal(~np.ma.getmaskarray(drawn), shown)
        assert in_si(label, drawn[shown]) == pytest.approx(field[shown], rel=1e-6)
        assert image.norm.vmin == 0
        above = field[shown] > in_si(label, image.norm.vmax)
        assert above.mean() == pytest.approx(0.01, abs=2 / shown.sum())
        assert ", red: the 1 % of the " in captions[name]


def test_a_map_of_the_stress_alone_shows_the_contact(oblong, tmp_path):
    """Stress far below the pressure is rounding; contact of so little stress is rare."""
    path = Path(shutil.copy(oblong, tmp_path / "copy.h5"))
    with h5py.File(path, "r+") as file:
        height, u = (file["fields/0"].pop(name)[...] for name in ("height", "u"))
    (row,) = read_rows(path)
    with open_study(path) as stored:
        sigma = stored.arrays("fields", 0)["sigma"]
        ((name, figure, _),) = maps._map_figures(stored, row)
    assert name == "stress"
    (image,) = figure.axes.images
    touching = (u == height) & (sigma > 0)
    assert np.mean(np.ma.getmaskarray(image.get_array()) == touching) < 0.01


def test_a_grid_of_many_rows_is_drawn_in_fewer_pixels(invoke, oblong, tmp_path):
    text = ONE.replace("n = 1", "n = 0").replace("points = 64", "points = 32\npoints_y = 300")
    path = solved(invoke, tmp_path, text)
    (row,) = read_rows(path)
    with open_study(path) as stored:
        stress = stored.arrays("fields", 0)["sigma"]
        figures = [figure for _, figure, _ in maps._map_figures(stored, row)]
        profile = read_profile(stored, row)
    for figure in figures:
        assert figure.axes.images[0].get_array().shape[:2] == (150, 16)
    loads = stress.sum(axis=1)
    assert np.argmax(loads) < 256  # of the first rows that are read
    assert np.array_equal(profile.values["sigma"], stress[np.argmax(loads)])
    note = "Maps have up to 256 pixels a side, each the mean of some grid points."
    for study, has_note in ((path, True), (oblong, False)):
        assert (note in maps.maps(read_report_data(study, "")).notes) == has_note


@pytest.mark.parametrize("is_row", [True, False])
def test_a_cross_section_shows_its_fields_in_the_units_of_its_axes(oblong, tmp_path, is_row):
    """Along the row that carries most load, or the diagonal where no fields are stored."""
    path = Path(shutil.copy(oblong, tmp_path / "copy.h5"))
    if not is_row:
        with h5py.File(path, "r+") as file:
            del file["fields/0"]
    (row,) = read_rows(path)
    with open_study(path) as stored:
        profile = read_profile(stored, row)
    upper, lower = profile_figure(profile).figure.axes
    indenter, elastomer = upper.lines
    (stress,) = lower.lines
    side = 1e-4 if is_row else np.hypot(1e-4, 5e-5)
    size = stress.get_xdata().size
    position = in_si(lower.get_xlabel(), stress.get_xdata())
    assert position == pytest.approx(side * np.arange(size) / size, abs=1e-12)
    for line, name in ((indenter, "height"), (elastomer, "u")):
        assert in_si(upper.get_ylabel(), line.get_ydata()) == pytest.approx(profile.values[name])
    assert in_si(lower.get_ylabel(), stress.get_ydata()) == pytest.approx(profile.values["sigma"])
    bottom, top = in_si(lower.get_ylabel(), lower.get_ylim())
    assert bottom < 0 < profile.values["sigma"].max() < top
    if is_row:
        with open_study(path) as stored:
            loads = stored.arrays("fields", 0)["sigma"].sum(axis=1)
        assert profile.place.endswith(f"(y = {with_unit(5e-5 * loads.argmax() / 48, 'm')})")


def test_key_numbers_and_headline_of_a_study_in_si_units(oblong):
    (row,) = read_rows(oblong)
    data = read_report_data(oblong, "")
    numbers = {name: (value, note) for name, value, note in key_numbers(data)}
    (curve,) = compare(oblong).curves
    u_g, theory = row["u_g"], curve.prediction.u_g[0]
    scales = f"rms height h_std, side {with_unit(1e-4, 'm')}"
    assert numbers["Pressure"] == (with_unit(row["pressure"], "Pa"), "p* = 0.3")
    assert numbers["Unit of stress"][0] == with_unit(row["pressure"] / 0.3, "Pa")
    assert numbers["Roughness"] == (with_unit(1e-7, "m"), scales)
    assert numbers["Mean gap"] == (with_unit(u_g * 1e-7, "m"), f"u_g / h_std = {span([u_g])}")
    assert numbers["Gap / Persson theory"] == (span([u_g / theory]), "u_g up to p* = 0.5")
    assert numbers["Time"][0] == with_unit(row["seconds"], "s")
    assert f"1 pressure, p* = 0.3 ({with_unit(row['pressure'], 'Pa')}), 64 x 48 points." in (
        headline(data)
    )


def test_the_bins_of_the_stress_are_the_same_in_si_units(oblong):
    """sigma Pr(sigma) has no unit, and sigma is a share of the rms stress in full contact."""
    (row,) = read_rows(oblong)
    (table,) = (
        each
        for title, each in stress_distribution(read_report_data(oblong, "")).disclosed.items()
        if "elastomers" in title
    )
    records = table.groups[0].records
    reduced, sigma, reduced_density, density = (
        np.array([float(column.cell(record)) for record in records]) for column in table.columns[:4]
    )
    assert [column.unit for column in table.columns[:4]] == ["", "Pa", "", "1/Pa"]
    assert sigma == pytest.approx(reduced * row["pressure"] / 0.3, rel=2e-3)  # of four digits
    assert sigma * density == pytest.approx(reduced * reduced_density, rel=3e-3)


@pytest.mark.parametrize("step", [1, 2, 3])
def test_pixels_are_means_over_squares(step):
    block = np.arange(35.0).reshape(5, 7)
    means = maps._means(block, step)
    assert means.shape == (-(-5 // step), -(-7 // step))
    assert means[0, 0] == block[:step, :step].mean()
    assert means[-1, -1] == block[(5 - 1) // step * step :, (7 - 1) // step * step :].mean()


@pytest.mark.parametrize("dimension", [1, 2])
def test_a_flat_spectrum_is_found_flat(dimension):
    """Every mode of the lattice has C(q) = 3: the density is 3 L^d in every band."""
    points, length = 32, 2.0
    lattice = np.fft.fftfreq(points, 1 / points)
    squares = sum(np.meshgrid(*[lattice**2] * dimension)) if dimension == 2 else lattice**2
    radius, modes = np.unique(squares[squares > 0], return_counts=True)
    q = 2 * np.pi / length * np.sqrt(radius)
    blank = np.ones_like(q)
    shells = Shells(q, 3.0 * modes, blank, blank, blank, 1.0 * modes)
    flat = spectrum(shells, (length,) * dimension, (points,) * dimension)
    assert flat.q.size > 6
    resolved = flat.q < 2 * np.pi / length * (points / 2 - 1)
    assert flat.density[resolved] == pytest.approx(3 * length**dimension, rel=1e-12)


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
    assert with_unit(1.234e-9, "m") == f"1.23{SPACE}nm"
    assert span([1e5, 1e8], "Pa") == f"100{SPACE}kPa to 100{SPACE}MPa"
    assert span([7e6, 1.2e8, np.nan], "Pa") == f"7 to 120{SPACE}MPa"
    assert span([0.0, 9.7e-7], "m") == f"0 to 0.97{SPACE}µm"
    assert span([0.0, 0.0], "m") == f"0{SPACE}m"
    assert span([2e-6]) == f"2{SPACE}×{SPACE}10⁻⁶"
    assert span([]) == "unknown"


def test_templates_and_style_sheet_are_installed_with_the_package():
    folder = Path(importlib.util.find_spec("gfmd_cli.report").origin).parent / "templates"
    names = {path.name for path in folder.iterdir()}
    assert {"page.html", "macros.html", "section.html", "style.css"} <= names


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_fields_without_a_finite_stress_are_drawn(copied, value):
    with h5py.File(copied, "r+") as file:
        for place in ("fields/0", "cross_sections/0"):
            file[place]["sigma"][...] = value
    assert "Map of the stress; black: none" in report(copied)


def test_key_numbers_and_tables_are_of_the_continuum_where_that_is_known(invoke, tmp_path):
    text = ONE.replace("p_star = 0.3", "p_star = [0.1, 1.0]")
    path = solved(invoke, tmp_path, text + "[accuracy]\ncontact_area = 0.2\n")
    rows = read_rows(path)
    page = Page(report(path))
    words = page.words
    start = words.index("Contact area", words.index("Pressure"))
    known = [row["a_r_continuum"] for row in rows if row["a_r_verdict"] == "regular"]
    assert known
    shown = [row["a_r_continuum" if row["a_r_verdict"] == "regular" else "a_r"] for row in rows]
    assert words[start + 1] == span(shown)
    assert words[start + 1] != span(row["a_r"] for row in rows)
    text_of_page = " ".join("".join(words).split())
    assert "share of the nominal area, in the continuum" in text_of_page
    (curve,) = compare(path).curves
    ratios = span(np.array(shown) / curve.prediction.a_r)
    assert words[words.index("Area / Persson theory") + 1] == ratios


def test_values_on_the_grid_are_not_said_to_be_of_the_continuum(whole):
    assert "in the continuum" not in whole.partition("</dl>")[0]


def test_two_grids_of_one_contact_add_the_continuum(invoke, tmp_path):
    text = ONE.replace("points = 64", "points = [64, 128]")
    page = Page(report(solved(invoke, tmp_path, text)))
    labels = [drawing["aria-label"] for drawing in page.all("svg")]
    in_continuum = "Distribution of the stress in the continuum, with error bars and edge laws: "
    assert any(label.startswith(in_continuum) for label in labels)


def test_maps_of_solvers_that_differ_in_any_key_are_separate_and_named(invoke, tmp_path):
    swept = ONE + "[solver]\nmax_steps = [500, 600]\n"
    page = report(solved(invoke, tmp_path, swept))
    titles = re.findall(r'<div class="pressures"><h3>(.*?)</h3>', page)
    assert len(titles) == 2
    assert ["max_steps=500" in titles[0], "max_steps=600" in titles[1]] == [True, True], titles


def test_a_single_contact_is_told_in_the_singular(invoke, tmp_path):
    path = solved(invoke, tmp_path, ONE + "[solver]\nmax_steps = 1\nnested = false\n")
    (first, *_) = warnings(read_report_data(path, ""))
    assert first == "1 of 1 contact: tolerance not reached."
    assert "Shown: 1 of 1 contact with stored fields or cross-sections, 12 at most." in report(path)


def test_fields_without_a_picture_are_told_what_they_lack(invoke, tmp_path):
    text = ONE.replace('fields = ["u", "sigma", "height"]\ncross_section = true', 'fields = ["u"]')
    page = report(solved(invoke, tmp_path, text))
    assert "The study stores no fields that are shown here." in page
    assert "contact with stored fields" not in page


def test_a_surface_on_several_grids_has_one_spectrum(invoke, tmp_path):
    path = solved(invoke, tmp_path, SPEC.replace("points = 64", "points = [64, 72]"))
    section = surface_spectrum(read_report_data(path, ""))
    assert section.drawings[0].svg.count("cutoff=0.1 seed=") == 2  # in the alternative text
    (table,) = (table for title, table in section.disclosed.items() if title.startswith("Table"))
    assert len(table.groups) == 2


def test_no_ratio_of_gaps_is_told_where_all_are_tiny(invoke, tmp_path):
    path = solved(invoke, tmp_path, ONE.replace("p_star = 0.3", "p_star = 1.0"))
    names = [name for name, *_ in key_numbers(read_report_data(path, ""))]
    assert "Area / Persson theory" in names
    assert "Gap / Persson theory" not in names


def test_tasks_that_failed_are_not_said_to_be_waiting(invoke, tmp_path):
    path = solved(invoke, tmp_path, ONE.replace("p_star = 0.3", "contact_area = [0.3, 1e-9]"))
    page = " ".join(report(path).split())
    assert "1 of 2 is not solved yet or has failed." in page
    assert "<code>gfmd status</code> prints the errors of those that failed" in page


def test_the_headline_of_an_unfinished_study_names_all_that_its_spec_has(invoke, tmp_path):
    path = solved(invoke, tmp_path, SPEC, "--shard", "0/4")  # n = 0 at p* = 0.1, both seeds
    assert headline(read_report_data(path, "")) == (
        "8 contacts: 2 elastomers (power n=0 and power n=1), surface self-affine cutoff=0.1, "
        "2 seeds, 2 pressures, p* = 0.1 so far, 64 points a side."
    )


def test_the_headline_does_not_count_an_indenter_as_a_seed(rows_of, tmp_path):
    surfaces = "surface=[{kind='self-affine', cutoff=0.2, seed=SEEDS}, {kind='parabola'}]"
    for seeds, text in (("3", "2 surfaces"), ("[3, 4]", "2 seeds")):
        name = f"{len(seeds)}.h5"
        rows_of(surfaces.replace("SEEDS", seeds), "elastomer.n=1", text=SPEC, name=name)
        sentence = headline(read_report_data(tmp_path / name, "A"))
        assert text in sentence
        assert ("seeds" in sentence) == (seeds == "[3, 4]")
