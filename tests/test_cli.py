import csv
import io
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from specs import power_spec

import gfmd_cli
from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.curve_styles import curve_styles
from gfmd_cli.cli import main
from gfmd_cli.study import resources

CONFIGS = Path(__file__).parents[1] / "configs"
CONTRACT = (
    "surface,seed,elastomer,n,thickness,points,p_star,a_r,a_r_error,sigma_p,sigma_p_error,"
    "u_g,u_g_error,residual,solver,transforms,seconds,status"
)
SPEC = power_spec(n=[0, 1], points=64, p_star=[0.1, 1.0], cutoff=0.05, name="small")


def test_run_then_analyze_then_export(gfmd):
    done = gfmd("run", "spec.toml")
    assert done.exit_code == 0, done.output
    assert "4 converged" in done.output
    assert "gfmd analyze small.h5" in done.output
    result = gfmd("analyze", "small.h5")
    assert result.exit_code == 0
    assert "Persson" in result.output
    rows = list(csv.DictReader(io.StringIO(gfmd("export", "small.h5").output)))
    assert ",".join(rows[0]).startswith(CONTRACT)
    assert len(rows) == 4
    assert rows[0]["a_r_error"] == ""
    assert rows[0]["thickness"] == ""
    assert float(rows[3]["residual"]) < 1e-6


def test_the_next_commands_take_files_whose_names_begin_with_a_hyphen(gfmd):
    Path("spec.toml").rename("-x.toml")
    missing = gfmd("status", "./-x.toml", "-o", "-x.h5").output
    assert missing.endswith("next: gfmd run ./-x.toml -o -x.h5\n")
    done = gfmd(*missing.split("next: gfmd ")[1].split()).output
    for command in re.findall(r"gfmd (\w+ \S+)\n", done):
        assert gfmd(*command.split()).exit_code == 0
    assert {"-x.h5", "-x.html"} < {path.name for path in Path().iterdir()}


def test_a_second_run_says_that_all_is_done(gfmd):
    gfmd("run", "spec.toml")
    before = Path("small.h5").read_bytes()
    again = gfmd("run", "spec.toml")
    assert again.exit_code == 0
    assert "4 converged" in again.output
    assert Path("small.h5").read_bytes() == before


def test_export_writes_a_file(gfmd):
    gfmd("run", "spec.toml", "-o", "a.h5")
    assert gfmd("export", "a.h5", "-o", "a.csv").exit_code == 0
    assert Path("a.csv").read_text().startswith(CONTRACT)


def test_analyze_prints_records_with_the_columns_of_export_and_theory(gfmd):
    gfmd("run", "spec.toml", "--set", "solver.tolerance=[1e-6, 1e-8]")
    records = json.loads(gfmd("analyze", "small.h5", "--json").output)
    rows = list(csv.DictReader(gfmd("export", "small.h5").output.splitlines()))
    assert len(records) == len(rows) == 8
    theory = {"a_r_persson", "sigma_p_persson", "u_g_persson", "p_star_persson_at_u_g"}
    closed_form = {f"{name}_einstein" for name in ("a_r", "sigma_p", "u_g")}
    assert set(records[0]) == {*rows[0], *theory, *closed_form}  # springs
    assert set(records[-1]) == {*rows[0], *theory}
    for record in records:
        texts = {key: "" if record[key] is None else str(record[key]) for key in rows[0]}
        assert texts in rows
    assert records[0]["thickness"] is None
    assert records[0]["a_r_persson"] == pytest.approx(0.07965567455405798, rel=1e-12)  # erf


def test_a_dry_run_lists_the_tasks_and_writes_nothing(gfmd):
    before = set(Path().iterdir())
    result = gfmd("run", "spec.toml", "--dry-run")
    assert result.exit_code == 0
    assert "4 tasks, 4 to do" in result.output
    assert "MiB" in result.output
    assert set(Path().iterdir()) == before
    assert "2 tasks" in gfmd("run", "spec.toml", "--dry-run", "--shard", "1/2").output
    swept = gfmd("run", "spec.toml", "--dry-run", "--set", "solver.tolerance=[1e-6, 1e-8]").output
    assert swept.count(", tolerance=1e-06") == swept.count(", tolerance=1e-08") == 2


def test_a_dry_run_names_each_solver_beside_a_file_of_its_name(gfmd, tmp_path):
    np.save(tmp_path / "fire-scan.npy", np.eye(8))
    surface = 'surface={kind="file", path="fire-scan.npy", length=1.0, periodic=true}'
    solver = 'solver.kind=["fire", "pcg"]'
    done = gfmd("run", "spec.toml", "--dry-run", "--set", surface, "--set", solver)
    titles = [line for line in done.output.splitlines() if "fire-scan" in line]
    assert [title.rpartition(", ")[2] for title in titles] == ["fire", "pcg"] * 2


def test_a_quiet_run_says_why_its_exit_status_is_not_zero(gfmd):
    done = gfmd("run", "spec.toml", "-q", "--set", "solver={kind='ccg', max_steps=1}")
    assert done.exit_code == 1
    assert re.search(r"gfmd: small\.h5: \d+ .*max_steps", done.output)


def test_a_shard_takes_its_share(gfmd):
    assert gfmd("run", "spec.toml", "--shard", "0/2").exit_code == 0
    assert "2 tasks not solved yet" in gfmd("analyze", "small.h5").output
    assert "2 tasks not solved yet" in gfmd("analyze", "small.h5", "--json").output
    assert len(gfmd("export", "small.h5").output.splitlines()) == 3
    assert gfmd("run", "spec.toml", "--shard", "1/2").exit_code == 0
    assert len(gfmd("export", "small.h5").output.splitlines()) == 5
    assert gfmd("run", "spec.toml", "--shard", "5/9").exit_code == 0


@pytest.mark.parametrize(
    "shard", ["2/2", "-1/2", "a/b", "1", "0/0", "1/2/3", "²/3", "0/²", "٠/٢", f"0/{5000 * '9'}"]
)
def test_a_bad_shard_is_refused(gfmd, shard):
    result = gfmd("run", "spec.toml", f"--shard={shard}")
    assert result.exit_code == 2
    assert "0 <= I < N" in result.output


@pytest.mark.parametrize(
    "words",
    [
        ("run", "none.toml"),
        ("run", "spec.toml", "--set", "elastomer.n=9"),
        ("run", "spec.toml", "--set", "surface.cutoff=0.001"),
        ("run", "spec.toml", "--jobs", "0"),
        ("run", "spec.toml", "-o", "a.h5", "-o", "b.h5"),
        ("run", "spec.toml", "--set", "elastomer.n=1", "--set", "elastomer.n=2"),
        ("run", "spec.toml", "--set", "load.p_star=1", "--set", "load.pressure=2"),
        ("run", "spec.toml", "-o", "."),
        ("run", "spec.toml", "-o", ""),
        ("run", "spec.toml", "-o", "small.csv"),
        ("run", "spec.toml", "--dry-run", "-o", "/"),
        ("status", "spec.toml", "-o", "."),
        ("run", "spec.toml", "--max-hours", "nan"),
        ("run", "spec.toml", "--checkpoint-every", "nan"),
        ("run", "spec.toml", "--set", "load.p_star=1e7"),
        ("analyze", "none.h5"),
        ("export", "none.h5"),
        ("run",),
        ("walk",),
    ],
)
def test_bad_usage_ends_in_status_2_without_traceback_or_file(gfmd, words):
    before = set(Path().iterdir())
    result = gfmd(*words)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert result.output.strip()
    assert set(Path().iterdir()) == before


def test_a_missed_tolerance_is_status_1_and_the_others_are_kept(gfmd):
    result = gfmd("run", "spec.toml", "--set", "solver.max_steps=1")
    assert result.exit_code == 1
    assert "2 converged, 2 max_steps" in result.output
    assert gfmd("run", "spec.toml", "--set", "solver.max_steps=1").exit_code == 1
    assert len(gfmd("export", "small.h5").output.splitlines()) == 5


def test_an_unreadable_study_is_status_74(gfmd):
    Path("bad.h5").write_bytes(b"nothing")
    for words in (
        ("analyze", "bad.h5"),
        ("export", "bad.h5"),
        ("run", "spec.toml", "-o", "bad.h5"),
    ):
        result = gfmd(*words)
        assert result.exit_code == 74
        assert "bad.h5" in result.output


@pytest.mark.parametrize("folder", [".", "/"])
def test_a_folder_is_no_study_to_report(gfmd, folder):
    result = gfmd("report", folder)
    assert result.exit_code in (73, 74)
    assert result.output.startswith("gfmd: ")


def test_a_figure_of_unknown_format_is_refused_before_the_work(gfmd):
    result = gfmd("surface", "spec.toml", "--figure", "x.jpg")
    assert result.exit_code == 2
    assert result.output == "gfmd: x.jpg: unknown suffix '.jpg'; allowed: .png, .pdf, .svg\n"


def test_a_place_that_cannot_be_written_is_status_73(gfmd):
    Path("file").write_text("")
    result = gfmd("run", "spec.toml", "-o", "file/study.h5")
    assert result.exit_code == 73
    assert "cannot be written" in result.output


def test_a_read_only_study_is_kept(gfmd):
    gfmd("run", "spec.toml", "-o", "a.h5")
    Path("a.h5").chmod(0o444)
    before = Path("a.h5").read_bytes()
    assert gfmd("run", "spec.toml", "-o", "a.h5").exit_code == 0  # all is done
    for words in (
        ("run", "spec.toml", "--set", "load.p_star=0.5", "-o", "a.h5"),
        ("run", "spec.toml", "--overwrite", "-o", "a.h5"),
    ):
        result = gfmd(*words)
        assert result.exit_code == 73
        assert "a.h5: cannot be written: it is read-only" in result.output
    assert set(Path().glob("a*")) == {Path("a.h5")}
    assert Path("a.h5").read_bytes() == before


def test_a_file_that_cannot_be_looked_for_is_told_with_the_reason(gfmd):
    """As in a folder without permission, which root can search."""
    assert gfmd("run", "spec.toml", "-o", "a.h5").exit_code == 0
    folder = "long" * 100
    for words in (
        ("run", "spec.toml", "-o", f"{folder}/x.h5"),
        ("run", "spec.toml", "-o", f"{folder}/x.h5", "--dry-run"),
        ("run", "spec.toml", "-o", f"{folder}/x.h5", "--overwrite"),
        ("submit", "spec.toml", "-o", f"{folder}/x.h5", "--shards", "2", "--dry-run"),
        ("status", "spec.toml", "-o", f"{folder}/x.h5"),
        ("status", f"{folder}/x.h5"),
        ("collect", "spec.toml", "-o", f"{folder}/x.h5"),
        ("analyze", f"{folder}/x.h5"),
        ("report", "a.h5", "--bench", f"{folder}/x.h5"),
        ("export", f"{folder}/x.h5"),
        ("diff", "a.h5", f"{folder}/x.h5"),
        ("bench", "spec.toml", "-o", f"{folder}/x.h5"),
        ("surface", f"{folder}/x.npy"),
        ("init", "new.toml", "--from", f"{folder}/x.npy"),
        ("init", f"{folder}/x.toml", "--from", "none.npy"),
    ):
        result = gfmd(*words)
        assert result.exit_code in (2, 73, 74), words
        expected = rf"gfmd: .*{folder}/.*\n"
        assert re.fullmatch(expected, result.output), result.output
        assert "File name too long" in result.output


def test_a_file_that_cannot_be_written_is_told_with_the_reason(gfmd):
    assert gfmd("run", "spec.toml", "-o", "a.h5").exit_code == 0
    Path("file").write_text("")
    for folder, reason in (
        ("/proc", "No such file or directory"),
        ("file", "there is no folder file"),
        ("mistyped", "there is no folder mistyped"),
    ):
        for words in (
            ("report", "a.h5", "-o", f"{folder}/x.html"),
            ("analyze", "a.h5", "--figures", f"{folder}/x"),
            ("export", "a.h5", "-o", f"{folder}/x.csv"),
            ("surface", "spec.toml", "--figure", f"{folder}/x.png"),
            ("run", "spec.toml", "-o", f"{folder}/x.h5"),
            ("bench", "spec.toml", "-o", f"{folder}/x.h5"),
            ("init", f"{folder}/x.toml"),
        ):
            result = gfmd(*words)
            assert result.exit_code == 73, words
            expected = rf"gfmd: {folder}/x\S*: cannot be written: .*({reason})"
            assert re.fullmatch(expected, result.output.splitlines()[-1]), result.output
    assert not Path("mistyped").exists()


def test_a_name_that_is_too_long_is_status_73(gfmd):
    result = gfmd("run", "spec.toml", "-o", 300 * "x" + ".h5")
    assert result.exit_code == 73
    assert "File name too long" in result.output


def test_a_grid_beyond_the_memory_is_refused_before_it_is_allocated(gfmd, monkeypatch):
    monkeypatch.setattr(resources, "available_memory", lambda: 2.0**30)
    result = gfmd("run", "spec.toml", "--set", "grid.points=8192")
    assert result.exit_code == 2
    assert "8192 points" in result.output
    assert "GiB" in result.output


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.full((16, 16), np.nan), "NaN"),
        (np.zeros((16, 18, 2)), "shape (16, 18, 2)"),
        (np.zeros((16, 16)), "flat"),
        (np.array([{}]), "cannot be read"),
    ],
)
def test_a_height_file_that_will_not_do_is_refused(gfmd, array, words):
    np.save("h.npy", array, allow_pickle=True)
    result = gfmd(
        "run", "spec.toml", "--set", "surface={kind='file', path='h.npy'}", "--set",
        "grid.points=16",
    )  # fmt: skip
    assert result.exit_code == 2
    assert words in result.output
    assert not Path("small.h5").exists()


@pytest.mark.parametrize("points", ["64", "'auto'"])
def test_a_surface_without_any_wave_is_refused_with_its_key(gfmd, points):
    band = "spectrum='cutoff', rolloff=0.43, cutoff=0.41"
    result = gfmd(
        "run", "spec.toml", "--set", f"surface={{kind='self-affine', {band}}}", "--set",
        f"grid.points={points}", "--set", "accuracy.contact_area=0.1",
    )  # fmt: skip
    assert result.exit_code == 2
    assert "spec.toml: surface.rolloff: 0.43 given with cutoff = 0.41" in result.output
    assert not Path("small.h5").exists()


@pytest.mark.parametrize("cutoff", [1e-6, 1e-30])
def test_a_cut_off_that_no_grid_resolves_has_no_summary(gfmd, cutoff):
    result = gfmd("surface", "spec.toml", "--set", f"surface.cutoff={cutoff}")
    assert result.exit_code == 2
    assert f"do not resolve the surface (kind 'self-affine', cutoff = {cutoff:g}" in result.output


def test_a_roll_off_beyond_all_waves_is_refused_with_its_key(gfmd):
    result = gfmd("run", "spec.toml", "--set", "surface.rolloff=1e200")
    assert result.exit_code == 2
    words = "spec.toml: surface.rolloff: 1e+200 given, out of range: it is in units of"
    assert words in result.output
    assert "at most 1e+06" in result.output
    assert not Path("small.h5").exists()


@pytest.mark.parametrize(
    ("surface", "elastomer", "key"),
    [
        ('kind = "file", path = "none.txt"', 'kind = "half-space"', "surface.path"),
        ('kind = "parabola"', 'kind = "table", path = "none.txt"', "elastomer.path"),
    ],
)
def test_a_file_that_is_not_there_is_refused_with_its_key(gfmd, surface, elastomer, key):
    tables = f"surface = {{ {surface} }}\nelastomer = {{ {elastomer} }}\n"
    Path("spec.toml").write_text(f"{tables}grid.points = 16\nload.p_star = 0.1\n")
    result = gfmd("run", "spec.toml")
    assert result.exit_code == 2
    place = Path("none.txt").resolve()
    assert result.output == f"gfmd: spec.toml: {key}: {place}: No such file or directory\n"


@pytest.mark.parametrize("command", [("run",), ("run", "--dry-run")])
@pytest.mark.parametrize(
    ("elastomer", "label"),
    [
        ("kind='power', n=[0, 1e-3]", "power n=0.001"),
        ("kind='layer', thickness=1e-3, base='sliding'", "layer thickness=1 mm base=sliding"),
        ("kind='slab', thickness=10.0", "slab thickness=10"),
        ("kind='table', path='rising.txt'", "table path=rising.txt"),
    ],
)
def test_sort_is_refused_where_the_stiffness_depends_on_the_wavenumber(
    gfmd, command, elastomer, label
):
    Path("rising.txt").write_text("1 1\n2 1\n4 1.001\n")
    result = gfmd(
        *command, "spec.toml", "--set", "solver.kind=sort", "--set", f"elastomer={{{elastomer}}}"
    )
    assert result.exit_code == 2
    assert result.output == (
        f'gfmd: spec.toml: solver.kind: "sort" given, but the stiffness of {label} depends on the '
        'wavenumber (1e-3 to 1e12 1/m); "sort" is for n = 0, "auto" for every elastomer\n'
    )
    assert {path.name for path in Path().iterdir()} == {"spec.toml", "rising.txt"}


@pytest.mark.parametrize("elastomer", ["kind='power', n=0", "kind='table', path='flat.txt'"])
def test_sort_solves_every_stiffness_that_is_constant(gfmd, elastomer):
    Path("flat.txt").write_text("1 3e10\n5 3e10\n7 3e10\n")
    words = ("--set", "solver.kind=sort", "--set", f"elastomer={{{elastomer}}}")
    result = gfmd("run", "spec.toml", *words)
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize("key", [", E_star=1.0", ", E_star=2.0", ""])
def test_pressures_in_pa_are_shown_where_the_stiffness_is_given(gfmd, key):
    keys = ("surface.h_std=1e-6", f"elastomer={{kind='half-space'{key}}}", "grid.points=64")
    done = gfmd("run", "spec.toml", *(word for key in keys for word in ("--set", key)))
    assert done.exit_code == 0, done.output
    for output in (done.output, gfmd("analyze", "small.h5").output):
        assert ("p [Pa]" in output) == bool(key)


def test_tables_of_one_name_are_told_apart(gfmd):
    """Three seeds of two materials: the means are those of each."""
    for folder, n in {"a": 1, "b": 2}.items():
        Path(folder).mkdir()
        np.savetxt(f"{folder}/k.txt", [[1e-3, 1e-3**n], [1e6, 1e6**n]])
    elastomers = "elastomer=[{kind='table', path='a/k.txt'}, {kind='table', path='b/k.txt'}]"
    seeds = ("--set", "surface.seed=[0, 1, 2]", "--set", "load.p_star=0.1")
    result = gfmd("run", "spec.toml", "--set", elastomers, *seeds, "--set", "grid.points=40")
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader(io.StringIO(gfmd("export", "small.h5").output)))
    assert {row["elastomer"] for row in rows} == {
        f"table path=k.txt sha256={row['elastomer_sha256'][:8]}" for row in rows
    }
    records = json.loads(gfmd("analyze", "small.h5", "--json").output)
    for checksum in {row["elastomer_sha256"] for row in rows}:
        values = [float(row["u_g"]) for row in rows if row["elastomer_sha256"] == checksum]
        (mean,) = {r["u_g_mean"] for r in records if r["elastomer_sha256"] == checksum}
        assert len(values) == 3
        assert mean == pytest.approx(np.mean(values), rel=1e-12)


def test_a_height_array_is_used_as_it_is(gfmd):
    heights = np.random.default_rng(5).normal(size=(32, 32))
    np.save("h.npy", heights)
    surface = ("--set", "surface={kind='file', path='h.npy', length=2.0}", "--set", "load.p_star=9")
    result = gfmd("run", "spec.toml", *surface, "--set", "grid.points=32")
    assert result.exit_code == 0, result.output
    row = next(csv.DictReader(io.StringIO(gfmd("export", "small.h5").output)))
    assert float(row["h_std"]) == pytest.approx(heights.std(), rel=1e-14)
    assert float(row["length"]) == 2.0
    changed = np.array(heights)
    changed[0, 0] += 1
    np.save("h.npy", changed)
    again = gfmd("run", "spec.toml", *surface, "--set", "grid.points=32")
    assert again.exit_code == 0
    assert "the study also contains 2 contacts of other specs" in again.output
    rows = list(csv.DictReader(io.StringIO(gfmd("export", "small.h5").output)))
    checksums = {row["surface_sha256"] for row in rows}
    assert len(checksums) == len({row["h_std"] for row in rows}) == 2
    labels = {f"file path=h.npy length=2 m sha256={checksum[:8]}" for checksum in checksums}
    assert {row["surface"] for row in rows} == labels
    assert labels == {
        line.partition(" on ")[2].partition(", ")[0]
        for line in gfmd("analyze", "small.h5").output.splitlines()
        if " on file" in line
    }
    assert all(label in again.output for label in labels)
    styles = curve_styles(compare(Path("small.h5")).curves)
    assert {style.label.rpartition(" ")[2] for style in styles} == {
        label.rpartition(" ")[2] for label in labels
    }
    Path("other").mkdir()
    np.save("other/h.npy", heights)
    folders = gfmd(
        "run", "spec.toml", "--dry-run", "--set", "grid.points=32", "--set",
        "surface={kind='file', path=['h.npy', 'other/h.npy'], length=2.0}",
    )  # fmt: skip
    assert all(label in folders.output for label in labels)
    only_second = gfmd("run", "spec.toml", "-o", "one.h5", *surface, "--set", "grid.points=32")
    assert "sha256" not in only_second.output
    assert only_second.exit_code == 0
    assert "only in A" in gfmd("diff", "small.h5", "one.h5").output


def test_pressures_may_be_given_in_pascal(gfmd):
    result = gfmd(
        "run", "spec.toml", "--set", "load={pressure=[1e3, 1e5]}", "--set",
        "elastomer={kind='half-space', E_star=1e6}",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    rows = list(csv.DictReader(io.StringIO(gfmd("export", "small.h5").output)))
    for row, pressure in zip(rows, (1e3, 1e5), strict=True):
        assert float(row["pressure"]) == pytest.approx(pressure, rel=1e-14)
        assert float(row["p_star"]) * float(row["delta_sigma"]) == pytest.approx(pressure)


def test_the_schema_is_json(gfmd):
    assert json.loads(gfmd("schema").output)["required"]


def test_the_shipped_schema_is_that_of_the_models(gfmd):
    """Else: python scripts/reference_pages.py."""
    shipped = Path(gfmd_cli.__file__).with_name("run-spec.schema.json")
    assert json.loads(shipped.read_text()) == json.loads(gfmd("schema").output)


@pytest.mark.parametrize("name", sorted(main.commands))
def test_the_help_of_each_command_has_an_example(gfmd, name):
    assert f"gfmd {name}" in gfmd(name, "--help").output.partition("Example")[2]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_are_told_how_to_complete(gfmd, shell):
    assert "_GFMD_COMPLETE" in gfmd("completion", shell).output


def test_help_is_quick_to_load():
    heavy = ("numpy", "h5py", "pyfftw", "pydantic", "tqdm")
    code = (
        "import sys; from click.testing import CliRunner; from gfmd_cli.cli import main;"
        "assert 'Commands:' in CliRunner().invoke(main, ['--help']).output;"
        f"print([m for m in {heavy} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_run_loads_only_what_it_needs():
    heavy = ("scipy.interpolate", "scipy.optimize", "matplotlib", "xarray")
    code = f"import sys, gfmd_cli.study.run; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


SMALL_SETTINGS = {
    "smoke": (),
    "observables": ("surface.cutoff=0.05", "grid.points=64"),
    "bench": ("surface.cutoff=0.05", "grid.points=64"),
    "demo": ("surface.cutoff=0.05", "grid.points=64", "load.p_star=[0.1,1.0]"),
    "slab": ("surface.cutoff=0.05", "grid.points=64", "load.p_star=[0.01,0.1]"),
    "ridge": ("grid.points=128",),
    "hertz": ("grid.points=64", "load.pressure=1e-3"),
    "accuracy": ("surface.seed=[0,1]", "load.p_star=0.3"),
    "stress-distribution": ("grid.points=[32,64]", "elastomer.n=[1,3]", "surface.seed=[0,1]"),
    "afm-scan": ("grid.points=256", "load.pressure=1e6"),
}


COARSE = ("grid.points=64", "surface.cutoff=0.05", "solver.tolerance=1e-4")
ONE_SEED = (*COARSE, "surface.seed=0")
ROUGH = (*COARSE, "surface.seed=[0, 1]")
TWO = "load.p_star=[0.1, 1.0]"
PAPER_SETTINGS = {
    "fig01": ("grid.points=128", "load.tolerance=0.8"),
    "fig02": ("grid.points=64",),
    "kappa": ("grid.points=64", "load={contact_area=0.05, tolerance=0.1}", "solver.tolerance=1e-6"),
    "fig04": ROUGH,
    "fig05": ROUGH,
    "fig06": (*ROUGH, TWO),
    "fig07": ROUGH,
    "fig09b": (*ROUGH, TWO),
    "fig10": (*ROUGH, TWO),
    "fig10b": (*ROUGH, TWO),
    "fig11": (*ROUGH, TWO),
    "fig12": ("grid.points=256", TWO),
    "fig13": ROUGH,
    "large_cell": ONE_SEED,
    "light": (*ROUGH, TWO),
    "small_pressure": (*ONE_SEED, TWO),
    "cut_off": (*ROUGH, TWO),
    "weights": ONE_SEED,
    "plate_map": ROUGH,
    "spacing": ROUGH,
}


@pytest.mark.parametrize(
    "config",
    sorted([*CONFIGS.glob("*.toml"), *CONFIGS.glob("paper/*.toml")]),
    ids=lambda path: path.stem,
)
def test_every_config_runs_on_a_small_grid(gfmd, config):
    if config.stem == "afm-scan":
        pytest.importorskip("SurfaceTopography")
    small = (SMALL_SETTINGS | PAPER_SETTINGS)[config.stem]
    settings = [word for s in small for word in ("--set", s)]
    result = gfmd("run", config, "-o", "study.h5", *settings)
    assert result.exit_code == 0, result.output
    assert gfmd("analyze", "study.h5").exit_code == 0


def test_a_study_is_no_height_map_unless_it_holds_heights(gfmd):
    gfmd("run", "spec.toml", "--set", "elastomer.n=0")
    result = gfmd("surface", "small.h5")
    assert result.exit_code == 2
    assert 'a study that stores no heights; give fields = ["height"]' in result.output
    gfmd("run", "spec.toml", "--set", "elastomer.n=0", "--set", 'output.fields=["u", "height"]')
    result = gfmd("surface", "small.h5")
    assert result.exit_code == 2
    name = re.search(r"its height maps: (\S+/height), \S+/height$", result.output.strip())[1]
    result = gfmd("surface", "small.h5", "--set", f"surface.dataset={name}")
    assert result.exit_code == 0, result.output
    assert "64 x 64 points" in result.output
