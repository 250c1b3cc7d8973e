"""The periodic grid: its wavenumbers, its one Fourier convention, its transforms.

h(x) = sum_q h(q) exp(i q x): the forward transform carries 1/size, so that h(q = 0) is the mean.
Coefficients are kept for non-negative wavenumbers of the last axis only (real transforms).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeVar

import numpy as np
import pyfftw

from gfmd_cli.physics import sweeps, wisdom
from gfmd_cli.physics.fields import Field, Modes
from gfmd_cli.physics.sweeps import Rows

T = TypeVar("T")
ALL = slice(None)
THREADED = 512  # points per side from which a second thread pays
PLANNING = (30.0, 1e-6)  # seconds at most to look for a plan, at all and per grid point
Span = tuple[int, int]


@dataclass(frozen=True)
class Grid:
    """`points` per side of a periodic cell, in one dimension (line scenes) or two."""

    points: int
    """Even number of points per side."""
    dimension: int = 2
    length: float = 1.0
    """Side of the cell [m]."""
    threads: int = 1
    precision: Literal["double", "single"] = "double"
    """Of fields and transforms."""

    @property
    def real(self) -> "np.dtype[np.floating[Any]]":
        """Type of the values of a field."""
        return np.dtype(np.float64 if self.precision == "double" else np.float32)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of a real field, indexed [y, x]."""
        return (self.points,) * self.dimension

    @property
    def spectral_shape(self) -> tuple[int, ...]:
        """Shape of its Fourier coefficients."""
        return (*self.shape[:-1], self.points // 2 + 1)

    @property
    def size(self) -> int:
        """Number of grid points."""
        return int(self.points**self.dimension)

    def total(self, values: T) -> T:
        """Sum over the grid, of what was summed over the rows that this process holds."""
        return values

    def most(self, value: float) -> float:
        """Largest over the grid, of what is largest over the rows that this process holds."""
        return value

    @property
    def own(self) -> slice:
        """The rows of the grid that a field of this process holds."""
        return ALL

    @property
    def whole(self) -> bool:
        """Whether that is all of them."""
        return True

    def empty(self) -> Field:
        """A real field, aligned for the transforms, values undefined."""
        array: Field = pyfftw.empty_aligned(self.shape, dtype=self.real)
        return array

    def empty_modes(self) -> Modes:
        """Fourier coefficients, aligned for the transforms, values undefined."""
        kind = np.result_type(self.real, np.complex64)
        array: Modes = pyfftw.empty_aligned(self.spectral_shape, dtype=kind)
        return array

    def mode_number(self, rows: slice = ALL) -> Field:
        """|q| L / 2 pi of every coefficient, shape `spectral_shape` (or of some of its rows)."""
        along = np.arange(*self.span, dtype=np.float64)
        if self.dimension == 1:
            return along[rows]
        across = np.fft.fftfreq(self.points, 1 / self.points)[rows]
        return np.sqrt(across[:, None] ** 2 + along**2)

    def wavenumber(self, rows: slice = ALL) -> Field:
        """|q| of every coefficient [1/m], shape `spectral_shape` (or of some of its rows)."""
        return self.mode_number(rows) * (2 * np.pi / self.length)

    def line(self, symbol: Field) -> Field:
        """The values of a symbol along x, from q = 0 to the highest wavenumber."""
        line: Field = symbol.reshape(-1, symbol.shape[-1])[0]
        return line

    def multiplicity(self) -> Field:
        """How often a coefficient counts in a sum over all q, a row of them."""
        count = np.full(self.points // 2 + 1, 2.0)
        count[0] = count[-1] = 1.0
        return count[slice(*self.span)]

    @cached_property
    def _workspace(self) -> tuple[Modes, Callable[[], None], Callable[[], None]]:
        """Memory that every transform of this grid works in, and the two plans, in place.

        In place they spare a field, and a third of the time of transforms between two arrays.
        Array and plans come together: measuring a plan overwrites the array.
        """
        work = self.empty_modes()
        real = work.view(self.real)[..., : self.points]

        def plan(flags: tuple[str, ...]) -> list[Callable[[], None]]:
            ways = ((real, work, "FFTW_FORWARD"), (work, real, "FFTW_BACKWARD"))
            return [
                pyfftw.FFTW(
                    source,
                    target,
                    tuple(range(self.dimension)),
                    way,
                    flags,
                    threads=self._threads,
                    planning_timelimit=PLANNING[0] + PLANNING[1] * self.size,
                ).execute
                for source, target, way in ways
            ]

        forward, backward = wisdom.planned(plan)
        return work, forward, backward

    @property
    def work(self) -> Modes:
        """Coefficients that every transform of this grid works in."""
        return self._workspace[0]

    @property
    def spectrum(self) -> Field:
        """The same as pairs of real values."""
        return self.work.view(self.real)

    @property
    def padded(self) -> Field:
        """The same memory as rows of real values, two more than the grid has points a row."""
        return self.spectrum

    def transform(self) -> None:
        """`work` <- coefficients of the values in `padded`, without the factor 1/size."""
        self._workspace[1]()

    def transform_back(self) -> None:
        """`padded` <- values of the coefficients in `work`, without the factor 1/size."""
        self._workspace[2]()

    def forward_into_work(self, field: Field) -> Modes:
        """`work` <- Fourier coefficients of a field, without 1/size."""
        self.padded[..., : self.points] = field
        self.transform()
        return self.work

    def forward(self, field: Field) -> Modes:
        """Fourier coefficients of a field."""
        modes = self.empty_modes()
        np.multiply(self.forward_into_work(field), 1.0 / self.size, out=modes)
        return modes

    def backward(self, modes: Modes) -> Field:
        """The field of these Fourier coefficients."""
        field = self.empty()
        self.work[...] = modes
        self.backward_into(field)
        return field

    def backward_into(self, field: Field) -> None:
        """field <- the field of the coefficients in `work`, which are lost; without 1/size."""
        self.transform_back()
        field[...] = self.padded[..., : self.points]

    def filter_padded(self, symbol: Field) -> float:
        """`padded` <- F^-1 symbol F of the values in it: one pair of transforms, no copy.

        Returns the sum over the grid of these values times what becomes of them.
        """
        self.transform()
        bodies = (self.as_rows(self.spectrum), self.as_rows(symbol))
        sums = self.spectral_rows.sums(1, sweeps.stiffen, *bodies, 1.0 / self.size, *self.ends)
        (total,) = sums
        self.transform_back()
        return float(total) / self.size

    def operator(self, symbol: Field) -> "Operator":
        """The linear map F^-1 symbol F."""
        return Operator(self, symbol)

    @cached_property
    def rows(self) -> Rows:
        """Shares the work of a sweep out over the threads."""
        return Rows(self.points, self._threads) if self.dimension == 2 else Rows(1, 1)

    @property
    def spectral_rows(self) -> Rows:
        """Likewise, of a sweep over the coefficients."""
        return self.rows

    @property
    def span(self) -> Span:
        """First and last but one wavenumber along x of the coefficients that this process holds."""
        return 0, self.points // 2 + 1

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether the first and the last of all wavenumbers along x are among these."""
        first, last = self.span
        return first == 0, last == self.points // 2 + 1

    @property
    def _threads(self) -> int:
        """Threads that pay: on a small grid, coarse ones of a cascade too, a second only costs."""
        return self.threads if self.points >= THREADED and self.dimension == 2 else 1

    def as_rows(self, field: Field) -> Field:
        """A field, a symbol or `padded` with two axes, in one dimension too."""
        return field if self.dimension == 2 else field.reshape(1, -1)

    def coarser(self, points: int) -> "Grid":
        """A grid of fewer points on the same cell."""
        return replace(self, points=points)

    def cut(self, symbol: Field, target: "Grid") -> Field:
        """The values of a symbol at the wavenumbers of a coarser grid."""
        half = target.points // 2
        symbol = symbol[..., : half + 1]
        return symbol if self.dimension == 1 else np.concatenate([symbol[:half], symbol[-half:]])

    def below(self, lines: Any) -> Any:
        """The row of a field that follows those which this process holds."""
        return lines[0]

    def collect(self, field: Field) -> Field | None:
        """All of a field, on the first process; None on the others."""
        return field

    def diagonal(self, field: Field) -> Field:
        """Values along the diagonal [i, i] of the cell; of a line scene, the whole line."""
        return field.copy() if self.dimension == 1 else np.diagonal(field).copy()

    def resample(self, field: Field, target: "Grid") -> Field:
        """The same trigonometric polynomial on another grid of the same cell.

        A finer grid interpolates; a coarser one loses what it does not resolve, its own highest
        mode included.
        """
        return target.take(self, field)

    def take(self, source: "Grid", field: Field) -> Field:
        """A field of another grid, see `resample`."""
        return source._resample(field, self)

    def _resample(self, field: Field, target: "Grid") -> Field:
        modes, out = self.forward_into_work(field), target.work
        finer = target.points > self.points
        half = min(self.points, target.points) // 2
        if finer:
            modes[..., -1] *= 0.5  # the highest mode stands for +q and -q alike
            if self.dimension == 2:
                modes[half] *= 0.5
        out[...] = 0.0
        kept = half + finer
        if self.dimension == 1:
            out[:kept] = modes[:kept]
        else:
            out[:kept, :kept] = modes[:kept, :kept]
            negative = slice(-half, None) if finer else slice(1 - half, None)
            out[negative, :kept] = modes[negative, :kept]
        resampled = target.empty()
        target.backward_into(resampled)
        resampled *= 1.0 / self.size
        return resampled


@dataclass(frozen=True)
class Operator:
    """F^-1 symbol F on one grid: one pair of transforms a call."""

    grid: Grid
    symbol: Field
    """Shape `grid.spectral_shape`."""

    def __call__(self, field: Field, out: Field) -> Field:
        """Apply to `field`, write to `out`, return `out`."""
        values = self.grid.padded[..., : self.grid.points]
        values[...] = field
        self.grid.filter_padded(self.symbol)
        out[...] = values
        return out
