"""Elastomers: each class is one `kind` of [elastomer] in the run spec.

Equation numbers are those of Mueser, "Elastic contacts of randomly rough surfaces across the
spatial dimensions".
"""

from collections.abc import Callable
from functools import lru_cache
from math import ceil
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.errors import InputError
from gfmd_cli.files.checksums import Version, file_version
from gfmd_cli.files.file_cache import file_cache
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.fft_grid import ALL_ROWS, Shape
from gfmd_cli.maps.interpolation import monotone_cubic
from gfmd_cli.physics.compliance_transforms import Compliance, separated
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.free_compliance import Spacings
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.persson import gamma_slab
from gfmd_cli.spec_table import FilePath, Positive
from gfmd_cli.units import LARGEST_RMS_HEIGHT, labelled, percent

LONG_WAVE = 1e-6  # q t up to which k of a layer is constant: (q t)^2 is below rounding
DECAY_DISTANCE = 25.0  # thicknesses from which the displacement of a layer is below rounding
MAX_SPACING = 16.0  # of a grid, in thicknesses of a layer with a free boundary
MAX_SHORT_WAVE_STRESS = 0.1  # fraction of the squared stress, for a thin plate; a choice
THICK_SLAB = 10.0  # thickness / L, probably not relative; a choice: 2 changes k by 1e-8
THICK_LAYER = 1000.0  # thickness / L, from which it is probably not in m; a choice
MAX_PLATE_PHASE = 0.1
"""Largest q t at which a slab counts as a plate; its stiffness is smaller by 0.2 % or less."""
NEARLY_INCOMPRESSIBLE = 0.48
"""Poisson's ratio of a bonded layer above which a load with a free boundary is wrong by 3 % or more
if pixels are wider than the layer is thick; measured, see docs/calibration.md."""
MAX_EXTRAPOLATED = 0.1  # fraction of squared stress or height beyond a table; a choice
MAX_FALLING = 0.5  # fraction of squared stress at waves where the k(q) of a table falls; a choice
FALLING_EXPONENT = -0.05  # of k(q), over an octave, so that rounded numbers do not count; a choice
OCTAVE = np.log(2)
MAX_TABLE_BYTES = 2**20  # a choice, some 40000 rows
SEPARATORS = str.maketrans(",;", "  ")  # of columns, beside spaces and tabs
ROUNDED_EXPONENT = 1e-3  # of the first rows of a table, whose numbers may be rounded; a choice


class Power(LinearElastomer):
    """Elastomer of stiffness k = k_n q^n. Paper Eq. (1)."""

    kind: Literal["power"] = "power"
    n: Annotated[float, Key(ge=0, le=4)]
    """Exponent of the stiffness, 0 to 4."""
    k_n: Positive = 1.0
    """Prefactor of the stiffness [Pa m^(n-1)]."""

    @property
    def exponent(self) -> float:  # type: ignore[override]
        """Exponent n of the stiffness."""
        return self.n

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m], zero at q = 0 for every n, including n = 0."""
        return self.k_n * np.where(q > 0, np.power(np.where(q > 0, q, 1.0), self.n), 0.0)

    @property
    def modulus(self) -> float:
        """Contact modulus E* = 2 k_1 [Pa] of n = 1, a half-space; 0 of other exponents."""
        return 2 * self.k_n if self.n == 1 else 0.0

    @property
    def uniform_stiffness(self) -> float | None:  # type: ignore[override]
        """k_0 of springs, n = 0."""
        return self.k_n if self.n == 0 else None


class HalfSpace(LinearElastomer):
    """Semi-infinite solid, k = E* q / 2. Paper Eq. (2), n = 1."""

    exponent: ClassVar[float | None] = 1.0
    kind: Literal["half-space"] = "half-space"
    E_star: Positive = 1.0
    """Contact modulus E / (1 - nu^2) [Pa]."""

    @property
    def short_label(self) -> str:
        """The kind."""
        return self.kind

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return 0.5 * self.E_star * q


class Membrane(LinearElastomer):
    """Membrane under equibiaxial tension, k = tension q^2. Paper Eq. (2), n = 2."""

    exponent: ClassVar[float | None] = 2.0
    kind: Literal["membrane"] = "membrane"
    tension: Positive = 1.0
    """Tension [N/m]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return self.tension * q**2


class Plate(LinearElastomer):
    """Thin plate, free to bend, k = E* t^3 q^4 / 12. Paper Eq. (2), n = 4."""

    exponent: ClassVar[float | None] = 4.0
    kind: Literal["plate"] = "plate"
    E_star: Positive = 1.0
    """Contact modulus E / (1 - nu^2) [Pa]."""
    thickness: Positive
    """Thickness [m]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return self.E_star / 12 * (self.thickness * q) ** 3 * q

    def warnings(self, scene: Scene, boundary: str, *, is_rough: bool) -> list[str]:
        """See `LinearElastomer.warnings`. At q t = 1 a slab is 0.81 times as stiff as a plate."""
        fraction = _fraction(scene.shells.variance, scene.shells.q * self.thickness > 1)
        if fraction <= MAX_SHORT_WAVE_STRESS:
            return []
        return [
            f"elastomer.thickness = {self.thickness:g} m: {percent(fraction)} of the squared "
            f"stress in full contact is at wavelengths below {2 * np.pi * self.thickness:.3g} m, "
            'for which a thin plate is too stiff; kind = "slab" has the stiffness of an elastic '
            "layer"
        ]


class Slab(LinearElastomer):
    """Layer of finite thickness t with constant stress on its back, k = E* q S(q t) / 2.

    Paper Eq. (41): a thin plate for q t << 1, a half-space for q t >> 1. The key `thickness` is
    relative to the side of the cell. The unit of pressure is that of the half-space.
    """

    kind: Literal["slab"] = "slab"
    thickness: Positive
    """Thickness t / L."""
    E_star: Positive = 1.0
    """Contact modulus E / (1 - nu^2) [Pa]."""

    @property
    def short_label(self) -> str:
        """The thickness."""
        return f"t/L = {self.thickness:g}"

    def label_on(self, length: float) -> str:
        """The label with the thickness in metres, except for L = 1 as in reduced units."""
        metres = labelled(self.thickness * length, "m")
        return self.label if length == 1 else f"{self.label} (t = {metres})"

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return 0.5 * self.E_star * q * slab_factor(q * self.thickness * length)

    def unit_stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m] of the half-space with the same contact modulus."""
        return 0.5 * self.E_star * q

    def warnings(self, scene: Scene, boundary: str, *, is_rough: bool) -> list[str]:
        """See `LinearElastomer.warnings`. A thickness may be meant in m."""
        length = scene.grid.length
        thickness = self.thickness * length
        if thickness * scene.shells.q.max() <= MAX_PLATE_PHASE:
            reason = "a thin plate at all wavelengths"
        elif is_rough and thickness < scene.h_std <= LARGEST_RMS_HEIGHT:
            reason = f"less than the rms height, {scene.h_std:.3g} m"
        elif self.thickness >= THICK_SLAB:
            reason = "a half-space at all wavelengths"
        else:
            return []
        return [
            f"elastomer.thickness = {self.thickness:g} is relative to the side of the cell, "
            f"{length:.3g} m: a slab of {thickness:.3g} m, {reason}; divide a thickness in m "
            "by the side"
        ]

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (42)."""
        return gamma_slab(q * self.thickness * length)


class Layer(LinearElastomer):
    """Elastic layer of finite thickness t on a rigid base, k = E* q / (2 chi(q t)).

    chi(q t) is the compliance relative to that of the half-space: chi = 1 for q t >> 1, and k has
    a limit above zero for q -> 0.
    """

    kind: Literal["layer"] = "layer"
    thickness: Positive
    """Thickness [m]."""
    E_star: Positive = 1.0
    """Contact modulus E / (1 - nu^2) [Pa]."""
    poisson: Annotated[float, Key(gt=-1, le=0.5)] | None = None
    """Poisson's ratio, required for a bonded layer and less than 0.5 there. A sliding layer depends
    on E_star alone."""
    base: Literal["bonded", "sliding"] = "bonded"
    """Whether the layer is bonded to the rigid base or slides on it without friction."""

    @model_validator(mode="after")
    def _has_poisson(self) -> Self:
        if self.base == "bonded" and self.poisson is None:
            raise ValueError('base = "bonded" needs poisson, Poisson\'s ratio')
        if self.base == "bonded" and self.poisson == 0.5:
            raise ValueError(
                'poisson = 0.5 is for base = "sliding"; for a bonded layer, which could not be '
                "compressed as a whole, it must be less than 0.5"
            )
        return self

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m], zero at q = 0."""
        phase = np.where(q > 0, q, 1.0) * self.thickness
        chi = layer_softening(phase, self.poisson if self.base == "bonded" else None)
        return np.where(q > 0, 0.5 * self.E_star * q / chi, 0.0)

    def warnings(self, scene: Scene, boundary: str, *, is_rough: bool) -> list[str]:
        """See `LinearElastomer.warnings`."""
        warnings, poisson = [], self.poisson if self.base == "bonded" else None
        if is_rough and self.thickness <= scene.h_std:
            warnings.append(
                f"elastomer.thickness = {self.thickness:g} m is less than the rms height, "
                f"{scene.h_std:.3g} m: linear elasticity does not hold for such compressions"
            )
        if self.thickness >= THICK_LAYER * scene.grid.length:
            warnings.append(
                f"elastomer.thickness = {self.thickness:g} m is "
                f"{self.thickness / scene.grid.length:.3g} times the side of the cell: the layer "
                "is a half-space at all wavelengths; is the thickness in m?"
            )
        spacing = max(scene.grid.spacings)
        is_thin = boundary == "free" and spacing > self.thickness
        if is_thin and poisson is not None and poisson > NEARLY_INCOMPRESSIBLE:
            warnings.append(
                f"pixels of {spacing:.3g} m are wider than elastomer.thickness, "
                f"{self.thickness:.3g} m: with poisson = {poisson:g} and a free boundary the load "
                "may be wrong by 3 to 15 %, and by more beyond six thicknesses; use more points"
            )
        return warnings

    @property
    def uniform_stiffness(self) -> float:  # type: ignore[override]
        """E* / t of a sliding layer, E* (1 - nu)^2 / [(1 - 2 nu) t] of a bonded one [Pa/m]."""
        if self.base == "sliding" or self.poisson is None:
            return self.E_star / self.thickness
        nu = self.poisson
        return self.E_star * (1 - nu) ** 2 / ((1 - 2 * nu) * self.thickness)

    @property
    def largest_displacement(self) -> float:  # type: ignore[override]
        """The thickness."""
        return self.thickness

    def decays(self, dimension: int) -> bool:
        """True: displacements decay exponentially, over the thickness."""
        return True

    def free_compliance(self, shape: Shape, spacings: Spacings, rows: slice = ALL_ROWS) -> Field:
        """Displacements [m/Pa]. Raises InputError for a layer that is far thinner than a pixel."""
        spacing, largest = max(spacings), MAX_SPACING * self.thickness
        if spacing > largest:
            raise InputError(
                f"elastomer.thickness, grid.points: the thickness is less than 1/{MAX_SPACING:g} "
                f"of the spacing: {self.thickness:.3g} m given, pixels of {spacing:.3g} m; use "
                f"{ceil(shape[-1] * spacing / largest)} points or more along x"
            )
        return super().free_compliance(shape, spacings, rows)

    def compliance(self) -> Compliance:
        """1/k(q), constant for the longest waves; displacements decay over the thickness."""
        return _compliance_of_layer(self)


class Tabulated(LinearElastomer):
    """Elastomer with a tabulated stiffness, interpolated by a monotone cubic in ln k over ln q.

    Beyond each end of the table, k is the power law through the two outermost rows.
    """

    kind: Literal["table"] = "table"
    path: FilePath
    """Text file with two columns, q [1/m] and k [Pa/m]: positive numbers, q increasing. Columns are
    separated by spaces, tabs, commas or semicolons; lines of words begin with #."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]. Raises InputError for an invalid table."""
        k = _interpolated(_read_table(self.path).tobytes())
        return np.where(q > 0, k(np.where(q > 0, q, 1.0)), 0.0)

    def warnings(self, scene: Scene, boundary: str, *, is_rough: bool) -> list[str]:
        """See `LinearElastomer.warnings`."""
        q, variance = scene.shells.q, scene.shells.variance
        first, *_, last = _read_table(self.path)[:, 0]
        beyond = (q < first) | (q > last)
        of_stress = _fraction(variance, beyond), "squared stress in full contact"
        of_height = _fraction(variance / self.stiffness(q) ** 2, beyond), "squared height"
        fraction, what = max(of_stress, of_height)
        warnings = []
        if fraction > MAX_EXTRAPOLATED:
            warnings.append(
                f"{self.path.name}: k(q) is given for q = {first:.3g} to {last:.3g} 1/m, but "
                f"{percent(fraction)} of the {what} is at other wavenumbers (the "
                f"surface has {q.min():.3g} to {q.max():.3g} 1/m), where k is extrapolated"
            )
        falling = _fraction(variance, self.local_exponent(q, step=OCTAVE / 2) < FALLING_EXPONENT)
        if falling > MAX_FALLING:
            warnings.append(
                f"{self.path.name}: k(q) falls with q at the wavenumbers of {percent(falling)} of "
                "the squared stress in full contact, but Persson theory assumes that it rises, or "
                "is constant; is the second column a compliance, 1/k?"
            )
        return warnings

    def decays(self, dimension: int) -> bool:
        """Whether k below the table is constant, or rises less than q^dimension."""
        exponent = _end_exponents(_read_table(self.path))[0]
        return -ROUNDED_EXPONENT <= exponent < dimension - ROUNDED_EXPONENT

    def check_free_boundary(self, dimension: int) -> None:
        """Raise InputError for exponents that have no compliance kernel."""
        first, last = _end_exponents(_read_table(self.path))
        if first < -ROUNDED_EXPONENT:
            raise InputError(
                'grid.boundary: "free" needs a table k(q) that is constant or rises at its lower '
                f"end, but {self.path.name} begins with k ~ q^{first:.2g}: add rows at smaller q, "
                'or use "periodic"'
            )
        super().check_free_boundary(dimension)
        if not last > 0:
            raise InputError(
                'grid.boundary: "free" needs a table k(q) that rises at its upper end; the '
                'compliance of this one has no kernel: use "periodic"'
            )

    def compliance(self) -> Compliance:
        """1/k(q) between the rows of the table and beyond."""
        return _compliance_of_table(_read_table(self.path).tobytes())

    @property
    def uniform_stiffness(self) -> float | None:  # type: ignore[override]
        """k of the first row of the table [Pa/m] if it is constant there, else None."""
        table = _read_table(self.path)
        return float(table[0, 1]) if abs(_end_exponents(table)[0]) < ROUNDED_EXPONENT else None


@lru_cache(maxsize=4)
def _compliance_of_layer(layer: Layer) -> Compliance:
    """The compliance of a layer; cached, because its transforms serve all grids."""
    t = layer.thickness
    return Compliance(layer.stiffness, np.array([LONG_WAVE / t]), 0.0, reach=DECAY_DISTANCE * t)


@lru_cache(maxsize=4)
def _compliance_of_table(content: bytes) -> Compliance:
    """1/k(q) from the bytes of a table; cached, because its transforms serve all grids."""
    table = np.frombuffer(content).reshape(-1, 2)
    exponent = max(_end_exponents(table)[0], 0.0)  # of rounded numbers it may be negative
    return Compliance(_interpolated(content), separated(table[:, 0]), exponent)


def _read_table(path: Path) -> Field:
    """The columns q [1/m] and k [Pa/m], shape (rows, 2). Raises InputError for an invalid table."""
    try:
        return _table(path, file_version(path))
    except (OSError, ValueError) as error:
        reason = "not UTF-8 text" if isinstance(error, UnicodeError) else error
        raise InputError(
            f"{path}: elastomer.path: cannot be read: {reason}; the file must be a text of two "
            "columns of numbers, q [1/m] and k [Pa/m], with # before words"
        ) from error


@file_cache(maxsize=4)
def _table(path: Path, version: Version) -> Field:
    """The columns of a table in this version; cached, because every block of rows asks for k."""
    if path.stat().st_size > MAX_TABLE_BYTES or not path.is_file():
        raise ValueError(f"not a regular file of at most {MAX_TABLE_BYTES} bytes")
    lines = path.read_text("utf-8-sig").translate(SEPARATORS).splitlines()
    is_empty = not any(line.partition("#")[0].strip() for line in lines)
    table = np.empty((0, 0)) if is_empty else np.loadtxt(lines, ndmin=2)
    if table.shape[0] < 2 or table.shape[1] != 2:
        raise InputError(
            f"{path}: elastomer.path: {table.shape[0]} rows, {table.shape[1]} columns; "
            "at least two rows of two columns, q and k, are needed"
        )
    is_valid = np.all(np.isfinite(table) & (table > 0), axis=1)
    is_valid[1:] &= np.diff(table[:, 0]) > 0
    if not is_valid.all():
        row = int(np.argmin(is_valid))
        raise InputError(
            f"{path}: elastomer.path: row {row + 1} is {table[row, 0]:g}, {table[row, 1]:g}: q and "
            "k must be finite and positive; q must increase"
        )
    table.flags.writeable = False
    return table


@lru_cache(maxsize=4)
def _interpolated(content: bytes) -> Callable[[Field], Field]:
    """k(q) [Pa/m] for q > 0 from the bytes of a table, rows q and k."""
    table = np.frombuffer(content).reshape(-1, 2)
    (x, y), (low, high) = np.log(table).T, _end_exponents(table)
    cubic = monotone_cubic(x, y)

    def stiffness(q: Field) -> Field:
        log_q = np.log(q)
        beyond = low * np.minimum(log_q - x[0], 0.0) + high * np.maximum(log_q - x[-1], 0.0)
        return np.exp(cubic(np.clip(log_q, x[0], x[-1])) + beyond)

    return stiffness


def _end_exponents(table: Field) -> tuple[float, float]:
    """Exponents of the power laws below and above a table."""
    slopes = np.diff(np.log(table[[0, 1, -2, -1]]), axis=0)
    return float(slopes[0, 1] / slopes[0, 0]), float(slopes[2, 1] / slopes[2, 0])


def _fraction(variance: Field, chosen: Mask) -> float:
    """Fraction of a variance at chosen wavenumbers."""
    return float(variance[chosen].sum() / variance.sum())


Elastomer = Annotated[
    Power | HalfSpace | Membrane | Plate | Slab | Layer | Tabulated, Key(discriminator="kind")
]


def layer_softening(phi: Field, poisson: float | None) -> Field:
    """Compliance chi(phi) of a layer on a rigid base over that of the half-space, at phi = q t.

    Sliding (`poisson` None): chi = (cosh 2phi - 1) / (sinh 2phi + 2phi), half of a layer of twice
    the thickness that is loaded from both sides. Bonded, with kappa = 3 - 4 nu (Johnson, Contact
    Mechanics, 1985, Sect. 5.8):

        chi = (kappa sinh 2phi - 2phi) / [kappa cosh 2phi + 2phi^2 + (1 + kappa^2) / 2].

    Both are evaluated with exp(-2phi), so that nothing overflows.
    """
    decay = np.exp(-2 * phi)
    if poisson is None:
        return np.expm1(-2 * phi) ** 2 / (4 * phi * decay - np.expm1(-4 * phi))
    kappa = 3 - 4 * poisson
    numerator = -kappa * np.expm1(-4 * phi) - 4 * phi * decay
    return numerator / (kappa * (1 + decay**2) + (4 * phi**2 + 1 + kappa**2) * decay)


def slab_factor(phi: Field) -> Field:
    """S(phi) = (cosh 2phi - 2phi^2 - 1) / (sinh 2phi + 2phi) at phi = q t >= 0, to a few roundings.

    Paper Eq. (41), which as printed cancels at small phi and overflows at phi = 355. Here numerator
    and denominator of S = (sinh phi - phi)(sinh phi + phi) / (sinh phi cosh phi + phi) are
    multiplied by 4 exp(-2phi), so that nothing overflows; sinh phi - phi is a series below phi = 1.
    """
    phi = np.asarray(phi, dtype=np.float64)
    decay, rising = np.exp(-phi), -np.expm1(-2 * phi)  # 2 exp(-phi) sinh phi
    small = np.minimum(phi, 1.0)
    tail = np.ones_like(phi)  # sinh x - x = x^3/6 (1 + x^2/20 (1 + x^2/42 (...)))
    for divisor in (272.0, 210.0, 156.0, 110.0, 72.0, 42.0, 20.0):  # 17*16, 15*14, ..., 5*4
        tail = 1.0 + small**2 / divisor * tail
    difference = np.where(phi < 1, small**3 / 3 * decay * tail, rising - 2 * phi * decay)
    denominator = np.maximum(4 * phi * decay**2 - np.expm1(-4 * phi), 1e-300)  # not 0 at phi = 0
    return difference * ((rising + 2 * phi * decay) / denominator)
