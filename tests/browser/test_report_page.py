"""The report in a browser: nothing but the page is asked for, all is read at any width."""

from importlib.util import find_spec
from pathlib import Path

import pytest
from click.testing import CliRunner

from gfmd_cli.analysis.report.theme import DARK, LEGIBLE, LIGHT, contrast
from gfmd_cli.cli import main

pytestmark = pytest.mark.browser

WIDTHS = (360, 768, 1280)
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
COLOURS = """
const seen = new Set()
for (const part of document.querySelectorAll('svg path, svg use')) {
  if (part.closest('defs')) continue
  const style = getComputedStyle(part)
  for (const colour of [style.stroke, style.fill])
    if (colour.startsWith('rgb(')) seen.add(colour)
}
return [...seen]
"""
AXE = """
const done = arguments[arguments.length - 1]
const alike = {exclude: [['svg > *'], ['tr:nth-child(n + 5)']]}
axe.run(alike).then(found => done(found.violations.map(v => [v.id, v.nodes.map(n => n.html)])))
"""


def gfmd(*words):
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == 0, done.output


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page with all there is; its spec tries to leave its place."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "spec.toml").write_text(HARD + SPEC)
    bench = ["--set", "output.fields=[]", "--set", "elastomer.n=1", "--set", "load.p_star=0.3"]
    gfmd("run", folder / "spec.toml", "-o", folder / "page.h5", "-q")
    gfmd("bench", folder / "spec.toml", "-o", folder / "bench.h5", "-q", *bench)
    gfmd("report", folder / "page.h5", "--bench", folder / "bench.h5")
    return folder / "page.html"


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_reaches_beyond_the_window(browser, page, width, scheme):
    browser.visit(page, width, scheme)
    for script in ("", OPEN):
        browser.run(script)
        assert browser.run("return document.documentElement.scrollWidth") <= width
    assert browser.run("return document.querySelectorAll('svg').length") > 20
    assert browser.run(
        "return [...document.querySelectorAll('svg')].every(one => one.clientWidth > 200)"
    )


def test_only_the_page_is_asked_for_and_nothing_complains(browser, page):
    browser.visit(page)
    browser.run(OPEN)
    asked = [url for url in browser.requests() if not url.startswith("data:")]
    assert asked == [page.as_uri()]
    assert browser.complaints() == []
    assert browser.run("return window.hit") is None
    assert browser.run("return document.images.length + document.scripts.length") == 0


@pytest.mark.parametrize(("width", "scheme"), [(WIDTHS[0], "dark"), (WIDTHS[-1], "light")])
def test_axe_finds_no_violation(browser, page, width, scheme):
    axe = Path(find_spec("axe_core_python").origin).with_name("axe.min.js")
    browser.visit(page, width, scheme)
    browser.run(OPEN)
    browser.run(axe.read_text("utf-8"))
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
    assert press(Keys.TAB) == "Table behind the figures"
    assert not browser.run("return document.querySelector('details').open")
    press(Keys.ENTER)
    assert browser.run("return document.querySelector('details').open")
    press(Keys.TAB)
    assert browser.run("return document.activeElement.className") == "scroll"


def test_print_is_dark_on_white_in_any_scheme(browser, page):
    browser.visit(page, scheme="dark")
    media = {"media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
    assert _hex(browser.run("return getComputedStyle(document.body).backgroundColor")) == LIGHT
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def _hex(colour):
    """Of rgb(1, 2, 3)."""
    return "#" + bytes(int(part) for part in colour[4:-1].split(",")).hex()
