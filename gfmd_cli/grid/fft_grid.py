"""The periodic grid: its wavenumbers, its one Fourier convention, its transforms.

h(x) = sum_q h(q) exp(i q x): the forward transform carries 1/size, so that h(q = 0) is the mean.
Coefficients are kept for non-negative wavenumbers of the last axis only (real transforms).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any, TypeVar

import numpy as np

from gfmd_cli.grid import kernels
from gfmd_cli.grid.arrays import Field, Mask, Modes, Precision, aligned
from gfmd_cli.grid.convolution import PaddedTransform, padded_shape
from gfmd_cli.grid.modes import multiplicity, shared_modes
from gfmd_cli.grid.pixels import average_along_x, average_rows, covered_rows
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.grid.shared_transforms import Columns, FieldTransforms, transform_memory
from gfmd_cli.grid.transposition import Span, Transposition

T = TypeVar("T")
ALL_ROWS = slice(None)
MIN_THREADED_SIDE = 512  # points per side from which a second thread pays
Shape = tuple[int, ...]
"""Numbers of points along the axes of a field, (y, x), or (x,) of a line."""


@dataclass(frozen=True)
class Grid:
    """Points of a periodic cell, in two dimensions or, for line contacts, in one; any sides."""

    points: int
    """Number of points along x."""
    dimension: int = 2
    length: float = 1.0
    """Side of the cell along x [m]."""
    threads: int = 1
    precision: Precision = "double"
    """Precision of fields and transforms."""
    points_y: int = 0
    """Number of points along y; 0 stands for as many as along x. A line has one."""
    length_y: float = 0.0
    """Side along y [m]; 0 stands for the points along y times the spacing along x."""
    is_temporary: bool = False
    """Whether it makes so few transforms that measuring their plans takes longer than it saves."""

    def __post_init__(self) -> None:
        points_y = self.points_y or self.points if self.dimension == 2 else 1
        length_y = self.length_y or self.length * points_y / self.points
        object.__setattr__(self, "points_y", points_y)
        object.__setattr__(self, "length_y", length_y if self.dimension == 2 else 0.0)

    @property
    def real(self) -> "np.dtype[np.floating[Any]]":
        """Type of the values of a field."""
        return np.dtype(self.precision)

    @property
    def _complex(self) -> "np.dtype[np.complexfloating[Any, Any]]":
        """Type of Fourier coefficients."""
        return np.result_type(self.real, np.complex64)

    @property
    def whole_shape(self) -> Shape:
        """Shape of a real field of the whole grid, indexed [y, x]."""
        return (self.points_y, self.points)[-self.dimension :]

    @property
    def shape(self) -> Shape:
        """Shape of the part of a real field that this process holds."""
        first, last = self.row_span
        return (last - first, self.points)[-self.dimension :]

    @property
    def sides(self) -> tuple[float, ...]:
        """Sides of the cell [m], in the order of the shape."""
        return (self.length_y, self.length)[-self.dimension :]

    @property
    def spacings(self) -> tuple[float, ...]:
        """Distances between neighbouring points [m], in the order of the shape."""
        pairs = zip(self.sides, self.whole_shape, strict=True)
        return tuple(side / points for side, points in pairs)

    @property
    def effective_points(self) -> float:
        """Number of points along x if their spacing were the wider one of both axes."""
        if self.dimension == 1:
            return float(self.points)
        return min(float(self.points), self.points_y * (self.length / self.length_y))

    @property
    def area(self) -> float:
        """Area of the cell [m^2]; of a line, its length [m]."""
        return prod(self.sides)

    @property
    def spectral_shape(self) -> Shape:
        """Shape of the Fourier coefficients that this process holds: all rows, some columns."""
        first, last = self.span
        return (*self.whole_shape[:-1], last - first)

    @property
    def size(self) -> int:
        """Number of grid points."""
        return prod(self.whole_shape)

    def total(self, values: T) -> T:
        """Sum over the grid from the sum over the rows of this process."""
        return self.rows.total(values)

    def max(self, value: float) -> float:
        """Maximum over the grid from the maximum over the rows of this process."""
        return value

    def min(self, value: float) -> float:
        """Minimum over the grid, likewise."""
        return -self.max(-value)

    def any(self, mask: Mask) -> bool:
        """Whether a mask is true somewhere on the grid."""
        return self.max(float(np.any(mask))) > 0

    def dot(self, one: Field, other: Field) -> float:
        """Sum over the grid of the products of two fields."""
        return self.total(float(np.vdot(one, other)))

    def mean(self, values: Field | Mask) -> float:
        """Mean of a field, or of some of its values, over the grid; zero without any."""
        total, count = self.total(np.array([values.sum(), values.size]))
        return float(total / count) if count else 0.0

    @property
    def own(self) -> slice:
        """The rows of the grid that a field of this process holds; all points of a line."""
        return slice(*self.row_span) if self.dimension == 2 else ALL_ROWS

    @property
    def row_span(self) -> Span:
        """First row that this process holds, and the row after its last."""
        return 0, self.points_y

    @property
    def whole(self) -> bool:
        """Whether this process holds all rows, so that none are exchanged."""
        return self.rows.is_whole

    def empty(self) -> Field:
        """A real field, aligned for the transforms, values undefined."""
        return aligned(self.shape, self.real)

    def mode_number(self, rows: slice = ALL_ROWS) -> Field:
        """|q| L / 2 pi of every coefficient, shape `spectral_shape` (or of some of its rows).

        L is the side along x, so that the numbers are whole for waves along x only.
        """
        along = np.arange(*self.span, dtype=np.float64)
        if self.dimension == 1:
            return along[rows]
        return np.sqrt(self.mode_number_y(rows)[:, None] ** 2 + along**2)

    def mode_number_y(self, rows: slice = ALL_ROWS) -> Field:
        """q_y L / 2 pi of the rows of coefficients, where L is the side along x."""
        across = np.fft.fftfreq(self.points_y, 1 / self.points_y)[rows]
        return across * (self.length / self.length_y)

    def wavenumber(self, rows: slice = ALL_ROWS) -> Field:
        """|q| of every coefficient [1/m], shape `spectral_shape` (or of some of its rows)."""
        return self.mode_number(rows) * (2 * np.pi / self.length)

    def along_x(self, symbol: Field) -> Field:
        """The values of a symbol along x, from q = 0 to the highest wavenumber."""
        return self.gather_columns(self.as_rows(symbol)[:1])[0]

    def along_y(self, symbol: Field) -> Field:
        """The values of a symbol along y, from q = 0 to the highest wavenumber."""
        column = symbol[: self.points_y // 2 + 1, 0]
        return self.total(column if self.ends[0] else np.zeros_like(column))

    def multiplicity(self) -> Field:
        """How often each coefficient of a row counts in a sum over all q."""
        return multiplicity(self.points)[slice(*self.span)]

    def gather_columns(self, values: Field) -> Field:
        """Values over rows and the columns of `span`, of all columns."""
        return values

    @property
    def pair_cost(self) -> int:
        """Cost of a pair of transforms of this grid, in transforms in double precision."""
        return 2 if self.precision == "double" else 1

    @cached_property
    def _memory(self) -> list[Modes]:
        """Memory that transforms work in, of one axis."""
        columns = self.points // 2 + 1
        return transform_memory(self.rows, columns, self._complex, self._transposition(columns))

    def in_single(self) -> "Grid":
        """The same grid in single precision; its transforms work in the memory of this one's."""
        grid = replace(self, precision="single")
        vars(grid)["_memory"] = [part.view(grid._complex) for part in self._memory]
        return grid

    def _transposition(self, columns: int) -> Transposition | None:
        """The exchange of so many columns of coefficients; None for one process."""
        return None

    @cached_property
    def _transforms(self) -> FieldTransforms:
        """All transforms of this grid, in one memory."""
        transposition = self._transposition(self.points // 2 + 1)
        return FieldTransforms(
            self._memory, self.points, self.rows, transposition, is_temporary=self.is_temporary
        )

    @property
    def work(self) -> Modes:
        """Coefficients that every transform of this grid works in."""
        return self._transforms.work.reshape(self.spectral_shape)

    @property
    def padded(self) -> Field:
        """The same memory as real values; a row has one or two more than the grid has points."""
        values = self._transforms.lines.view(self.real)
        return values if self.dimension == 2 else values[0]

    def transform(self) -> None:
        """`work` <- coefficients of the values in `padded`, without the factor 1/size."""
        self._transforms.to_columns()
        self._transforms.along_columns.run(lambda columns: columns.forward())

    def transform_back(self, kept: int | None = None) -> None:
        """`padded` <- values of the coefficients in `work`, without the factor 1/size.

        Only the first `kept` columns of the whole grid, if given, are not zero.
        """
        own = None if kept is None else kept - self.span[0]
        self._transforms.along_columns.run(lambda columns: columns.backward(), own)
        self._transforms.to_values()

    def _filter_by(
        self, kernel: Any, symbol: Field, *arguments: Any, blocks: Sequence[int] | None
    ) -> None:
        """`padded` <- values whose coefficients a kernel has multiplied: a pair of transforms.

        The kernel, of `grid.kernels`, gets the factor 1/size and the `arguments`.
        """
        symbol = self.as_rows(symbol)

        def multiply(columns: Columns) -> None:
            modes, span = columns.array.view(self.real), (columns.part.start, columns.part.stop)
            kernel(modes, columns.first, symbol, *span, 1 / self.size, *arguments)

        self._transforms.filter(multiply, blocks)

    def forward_into_work(self, field: Field) -> Modes:
        """`work` <- Fourier coefficients of a field, without 1/size."""
        self.padded[..., : self.points] = field
        self.transform()
        return self.work

    def field_of_work(self, factor: float = 1.0, kept: int | None = None) -> Field:
        """The field of the coefficients in `work`, which are lost, times a factor.

        `kept` as in `transform_back`.
        """
        self.transform_back(kept)
        return np.multiply(self.padded[..., : self.points], factor, out=self.empty())

    def filter_padded(self, symbol: Field, blocks: Sequence[int] | None = None) -> float:
        """`padded` <- F^-1 symbol F of the values in it: one pair of transforms, no copy.

        Returns the sum over the grid of the old values times the new ones. `blocks` are numbers of
        the blocks of 8 rows outside of which all values are zero; the rows there are not
        transformed.
        """
        energies = np.zeros(self.spectral_shape[-1])
        self._filter_by(kernels.apply_symbol, symbol, energies, blocks=blocks)
        energies *= self.multiplicity()
        return float(self.total(float(energies.sum()))) / self.size

    def unfilter_padded(
        self, symbol: Field, blocks: Sequence[int] | None = None, *, shift: float = 0.0
    ) -> None:
        """`padded` <- F^-1 1 / (symbol + shift) F of the values in it.

        Modes at which symbol + shift is zero are set to zero. `blocks` as in `filter_padded`.
        """
        self._filter_by(kernels.divide_by_symbol, symbol, shift, blocks=blocks)

    def apply(self, symbol: Field, field: Field, out: Field, mean: float = 0.0) -> Field:
        """out <- F^-1 symbol F field + `mean`, which is returned: one pair of transforms."""
        values = self.padded[..., : self.points]
        values[...] = field
        self.filter_padded(symbol)
        return np.add(values, mean, out=out)

    @cached_property
    def rows(self) -> LocalRows:
        """The rows of a field that this process holds; runs kernels over them."""
        return LocalRows(self.points_y, self._threads)

    @property
    def span(self) -> Span:
        """First wavenumber along x that this process holds, and the one after its last."""
        return 0, self.points // 2 + 1

    @property
    def ends(self) -> tuple[bool, bool]:
        """Whether q_x = 0 and the Nyquist wavenumber along x are among the wavenumbers of `span`.

        An odd number of points has no Nyquist wavenumber.
        """
        first, last = self.span
        return first == 0, self.points % 2 == 0 and last == self.points // 2 + 1

    @property
    def _threads(self) -> int:
        """Number of threads; 1 on small grids, for which a second thread is slower."""
        return self.threads if self.size >= MIN_THREADED_SIDE**2 and self.dimension == 2 else 1

    def as_rows(self, field: Any) -> Any:
        """A field, a symbol or `padded` with two axes, in one dimension too."""
        return field if self.dimension == 2 else field.reshape(1, -1)

    def coarser(self, shape: Shape) -> "Grid":
        """A temporary grid of fewer points on the same cell."""
        return replace(self, points=shape[-1], points_y=shape[0], is_temporary=True)

    def doubled(self) -> "Grid":
        """A temporary grid of twice the points along each axis, on a cell of twice the sides."""
        along_x = replace(self, points=2 * self.points, length=2 * self.length, is_temporary=True)
        if self.dimension == 1:
            return along_x
        return replace(along_x, points_y=2 * self.points_y, length_y=2 * self.length_y)

    def cut(self, symbol: Field, target: "Grid") -> Field:
        """The values of a symbol at the wavenumbers of a coarser grid."""
        m_y = np.fft.ifftshift(np.arange(target.points_y) - target.points_y // 2)
        kept = self.select_modes(self.as_rows(symbol), m_y, target.points // 2 + 1, self, target)
        return kept.reshape(target.spectral_shape)

    def select_modes(self, values: Any, m_y: Any, kept: int, source: "Grid", target: "Grid") -> Any:
        """Values at some wavenumbers, from the processes of one grid to those of another.

        These wavenumbers are `m_y` along y and the first `kept` along x. `self` is one of the two
        grids; if processes share only one of them, it is that one.
        """
        return values[m_y, :kept]

    def gather_rows(self, values: Any, span: Span) -> Any:
        """The rows `span` of the grid from the rows of all processes."""
        return values[slice(*span)]

    def average(self, values: Field, target: "Grid") -> Field:
        """Means over the pixels of another grid of the same cell; values are constant on a pixel.

        On a finer grid these are the values themselves where its pixels do not overlap several.
        """
        values = average_along_x(self.as_rows(values), target.points)
        of = self.points_y, target.points_y
        rows = self.gather_rows(values, covered_rows(target.row_span, *of))
        return average_rows(rows, target.row_span, *of).reshape(target.shape)

    def padded_transform(self) -> PaddedTransform:
        """Transforms of fields that are padded by zeros to twice the points a side."""
        shape, padded = self.whole_shape, padded_shape(self.whole_shape)
        transposition = self._transposition(padded[-1] // 2 + 1)
        return PaddedTransform(
            shape,
            padded,
            threads=self._threads,
            transposition=transposition,
            is_temporary=self.is_temporary,
        )

    def collect(self, field: Field) -> Field | None:
        """All of a field, on the first process; None on the others."""
        return field

    def diagonal(self, field: Field) -> Field:
        """Values along the diagonal of the cell; of a line contact, the whole line.

        On an oblong grid, the point next to the diagonal in each row or column, whichever are more.
        """
        if self.dimension == 1:
            return field.copy()
        step = np.arange(max(self.whole_shape))
        rows, columns = (
            (2 * step * n + step.size) // (2 * step.size) % n for n in self.whole_shape
        )
        first, last = self.row_span
        own = (first <= rows) & (rows < last)
        values = np.zeros(step.size, field.dtype)
        values[own] = field[rows[own] - first, columns[own]]
        return self.total(values)

    def resample(self, field: Field, target: "Grid") -> Field:
        """The same trigonometric polynomial on another grid of the same cell.

        A finer grid interpolates; a coarser one loses what it does not resolve, its own highest
        mode included.
        """
        modes = self.as_rows(self.forward_into_work(field))
        m_y, halved_y = shared_modes(self.points_y, target.points_y)
        m_x, halved_x = shared_modes(self.points, target.points)
        if halved_y:
            modes[m_y[-1]] *= 0.5
        if halved_x and self.ends[1]:
            modes[:, -1] *= 0.5
        grid, kept = target if self.whole else self, int(m_x[-1]) + 1
        modes = grid.select_modes(modes, m_y, kept, self, target)
        target.work[...] = 0.0
        target.as_rows(target.work)[m_y, : modes.shape[1]] = modes
        return target.field_of_work(1.0 / self.size, kept)
