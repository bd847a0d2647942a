"""Where each quantity stands in the decision vector of a rigid body's programme, and rows of cones on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array, Index
from guidance.successive.discretisation import CONTROL, STATE


class ConeRows:
    """Rows b - A x in cones, block by block."""

    def __init__(self) -> None:
        """Begin without rows."""
        self.row: list[Index] = []
        self.column: list[Index] = []
        self.value: list[Array] = []
        self.bound: list[Array] = []
        self.cones: list[tuple[str, int]] = []
        self.count = 0

    def add(self, kind: str, bound: Array, *terms: tuple[Index, float | Array], size: int = 0) -> None:
        """Add rows.

        Args:
            kind: of the cones.
            bound: b, of any shape.
            terms: (column, value) pairs: a column for each bound, or along one more axis several.
            size: rows in each cone of the second order.
        """
        row = self.count + np.arange(bound.size).reshape(bound.shape)
        for column, value in terms:
            wide = row if column.ndim == row.ndim else row[..., None]
            self.row.append(np.broadcast_to(wide, column.shape).ravel())
            self.column.append(column.ravel())
            self.value.append(np.broadcast_to(value, column.shape).ravel())
        self.bound.append(bound.ravel())
        self.count += bound.size
        if kind == "second_order":
            self.cones += [(kind, size)] * (bound.size // size)
        else:
            self.cones.append((kind, bound.size))

    def add_cones(
        self,
        bound: Array,
        columns: tuple[Index, ...],
        weights: tuple[float, ...],
        rows: tuple[tuple[int, int, float], ...],
    ) -> None:
        """Add cones of the second order, one for each line of `bound`.

        Args:
            bound: b, shape (cones, size).
            columns: blocks, a line for each cone.
            weights: of the blocks.
            rows: (row of the cone, column of the blocks, factor).
        """
        first, count, size = self.count, *bound.shape
        for block, weight in zip(columns, weights, strict=True):
            for row, column, factor in rows:
                self.row.append(first + size * np.arange(count) + row)
                self.column.append(block[:, column])
                self.value.append(np.full(count, -weight * factor))
        self.bound.append(bound.ravel())
        self.count += bound.size
        self.cones += [("second_order", size)] * count


@dataclass(frozen=True)
class ProgrammeLayout:
    """Columns: states, controls, time of flight, virtual controls up and down."""

    nodes: int

    @property
    def state(self) -> Index:
        """Shape (N, 14)."""
        return np.arange(self.nodes * STATE).reshape(self.nodes, STATE)

    @property
    def control(self) -> Index:
        """Shape (N, 6)."""
        return self.nodes * STATE + np.arange(self.nodes * CONTROL).reshape(self.nodes, CONTROL)

    @property
    def duration(self) -> int:
        """One column."""
        return self.nodes * (STATE + CONTROL)

    @property
    def virtual(self) -> tuple[Index, Index]:
        """Two of shape (N - 1, 14)."""
        count = (self.nodes - 1) * STATE
        up = self.duration + 1 + np.arange(count).reshape(-1, STATE)
        return up, up + count

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.duration + 1 + 2 * (self.nodes - 1) * STATE
