import json
import re
import tomllib
from contextlib import nullcontext
from pathlib import Path

import jsonschema
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from specs import power_spec

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import is_solved
from gfmd_cli.spec.differences import differences
from gfmd_cli.spec.parse import read_spec, read_tables
from gfmd_cli.spec.schema import spec_schema
from gfmd_cli.study.tasks import plan

CONFIGS = sorted((Path(__file__).parents[1] / "configs").glob("*.toml"))
BASE = power_spec(n=1, points=64, p_star=[0.1, 1.0], cutoff=0.05, name="base")


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


def test_loads_that_agree_in_fourteen_digits_are_one_task(read):
    assert len(plan(read(("[0.1, 1.0]", "[0.1, 0.10000000000000002]")))) == 1


@pytest.mark.parametrize("length_y", ["1e+30", "1e-30"])
@pytest.mark.parametrize("points_y", ["", "\npoints_y = 64"])
def test_a_cell_of_too_different_sides_is_refused(read, length_y, points_y):
    spec = read(
        ("cutoff = 0.05", f"cutoff = 0.05\nlength_y = {length_y}"),
        ("points = 64", f"points = 64{points_y}"),
    )
    with pytest.raises(InputError, match=f"surface.length_y = {re.escape(length_y)} m is out of"):
        plan(spec)


@pytest.mark.parametrize("length", ["1e-31", "1e31"])
@pytest.mark.parametrize("key", ["length", "length_y"])
def test_lengths_out_of_range_are_refused(read, key, length):
    with pytest.raises(InputError, match=rf"surface\.{key}: must be (less|greater) than or equal"):
        read(("cutoff = 0.05", f"cutoff = 0.05\n{key} = {length}"))


def test_several_tables_of_one_kind_are_a_sweep_too(read):
    spec = read(
        (
            '[elastomer]\nkind = "power"\nn = 1',
            '[[elastomer]]\nkind="power"\nn=[1,2]\n[[elastomer]]\nkind="slab"\nthickness=0.1',
        )
    )
    assert [e.kind for e in spec.elastomer] == ["power", "power", "slab"]


def sequence(read, **keys):
    pairs = ", ".join(f"{key.strip('_')} = {value!r}" for key, value in keys.items())
    return read(("p_star = [0.1, 1.0]", f"pressure = {{ {pairs} }}"))


def test_a_sequence_has_a_fixed_step_and_stays_below_its_end(read):
    pressures = sequence(read, from_=1e-3, to=3.0, per_decade=4).load.values()
    expected = [1e-3 * 10 ** (i / 4) for i in range(14)]
    assert pressures == pytest.approx(expected, rel=1e-14, abs=0)
    assert pressures[-1] <= 3.0 < pressures[-1] * 10**0.25


@pytest.mark.parametrize(("first", "to"), [(1e-3, 1.0), (0.003, 0.3), (7e4, 7e7), (1e-300, 1e300)])
@pytest.mark.parametrize("per_decade", [1, 3])
def test_the_end_of_a_sequence_is_a_value_if_it_is_one_of_the_sequence(read, first, to, per_decade):
    pressures = sequence(read, from_=first, to=to, per_decade=per_decade).load.values()
    assert pressures[-1] == pytest.approx(to, rel=1e-12)
    assert max(pressures) <= to * (1 + 1e-12)


@pytest.mark.parametrize("per_decade", [1, 3, 1000])
def test_a_sequence_of_reduced_pressures_may_end_at_the_largest_one(read, per_decade):
    """Its last value, 1e-5 * 10^11, is above 1e6 by rounding."""
    ends = f"load.p_star={{from=1e-5, to=1e6, per_decade={per_decade}}}"
    assert read(overrides=(ends,)).load.values()[-1] == pytest.approx(1e6, rel=1e-12)
    assert is_solved(1e6 * (1 + 1e-13))
    with pytest.raises(InputError, match=r"p_star must be from 1e-30 to 1e\+06, got 1000000\.1"):
        read(overrides=("load.p_star=1000000.1",))


@given(
    first=st.floats(1e-6, 1e6), decades=st.floats(0, 4), more=st.floats(0, 4), per=st.floats(0.5, 9)
)
@settings(max_examples=200)
@example(first=1.0, decades=1.0, more=1.0, per=1.9999999998840412)
@example(first=100000.701171875, decades=1.9999999999999996, more=1.0, per=1.0)
def test_a_longer_sequence_moves_no_task(first, decades, more, per):
    short, long = (
        {task.id for task in plan(read_tables(tomllib.loads(BASE) | {"load": {"pressure": ends}}))}
        for ends in (
            {"from": first, "to": first * 10**d, "per_decade": per}
            for d in (decades, decades + more)
        )
    )
    assert short <= long


def test_a_sequence_that_ends_below_its_second_value_has_one(read):
    assert sequence(read, from_=0.1, to=0.2, per_decade=2).load.values() == [0.1]


def test_an_override_replaces_a_key(read):
    spec = read(overrides=("load.p_star=0.5", "elastomer.n=[2, 3]", "study.name=other"))
    assert spec.load.values() == [0.5]
    assert [e.n for e in spec.elastomer] == [2, 3]
    assert spec.study.name == "other"


def test_task_ids_depend_on_content_not_on_place(read):
    wide = plan(read(("n = 1", "n = [0, 1]")))
    narrow = plan(read())
    assert {t.id for t in narrow} < {t.id for t in wide}
    assert {t.scene_id for t in narrow} < {t.scene_id for t in wide}


def test_task_ids_do_not_depend_on_the_output(read):
    more = read(("[study]", '[output]\nfields = ["u"]\nstiffness = true\n[study]'))
    assert [t.id for t in plan(more)] == [t.id for t in plan(read())]
    assert more.output.names() == {"histogram", "fields.u", "stiffness"}
    assert read().output.with_names(more.output.names()).names() == more.output.names()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("cutoff", "cutof"), ["surface.cutof", "unknown key", "did you mean 'cutoff'", ":5"]),
        (("cutoff = 0.05", "h_rms = 1e-6"), ["surface.h_rms", "did you mean 'h_std'"]),
        (("cutoff = 0.05", "side = 1e-6"), ["surface.side", "did you mean 'length'"]),
        (("cutoff = 0.05", "height = 1e-6"), ["unknown key 'height' (known: "]),
        (("points = 64", "points = 64\npoints_x = 9"), ["points_x", "did you mean 'points'"]),
        (
            ("[grid]", "[gird]"),
            ["unknown table 'gird'", "did you mean 'grid'", "[grid] is missing"],
        ),
        (('"power"', '"powr"'), ["elastomer.kind", "'powr'", "did you mean 'power'", ":7"]),
        (('kind = "power"\n', ""), ["elastomer.kind", "is missing", "half-space"]),
        (("n = 1", 'n = "1"'), ["elastomer.n", "valid number", "'1'", ":8"]),
        (("n = 1", "n = true"), ["elastomer.n", "valid number", "got true"]),
        (("n = 1", "n = 2026-01-02"), ["elastomer.n", "valid number, got 2026-01-02"]),
        (("[study]", "[output]\nspectra = 1\n[study]"), ["must be true or false, got 1"]),
        (("n = 1", "n = 4.5"), ["elastomer.n", "less than or equal to 4", "4.5"]),
        (("n = 1", "n = [0, -0.5]"), ["elastomer.n[1]", "greater than or equal to 0", "-0.5"]),
        (("n = 1", "n = nan"), ["elastomer.n", "nan"]),
        (("n = 1", "n = []"), [":8: elastomer.n: must have 1 or more values"]),
        (("n = 1", ""), ["elastomer.n", "is missing"]),
        (("cutoff = 0.05", "hurst = 0"), ["surface.hurst", "greater than 0", "got 0"]),
        (("cutoff = 0.05", "hurst = 1.1"), ["surface.hurst", "less than or equal to 1", "1.1"]),
        (("points = 64", "points = 64\npoints_y = 7"), ["grid.points_y", "equal to 8", "7"]),
        (("points = 64", "points = 4"), ["grid.points", "greater than or equal to 8", "4"]),
        (
            ("points = 64", 'points = "64"'),
            ["grid.points", 'a whole number of points, or "auto"', "without quotation marks"],
        ),
        (
            ("points = 64", 'points = "many"'),
            ["grid.points", 'or "auto"', "'many'"],
        ),
        (("points = 64", "points = 64.5"), ["grid.points", "integer", "64.5"]),
        (("[0.1, 1.0]", "[0.1, 0.0]"), ["load.p_star[1]", "greater than 0", "0.0"]),
        (("[0.1, 1.0]", "-1"), ["load.p_star", "greater than 0", "-1"]),
        (("[0.1, 1.0]", "[]"), ["load.p_star", "must have 1 or more values, got []"]),
        (("[0.1, 1.0]", "[0.1, 1e26]"), ["load: p_star", "from 1e-30 to 1e+06", "got 1e+26"]),
        (("[0.1, 1.0]", "{from=1e-300, to=1}"), ["load: p_star", "got 1e-300"]),
        (("[0.1, 1.0]", "{from=1, to=0.1}"), ["load.p_star", "lies below"]),
        (("[0.1, 1.0]", "{from=1, too=2}"), ["load.p_star.too", "did you mean 'to'"]),
        (
            ("p_star = [0.1, 1.0]", "contact_area = {from=0.1, to=0.5}"),
            [":12: load.contact_area: must be a number or a list", "got {'from': 0.1, 'to': 0.5}"],
        ),
        (("p_star = [0.1, 1.0]", "contact_area = 50"), ["load.contact_area", "less than 1", "50"]),
        (("n = 1", "n = {a=1}"), ["elastomer.n: must be a valid number, got {'a': 1}"]),
        (
            ("[0.1, 1.0]", "0.1\npressure = 1"),
            ["load", "give one of p_star, pressure, contact_area, mean_gap"],
        ),
        (("[study]", "[study"), [":1: [study: TOML syntax", "Expected ']'"]),
        (("[0.1, 1.0]", "0,1"), [":12: p_star = 0,1: ", "decimal point"]),
        (('"power"', "power"), [":7: kind = power: ", "in quotation marks"]),
        (("cutoff = 0.05", r'path = "C:\Users\map.npy"'), [r"5: path = ", "in single quotes"]),
        (("cutoff = 0.05", r'path = "C:\data\map.npy"'), [r"5: path = ", "in single quotes"]),
        (
            ("cutoff = 0.05", r'path = "C:\temp\new.npy"'),
            [r"5: surface.path: no such file 'C:\temp", "in single quotes"],
        ),
        (("n = 1", "n = 1\nn = 2"), [":9: n = 2: ", "was given before"]),
        (("\n", "\r"), [":1: [study]: TOML syntax: its lines end in a carriage return alone"]),
        (("[grid]", "[surface]"), [":9: [surface]: ", "was given before"]),
        (('"base"', '"../x"'), ["study.name", "only letters, digits"]),
        (
            ("[study]", "[solver]\ntolerance = 0\n[study]"),
            ["solver.tolerance", "greater than or equal to 1e-16"],
        ),
        (
            ("[study]", '[solver]\nkind = "fire"\ntime_step = 2.0\n[study]'),
            ["solver.time_step", "less than 2", "got 2.0", ":3"],
        ),
        (
            ("[study]", "[solver]\ntime_step = 1.0\n[study]"),
            ["unknown key 'time_step'", "known: kind, tolerance", "kind fire has it"],
        ),
        (
            ("[study]", '[solver]\nkind = "frie"\n[study]'),
            ["solver.kind", "'frie'", "did you mean 'fire'", "polonsky-keer"],
        ),
        (
            ("[study]", f"[solver]\nmax_steps = {2**63}\n[study]"),
            ["solver.max_steps", "less than 9223372036854775808"],
        ),
        (
            ("[0.1, 1.0]", "{from=0.1, to=1, per_decade=1e-308}"),
            ["load.p_star.per_decade", "greater than or equal to 0.001", "1e-308"],
        ),
        (
            ("p_star = [0.1, 1.0]", "pressure = {from=1e-60, to=1e60, per_decade=1000}"),
            ["load.pressure: a sequence of 120001 values; at most 100000 are allowed"],
        ),
        (
            ("[grid]", f"[output]\nfields = {5 * ['u']}\n[grid]"),
            ["output.fields: must have at most 4 values, got ['u', "],
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
        ("study.name.x=1", ["not a table"]),
        ("grid.points={", ["not a TOML value"]),
        ("load.p_star=0.1\n[study]\nname='other'", ["is not a TOML value"]),
        ("surface={kind='file', path=\"a\\u0000b\"}", ["surface.path", "no such file"]),
        ("gird.points=8", ["--set gird.points=8: unknown table 'gird'"]),
    ],
)
def test_a_bad_override_is_named(read, override, words):
    with pytest.raises(InputError) as error:
        read(overrides=(override,))
    for word in words:
        assert word in str(error.value)


def test_all_that_is_wrong_is_said_at_once(read):
    with pytest.raises(InputError) as error:
        read(("points = 64", "points = 6"), ("n = 1", "n = 5"), ("cutoff", "cutof"))
    assert len(str(error.value).splitlines()) == 3


def test_an_unresolved_cutoff_names_the_grid_that_would_do(read):
    with pytest.raises(InputError, match=r"spec\.toml: .*64 points .* 100 or more"):
        plan(read(("0.05", "0.02")))
    assert plan(read(("0.05", "0.02"), ("points = 64", "points = 100")))


@pytest.mark.parametrize(
    "surface", ["{kind='punch', radius=5e-324}", "{kind='ridge', width=5e-324}"]
)
def test_a_surface_that_takes_more_points_than_can_be_counted_is_refused(read, surface):
    with pytest.raises(InputError, match=r"it takes [12]e\+15, but at most 131072 are allowed"):
        plan(read(overrides=(f"surface={surface}",)))


def test_a_punch_narrower_than_a_spacing_is_refused(read):
    punch = "surface={kind='punch', radius=0.02}"
    with pytest.raises(InputError, match=r"grid\.points: 40 points .*a spacing or more\); use 50"):
        plan(read(overrides=(punch, "grid.points=40")))
    oblong = "surface={kind='punch', radius=0.02, length_y=2}"
    with pytest.raises(InputError, match=r"grid\.points_y: 64 points .*; use 100 or more"):
        plan(read(overrides=(oblong, "grid={points=64, points_y=64}")))
    assert plan(read(overrides=(punch, "grid.points=50")))


def test_a_limit_of_points_below_those_that_are_given_is_refused(read):
    accuracy = "accuracy={mean_gap=0.1, max_points=32}"
    with pytest.raises(InputError, match=r"accuracy\.max_points: 32 given, but grid.points = 64"):
        read(overrides=(accuracy,))
    assert read(overrides=(accuracy.replace("32", "64"),))


def test_an_accuracy_needs_a_pressure_that_does_not_change_with_the_grid(read):
    accuracy = "accuracy={mean_gap=0.1}"
    for surface in ("{kind='parabola'}", "{kind='cone'}"):
        words = (f"surface={surface}", accuracy)
        with pytest.raises(InputError, match=r"spec\.toml: load\.p_star: .* give load\.pressure"):
            plan(read(overrides=words))
        assert plan(read(overrides=(*words, "load={pressure=0.1}")))
    assert plan(read(overrides=("surface={kind='wave'}", accuracy)))


def test_a_cutoff_that_no_grid_resolves_names_its_unit(read):
    """Mostly it was given in metres."""
    words = r"takes 2000000, but at most 131072 are allowed; check: surface.cutoff is relative to"
    changes = ("0.05", "1e-6"), ("points = 64", 'points = "auto"')
    for changed, key in ((changes[:1], r"grid\.points"), (changes, r"accuracy\.max_points")):
        with pytest.raises(InputError, match=f"{key}: .*{words}"):
            plan(read(*changed, overrides=("accuracy.mean_gap=0.1",)))


@pytest.mark.parametrize(
    ("content", "words"), [(b"\xff\xfe\x00", "not UTF-8"), (b"#" * 300_000, "too long")]
)
def test_a_file_that_is_no_spec_is_refused(tmp_path, content, words):
    path = tmp_path / "spec.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
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


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (7e10, 2e9, "7e+10 -> 2e+09"),
        ([1e8], [1e8, 2.5e7], "[1e+08] -> [1e+08, 2.5e+07]"),
        (1234567.5, 0.1, "1234567.5 -> 0.1"),
        (1.0000000000000001e-07, 2e-7, "1e-07 -> 2e-07"),
        (0.1, 0.1 + 1e-16, "0.1 -> 0.1000000000000001"),
        ("auto", {"a": 1.0, "b": [True, None]}, '"auto" -> {"a": 1, "b": [true, null]}'),
    ],
)
def test_differences_have_numbers_as_labels_have_them(old, new, text):
    assert differences({"key": old}, {"key": new}) == [f"key: {text}"]


@pytest.fixture(scope="module")
def validator():
    """Checks data by the schema, which is checked to be one."""
    schema = json.loads(json.dumps(spec_schema()))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda p: p.stem)
def test_every_config_is_valid_under_the_schema_and_the_models(validator, path):
    validator.validate(tomllib.loads(path.read_text()))
    assert plan(read_spec(path)[0])


@pytest.mark.parametrize("change", [("n = 1", 'n = "1"'), ("points = 64", "points = 6")])
def test_the_schema_refuses_what_the_models_refuse(change):
    data = tomllib.loads(BASE.replace(*change))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, spec_schema())


def test_two_sweeps_differ_in_the_values_of_their_keys():
    old = [{"kind": "a", "hurst": h, "seed": s} for h in (0.3, 0.8) for s in range(5)]
    new = [{"kind": "a", "hurst": h, "seed": s} for h in (0.3, 0.8) for s in range(7)]
    words = differences({"surface": old}, {"surface": new})
    assert words == ["surface.seed: [0, 1, 2, 3, 4] -> [0, 1, 2, 3, 4, 5, 6]"]
    assert differences([{"n": 1}], [{"n": 1}, {"n": 2}], "elastomer") == [
        "elastomer.n: 1 -> [1, 2]"
    ]


def test_an_override_of_the_load_takes_the_place_of_what_the_file_says(tmp_path):
    (tmp_path / "spec.toml").write_text(
        '[surface]\nkind = "wave"\n[elastomer]\nkind = "half-space"\n'
        "[grid]\npoints = 64\n[load]\npressure = 1e6\n"
    )
    load = read_spec(tmp_path / "spec.toml", ("load.p_star=0.5",))[0].load
    assert (load.key, load.values()) == ("p_star", [0.5])


def test_other_combinations_of_the_same_values_are_another_sweep():
    few = [{"hurst": 0.3, "seed": 0}, {"hurst": 0.8, "seed": 1}]
    every = [{"hurst": h, "seed": s} for h in (0.3, 0.8) for s in (0, 1)]
    assert differences({"surface": few}, {"surface": every})


def test_a_table_without_a_kind_is_of_the_kind_that_chooses(read):
    (solver,) = read(("[study]", "[solver]\ntolerance = 1e-3\n[study]")).solver
    assert (solver.kind, solver.tolerance) == ("auto", 1e-3)


def test_a_parameter_of_one_solver_is_a_key_that_can_be_swept(read):
    solvers = read(("[study]", '[solver]\nkind = "fire"\ntime_step = [0.5, 1.0]\n[study]')).solver
    assert [solver.time_step for solver in solvers] == [0.5, 1.0]


@pytest.mark.parametrize(
    ("change", "place", "words"),
    [
        (("cutoff = 0.05", "cutof = 0.05"), ["surface", "cutof"], "unknown key"),
        (("[study]", "[studdy]"), ["studdy"], "unknown key"),
        (("[study]", "[output]\npatch = true\n[study]"), ["output", "patch"], "unknown key"),
        (("cutoff = 0.05", "hurst = 1.5"), ["surface", "hurst"], "1.5"),
        (("n = 1", 'n = "1"'), ["elastomer", "n"], "'1'"),
        (('"power"', '"powr"'), ["elastomer", "kind"], "'powr' is not one of"),
        (('kind = "power"\n', ""), ["elastomer"], "'kind' is a required property"),
        (("points = 64", "points = 65.5"), ["grid", "points"], "65.5"),
        (
            ("[study]", '[solver]\nkind = "fire"\ntime_step = 3\n[study]'),
            ["solver", "time_step"],
            "3",
        ),
        (("[study]", "[solver]\ntolerance = 2\n[study]"), ["solver", "tolerance"], "2"),
    ],
)  # fmt: skip
def test_the_schema_names_the_key_that_is_wrong(validator, change, place, words):
    error = jsonschema.exceptions.best_match(
        validator.iter_errors(tomllib.loads(BASE.replace(*change)))
    )
    assert list(error.absolute_path) == place
    assert words in error.message


def test_the_schema_names_the_table_of_several_that_is_wrong(validator):
    data = tomllib.loads(BASE) | {"elastomer": [{"kind": "half-space"}, {"kind": "power", "n": 5}]}
    (error,) = validator.iter_errors(data)
    assert list(error.absolute_path) == ["elastomer", 1, "n"]


@pytest.mark.parametrize(
    ("solver", "valid"),
    [
        ({"tolerance": 1e-3}, True),
        ({"kind": "fire", "time_step": [0.5, 1.0]}, True),
        ({"kind": ["pcg", "fire"], "tolerance": [1e-3, 1e-4]}, True),
        ([{"kind": "pcg"}, {"kind": "fire", "time_step": 1.0}], True),
        ({"time_step": 1.0}, False),
        ({"kind": "fire", "time_step": 2.0}, False),
        ({"kind": ["pcg", "fire"], "time_step": 1.0}, False),
        ({"kind": "frie"}, False),
        ({"kind": []}, False),
    ],
)
def test_the_schema_accepts_the_same_solvers_as_the_models(solver, valid):
    data = tomllib.loads(BASE) | {"solver": solver}
    assert jsonschema.Draft202012Validator(spec_schema()).is_valid(data) == valid
    with nullcontext() if valid else pytest.raises(InputError):
        read_tables(data)


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_a_spec_in_another_encoding_says_how_to_save_it(tmp_path, encoding):
    path = tmp_path / "spec.toml"
    path.write_text("# 5 µm\n[study]\n", encoding=encoding)
    with pytest.raises(InputError, match=r"not UTF-8 text .*: save a spec as UTF-8"):
        read_spec(path)


def test_a_large_scan_in_place_of_a_spec_is_told_from_it(tmp_path):
    scan = tmp_path / "scan.csv"
    scan.write_text(2**18 * "1.0,")
    with pytest.raises(InputError, match=r"too long; .*`gfmd init SPEC --from .*scan\.csv`"):
        read_spec(scan)
