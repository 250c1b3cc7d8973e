"""Linear maps of fields that are zero beyond their own points, by transforms of padded fields.

The first rows and columns of the padded field are the field, all others are zero. The rows that are
zero need no transform along x. The columns are transformed in blocks that stay in the cache and
are never stored padded, so that the memory is that of a field padded along x alone. Processes that
share a field exchange no zero rows either.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gfmd_cli.grid import plans
from gfmd_cli.grid.arrays import Field, Modes, Precision
from gfmd_cli.grid.modes import multiplicity
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.grid.shared_transforms import Columns, FieldTransforms, transform_memory
from gfmd_cli.grid.transposition import Transposition


def padded_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Numbers of points that are fast to transform, at least twice those of a shape.

    This makes a convolution linear: no load acts around the border.
    """
    return tuple(plans.fast_length(2 * n) for n in shape)


@dataclass(eq=False)
class PaddedTransform:
    """Maps F^-1 symbol F of real fields of a shape, padded by zeros; symbols are real and even.

    Of processes that share the fields each holds some of the rows, and some columns of a symbol.
    """

    shape: tuple[int, ...]
    """Shape of the fields."""
    padded: tuple[int, ...]
    """Shape of the padded fields."""
    precision: Precision = "double"
    threads: int = 1
    transposition: Transposition | None = None
    """The exchange between the processes that share the fields; None for one process."""
    is_temporary: bool = False
    """As of `Grid`."""

    def __post_init__(self) -> None:
        self.field_rows, self.field_columns = (1, *self.shape)[-2:]
        self.padded_rows, self.padded_columns = (1, *self.padded)[-2:]
        self.real = np.dtype(self.precision)
        self.own_rows, self.span = self.field_rows, (0, self.padded_columns // 2 + 1)
        if self.transposition is not None:
            self.own_rows, self.span = self.transposition.row_count, self.transposition.span
        self.local_rows = LocalRows(self.own_rows, self.threads)

    @property
    def symbol_shape(self) -> tuple[int, int]:
        """Shape of a symbol, even in q_y and q_x: q_y >= 0, and the q_x >= 0 of this process."""
        first, last = self.span
        return self.padded_rows // 2 + 1, last - first

    def symbol_of(self, kernel: Field) -> Field:
        """The symbol of a convolution with a kernel G(|y|, |x|), given at the points of a field.

        The padding must be twofold.
        """
        kernel = kernel.reshape(self.own_rows, self.field_columns)
        transforms, symbol = self._transforms, np.empty(self.symbol_shape, self.real)
        values, work = transforms.values, transforms.work
        values[:, : self.field_columns] = kernel
        values[:, self.field_columns :] = 0.0
        values[:, self.padded_columns - self.field_columns + 1 :] = kernel[:, :0:-1]

        def mirror(columns: Columns) -> None:
            columns.coefficients[self.padded_rows - self.field_rows + 1 :] = work[
                :0:-1, columns.part
            ]
            columns.forward()
            symbol[:, columns.part] = columns.coefficients[: len(symbol)].real

        transforms.to_columns()
        transforms.along_columns.run(mirror)
        return symbol

    def apply(self, symbol: Field, field: Field, out: Field) -> Field:
        """out <- F^-1 symbol F field; return it. `out` may be `field`."""
        values = self._transforms.values
        values[:, : self.field_columns] = field.reshape(self.own_rows, self.field_columns)
        values[:, self.field_columns :] = 0.0
        mirrored = symbol[(self.padded_rows - 1) // 2 : 0 : -1]

        def multiply(columns: Columns) -> None:
            columns.coefficients[: len(symbol)] *= symbol[:, columns.part]
            columns.coefficients[len(symbol) :] *= mirrored[:, columns.part]

        self._transforms.filter(multiply)
        scale = 1.0 / (self.padded_rows * self.padded_columns)
        target = out.reshape(self.own_rows, self.field_columns)
        np.multiply(values[:, : self.field_columns], scale, out=target)
        return out

    def mean_square(self, symbol: Field) -> float:
        """Mean square of a symbol over all q except 0; with several processes, its part of that."""
        first, last = self.span
        down, across = map(multiplicity, (self.padded_rows, self.padded_columns))
        total = np.einsum("i,ij,ij->j", down, symbol, symbol) @ across[first:last]
        longest = float(symbol[0, 0]) ** 2 if first == 0 else 0.0
        return float(total - longest) / (self.padded_rows * self.padded_columns)

    def in_single(self) -> "PaddedTransform":
        """The same in single precision; its transforms work in the memory of these."""
        transform = replace(self, precision="single")
        vars(transform)["_memory"] = [part.view(np.complex64) for part in self._memory]
        return transform

    @cached_property
    def _memory(self) -> list[Modes]:
        """Memory of the transforms."""
        kind, count = np.result_type(self.real, np.complex64), self.padded_columns // 2 + 1
        return transform_memory(self.local_rows, count, kind, self.transposition)

    @cached_property
    def _transforms(self) -> FieldTransforms:
        """The transforms of the padded fields."""
        return FieldTransforms(
            self._memory,
            self.padded_columns,
            self.local_rows,
            self.transposition,
            padded_rows=self.padded_rows,
            is_temporary=self.is_temporary,
        )
