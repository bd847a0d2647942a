"""Where each quantity stands in the decision vector of the convex problem: the only owner of its indices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from guidance.arrays import Index

_PER_NODE = 11  # position 3, velocity 3, log-mass 1, thrust acceleration 3, its slack 1


@dataclass(frozen=True)
class Layout:
    """Indices into the decision vector of `nodes` nodes, node by node.

    Attributes:
        nodes: N, at least 3; there are N - 1 intervals.
        free_landing_point: whether the vector ends with one more number, the landing error, because the
            landing point may move in the target plane.
    """

    nodes: int
    free_landing_point: bool = False

    @property
    def size(self) -> int:
        """Length of the decision vector."""
        return _PER_NODE * self.nodes + int(self.free_landing_point)

    def _block(self, first: int, width: int) -> Index:
        return np.arange(self.nodes)[:, None] * _PER_NODE + np.arange(first, first + width)

    @cached_property
    def position(self) -> Index:
        """Shape (N, 3)."""
        return self._block(0, 3)

    @cached_property
    def velocity(self) -> Index:
        """Shape (N, 3)."""
        return self._block(3, 3)

    @cached_property
    def log_mass(self) -> Index:
        """Shape (N,)."""
        return self._block(6, 1)[:, 0]

    @cached_property
    def acceleration(self) -> Index:
        """Thrust acceleration, shape (N, 3)."""
        return self._block(7, 3)

    @cached_property
    def slack(self) -> Index:
        """Upper bound of the thrust acceleration's magnitude, shape (N,)."""
        return self._block(10, 1)[:, 0]

    @property
    def landing_error(self) -> int:
        """Distance between landing point and target.

        Raises:
            AttributeError: the landing point is not free.
        """
        if not self.free_landing_point:
            raise AttributeError("the landing point of this layout is fixed")
        return self.size - 1
