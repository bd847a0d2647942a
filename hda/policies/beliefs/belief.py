"""What all looks so far say about the true safety map, cell by cell: Bayes with Algorithm 2's noise.

The true V_P of a cell is taken as one of eight levels, weighted as on the training tiles. A look at a cell
that holds the level V reads V plus Gaussian noise of known deviation, clipped to [0, 1]: between the ends the
likelihood is the normal density, at an end the normal probability of lying beyond it. The noise of two looks,
and of two pixels in one cell, is independent, so log-likelihoods add and the posterior of each seen cell is
exact. A pixel too far from the vertical says nothing; one outside the map reads 0, as unsafe ground does.

V_D is V_P > 1/2 for Algorithm 1's maps, so the probability that a cell is safe is that of the upper levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.policies.beliefs.map_readings import CellReadings, fuse_into
from hda.policies.beliefs.placement_error import Placement
from hda.sensing.lidar import Lidar
from hda.task.observation import Observation

LEVELS = np.array([0.0, 0.1, 0.25, 0.4, 0.6, 0.75, 0.9, 1.0])
"""Values that V_P is taken to have; the first half is unsafe ground."""

LEVEL_SHARES = np.array([0.8980, 0.0014, 0.0003, 0.0002, 0.0002, 0.0002, 0.0009, 0.0988])
"""Share of the training tiles' ground at each level (`python -m hda.belief_statistics`)."""

_LOG_SHARES = np.log(LEVEL_SHARES)
_PRIOR = float(LEVEL_SHARES[LEVELS.size // 2 :].sum() / LEVEL_SHARES.sum())


@dataclass(frozen=True)
class CellSquare:
    """A square of 1 m cells with sides along the axes; row grows north, column east.

    Attributes:
        corner: (x, y) of its south-west corner [m], whole numbers.
        side: cells along each side.
    """

    corner: tuple[int, int]
    side: int

    @classmethod
    def around(cls, center: Array, half_side: int) -> CellSquare:
        """The cells within `half_side` [m] of `center` along each axis."""
        return cls((math.floor(center[0]) - half_side, math.floor(center[1]) - half_side), 2 * half_side)

    def cell(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the cell under `site`, or None outside the square."""
        row, column = math.floor(site[1]) - self.corner[1], math.floor(site[0]) - self.corner[0]
        return (row, column) if 0 <= row < self.side and 0 <= column < self.side else None

    def site(self, row: int, column: int, plane: float) -> Array:
        """[m] shape (3,), centre of a cell at the height of the target plane."""
        return np.array([self.corner[0] + column + 0.5, self.corner[1] + row + 0.5, plane])


class GroundBelief(Protocol):
    """What a policy asks of a belief over a square of 1 m cells, however its looks came about."""

    @property
    def corner(self) -> tuple[int, int]:
        """(x, y) of the square's south-west corner [m]."""
        ...

    @property
    def side(self) -> int:
        """Cells along each side."""
        ...

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Shape (n, n), whether a cell has been read."""
        ...

    @property
    def placement(self) -> Placement | None:
        """By how much its looks may be misplaced; None where no look errs."""
        ...

    def probability(self) -> NDArray[np.float32]:
        """Shape (n, n), probability that each cell is safe, from its own readings alone."""
        ...

    def cell(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the cell under `site`, or None outside the square."""
        ...

    def site(self, row: int, column: int, plane: float) -> Array:
        """[m] shape (3,), centre of a cell at the height of the target plane."""
        ...


@dataclass(frozen=True, eq=False)
class SafetyBelief:
    """The belief over a square of 1 m cells.

    Attributes:
        square: where it lies.
        readings: of all looks so far.
    """

    square: CellSquare
    readings: CellReadings = field(repr=False)

    @classmethod
    def blank(cls, center: Array, half_side: int) -> SafetyBelief:
        """Nothing seen yet, over the cells within `half_side` [m] of `center` along each axis."""
        return cls(CellSquare.around(center, half_side), CellReadings.none(LEVELS.size))

    @property
    def corner(self) -> tuple[int, int]:
        """(x, y) of the square's south-west corner [m]."""
        return self.square.corner

    @property
    def side(self) -> int:
        """Cells along each side."""
        return self.square.side

    @property
    def placement(self) -> None:
        """Its looks are taken to lie where they belong: no preset with such looks has a filter."""

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Shape (n, n), whether a cell has been read at least once."""
        out = np.zeros((self.side, self.side), dtype=np.bool_)
        out[self.readings.place] = self.readings.count > 0
        return out

    def fused(self, observation: Observation, lidar: Lidar) -> SafetyBelief:
        """The belief after one more look; itself if the look has no map."""
        target, position = observation.target, observation.state.position
        x, y = float(target[0]) - self.corner[0], float(target[1]) - self.corner[1]
        columns, rows = (self._covered(middle, observation.pixel_offset) for middle in (x, y))
        if not observation.has_map or columns.start >= columns.stop or rows.start >= rows.stop:
            return self
        readings = self.readings.copied_onto(rows, columns, _PRIOR)
        fuse_into(
            observation.safety_map,
            (x, y, observation.width),
            (
                float(position[0]) - self.corner[0],
                float(position[1]) - self.corner[1],
                float(position[2]) - float(target[2]),
            ),
            (lidar.noise / lidar.noise_range, math.tan(lidar.off_nadir_limit)),
            (LEVELS, _LOG_SHARES),
            (readings.row, readings.column, readings.log_likelihood, readings.count, readings.safe),
        )
        return SafetyBelief(self.square, readings)

    def _covered(self, middle: float, offset: Array) -> slice:
        """Cells of the square along one axis that hold pixels at these offsets [m] from a place in it."""
        first, last = (math.floor(middle + float(offset[end])) for end in (0, -1))
        return slice(max(first, 0), min(last + 1, self.side))

    def probability(self) -> NDArray[np.float32]:
        """Shape (n, n), posterior probability that each cell is safe, from its own readings alone."""
        out = np.full((self.side, self.side), _PRIOR, dtype=np.float32)
        out[self.readings.place] = self.readings.safe
        return out

    def cell(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the cell under `site`, or None outside the square."""
        return self.square.cell(site)

    def site(self, row: int, column: int, plane: float) -> Array:
        """[m] shape (3,), centre of a cell at the height of the target plane."""
        return self.square.site(row, column, plane)
