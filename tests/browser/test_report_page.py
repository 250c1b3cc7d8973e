"""The report in a browser: nothing but the page is asked for, all is read at any width."""

import csv
import struct
import time
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gfmd_cli.report.theme import DARK, LEGIBLE, LIGHT, contrast
from gfmd_cli.study.reading import read_rows

pytestmark = pytest.mark.browser

WIDTHS = (360, 400, 768, 1280, 1600)
SCHEMES = ("light", "dark")
SPEC = """\
[study]
name = "page"
[surface]
kind = "self-affine"
cutoff = 0.1
[elastomer]
kind = "power"
n = [0, 1, 3]
[grid]
points = 64
[load]
p_star = [0.03, 0.3, 1.0]
[output]
fields = ["u", "sigma", "height"]
cross_section = true
"""
HARD = "#</pre><script>window.hit = 1</script><img src=http://127.0.0.1:9/x onerror='hit = 1'>\n"
OPEN = "document.querySelectorAll('details').forEach(one => one.open = true)"
RANGE = "return document.querySelector('.plot').layout.xaxis.range"
EXTENT = "const [low, high] = document.querySelector('.plot').layout.xaxis.range"
PRESS = """
for (const tool of document.querySelector(arguments[0]).querySelectorAll('.tools button'))
  if (tool.textContent === arguments[1]) tool.click()
"""
COLOURS = """
const seen = new Set()
const parts = '.drawing svg path, .drawing svg use, .plot .scatterlayer path'
for (const part of document.querySelectorAll(parts)) {
  if (part.closest('defs')) continue
  const style = getComputedStyle(part)
  for (const colour of [style.stroke, style.fill])
    if (colour.startsWith('rgb(')) seen.add(colour)
}
return [...seen]
"""
CAPTIONS = """
return [...document.querySelectorAll('.scroll')].flatMap(box => {
  const right = box.getBoundingClientRect().left + box.clientLeft + box.clientWidth
  const texts = [...box.querySelectorAll('caption span, .group span')]
  return texts.map(text => [text.getBoundingClientRect().right, right])
})
"""
AXE = """
const done = arguments[arguments.length - 1]
const alike = {exclude: [['svg > *'], ['tr:nth-child(n + 5)']]}
axe.run(alike).then(found => done(found.violations.map(v => [v.id, v.nodes.map(n => n.html)])))
"""


def axe_script():
    """The checks of axe, to be run in the page."""
    return Path(find_spec("axe_core_python").origin).with_name("axe.min.js").read_text("utf-8")


@pytest.fixture(scope="module")
def page(output_of, tmp_path_factory):
    """A page with all there is; its spec tries to leave its place."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "spec.toml").write_text(HARD + SPEC)
    bench = ["--set", "output.fields=[]", "--set", "elastomer.n=1", "--set", "load.p_star=0.3"]
    output_of("run", folder / "spec.toml", "-o", folder / "page.h5", "-q")
    output_of("bench", folder / "spec.toml", "-o", folder / "bench.h5", "-q", *bench)
    output_of("report", folder / "page.h5", "--bench", folder / "bench.h5")
    return folder / "page.html"


@pytest.fixture(scope="module")
def pair(output_of, tmp_path_factory):
    """A page of two studies in pascals."""
    folder = tmp_path_factory.mktemp("pair")
    (folder / "spec.toml").write_text(SPEC)
    studies = [folder / f"{name}.h5" for name in ("soft", "hard")]
    for study, modulus in zip(studies, ("1e9", "2e9"), strict=True):
        body = f"elastomer={{kind='half-space', E_star={modulus}}}"
        load = "load={pressure=[1e7, 1e8]}"
        output_of("run", folder / "spec.toml", "-o", study, "-q", "--set", body, "--set", load)
    output_of("report", *studies, "-o", folder / "pair.html")
    output_of("report", studies[0])
    return folder


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_reaches_beyond_the_window(browser, page, width, scheme):
    browser.visit(page, width, scheme)
    for script in ("", OPEN):
        browser.run(script)
        assert browser.run("return document.documentElement.scrollWidth") <= width
    assert browser.run("return document.querySelectorAll('.drawing svg').length") > 20
    assert browser.run("return document.querySelectorAll('.plot .main-svg').length") > 8
    shown = "[...document.querySelectorAll('.drawing, .plot')].filter(one => one.offsetParent)"
    assert browser.run(f"return {shown}.every(one => one.clientWidth > 200)")


@pytest.mark.parametrize("width", WIDTHS)
def test_captions_are_read_without_scrolling(browser, page, width):
    browser.visit(page, width)
    browser.run(OPEN)
    ends = browser.run(CAPTIONS)
    assert len(ends) > 5
    assert all(end <= right for end, right in ends)


def test_only_the_page_is_asked_for_and_nothing_complains(browser, page):
    browser.visit(page)
    browser.run(OPEN)
    addresses = [url for url in browser.requests() if not url.startswith("data:")]
    assert addresses == [page.as_uri()]
    assert browser.complaints() == []
    assert browser.run("return window.hit") is None
    assert browser.run("return document.images.length") == 0
    assert browser.run("return [...document.scripts].filter(one => !one.type).length") == 2


@pytest.mark.parametrize(("width", "scheme"), [(WIDTHS[0], "dark"), (WIDTHS[-1], "light")])
def test_axe_finds_no_violation(browser, page, width, scheme):
    browser.visit(page, width, scheme)
    browser.run(OPEN)
    browser.run(axe_script())
    assert browser.driver.execute_async_script(AXE) == []


@pytest.mark.parametrize(("scheme", "paper"), [("light", LIGHT), ("dark", DARK)])
def test_figures_stand_out_from_the_paper(browser, page, scheme, paper):
    browser.visit(page, scheme=scheme)
    ground = browser.run("return getComputedStyle(document.body).backgroundColor")
    assert _hex(ground) == paper
    colours = {_hex(colour) for colour in browser.run(COLOURS)}
    assert len(colours) > 5
    for colour in colours - {paper}:
        assert contrast(colour, paper) >= LEGIBLE, colour


def test_all_is_reached_by_keys(browser, page):
    from selenium.webdriver import ActionChains, Keys

    def press(*keys):
        ActionChains(browser.driver).send_keys(*keys).perform()
        return browser.run("return document.activeElement.textContent")

    browser.visit(page)
    assert press(Keys.TAB) == "Skip to the results"
    press(Keys.ENTER)
    assert browser.run("return document.activeElement.tagName") == "MAIN"
    assert press(Keys.TAB) == "Table of all values of page as CSV"
    assert press(Keys.TAB).endswith("n = 0")
    press(Keys.ENTER)
    assert browser.run("return document.activeElement.getAttribute('aria-pressed')") == "false"
    while browser.run("return document.activeElement.className").split()[:1] != ["plot"]:
        press(Keys.TAB)
    before = browser.run(RANGE)
    press("+", Keys.ARROW_RIGHT)
    low, high = browser.run(RANGE)
    assert high - low == pytest.approx(0.8 * (before[1] - before[0]))
    assert (low + high) / 2 > sum(before) / 2
    press("0")
    assert browser.run(RANGE) == pytest.approx(before)
    while press(Keys.TAB) != "Table behind the figures":
        pass
    assert not browser.run("return document.querySelector('details').open")
    press(Keys.ENTER)
    assert browser.run("return document.querySelector('details').open")
    press(Keys.TAB)
    assert browser.run("return document.activeElement.className") == "scroll"


def test_a_point_says_its_value_status_and_parameters(browser, page):
    from selenium.webdriver import ActionChains

    browser.visit(page)
    point = browser.run("return document.querySelector('.plot .scatterlayer path.point')")
    browser.run("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", point)
    ActionChains(browser.driver).move_to_element(point).perform()
    label = browser.wait("return document.querySelector('.hoverlayer')?.textContent")
    for words in ("n = 0", "Δσ: 0.03", "relative contact area a_r: 0.", "converged: residual"):
        assert words in label


def test_curves_are_turned_off_and_on(browser, page):
    browser.visit(page)
    count = "return document.querySelector('.plot').querySelectorAll('path.point').length"
    assert browser.run(count) == 9
    for expected in (6, 9):
        browser.run("document.querySelector('.legend button').click()")
        assert browser.wait(f"{count} === arguments[0]", expected)


@pytest.mark.parametrize("width", [360, 1280])
def test_each_of_many_curves_can_be_turned_off(browser, output_of, tmp_path, width):
    (tmp_path / "spec.toml").write_text(SPEC.split("[output]")[0])
    hurst = ", ".join(f"{0.1 + 0.02 * place:.2f}" for place in range(40))
    settings = ["--set", f"surface.hurst=[{hurst}]", "--set", "elastomer.n=1"]
    few = ["--set", "grid.points=32", "--set", "load.p_star=0.3"]
    output_of("run", tmp_path / "spec.toml", "-o", tmp_path / "many.h5", "-q", *settings, *few)
    output_of("report", tmp_path / "many.h5")
    browser.visit(tmp_path / "many.html", width)
    legend = "document.querySelector('.legend')"
    assert browser.run(f"return {legend}.querySelectorAll('button').length") == 41
    assert browser.run(f"return {legend}.clientHeight < {legend}.scrollHeight")
    assert browser.run(f"return {legend}.clientHeight") < 200
    inside = "getBoundingClientRect().right <= document.documentElement.clientWidth"
    assert browser.run(f"return [...{legend}.children].every(one => one.{inside})")
    count = "return document.querySelector('.plot').querySelectorAll('path.point').length"
    assert browser.run(count) == 40
    browser.run(f"{legend}.querySelectorAll('button')[21].click()")
    assert browser.wait(f"{count} === arguments[0]", 39)


def test_a_figure_is_zoomed_with_the_mouse_and_keeps_that_with_fewer_curves(browser, page):
    from selenium.webdriver import ActionChains

    browser.visit(page)
    before = browser.run(RANGE)
    plot = browser.run("return document.querySelector('.plot .nsewdrag')")
    browser.run("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    drag = ActionChains(browser.driver).move_to_element_with_offset(plot, -80, -60)
    drag.click_and_hold().move_by_offset(120, 100).release().perform()
    narrow = 0.8 * (before[1] - before[0])
    assert browser.wait(f"{EXTENT}; return high - low < arguments[0]", narrow)
    zoomed = browser.run(RANGE)
    browser.run("document.querySelector('.legend button').click()")
    assert browser.run(RANGE) == pytest.approx(zoomed)
    browser.run("document.querySelector('[aria-label=\"Reset zoom\"]').click()")
    assert browser.wait(f"{EXTENT}; return low === arguments[0]", before[0])


def test_an_axis_in_pascals_follows_the_zoom(browser, pair):
    browser.visit(pair / "soft.html")
    ends = "const {xaxis, xaxis2} = document.querySelector('.plot').layout\n"
    both = f"{ends} return [xaxis.range, xaxis2.range]"
    before = browser.run(both)
    browser.run(PRESS, "figure", "+")
    moved = "xaxis.range[0] !== arguments[0] && xaxis2.range[0] !== arguments[1]"
    browser.wait(f"{ends} return {moved}", before[0][0], before[1][0])
    (low, high), (low_above, high_above) = before
    (low_now, high_now), (low_now_above, high_now_above) = browser.run(both)
    shift = low_above - low  # of decadic logarithms
    above = [high_above - high, low_now_above - low_now, high_now_above - high_now]
    assert above == pytest.approx(3 * [shift])
    assert browser.complaints() == []


def test_a_page_of_two_studies_is_accessible(browser, pair):
    browser.visit(pair / "pair.html", 400)
    browser.run(OPEN)
    assert browser.run("return document.documentElement.scrollWidth") <= 400
    browser.run(axe_script())
    assert browser.driver.execute_async_script(AXE) == []


def test_data_and_images_are_saved_from_the_page(browser, page, tmp_path):
    browser.visit(page)
    browser.downloads(tmp_path)
    browser.run(OPEN)
    for name in ("CSV", "SVG", "PNG"):
        browser.run(PRESS, "figure", name)
    browser.run(PRESS, "details", "CSV")
    browser.run(PRESS, ".contact figure", "PNG")
    browser.run("document.querySelector('a[download]').click()")
    names = ("contact_area.csv", "contact_area.svg", "contact_area.png",
             "contact-area-table-1.csv", "contact-0.png")  # fmt: skip
    text = {name: saved(tmp_path / f"page-{name}") for name in names}
    header, *rows = csv.reader(text["contact_area.csv"].decode().splitlines())
    assert header[2:4] == ["reduced pressure p* = p / Δσ", "relative contact area a_r"]
    stored = {row["a_r"] for row in read_rows(page.with_suffix(".h5"))}
    shown = [float(row[3]) for row in rows if row[1] == "simulation"]
    assert sorted(shown) == pytest.approx(sorted(stored), rel=1e-9)
    ElementTree.fromstring(text["contact_area.svg"])
    assert b"var(" not in text["contact_area.svg"]
    for name in ("contact_area.png", "contact-0.png"):
        width, height = struct.unpack(">II", text[name][16:24])
        assert min(width, height) > 500
    table = list(csv.reader(text["contact-area-table-1.csv"].decode().splitlines()))
    assert table[0][:2] == ["group", "p*"]
    assert len(table) == 1 + 9
    assert len(list(csv.reader(saved(tmp_path / "page.csv").decode().splitlines()))) == 1 + 9
    assert browser.complaints() == []


def saved(path):
    """The content of a file that the page saves, once it is there."""
    for _ in range(600):
        if path.exists():
            return path.read_bytes()
        time.sleep(0.1)
    raise AssertionError(f"{path.name} is missing; there are {list(path.parent.iterdir())}")


def test_a_table_is_sorted_by_a_column_within_its_groups(browser, page):
    browser.visit(page)
    browser.run(OPEN)
    cells = """
    return [...document.querySelector('main table').tBodies].map(body =>
      [...body.rows].filter(row => row.cells.length > 1).map(row => row.cells[2].textContent))
    """
    head = "document.querySelector('main table').tHead.rows[0].cells[2]"
    before = browser.run(cells)
    for order, falling in (("ascending", False), ("descending", True)):
        browser.run(f"{head}.querySelector('button').click()")
        assert browser.run(f"return {head}.getAttribute('aria-sort')") == order
        assert browser.run(cells) == [sorted(g, key=float, reverse=falling) for g in before]


def test_a_slider_goes_through_the_pressures_of_maps(browser, page):
    from selenium.webdriver import Keys

    browser.visit(page)
    titles = """
    const series = document.querySelector('.pressures')
    return [...series.querySelectorAll('h4')].filter(one => one.offsetParent)
      .map(one => one.textContent)
    """
    slider = browser.run("return document.querySelector('.pressures input[type=range]')")
    for p_star in ("0.03", "0.3", "1"):
        (title,) = browser.run(titles)
        assert title.startswith(f"p* = {p_star}, ")
        assert slider.get_attribute("aria-valuetext") == title
        slider.send_keys(Keys.ARROW_RIGHT)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert len(browser.run(titles)) == 3
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_without_scripts_all_figures_and_maps_are_there(browser, page):
    disable = "Emulation.setScriptExecutionDisabled"
    browser.driver.execute_cdp_cmd(disable, {"value": True})
    try:
        browser.visit(page)
    finally:
        browser.driver.execute_cdp_cmd(disable, {"value": False})
    assert browser.run("return document.querySelectorAll('.drawing svg').length") > 10
    hidden = "[...document.querySelectorAll('.drawing svg')].filter(one => one.clientWidth < 200)"
    assert browser.run(f"return {hidden}.length") == 0
    assert browser.run("return document.querySelectorAll('button, input, .plot').length") == 0


def test_paper_shows_the_static_figures(browser, page):
    browser.visit(page)
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    assert browser.run("return document.querySelectorAll('.drawing').length") > 10
    hidden = "[...document.querySelectorAll('.drawing')].filter(one => !one.offsetParent)"
    assert browser.run(f"return {hidden}.length") == 0
    assert browser.run(
        "return [...document.querySelectorAll('.plot, button')]"
        ".filter(one => one.offsetParent && !one.closest('th')).length"
    ) == 0  # fmt: skip
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_figures_follow_the_colour_scheme(browser, page):
    browser.visit(page, scheme="light")
    axis = "return getComputedStyle(document.querySelector('.plot .xtick text')).fill"
    light = browser.run(axis)
    scheme = {"name": "prefers-color-scheme", "value": "dark"}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    assert browser.wait(f"return (() => {{ {axis} }})() !== arguments[0]", light)
    assert contrast(_hex(browser.run(axis)), DARK) >= 4.5


def test_print_is_dark_on_white_in_any_scheme(browser, page):
    browser.visit(page, scheme="dark")
    media = {"media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    assert _hex(browser.run("return getComputedStyle(document.body).backgroundColor")) == LIGHT
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def _hex(colour):
    """Of rgb(1, 2, 3)."""
    return "#" + bytes(int(part) for part in colour[4:-1].split(",")).hex()
