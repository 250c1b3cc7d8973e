"""Elastic bodies: the stiffness k(q), stress per displacement of a wave of wavenumber q.

The elastic energy per area is sum_q k(q) |u(q)|^2 / 2, paper Eq. (1); sums never contain q = 0,
where k is zero for every body (load control). `length` is the side of the cell [m], for what is
given as a share of it. Equation numbers are those of Mueser, "Elastic
contacts of randomly rough surfaces across the spatial dimensions".
"""

import warnings
from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.physics.choice import Choice, FilePath, Positive
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import gamma_n, gamma_slab

MAX_TABLE = 2**20  # bytes of a tabulated stiffness
Stiffness = Callable[[Field, float], Field]
STEP = 1e-3  # of log q: fine against any table, coarse against rounding


def exponent_at(stiffness: Stiffness, q: Field, length: float = 1.0) -> Field:
    """d ln k / d ln q at wavenumbers q [1/m], by central differences; zero where k is zero.

    Parameters
    ----------
    stiffness : k(q, length) [Pa/m]
    """
    above, below = (stiffness(q * np.exp(step), length) for step in (STEP, -STEP))
    safe = (above > 0) & (below > 0)
    ratio = np.where(safe, above, 1.0) / np.where(safe, below, 1.0)
    return np.asarray(np.log(ratio) / (2 * STEP))


def _power(q: Field, n: float) -> Field:
    """q^n, and zero at q = 0 for every n, n = 0 too."""
    return np.where(q > 0, np.power(np.where(q > 0, q, 1.0), n), 0.0)


class Power(Choice):
    """Body of stiffness k = k_n q^n. Paper Eq. (1)."""

    kind: Literal["power"] = "power"
    n: Annotated[float, Key(ge=0, le=4)]
    """Exponent of the stiffness, 0 to 4."""
    k_n: Positive = 1.0
    """Prefactor of the stiffness [Pa m^(n-1)]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return self.k_n * _power(q, self.n)

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (39)."""
        return np.full_like(q, gamma_n(self.n))


class HalfSpace(Choice):
    """Semi-infinite solid, k = E* q / 2. Paper Eq. (2), n = 1."""

    kind: Literal["half-space"] = "half-space"
    E_star: Positive = 1.0
    """Contact modulus [Pa]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return 0.5 * self.E_star * q

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (39)."""
        return np.full_like(q, gamma_n(1.0))


class Membrane(Choice):
    """Membrane under equibiaxial tension, k = tension q^2. Paper Eq. (2), n = 2."""

    kind: Literal["membrane"] = "membrane"
    tension: Positive = 1.0
    """Tension [N/m]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return self.tension * q**2

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (39)."""
        return np.full_like(q, gamma_n(2.0))


class Plate(Choice):
    """Thin plate, free to bend, k = E* t^3 q^4 / 12. Paper Eq. (2), n = 4."""

    kind: Literal["plate"] = "plate"
    E_star: Positive = 1.0
    """Contact modulus [Pa]."""
    thickness: Positive
    """Thickness [m]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return self.E_star / 12 * (self.thickness * q) ** 3 * q

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (39)."""
        return np.full_like(q, gamma_n(4.0))


class Slab(Choice):
    """Layer of finite thickness t under constant stress from behind, k = E* q S(q t) / 2.

    Paper Eq. (41): a thin plate at q t << 1, a half-space at q t >> 1. The thickness is given as
    a share of the side of the cell.
    """

    kind: Literal["slab"] = "slab"
    thickness: Positive
    """Thickness t / L."""
    E_star: Positive = 1.0
    """Contact modulus [Pa]."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        return 0.5 * self.E_star * q * slab_factor(q * self.thickness * length)

    def half_space(self, q: Field) -> Field:
        """k(q) of the semi-infinite body, which sets the unit of pressure [Pa/m]."""
        return 0.5 * self.E_star * q

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory. Paper Eq. (42)."""
        return gamma_slab(q * self.thickness * length)


class Tabulated(Choice):
    """Body whose stiffness is a table: log k over log q, interpolated by a monotone cubic.

    Beyond its ends the table goes on as the power law of its last two rows.
    """

    kind: Literal["table"] = "table"
    path: FilePath
    """Text file with two columns, q [1/m] and k [Pa/m], both positive, q rising."""

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m]."""
        from scipy.interpolate import PchipInterpolator

        x, y = np.log(self._table()).T
        wanted = np.log(np.where(q > 0, q, 1.0))
        inside = PchipInterpolator(x, y)(np.clip(wanted, x[0], x[-1]))
        low, high = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])
        beyond = low * np.minimum(wanted - x[0], 0.0) + high * np.maximum(wanted - x[-1], 0.0)
        return np.where(q > 0, np.exp(inside + beyond), 0.0)

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory: Eq. (39) at the local exponent of k."""
        return gamma_n(np.clip(exponent_at(self.stiffness, q, length), 0.0, 4.0))

    def _table(self) -> Field:
        """The rows (q, k). Raises InputError for anything but two rising positive columns."""
        try:
            if not self.path.is_file() or self.path.stat().st_size > MAX_TABLE:
                raise ValueError(f"no regular file of at most {MAX_TABLE} bytes")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of no rows, which is refused below
                table = np.loadtxt(self.path, ndmin=2)
        except (OSError, ValueError) as error:
            raise InputError(f"{self.path}: elastomer.path: cannot be read: {error}") from error
        if table.shape[0] < 2 or table.shape[1] != 2:
            raise InputError(
                f"{self.path}: elastomer.path: {table.shape[0]} rows, {table.shape[1]} columns; "
                "at least two rows of two columns, q and k, are needed"
            )
        if not (
            np.all(np.isfinite(table)) and np.all(table > 0) and np.all(np.diff(table[:, 0]) > 0)
        ):
            raise InputError(
                f"{self.path}: elastomer.path: q and k must be finite and positive and q must rise"
            )
        return table


Elastomer = Annotated[
    Power | HalfSpace | Membrane | Plate | Slab | Tabulated, Key(discriminator="kind")
]


def slab_factor(t: Field) -> Field:
    """S(t) = (cosh 2t - 2t^2 - 1) / (sinh 2t + 2t) for t >= 0, to a few roundings.

    Paper Eq. (41). As printed it loses all digits at small t and overflows at t = 355. Here
    S = (sinh t - t)(sinh t + t) / (sinh t cosh t + t), with sinh t - t summed as its series below
    t = 1 and S = 1 - (4 t^2 + 4 t + 2) exp(-2 t) above t = 20.
    """
    t = np.asarray(t, dtype=np.float64)
    thin, thick = t < 1, t > 20
    middle = np.clip(t, 1e-300, 20.0)
    sinh, cosh = np.sinh(middle), np.cosh(middle)
    square = np.where(thin, t, 0.0) ** 2
    tail = np.ones_like(square)  # sinh t - t = t^3/6 (1 + t^2/20 (1 + t^2/42 (...)))
    for divisor in (272.0, 210.0, 156.0, 110.0, 72.0, 42.0, 20.0):  # 17*16, 15*14, ..., 5*4
        tail = 1.0 + square / divisor * tail
    difference = np.where(thin, square * np.where(thin, t, 0.0) / 6 * tail, sinh - middle)
    factor = difference * ((sinh + middle) / (sinh * cosh + middle))  # t^4 would underflow first
    large = np.clip(t, 20.0, 400.0)
    bulk = 1.0 - (4 * large**2 + 4 * large + 2) * np.exp(-2 * large)
    return np.where(thick, bulk, factor)
