"""Every script with a command line starts, and those that take small sizes run on them."""

import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "scripts"
WITH_OPTIONS = [
    path.name
    for path in sorted(SCRIPTS.glob("*.py"))
    if "ArgumentParser(" in path.read_text("utf-8")
]
SMALL = {
    "accuracy_gain.py": "--max-points 400",
    "cost.py": "--table-only --points 128 --sizes 128 --repeats 1",
    "direct_solutions.py": "--points 64 256 --p-star 1e-5 --exponents 4",
    "economy.py": "--points 400",
    "energy_weights.py": "weights.jsonl --points 128 --seeds 2",
    "hard_cases.py": "--points 32 --only cliff --seconds 1",
    "identities.py": "--points 32 --cutoff 0.1 --exponents 1",
    "indenter_bars.py": "--points 64 --line-reference 256 --round-reference 128 --exponents 1 "
    "--pressures 1",
    "interpolated_maps.py": "--points 64 --seeds 1 --contacts",
    "row_blocks.py": "--points 64 --coefficients 512 1e12 --repeats 1",
    "line_bars.py": "--seeds 1 --exponents 1 --finest 512",
    "forecast_pairs.py": "--points 64 --exponents 1 --cutoff 0.1 --repeats 1",
    "line_theory.py": "--seeds 2 --points 8",
    "load_searches.py": "--points 128 --seeds 10",
    "noise_of_maps.py": "--points 64 --seeds 1",
    "neighbour_start.py": "--points 512 --p-star 0.001 0.0011",
    "plain_processor.py": "",
    "plate_areas.py": "none.jsonl --no-run",
    "reference_pages.py": "--check",
    "rounded_heights.py": "--points 64 --seeds 1",
    "sigma_rounding.py": "--points 128 --exponents 1 --p-star 0.1",
    "solver_constants.py": "pcg.SELECTION_GROWTH 2 --points 32 --exponents 1 --seeds 3",
    "spectrum_fits.py": "--seeds 2 --hurst 0.8 --rolloffs 20 --pixels 4",
    "seams_of_maps.py": "--points 64 --seeds 1",
    "scan_files.py": f"{ROOT / 'configs' / 'data'} --limit 60",
    "steep_stiffness.py": "--points 32 --steps 300",
    "searched_pressures.py": "--count 1 --finer 2",
    "small_contacts.py": "--points 64 --cutoff 0.1 --p-star 0.1 --seeds 0 --repeats 1",
    "tile_solves.py": "--points 512 --cutoff 0.02 --p-star 0.001 --repeats 1",
    "surface_classes.py": "bumps random --count 1 --finest 4",
    "transform_work.py": "--points 64",
    "tip_radius.py": "--points 256 --seeds 1 --hurst 0.8 --radii 1",
    "time_left.py": f"{ROOT / 'configs' / 'smoke.toml'} --set grid.points=100 --jobs 1",
    "unresolved_roughness.py": "--points 512 --seeds 2 --hurst 0.8 --maps sharp",
}
"""Arguments with which a script takes seconds."""
CONSTANTS = [
    ("forecast_pairs.py", "--boundary free --solver dual --points 64 --exponents 1 --cutoff 0.1"),
    ("indenter_bars.py", "--units --points 64 128 --exponents 1"),
    ("spectrum_fits.py", "--search --seeds 1 --hurst 0.8"),
]
"""Options with which scripts measure constants of the program, on small sizes."""


def test_each_script_is_named_or_imported_somewhere():
    files = [*ROOT.glob("docs/*.md"), *ROOT.glob("gfmd_cli/**/*.py"), *SCRIPTS.rglob("*.py")]
    files += [ROOT / name for name in ("CONTRIBUTING.md", "Makefile", "mkdocs.yml")]
    texts = {path: path.read_text("utf-8") for path in files}
    for script in SCRIPTS.glob("*.py"):
        others = "\n".join(text for path, text in texts.items() if path != script)
        assert re.search(rf"{script.name}|^(from|import) {script.stem}\b", others, re.M), script


def run(name, arguments, monkeypatch):
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    monkeypatch.syspath_prepend(SCRIPTS)
    try:
        runpy.run_path(str(SCRIPTS / name), run_name="__main__")
    except SystemExit as end:
        if end.code:
            pytest.fail(str(end.code))


@pytest.mark.parametrize("name", WITH_OPTIONS)
def test_a_script_shows_its_help(name, monkeypatch, capsys):
    run(name, ["--help"], monkeypatch)
    assert capsys.readouterr().out.startswith(f"usage: {name}")


def test_a_script_without_its_study_ends_with_one_message(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for path in SCRIPTS.glob("*.py"):
        if "run_with_studies(main, " in path.read_text("utf-8"):
            with pytest.raises(pytest.fail.Exception, match=r"no such study; `.*` makes"):
                run(path.name, [], monkeypatch)


@pytest.mark.parametrize("name", SMALL)
def test_a_script_runs_on_small_sizes(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    run(name, SMALL[name].split(), monkeypatch)


@pytest.mark.parametrize(("name", "arguments"), CONSTANTS)
def test_a_constant_is_measured_on_small_sizes(name, arguments, monkeypatch):
    run(name, arguments.split(), monkeypatch)
