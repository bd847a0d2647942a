"""Where each quantity stands in the decision vector of the convex problem: the only owner of its indices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from guidance.arrays import Index

STATE_SIZE = 6
"""Position 3 and velocity 3 of a node, which stand before its log-mass."""
CONTROL_SIZE = 5
"""Log-mass 1, thrust acceleration 3 and its slack 1."""


@dataclass(frozen=True)
class CondensedLayout:
    """Indices into the decision vector without states of `nodes` nodes, node by node.

    Attributes:
        nodes: N, at least 3; there are N - 1 intervals.
    """

    nodes: int
    states: ClassVar[int] = 0

    @property
    def size(self) -> int:
        """Length of the decision vector."""
        return (self.states + CONTROL_SIZE) * self.nodes

    def _block(self, first: int, width: int) -> Index:
        return np.arange(self.nodes)[:, None] * (self.states + CONTROL_SIZE) + np.arange(first, first + width)

    @cached_property
    def log_mass(self) -> Index:
        """Shape (N,)."""
        return self._block(self.states, 1)[:, 0]

    @cached_property
    def acceleration(self) -> Index:
        """Thrust acceleration, shape (N, 3)."""
        return self._block(self.states + 1, 3)

    @cached_property
    def slack(self) -> Index:
        """Upper bound of the thrust acceleration's magnitude, shape (N,)."""
        return self._block(self.states + 4, 1)[:, 0]


@dataclass(frozen=True)
class Layout(CondensedLayout):
    """Indices into the whole decision vector: each node's state stands before the rest.

    Attributes:
        free_landing_point: whether the vector ends with one more number, the landing error, because the
            landing point may move in the target plane.
    """

    free_landing_point: bool = False
    states: ClassVar[int] = STATE_SIZE

    @property
    def size(self) -> int:
        """Length of the decision vector."""
        return super().size + int(self.free_landing_point)

    @cached_property
    def position(self) -> Index:
        """Shape (N, 3)."""
        return self._block(0, 3)

    @cached_property
    def velocity(self) -> Index:
        """Shape (N, 3)."""
        return self._block(3, 3)

    @property
    def landing_error(self) -> int:
        """Distance between landing point and target.

        Raises:
            AttributeError: the landing point is not free.
        """
        if not self.free_landing_point:
            raise AttributeError("the landing point of this layout is fixed")
        return self.size - 1
