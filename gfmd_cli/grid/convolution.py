"""Linear maps of fields that are zero beyond their own points, by transforms of padded fields.

The padded field has its first rows and columns from the field, the others are zero. The rows that
are zero need no transform along x. The columns are transformed in blocks that stay in the cache and
are never stored padded, so that the memory is that of a field padded along x alone.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pyfftw

from gfmd_cli.grid import plans
from gfmd_cli.grid.arrays import Field, Modes

BLOCK = 2**14  # coefficients of a block of columns: 256 KiB, in the cache of a core
NARROWEST = 8  # columns of a block; four make a line of the cache
PLANNING = 30.0  # seconds at most to look for a plan


def padded_shape(shape: tuple[int, ...], factor: float) -> tuple[int, ...]:
    """Numbers of points that are fast to transform, at least `factor` times those of a shape.

    A factor of 2 makes a convolution linear: no load acts around the border.
    """
    return tuple(int(pyfftw.next_fast_len(int(np.ceil(factor * n)))) for n in shape)


class PaddedTransform:
    """Maps F^-1 symbol F of real fields of a shape, padded by zeros; symbols are real and even."""

    def __init__(
        self,
        shape: tuple[int, ...],
        padded: tuple[int, ...],
        precision: Literal["double", "single"] = "double",
        threads: int = 1,
    ) -> None:
        self.shape, self.threads = shape, threads
        self.rows, self.columns = (1, *shape)[-2:]
        self.padded_rows, self.padded_columns = (1, *padded)[-2:]
        self.real = np.dtype(np.float64 if precision == "double" else np.float32)
        self.modes = self.padded_columns // 2 + 1
        self.width = min(self.modes, max(NARROWEST, BLOCK // self.padded_rows))

    @property
    def symbol_shape(self) -> tuple[int, int]:
        """Shape of a symbol: wavenumbers q_y >= 0 and q_x >= 0; the symbol is even in both."""
        return self.padded_rows // 2 + 1, self.modes

    def wavenumber(self, spacings: tuple[float, ...]) -> Field:
        """|q| [1/m] of the padded cell, of `symbol_shape`; `spacings` [m] in the order (y, x)."""
        sides = self.padded_rows * spacings[0], self.padded_columns * spacings[-1]
        y, x = (
            np.arange(n) * (2 * np.pi / side)
            for n, side in zip(self.symbol_shape, sides, strict=True)
        )
        return np.asarray(np.hypot(y[:, None], x))

    def symbol_of(self, kernel: Field) -> Field:
        """The symbol of a convolution with a kernel G(|y|, |x|), given at the points of a field."""
        if self.padded_rows < 2 * self.rows - 1 or self.padded_columns < 2 * self.columns - 1:
            raise ValueError("a convolution needs twice the points")
        kernel = kernel.reshape(self.rows, self.columns)
        even = np.zeros((self.padded_rows, self.padded_columns))
        even[: self.rows, : self.columns] = kernel
        even[self.padded_rows - self.rows + 1 :, : self.columns] = kernel[:0:-1]
        even[:, self.padded_columns - self.columns + 1 :] = even[:, self.columns - 1 : 0 : -1]
        modes = np.fft.rfft2(even).real[: self.symbol_shape[0]]
        return np.ascontiguousarray(modes, dtype=self.real)

    def apply(self, symbol: Field, field: Field, out: Field) -> Field:
        """out <- F^-1 symbol F field; return it. `out` may be `field`."""
        work, values, forward, backward = self._row_plans
        values[:, : self.columns] = field.reshape(self.rows, self.columns)
        values[:, self.columns :] = 0.0
        forward()
        if self.padded_rows == 1:
            work *= symbol
        else:
            self._filter_columns(work, symbol)
        backward()
        scale = 1.0 / (self.padded_rows * self.padded_columns)
        target = out.reshape(self.rows, self.columns)
        np.multiply(values[:, : self.columns], scale, out=target)
        return out

    def _filter_columns(self, work: Modes, symbol: Field) -> None:
        """Transform the padded columns, multiply them by the symbol and transform back."""
        block, forward, backward = self._column_plans
        upper, lower = slice(len(symbol)), slice(len(symbol), None)
        mirrored = symbol[(self.padded_rows - 1) // 2 : 0 : -1]
        for start in range(0, self.modes, self.width):
            part = slice(start, min(start + self.width, self.modes))
            here = block[:, : part.stop - part.start]
            here[: self.rows] = work[:, part]
            here[self.rows :] = 0.0
            forward()
            here[upper] *= symbol[:, part]
            here[lower] *= mirrored[:, part]
            backward()
            work[:, part] = here[: self.rows]

    @cached_property
    def _row_plans(self) -> tuple[Modes, Field, Callable[[], None], Callable[[], None]]:
        """Coefficients of the rows, their values in the same memory, and both transforms."""
        work = self._empty((self.rows, self.modes))
        values = work.view(self.real)[:, : self.padded_columns]
        forward, backward = self._planned((values, work), (work, values), axis=1)
        return work, values, forward, backward

    @cached_property
    def _column_plans(self) -> tuple[Modes, Callable[[], None], Callable[[], None]]:
        """A block of padded columns, and both transforms, in place."""
        block = self._empty((self.padded_rows, self.width))
        block[...] = 0.0
        forward, backward = self._planned((block, block), (block, block), axis=0)
        return block, forward, backward

    def _empty(self, shape: tuple[int, int]) -> Modes:
        kind = np.result_type(self.real, np.complex64)
        array: Modes = pyfftw.empty_aligned(shape, dtype=kind)
        return array

    def _planned(self, there: Any, back: Any, axis: int) -> list[Callable[[], None]]:
        """Execute functions of the plans of a transform and its inverse, without 1/size."""

        def plan(flags: tuple[str, ...]) -> list[Callable[[], None]]:
            ways = ((there, "FFTW_FORWARD"), (back, "FFTW_BACKWARD"))
            return [
                pyfftw.FFTW(
                    *arrays,
                    axes=(axis,),
                    direction=way,
                    flags=flags,
                    threads=self.threads,
                    planning_timelimit=PLANNING,
                ).execute
                for arrays, way in ways
            ]

        return plans.planned(plan)
