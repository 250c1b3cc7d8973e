"""Plans of transforms that were changed and given a valid checksum again."""

import json
import os
import random
import re

import numpy as np
import pyfftw
import pytest

from gfmd_cli.grid import plans
from gfmd_cli.grid.fft_grid import Grid

COUNT = 10 * int(os.environ.get("GFMD_FORGERIES", "10"))  # `make test-kills` takes 200
POINTS = 30


@pytest.fixture
def wisdom(tmp_path, monkeypatch, small_plans_measured):
    """What FFTW measured for a grid; a folder to keep it in. The cache is empty before."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    plans.plan_with(tmp_path)
    Grid(POINTS).transform()
    yield plans.read_wisdom(tmp_path)
    plans.plan_with(None)


def keep(folder, wisdom, text=None):
    """Keep wisdom in a folder, with a valid checksum; `text` replaces that in double precision."""
    ((key, (double, single)),) = wisdom.items()
    plans._write(folder, {key: [text or double, single]})
    plans._known.clear()


def text_of(wisdom):
    """The text in double precision of the only group of transforms."""
    ((double, _),) = wisdom.values()
    return double


def test_wisdom_as_fftw_writes_it_is_read(wisdom, tmp_path):
    keep(tmp_path, wisdom)
    assert plans.read_wisdom(tmp_path) == wisdom
    assert plans._limited(wisdom) == wisdom


def test_a_link_in_the_place_of_wisdom_is_damage(wisdom, tmp_path):
    path = plans._path(tmp_path)
    for target in ("nowhere", "long" * 100):
        path.unlink()
        path.symlink_to(target)
        assert "damaged" in plans.plan_with(tmp_path)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_flags_of_too_many_bits_which_abort_fftw_are_not_read(wisdom, tmp_path, place):
    numbers = ["#x11bdd", "#x11bdd", "#x0"]
    numbers[place] = ["#x11bdd0", "#x11bdd0", "#x200"][place]
    line = "  (fftw_rdft2_nop_register 0 {} #x1 #x2 #x3 #x4)\n)\n".format(" ".join(numbers))
    keep(tmp_path, wisdom, text_of(wisdom)[:-2] + line)
    assert plans.read_wisdom(tmp_path) is None


def forged(text, rng):
    """The text with other solvers, other flags, exchanged problems, or other letters."""
    lines = text.splitlines()
    for _ in range(rng.randint(1, 4)):
        one, other = (rng.randrange(1, len(lines) - 1) for _ in range(2))
        words, others = lines[one].split(), lines[other].split()
        how = rng.randrange(4)
        if how == 0:
            words[:2] = others[:2]
        elif how == 1:
            words[rng.randrange(2, 5)] = f"#x{rng.getrandbits(rng.choice([9, 20, 32])):x}"
        elif how == 2:
            words[5:] = others[5:]
        else:
            at = rng.randrange(len(words))
            words[at] = re.sub("[0-9a-f]", rng.choice("0123456789abcdef-("), words[at], count=1)
        lines[one] = "  " + " ".join(words)
    return "\n".join(lines) + "\n"


def transformed():
    """Coefficients of a random field by FFTW and by NumPy."""
    grid, field = Grid(POINTS), np.random.default_rng(0).normal(size=(POINTS, POINTS))
    grid.padded[...] = 0.0
    grid.padded[:, :POINTS] = field
    grid.transform()
    return grid.work, np.fft.rfft2(field)


def test_forged_plans_change_no_number(wisdom, tmp_path):
    rng, read = random.Random(0), 0
    for _ in range(COUNT):
        keep(tmp_path, wisdom, forged(text_of(wisdom), rng))
        read += plans.read_wisdom(tmp_path) is not None
        values, exact = transformed()
        assert np.abs(values - exact).max() < 1e-12 * np.abs(exact).max()
    assert 0 < read < COUNT


def test_the_checksum_of_wisdom_is_read(wisdom, tmp_path):
    keep(tmp_path, wisdom)
    (path,) = tmp_path.glob("wisdom-*.json")
    data = json.loads(path.read_text())
    next(iter(data["wisdom"].values())).reverse()
    path.write_text(json.dumps(data))
    assert plans.read_wisdom(tmp_path) is None


@pytest.mark.usefixtures("small_plans_measured")
def test_the_cache_of_plans_stays_small(tmp_path, monkeypatch):
    """Every new size reads and writes all of it; a process that was killed left a part of it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(plans, "MAX_CACHED_LINES", 100)
    cache = tmp_path / "gfmd"
    cache.mkdir()
    (cache / f".{plans._path(cache).name}.0123abcd").write_text("half")
    study = tmp_path / "study.parts"
    study.mkdir()
    for folder in (None, study, None):
        plans.plan_with(folder)
        for points in (34, 38, 46, 58, 62):
            Grid(points).transform()
            assert 0 < lines_of(plans.read_wisdom(cache)) <= 100
    plans.plan_with(None)
    Grid(62).transform()  # the last one is known, the first was dropped
    assert sorted(path.name for path in cache.iterdir()) == ["planning", plans._path(cache).name]
    assert set(plans.read_wisdom(cache)) < set(plans.read_wisdom(study))
    assert lines_of(plans.read_wisdom(study)) > 100


def lines_of(wisdom):
    return sum(len(text.splitlines()) for texts in wisdom.values() for text in texts)


def test_plans_do_not_depend_on_what_else_is_known(wisdom, tmp_path, monkeypatch):
    """FFTW takes parts of a plan from what it knows: at each plan it knows the same."""
    by_wisdom, known = plans._by_wisdom, []

    def note(texts, make, fftw):
        def watched(fftw):
            known.append(sorted("".join(plans._export()).splitlines()))
            return make(fftw)

        return by_wisdom(texts, watched, fftw)

    monkeypatch.setattr(plans, "_by_wisdom", note)
    for sizes in ((POINTS,), (2 * POINTS, 90, POINTS)):
        plans.plan_with(tmp_path)
        for points in sizes:
            Grid(points).transform()
    assert known[0] == known[-1]
    assert known[0] != known[1]


@pytest.mark.usefixtures("small_plans_measured")
@pytest.mark.parametrize("way", ["estimated", ""])
def test_a_process_searches_for_the_plans_of_a_grid_once(tmp_path, monkeypatch, way):
    """Also where FFTW has planned another one since; an estimate of 1024^2 takes 20 ms or more."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("GFMD_PLANS", way)
    monkeypatch.setattr(plans, "_estimates", {})
    plans.plan_with(None)
    for points in (26, 34):
        Grid(points).transform()
    flags, make = set(), pyfftw.FFTW

    def note(*arrays, **options):
        flags.add(options["flags"])
        return make(*arrays, **options)

    monkeypatch.setattr(pyfftw, "FFTW", note)
    Grid(26).transform()
    assert flags == {("FFTW_ESTIMATE" if way else "FFTW_MEASURE", "FFTW_WISDOM_ONLY")}


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("processor : 0\nmodel name : A 1\nprocessor : 1\nmodel name : A 1\n", "A 1"),
        ("processor : 0\nCPU implementer : 0x41\nCPU part : 0xd40\nCPU part : 0xd41\n",
         "0x41 0xd40 0xd41"),
    ],
)  # fmt: skip
def test_processors_of_all_kinds_have_names(monkeypatch, text, name):
    monkeypatch.setattr(plans.Path, "read_text", lambda *_, **__: text)
    assert plans.processor.__wrapped__() == name
