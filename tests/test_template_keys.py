"""Keys set in the text of a commented spec: `gfmd init --set`."""

import tomllib

import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.spec.starter import with_keys

TEXT = """\
[elastomer]
kind = "power"              # a comment
n = [1, 2]                  # another

[load]
p_star = 0.1                # p*
#pressure = 1e5             # [Pa], instead

#[accuracy]
#mean_gap = 0.01            # requested
#contact_area = 0.05        # likewise
"""


@pytest.mark.parametrize("value", [1e-8, 7e10, 1.5, 1.234567890123e-8, 100000.0])
def test_numbers_are_written_as_people_do_and_without_loss(value):
    (line,) = with_keys("[solver]\n", (f"solver={{tolerance={value!r}}}",)).splitlines()[1:]
    assert tomllib.loads(line)["tolerance"] == value
    assert "+" not in line
    assert "e0" not in line


def test_a_key_takes_the_place_of_its_line():
    changed = with_keys(TEXT, ("elastomer.n=3",))
    assert changed.splitlines()[2] == "n = 3                       # as given on the command line"
    assert len(changed.splitlines()) == len(TEXT.splitlines())


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (("load.pressure=[1e5, 2e5]",), {"load": {"pressure": [1e5, 2e5]}}),
        (("accuracy.contact_area=0.1",), {"accuracy": {"contact_area": 0.1}}),
        (("solver.tolerance=1e-8",), {"solver": {"tolerance": 1e-8}}),
        (("elastomer.kind=half-space",), {"elastomer": {"kind": "half-space"}}),
        (
            ("elastomer.E_star=7e10", "elastomer.kind='half-space'"),
            {"elastomer": {"kind": "half-space", "E_star": 7e10}},
        ),
        (("load.tolerance=0.1",), {"load": {"p_star": 0.1, "tolerance": 0.1}}),
        (("accuracy={mean_gap=0.01}",), {"accuracy": {"mean_gap": 0.01}}),
        (("elastomer={kind='half-space'}",), {"elastomer": {"kind": "half-space"}}),
        (
            ("load.p_star={from=1e-3, to=1}", "load.p_star.per_decade=2"),
            {"load": {"p_star": {"from": 1e-3, "to": 1, "per_decade": 2}}},
        ),
        (("output.fields=['u', 'sigma']",), {"output": {"fields": ["u", "sigma"]}}),
        (("solver.tolerance=1.234567890123e-8",), {"solver": {"tolerance": 1.234567890123e-8}}),
        (("study.name=first",), {"study": {"name": "first"}}),
        (("sweep=[{paired=['a.b', 'c.d']}]",) * 2, {"sweep": [{"paired": ["a.b", "c.d"]}]}),
    ],
)
def test_a_key_changes_its_table_only(overrides, expected):
    before = tomllib.loads(TEXT)
    assert tomllib.loads(with_keys(TEXT, overrides)) == before | expected


@pytest.mark.parametrize("override", ["n=3", "load.p star=1", "load.", "load"])
def test_anything_but_a_key_of_a_table_is_refused(override):
    with pytest.raises(InputError, match=r"--set .*: write (table|key)\.\w+=value, such as"):
        with_keys(TEXT, (override,))
