"""Proofs that no flight exists, checked by code that shares nothing with the solver but the rows themselves.

A proof for one time of flight is a vector y in the dual cones with A'y = 0 and b'y < 0: a flight x would give
0 <= y'(b - A x) = b'y < 0. Rounding leaves A'y small, not zero, so the check demands -b'y > |A'y|_1 X, where
X bounds every unknown of any flight that keeps the thrust bounds and the dry mass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.convex.constraints import Rows

_UNNAMED = ("start", "motion", "landing", "thrust", "landing error", "landing error limit")


@dataclass(frozen=True, eq=False)
class FarkasProof:
    """Why no flight of one duration exists on one mesh.

    Attributes:
        time: [s] time of flight.
        rows: the constraints, b - A x in their cones.
        multipliers: y, shape (m,), over the rows in their order.
        unknown_bound: X, bound on the magnitude of every unknown.
    """

    time: float
    rows: list[Rows]
    multipliers: Array
    unknown_bound: float

    def __post_init__(self) -> None:
        """Move the multipliers into the dual cones exactly: solvers keep them there only to rounding."""
        y = self.multipliers.copy()
        for part, piece in self._pieces(y):
            if part.cone == "nonnegative":
                np.maximum(piece, 0.0, out=piece)
            elif part.cone == "second_order":
                cone = piece.reshape(-1, part.cone_size)
                cone[:, 0] = np.maximum(cone[:, 0], np.linalg.norm(cone[:, 1:], axis=1))
        object.__setattr__(self, "multipliers", y)

    def _pieces(self, y: Array) -> list[tuple[Rows, Array]]:
        sizes = np.cumsum([0] + [part.bound.size for part in self.rows])
        return [(part, y[a:b]) for part, a, b in zip(self.rows, sizes[:-1], sizes[1:], strict=True)]

    @property
    def margin(self) -> float:
        """-b'y - |A'y|_1 X, over the same with plus: above zero proves; nan or negative proves nothing."""
        size = 1 + max(int(part.column.max()) for part in self.rows)
        remainder, descent = np.zeros(size), 0.0
        for part, y in self._pieces(self.multipliers):
            np.add.at(remainder, part.column, part.value * y[part.row])
            descent -= float(part.bound @ y)
        doubt = float(np.abs(remainder).sum()) * self.unknown_bound
        scale = abs(descent) + doubt
        return (descent - doubt) / scale if np.isfinite(scale) and scale > 0.0 else float("nan")

    @property
    def verified(self) -> bool:
        """Whether the proof holds."""
        return self.margin > 0.0

    def supports(self, lower_bound: float) -> bool:
        """Whether `lower_bound` [kg] says that there is no flight of this duration."""
        return math.isinf(lower_bound)

    @property
    def causes(self) -> tuple[str, ...]:
        """Limits that take part in the contradiction."""
        greatest = float(np.abs(self.multipliers).max())
        return tuple(
            part.name
            for part, y in self._pieces(self.multipliers)
            if part.name not in _UNNAMED and float(np.abs(y).max(initial=0.0)) > 1e-5 * greatest
        )
