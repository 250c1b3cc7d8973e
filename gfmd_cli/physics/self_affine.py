"""Random self-affine surfaces: the spectrum, and heights with the phases that a seed defines.

Equation numbers are those of Mueser, "Elastic contacts of randomly rough surfaces across the
spatial dimensions".
"""

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field, Modes
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.indenters import MAX_POINTS, SMALLEST_GRID, UNCOUNTABLE, RigidSurface
from gfmd_cli.spec_table import Positive, Scale, Seed

LARGEST_ROLLOFF = 1e6
"""Largest lambda_r / L. It is above the longest wave of every cell."""


class SelfAffine(RigidSurface):
    """Random self-affine surface: |h(q)| = sqrt(C(q)), phases uniform in (0, 2 pi).

    Paper Eqs. (3) and (40). The phase of a mode depends only on the seed and the mode, so a seed
    defines one continuous surface for all grids. A smaller cut-off only adds modes to it.
    """

    rough: ClassVar[bool] = True
    band_limited: ClassVar[bool] = True
    size_hint: ClassVar[str] = "surface.cutoff is relative to surface.length"
    kind: Literal["self-affine"] = "self-affine"
    hurst: Annotated[float, Key(gt=0, le=1)] = 0.8
    """Hurst exponent H, 0 < H <= 1."""
    rolloff: Positive = 0.5
    """Roll-off wavelength lambda_r / L; with spectrum = "cutoff", the longest wavelength."""
    cutoff: Annotated[float, Key(gt=0, le=1)] = 0.005
    """Short-wavelength cut-off lambda_s / L."""
    spectrum: Literal["rolloff", "cutoff"] = "rolloff"
    """"rolloff": C = [1 + (q/q_r)^2]^(-1-H), Eq. (3); "cutoff": C = (q/q_r)^(-2-2H) for
    q >= q_r and zero below, Eq. (40)."""
    seed: Seed = 0
    """Seed of the random phases."""
    h_std: Positive | None = None
    """Root-mean-square height [m]; by default the prefactor of C is 1 m^2."""
    length: Scale = 1.0
    """Side of the cell along x, L [m]."""
    length_y: Scale | None = None
    """Side of the cell along y [m]; by default the points along y times the spacing along x."""

    @model_validator(mode="after")
    def _has_modes(self) -> Self:
        if self.spectrum == "cutoff" and self.cutoff > self.rolloff:
            raise ValueError(
                f"cutoff = {self.cutoff:g} is above rolloff = {self.rolloff:g}: no mode is left"
            )
        return self

    @property
    def highest_modes(self) -> tuple[int, int]:
        """Largest numbers of waves along the sides y and x of the cell: side / lambda_s."""
        length_y, length = self.sides
        shortest = max(self.cutoff, 1e-300) / (1 + 1e-12)  # 1/0.01: 100, not 99
        numbers = (length_y / length / shortest, 1 / shortest)
        along_y, along_x = (int(min(number, UNCOUNTABLE)) for number in numbers)
        return along_y, along_x

    def smallest_grid(self) -> int:
        """Smallest number of points along x, two per lambda_s.

        Raises InputError where no wave of the cell lies between lambda_r and lambda_s, and for a
        meaningless lambda_r.
        """
        if self.rolloff > LARGEST_ROLLOFF:
            raise InputError(
                f"surface.rolloff: {self.rolloff:.12g} given, out of range: it is in units of "
                f"surface.length, and at most {LARGEST_ROLLOFF:g}"
            )
        needed = max(SMALLEST_GRID, 2 * self.highest_modes[1])
        if self.spectrum == "cutoff" and needed <= MAX_POINTS:
            self._check_waves()
        return needed

    def _check_waves(self) -> None:
        """Raise InputError where no wave of the cell is in the band of spectrum = "cutoff"."""
        length_y, length = self.sides
        x = np.arange(self.highest_modes[1] + 2)
        y = np.floor(np.sqrt(np.maximum(self.cutoff**-2 - x**2, 0)) * (length_y / length))
        m = np.hypot(np.stack([y, y + 1]) * (length / length_y), x)  # next to lambda_s
        if self._amplitude(m).any():
            return
        is_longer = m * self.rolloff < 1
        longer, shorter = 1 / m[is_longer].max(), 1 / m[~is_longer].min()
        raise InputError(
            f"surface.rolloff: {self.rolloff:g} given with cutoff = {self.cutoff:g}, but no wave "
            f"of the cell has a wavelength between them; the nearest ones are {longer:.5g} and "
            f"{shorter:.5g}: choose a rolloff above the first or a cutoff below the second"
        )

    def smallest_grid_y(self) -> int:
        """Smallest number of points along y, likewise."""
        return max(SMALLEST_GRID, 2 * self.highest_modes[0])

    def smallest_grid_reason(self) -> str:
        """Reason for the smallest grid: the cut-off needs two points per lambda_s."""
        return f"kind {self.kind!r}, cutoff = {self.cutoff:g}: two points per lambda_s"

    def warnings(self, boundary: str = "periodic") -> list[str]:
        """A warning about a spectrum without a self-affine part."""
        if self.cutoff <= self.rolloff:
            return []
        return [
            f"surface.cutoff = {self.cutoff:g} is above surface.rolloff = {self.rolloff:g}: no "
            "wave is self-affine"
        ]

    def heights_on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        self._write_modes(grid)
        return grid.field_of_work(kept=self.highest_modes[1] + 1)

    def _amplitude(self, m: Field) -> Field:
        """sqrt(C(q)) at |q| = 2 pi m / L, zero beyond the cut-off.

        Paper Eqs. (3) and (40), corrected: Theta(q_s - q) (printed: Theta(q_s - 1)).
        """
        reduced = m * self.rolloff  # q / q_r
        present = (m > 0) & (m * self.cutoff <= 1 + 1e-12)
        if self.spectrum == "rolloff":
            return np.where(present, (1 + reduced**2) ** (-0.5 - 0.5 * self.hurst), 0.0)
        present &= reduced >= 1 - 1e-12
        return np.where(present, np.where(present, reduced, 1.0) ** (-1 - self.hurst), 0.0)

    def _write_modes(self, grid: Grid) -> None:
        """Set `grid.work` to the Fourier coefficients on a grid that resolves the surface.

        Phases are drawn in square rings |m|_max = 1, 2, ..., for one of q and -q. On an oblong cell
        |h(q)|^2 is C L / L_y: the modes are L_y / L times as dense in the plane of q, so that their
        variance per area of this plane is the same.
        """
        modes, (first, last) = grid.work, grid.span
        modes[...] = 0.0
        generator = np.random.Generator(np.random.PCG64(self.seed))
        length_y, length = self.sides
        highest_y, highest_x = self.highest_modes
        ends, factor, variance = (first, min(last, highest_x + 1)), np.sqrt(length / length_y), 0.0
        for ring in range(1, max(highest_y, highest_x) + 1):
            y, x, phase = _ring(generator, ring, *ends, highest_y)
            amplitude = factor * self._amplitude(np.hypot(y * (length / length_y), x))
            coefficients = amplitude * np.exp(2j * np.pi * phase)
            variance += 2 * float(np.sum(np.abs(coefficients) ** 2))
            if 2 * ring == grid.points_y:  # m_y = +-ring are one row
                np.add.at(modes, (y, x - first), coefficients)
            else:
                modes[y, x - first] = coefficients
        _complete(modes, grid)
        if self.h_std is not None:
            modes *= self.h_std / np.sqrt(grid.total(variance) or 1.0)


def _complete(modes: Modes, grid: Grid) -> None:
    """Add the coefficients of -q where those of q and -q are both kept: q_x = 0 and Nyquist."""
    opposite = -np.arange(grid.points_y)
    for column, is_own in zip((0, -1), grid.ends, strict=True):
        if is_own:
            modes[:, column] += modes[opposite, column].conj()


def _ring(
    generator: np.random.Generator, ring: int, first: int, last: int, highest_y: int
) -> tuple[Any, Any, Field]:
    """Modes of a square ring with first <= m_x < last and |m_y| <= highest_y, and their phases.

    The random numbers are assigned in this order: m_x = ring with m_y increasing from -ring;
    m_y = ring; m_y = -ring. The generator skips the numbers of the modes that are left out.

    Returns m_y, m_x and the phases / 2 pi, each of shape (modes,).
    """
    reach, none = min(ring, highest_y), np.arange(0)
    side = np.arange(-reach, reach + 1) if first <= ring < last else none
    above = np.arange(first, min(last, ring)) if ring <= highest_y else none
    below = above[above > 0]
    parts: list[tuple[int, Any, Any]] = [  # place of the first number, m_y, m_x
        (ring - reach, side, np.full_like(side, ring)),
        (2 * ring + 1 + first, np.full_like(above, ring), above),
        (3 * ring + max(first, 1), np.full_like(below, -ring), below),
    ]
    position, phases = 0, []
    for begin, places, _ in parts:
        generator.bit_generator.advance(begin - position)  # type: ignore[attr-defined]
        phases.append(generator.random(places.size))
        position = begin + places.size
    generator.bit_generator.advance(4 * ring - position)  # type: ignore[attr-defined]
    y, x = (np.concatenate([part[axis] for part in parts]) for axis in (1, 2))
    return y, x, np.concatenate(phases)
