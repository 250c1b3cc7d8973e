"""The exchange between two decompositions of coefficients: by rows, and by columns.

A transform along x needs whole rows of a field, and one along y whole columns.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from gfmd_cli.grid.arrays import Modes
from gfmd_cli.grid.ranks import LONG_SPIN_SECONDS, Ranks

Span = tuple[int, int]
"""First index of a range, and the index after its last."""


@dataclass(frozen=True)
class Transposition:
    """All-to-all exchange of coefficients, shape (rows, columns), that processes share.

    `lines` are the rows of this process, shape (own rows, all columns), and `columns` its columns,
    shape (all rows, own columns). Both are contiguous and may lie in the same memory. `spare` is
    memory for as many coefficients as `lines`.
    """

    ranks: Ranks
    edges: list[int]
    """First row of each process, and the number of rows."""
    columns: int
    """Number of columns."""

    @cached_property
    def spans(self) -> list[Span]:
        """The columns of each process."""
        count = self.ranks.size
        return list(pairwise(self.columns * rank // count for rank in range(count + 1)))

    @property
    def row_count(self) -> int:
        """Number of rows of this process."""
        return self.edges[self.ranks.rank + 1] - self.edges[self.ranks.rank]

    @property
    def span(self) -> Span:
        """The columns of this process."""
        return self.spans[self.ranks.rank]

    def to_columns(self, lines: Modes, columns: Modes, spare: Modes) -> None:
        """Fill `columns` from the `lines` of all processes."""
        blocks = self._blocks(lines, spare)
        for (a, b), block in zip(self.spans, blocks, strict=True):
            block[...] = lines[:, a:b]
        self._exchange(self._in_blocks(lines, spare), self._in_columns(columns))

    def to_lines(self, lines: Modes, columns: Modes, spare: Modes) -> None:
        """Fill `lines` from the `columns` of all processes."""
        self._exchange(self._in_columns(columns), self._in_blocks(lines, spare))
        for (a, b), block in zip(self.spans, self._blocks(lines, spare), strict=True):
            lines[:, a:b] = block

    def _blocks(self, lines: Modes, spare: Modes) -> list[Modes]:
        """The columns of each process within `lines`, one block after the other in `spare`."""
        rows = len(lines)
        return [spare[rows * a : rows * b].reshape(rows, b - a) for a, b in self.spans]

    def _in_blocks(self, lines: Modes, spare: Modes) -> list[Any]:
        return [spare[: lines.size], [len(lines) * (b - a) for a, b in self.spans]]

    def _in_columns(self, columns: Modes) -> list[Any]:
        return [columns.reshape(-1), np.diff(self.edges) * columns.shape[1]]

    def _exchange(self, sent: list[Any], received: list[Any]) -> None:
        self.ranks.wait(self.ranks.comm.Ialltoallv(sent, received), spin=LONG_SPIN_SECONDS)
