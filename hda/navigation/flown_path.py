"""What a filter is taken along: a path as it was really flown."""

from __future__ import annotations

from dataclasses import dataclass

from guidance.arrays import Array


@dataclass(frozen=True, eq=False)
class FlownPath:
    """A path at n control instants, one control period apart; the last may come at another time.

    Attributes:
        time: [s] shape (n,), n at least 2.
        states: shape (n, 7), true (x y z vx vy vz m) [m], [m/s], [kg], site frame.
        ranges: [m] shape (n - 1,), down to the ground at the instants after the first, NaN where there is
            none (`hda.navigation.measure_ranges`).
        attitudes: shape (n, 4), true unit quaternions, scalar first, that turn body vectors into the site
            frame; for a gyroscope alone.

    Raises:
        ValueError: the shapes do not fit together.
    """

    time: Array
    states: Array
    ranges: Array
    attitudes: Array | None = None

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit together: the kernels would reach beyond the arrays."""
        time, states, ranges, nodes = self.time.shape, self.states.shape, self.ranges.shape, self.time.size
        if nodes < 2 or time != (nodes,) or states != (nodes, 7) or ranges != (nodes - 1,):
            raise ValueError(f"flown path: shapes {time}, {states} and {ranges} do not fit together")
        if self.attitudes is not None and self.attitudes.shape != (nodes, 4):
            raise ValueError(
                f"flown path: attitudes must have shape {(nodes, 4)}, got {self.attitudes.shape}"
            )

    @property
    def periods(self) -> int:
        """How many control periods were flown."""
        return self.time.size - 1
