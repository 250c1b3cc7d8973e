import json
import tomllib
from itertools import pairwise
from pathlib import Path

import jsonschema
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.study.parse import read_spec
from gfmd_cli.study.schema import spec_schema
from gfmd_cli.study.spec import differences
from gfmd_cli.study.tasks import plan

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
BASE = """\
[study]
name = "base"
[surface]
kind = "self-affine"
cutoff = 0.05
[elastomer]
kind = "power"
n = 1
[grid]
points = 64
[load]
p_star = [0.1, 1.0]
"""


@pytest.fixture
def read(tmp_path):
    """Reads BASE with some of its text replaced, and overrides."""

    def read(*changes, overrides=()):
        text = BASE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "spec.toml"
        path.write_text(text)
        return read_spec(path, overrides)[0]

    return read


def test_a_spec_with_defaults_is_filled_in(read):
    spec = read()
    assert spec.study.name == "base"
    assert spec.surface[0].hurst == 0.8
    assert spec.solver[0].tolerance == 1e-6
    assert spec.load.values() == [0.1, 1.0]
    assert spec.output.histogram


def test_lists_make_sweeps_that_multiply(read):
    spec = read(
        ("n = 1", "n = [0, 1, 2]"), ("cutoff = 0.05", "cutoff = 0.05\nseed = [3, 4]\nhurst=[0.5,1]")
    )
    assert len(spec.surface) == 4
    assert len(plan(spec)) == 4 * 3 * 2


def test_equal_entries_of_a_list_are_one_task(read):
    assert len(plan(read(("n = 1", "n = [1, 1.0]"), ("[0.1, 1.0]", "[0.1, 0.1]")))) == 1


def test_several_tables_of_one_kind_are_a_sweep_too(read):
    spec = read(
        (
            '[elastomer]\nkind = "power"\nn = 1',
            '[[elastomer]]\nkind="power"\nn=[1,2]\n[[elastomer]]\nkind="slab"\nthickness=0.1',
        )
    )
    assert [e.kind for e in spec.elastomer] == ["power", "power", "slab"]


def test_a_ladder_hits_both_ends_with_even_steps(read):
    pressures = read(("[0.1, 1.0]", "{ from = 1e-3, to = 3.0, per_decade = 4 }")).load.values()
    assert pressures[0] == pytest.approx(1e-3, rel=1e-15)
    assert pressures[-1] == pytest.approx(3.0, rel=1e-15)
    ratios = {round(b / a, 10) for a, b in pairwise(pressures)}
    assert len(ratios) == 1
    assert 10**0.23 < ratios.pop() < 10**0.27


def test_an_override_replaces_a_key(read):
    spec = read(overrides=("load.p_star=0.5", "elastomer.n=[2, 3]", "study.name=other"))
    assert spec.load.values() == [0.5]
    assert [e.n for e in spec.elastomer] == [2, 3]
    assert spec.study.name == "other"


def test_task_ids_depend_on_content_not_on_place(read):
    wide = plan(read(("n = 1", "n = [0, 1]")))
    narrow = plan(read())
    assert {t.id for t in narrow} < {t.id for t in wide}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("cutoff", "cutof"), ["surface.cutof", "unknown key", "did you mean 'cutoff'", ":5"]),
        (
            ("[grid]", "[gird]"),
            ["unknown table 'gird'", "did you mean 'grid'", "[grid] is missing"],
        ),
        (('"power"', '"powr"'), ["elastomer.kind", "'powr'", "did you mean 'power'", ":7"]),
        (('kind = "power"\n', ""), ["elastomer.kind", "is missing", "half-space"]),
        (("n = 1", 'n = "1"'), ["elastomer.n", "valid number", "'1'", ":8"]),
        (("n = 1", "n = true"), ["elastomer.n", "valid number", "True"]),
        (("n = 1", "n = 4.5"), ["elastomer.n", "less than or equal to 4", "4.5"]),
        (("n = 1", "n = [0, -0.5]"), ["elastomer.n[1]", "greater than or equal to 0", "-0.5"]),
        (("n = 1", "n = nan"), ["elastomer.n", "nan"]),
        (("n = 1", "n = []"), ["elastomer", "0 combinations"]),
        (("n = 1", ""), ["elastomer.n", "is missing"]),
        (("cutoff = 0.05", "hurst = 0"), ["surface.hurst", "greater than 0", "got 0"]),
        (("cutoff = 0.05", "hurst = 1.1"), ["surface.hurst", "less than or equal to 1", "1.1"]),
        (("points = 64", "points = 65"), ["grid.points", "multiple of 2", "65"]),
        (("points = 64", "points = 4"), ["grid.points", "greater than or equal to 8", "4"]),
        (("points = 64", "points = 64.5"), ["grid.points", "integer", "64.5"]),
        (("[0.1, 1.0]", "[0.1, 0.0]"), ["load.p_star[1]", "greater than 0", "0.0"]),
        (("[0.1, 1.0]", "-1"), ["load.p_star", "greater than 0", "-1"]),
        (("[0.1, 1.0]", "[]"), ["load.p_star", "at least 1 item"]),
        (("[0.1, 1.0]", "{from=1, to=0.1}"), ["load.p_star", "lies below"]),
        (("[0.1, 1.0]", "{from=1, too=2}"), ["load.p_star.too", "did you mean 'to'"]),
        (
            ("[0.1, 1.0]", "0.1\npressure = 1"),
            ["load", "give one of p_star, pressure, contact_area, mean_gap"],
        ),
        (("[study]", "[study"), ["TOML syntax"]),
        (('"base"', '"../x"'), ["study.name", "pattern"]),
        (
            ("[study]", "[solver]\ntolerance = 0\n[study]"),
            ["solver.tolerance", "greater than or equal to 0.00000"],
        ),
        (
            ("[study]", '[solver]\nkind = "fire"\nprecision = "single"\n[study]'),
            ["solver", "precision", "fire"],
        ),
        (("[study]", "surface = 3\n[study]"), ["TOML syntax"]),
        (("[study]", "x" + ".x" * 5000 + " = 1\n[study]"), ["5000 dots in a line"]),
        (("[study]", "x = {x" + ".x" * 5000 + " = 1}\n[study]"), ["5000 dots in a line"]),
        (("[study]", "x" + ".x" * 20 + " = 1\n[study]"), ["nested deeper"]),
        (("[study]", "x = " + "[" * 5000 + "\n[study]"), ["nested deeper"]),
    ],
)
def test_bad_input_names_key_place_and_what_is_allowed(read, change, words):
    with pytest.raises(InputError) as error:
        read(change)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("load.p_star=-1", ["--set load.p_star=-1", "greater than 0"]),
        ("nonsense", ["key.name=value"]),
        ("study.name.x=1", ["no table"]),
        ("grid.points={", ["no TOML value"]),
    ],
)
def test_a_bad_override_is_named(read, override, words):
    with pytest.raises(InputError) as error:
        read(overrides=(override,))
    for word in words:
        assert word in str(error.value)


def test_all_that_is_wrong_is_said_at_once(read):
    with pytest.raises(InputError) as error:
        read(("points = 64", "points = 65"), ("n = 1", "n = 5"), ("cutoff", "cutof"))
    assert len(str(error.value).splitlines()) == 3


def test_an_unresolved_cutoff_names_the_grid_that_would_do(read):
    with pytest.raises(InputError, match=r"64 points .* 100 or more"):
        plan(read(("0.05", "0.02")))
    assert plan(read(("0.05", "0.02"), ("points = 64", "points = 100")))


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"#" * 300_000])
def test_a_file_that_is_no_spec_is_refused(tmp_path, content):
    path = tmp_path / "spec.toml"
    path.write_bytes(content)
    with pytest.raises(InputError):
        read_spec(path)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_spec(tmp_path / "none.toml")


def test_differences_name_the_keys_that_changed():
    old = {"a": {"b": 1, "c": [1, 2]}, "d": 0}
    assert differences(old, old) == []
    assert differences(old, {"a": {"b": 2, "c": [1, 3]}, "e": 5}) == [
        "a.b: 1 -> 2",
        "a.c[1]: 2 -> 3",
        "d: 0 -> null",
        "e: null -> 5",
    ]


@pytest.mark.parametrize("path", CONFIGS, ids=lambda p: p.stem)
def test_every_config_is_valid_under_the_schema_and_the_models(path):
    schema = json.loads(json.dumps(spec_schema()))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(tomllib.loads(path.read_text()), schema)
    assert plan(read_spec(path)[0])


@pytest.mark.parametrize("change", [("n = 1", 'n = "1"'), ("points = 64", "points = 65")])
def test_the_schema_refuses_what_the_models_refuse(change):
    data = tomllib.loads(BASE.replace(*change))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, spec_schema())


def test_two_sweeps_differ_in_the_values_of_their_keys():
    old = [{"kind": "a", "hurst": h, "seed": s} for h in (0.3, 0.8) for s in range(5)]
    new = [{"kind": "a", "hurst": h, "seed": s} for h in (0.3, 0.8) for s in range(7)]
    told = differences({"surface": old}, {"surface": new})
    assert told == ["surface.seed: [0, 1, 2, 3, 4] -> [0, 1, 2, 3, 4, 5, 6]"]
    assert differences([{"n": 1}], [{"n": 1}, {"n": 2}], "elastomer") == [
        "elastomer.n: 1 -> [1, 2]"
    ]


def test_an_override_of_the_load_takes_the_place_of_what_the_file_says(tmp_path):
    (tmp_path / "spec.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\npressure = 1e6\n"
    )
    load = read_spec(tmp_path / "spec.toml", ("load.p_star=0.5",))[0].load
    assert (load.quantity, load.values()) == ("p_star", [0.5])


def test_other_combinations_of_the_same_values_are_another_sweep():
    few = [{"hurst": 0.3, "seed": 0}, {"hurst": 0.8, "seed": 1}]
    every = [{"hurst": h, "seed": s} for h in (0.3, 0.8) for s in (0, 1)]
    assert differences({"surface": few}, {"surface": every})
