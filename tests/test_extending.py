"""A new elastomer, surface, solver or observable is one declaration, and one name in a list.

They go into a copy of the package, as an author would write them there; then the command line
solves a spec that uses them.
"""

import csv
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gfmd_cli

ROUGH = 'kind = "self-affine"\ncutoff = 0.1'
COATED = '''
class Coated(LinearElastomer):
    """Half-space under a thin soft coating that acts as springs, 1/k = 1/k_0 + 2/(E* q)."""

    kind: Literal["coated"] = "coated"
    E_star: Positive = 1.0
    """Contact modulus of the half-space [Pa]."""
    k_0: Positive
    """Stiffness of the coating [Pa/m]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        half_space = 0.5 * self.E_star * q
        return half_space * self.k_0 / (half_space + self.k_0)


'''
RANDOM_WAVES = '''
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field as Key

from gfmd_cli.spec_table import Positive, Seed
from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.indenters import SMALLEST_GRID, RigidSurface


class RandomWaves(RigidSurface):
    """Cosine waves of random direction, wavelength and phase."""

    rough: ClassVar[bool] = True
    kind: Literal["random-waves"] = "random-waves"
    waves: Annotated[int, Key(gt=0)] = 60
    """Number of waves."""
    highest: Annotated[int, Key(gt=0)] = 8
    """Largest number of periods along a side."""
    seed: Seed = 0
    """Seed of directions and phases."""
    length: Positive = 1.0
    """Side of the cell L [m]."""

    @property
    def band_limited(self) -> bool:
        """True: the smallest grid contains all waves."""
        return True

    def smallest_grid(self) -> int:
        """Four points per shortest wave."""
        return max(SMALLEST_GRID, 4 * self.highest)

    def heights_on(self, grid: Grid) -> Field:
        """Heights h [m] at the points of a grid that this process holds."""
        generator = np.random.default_rng(self.seed)
        modes = generator.integers(-self.highest, self.highest + 1, size=(self.waves, 2))
        x = np.arange(grid.points) / grid.points
        height = grid.empty()
        height[...] = 0.0
        for (m_y, m_x), phase in zip(modes, generator.random(self.waves), strict=True):
            height += np.cos(2 * np.pi * (m_y * x[grid.own, None] + m_x * x + phase))
        return height


'''
DESCENT = '''
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field as Key

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import Solver, State


@dataclass(kw_only=True)
class DescentState(State):
    """State of projected descent."""

    velocity: Field
    """The last move."""


class Descent(Solver):
    """Projected gradient descent with momentum: slow and safe."""

    kind: Literal["descent"] = "descent"
    momentum: Annotated[float, Key(ge=0, lt=1)] = 0.9
    """Fraction of the last move that is added to the next one."""

    state_type: ClassVar[type[State]] = DescentState

    def begin(self, contact: Contact, u: Field) -> DescentState:
        """Start at rest from u, lifted above the indenter."""
        contact.settle(u)
        sigma = contact.stress(u, out=contact.grid.empty())
        return DescentState(u=u, sigma=sigma, transforms=2, velocity=np.zeros_like(u))

    def iterate(self, contact: Contact, state: DescentState) -> Iterator[State]:
        """Advance the state in place, with one pair of transforms a step."""
        length = 1.0 / contact.stiffness.max()
        while True:
            state.residual = contact.residual(state.u, state.sigma)
            yield state
            move = self.momentum * state.velocity - length * state.sigma
            u = np.maximum(state.u + move, contact.height)
            state.velocity, state.u = u - state.u, u
            contact.stress(state.u, out=state.sigma)
            state.transforms += 2
            state.step += 1
'''
OBSERVABLE = """OPTIONAL_OBSERVABLES = (
    OptionalObservable(
        "lowest",
        Column("lowest_point", "depth of the lowest point of the elastomer / h_std"),
        lambda solved: float(-solved.u.min()),
        "lowest point",
        ReducedUnit("h_std", "m", lambda row: float(row["h_std"])),
    ),
"""
OPTION = '''    lowest: bool = False
    """Depth of the lowest point of the elastomer."""

    def on_request('''
SPEC = """
[surface]
{surface}
[elastomer]
{elastomer}
[grid]
points = 128
[load]
p_star = 0.2
[accuracy]
contact_area = 0.1
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the package with all of them, with the compiled kernels of the original."""
    folder = tmp_path_factory.mktemp("package")
    copy = folder / "gfmd_cli"
    shutil.copytree(Path(gfmd_cli.__file__).parent, copy)
    extend(copy / "physics/elastomers.py", COATED, "Elastomer = Annotated[", "Tabulated", "Coated")
    (copy / "physics/random_waves.py").write_text(RANDOM_WAVES)
    imported = "from gfmd_cli.physics.random_waves import RandomWaves\n\n"
    extend(
        copy / "physics/surfaces.py",
        imported,
        "Surface = Annotated[",
        "FileSurface",
        "RandomWaves",
    )
    (copy / "solvers/descent.py").write_text(DESCENT)
    imported = "from gfmd_cli.solvers.descent import Descent\n\n"
    extend(copy / "solvers/auto.py", imported, "AnySolver = Annotated[", "PolonskyKeer", "Descent")
    replace(copy / "study/observables.py", "OPTIONAL_OBSERVABLES = (\n", OBSERVABLE)
    replace(copy / "spec/models.py", "    def on_request(", OPTION)
    return folder


def replace(path, old, new):
    """Replace a text that a file has once."""
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))


def extend(path, class_, union, last, new):
    """Write a class before a union, and its name behind the last one of it."""
    text = path.read_text()
    before, after = text.split(union)
    assert f"| {last}," in after
    path.write_text(
        before + class_.lstrip() + union + after.replace(f"| {last},", f"| {last} | {new},")
    )


@pytest.fixture
def python(package, tmp_path):
    """Runs Python with the extended package in an empty folder; returns what it prints."""

    def python(*words):
        done = subprocess.run(
            [sys.executable, *words],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(package)},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr + done.stdout
        return done.stdout

    return python


@pytest.fixture
def export(python, tmp_path):
    """Solves a spec with the extended package; returns the rows of the CSV."""

    def export(surface, elastomer, output=""):
        text = SPEC.format(surface=surface, elastomer=elastomer) + output
        (tmp_path / "spec.toml").write_text(text)
        (tmp_path / "s.h5").unlink(missing_ok=True)
        python("-m", "gfmd_cli", "run", "spec.toml", "-o", "s.h5", "-q", "-j", "1")
        return list(csv.DictReader(io.StringIO(python("-m", "gfmd_cli", "export", "s.h5"))))

    return export


def test_a_new_elastomer_is_one_class_and_one_name(export):
    soft, stiff = export(ROUGH, 'kind = "coated"\nk_0 = [1e-6, 1e6]')
    assert [row["k_0"] for row in (soft, stiff)] == ["1e-06", "1000000.0"]
    assert soft["elastomer"] == "coated k_0=1e-06"
    assert soft["elastomer_kind"] == "coated"
    assert soft["n"] == ""
    springs, half_space = export(ROUGH, 'kind = "power"\nn = [0, 1]')
    assert float(soft["a_r"]) == pytest.approx(float(springs["a_r"]), rel=1e-2)
    assert float(stiff["a_r"]) == pytest.approx(float(half_space["a_r"]), rel=1e-2)


def test_a_new_rough_surface_has_error_bars(export):
    first, second = export('kind = "random-waves"\nseed = [0, 1]', 'kind = "half-space"')
    assert second["surface"] == "random-waves seed=1"
    assert second["ensemble"] == "random-waves"
    assert (second["waves"], second["highest"], second["seed"]) == ("60", "8", "1")
    for row in (first, second):
        assert row["a_r_verdict"] == row["u_g_verdict"] == "regular"
        assert 0 < float(row["a_r_continuum_error"]) < 0.1 * float(row["a_r"])


def test_a_new_solver_is_one_class_and_one_name(export):
    solver = '[solver]\nkind = "descent"\nmomentum = 0.8\ntolerance = 1e-4'
    (slow,) = export(ROUGH, 'kind = "half-space"', solver)
    assert (slow["solver"], slow["momentum"], slow["status"]) == ("descent", "0.8", "converged")
    (fast,) = export(ROUGH, 'kind = "half-space"')
    assert float(slow["u_g"]) == pytest.approx(float(fast["u_g"]), rel=1e-3)
    assert float(slow["a_r_continuum"]) == pytest.approx(float(fast["a_r_continuum"]), rel=1e-2)
    assert float(slow["transforms"]) > 2 * float(fast["transforms"])


def test_a_new_observable_is_in_csv_xarray_tables_records_and_report(export, python, tmp_path):
    """Its declaration and its key of [output] are all that is written for it."""
    (row,) = export(f"{ROUGH}\nh_std = 1e-6", 'kind = "half-space"', "[output]\nlowest = true")
    depth = float(row["lowest_point"])
    assert 0 < depth < 10
    dataset = "from gfmd_cli.api import dataset; d = dataset('s.h5').lowest_point"
    printed = python("-c", f"{dataset}; print(d.item(), d.attrs['long_name'], d.units)")
    assert printed == f"{depth} depth of the lowest point of the elastomer / h_std 1\n"
    (record,) = json.loads(python("-m", "gfmd_cli", "analyze", "s.h5", "--json"))
    assert record["lowest_point"] == depth
    text = python("-m", "gfmd_cli", "analyze", "s.h5")
    python("-m", "gfmd_cli", "report", "s.h5")
    page = (tmp_path / "s.html").read_text()
    for shown in ("depth of the lowest point", f"{depth:#.4g}", f"{depth * 1e-6:#.4g}"):
        assert shown in text.lower()
        assert shown in page.lower()
    columns = next(line for line in text.splitlines() if "lowest point  lowest point" in line)
    assert columns.split()[0] == "p*"
