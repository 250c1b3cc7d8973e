"""Linear maps of fields that are zero beyond their own points, by transforms of padded fields.

The first rows and columns of the padded field are the field, all others are zero. The rows that are
zero need no transform along x. The columns are transformed in blocks that stay in the cache and
are never stored padded, so that the memory is that of a field padded along x alone. Processes that
share a field exchange no zero rows either.
"""

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
import pyfftw

from gfmd_cli.grid import plans
from gfmd_cli.grid.arrays import Field, Modes, Precision
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.grid.shared_transforms import Columns, ColumnTransforms, RowTransforms
from gfmd_cli.grid.transposition import Span, Transposition, column_spans


def padded_shape(shape: tuple[int, ...], factor: float) -> tuple[int, ...]:
    """Numbers of points that are fast to transform, at least `factor` times those of a shape.

    A factor of 2 makes a convolution linear: no load acts around the border.
    """
    return tuple(plans.fast_length(factor * n) for n in shape)


@dataclass(eq=False)
class PaddedTransform:
    """Maps F^-1 symbol F of real fields of a shape, padded by zeros; symbols are real and even."""

    shape: tuple[int, ...]
    """Shape of the fields."""
    padded: tuple[int, ...]
    """Shape of the padded fields."""
    precision: Precision = "double"
    threads: int = 1

    def __post_init__(self) -> None:
        self.rows, self.columns = (1, *self.shape)[-2:]
        self.padded_rows, self.padded_columns = (1, *self.padded)[-2:]
        self.real = np.dtype(np.float64 if self.precision == "double" else np.float32)
        self.modes = self.padded_columns // 2 + 1
        local_rows = LocalRows(self.own_rows, self.threads)
        self.pool, self.parts = local_rows.pool, local_rows.parts

    @property
    def own_rows(self) -> int:
        """Number of rows of a field that this process holds."""
        return self.rows

    @property
    def span(self) -> Span:
        """First wavenumber along x that this process holds, and the one after its last."""
        return 0, self.modes

    @property
    def symbol_shape(self) -> tuple[int, int]:
        """Shape of a symbol: q_y >= 0, and q_x >= 0 of `span`; the symbol is even in both."""
        first, last = self.span
        return self.padded_rows // 2 + 1, last - first

    def wavenumber(self, spacings: tuple[float, ...]) -> Field:
        """|q| [1/m] of the padded cell, of `symbol_shape`; `spacings` [m] in the order (y, x)."""
        sides = self.padded_rows * spacings[0], self.padded_columns * spacings[-1]
        numbers = np.arange(self.symbol_shape[0]), np.arange(*self.span)
        y, x = (m * (2 * np.pi / side) for m, side in zip(numbers, sides, strict=True))
        return np.hypot(y[:, None], x)

    def symbol_of(self, kernel: Field) -> Field:
        """The symbol of a convolution with a kernel G(|y|, |x|), given at the points of a field.

        Raises ValueError where the padding is less than twofold.
        """
        if self.padded_rows < 2 * self.rows - 1 or self.padded_columns < 2 * self.columns - 1:
            raise ValueError("a convolution needs twice the points")
        kernel = kernel.reshape(self.own_rows, self.columns)
        values, along_rows, along_columns = self._workspace
        values[:, : self.columns] = kernel
        values[:, self.columns :] = 0.0
        values[:, self.padded_columns - self.columns + 1 :] = kernel[:, :0:-1]
        along_rows.forward()
        self._to_columns()
        symbol, work = np.empty(self.symbol_shape, self.real), along_columns.work

        def mirror(columns: Columns) -> None:
            columns.coefficients[self.padded_rows - self.rows + 1 :] = work[:0:-1, columns.part]
            columns.forward()
            symbol[:, columns.part] = columns.coefficients[: len(symbol)].real

        along_columns.run(mirror)
        return symbol

    def apply(self, symbol: Field, field: Field, out: Field) -> Field:
        """out <- F^-1 symbol F field; return it. `out` may be `field`."""
        values, along_rows, along_columns = self._workspace
        values[:, : self.columns] = field.reshape(self.own_rows, self.columns)
        values[:, self.columns :] = 0.0
        mirrored = symbol[(self.padded_rows - 1) // 2 : 0 : -1]

        def multiply(columns: Columns) -> None:
            columns.coefficients[: len(symbol)] *= symbol[:, columns.part]
            columns.coefficients[len(symbol) :] *= mirrored[:, columns.part]

        along_rows.forward()
        self._to_columns()
        along_columns.filter(multiply)
        self._to_lines()
        along_rows.backward()
        scale = 1.0 / (self.padded_rows * self.padded_columns)
        target = out.reshape(self.own_rows, self.columns)
        np.multiply(values[:, : self.columns], scale, out=target)
        return out

    def _to_columns(self) -> None:
        """Exchange coefficients transformed along x for all rows of the columns of `span`."""

    def _to_lines(self) -> None:
        """Undo `_to_columns`."""

    @cached_property
    def _workspace(self) -> tuple[Field, RowTransforms, ColumnTransforms]:
        """The values of the padded rows, and the transforms in their memory."""
        lines, work, _ = self._memory
        values = lines.view(self.real)[:, : self.padded_columns]

        def make(fftw: plans.Plan) -> tuple[RowTransforms, ColumnTransforms]:
            along_rows = RowTransforms(values, lines, self.parts, self.pool, fftw)
            arguments = (work, len(self.parts), self.pool, fftw)
            return along_rows, ColumnTransforms(*arguments, padded_rows=self.padded_rows)

        return values, *plans.planned(make)

    @cached_property
    def _memory(self) -> tuple[Modes, Modes, Modes]:
        """Coefficients as rows and, in the same memory, as columns; memory for an exchange."""
        lines = self._empty((self.own_rows, self.modes))
        return lines, lines, lines

    def _empty(self, shape: tuple[int, ...]) -> Modes:
        kind = np.result_type(self.real, np.complex64)
        return pyfftw.empty_aligned(shape, dtype=kind)


@dataclass(eq=False, kw_only=True)
class DistributedPaddedTransform(PaddedTransform):
    """The same as `PaddedTransform`, for fields and symbols that several processes share.

    A process holds the rows between two `edges` of a field, and some columns of a symbol, and of
    the coefficients between the transforms along the two axes.
    """

    ranks: Ranks
    edges: list[int]
    """First row of each process, and the number of rows."""

    def __post_init__(self) -> None:
        super().__post_init__()
        spans = column_spans(self.modes, self.ranks.size)
        self.transposition = Transposition(self.ranks, self.edges, spans)

    @property
    def own_rows(self) -> int:
        """Number of rows of a field that this process holds."""
        return self.edges[self.ranks.rank + 1] - self.edges[self.ranks.rank]

    @property
    def span(self) -> Span:
        """First wavenumber along x that this process holds, and the one after its last."""
        return self.transposition.spans[self.ranks.rank]

    def _to_columns(self) -> None:
        self.transposition.to_columns(*self._memory)

    def _to_lines(self) -> None:
        lines, columns, spare = self._memory
        self.transposition.to_lines(columns, lines, spare)

    @cached_property
    def _memory(self) -> tuple[Modes, Modes, Modes]:
        """Coefficients as rows and, in the same memory, as columns; memory for the exchange."""
        first, last = self.span
        in_lines, in_columns = (self.own_rows, self.modes), (self.rows, last - first)
        memory = self._empty((max(prod(in_lines), prod(in_columns)),))
        lines, columns = (memory[: prod(s)].reshape(s) for s in (in_lines, in_columns))
        return lines, columns, self._empty((lines.size,))
