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
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.sensing.lidar import Lidar
from hda.task.observation import Observation

LEVELS = np.array([0.0, 0.1, 0.25, 0.4, 0.6, 0.75, 0.9, 1.0])
"""Values that V_P is taken to have; the first half is unsafe ground."""

LEVEL_SHARES = np.array([0.8980, 0.0014, 0.0003, 0.0002, 0.0002, 0.0002, 0.0009, 0.0988])
"""Share of the training tiles' ground at each level (`python -m hda.belief_statistics`)."""

_LEAST_DEVIATION = 1e-3  # of a noiseless sensor: a level stands for an interval, not for one number


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
        corner: (x, y) of the square's south-west corner [m], whole numbers.
        log_likelihood: shape (levels, n, n), of all readings of a cell given each level; row grows north,
            column east.
        looks: shape (n, n), number of readings of each cell.
    """

    corner: tuple[int, int]
    log_likelihood: NDArray[np.float32] = field(repr=False)
    looks: NDArray[np.uint16] = field(repr=False)

    @classmethod
    def blank(cls, center: Array, half_side: int) -> SafetyBelief:
        """Nothing seen yet, over the cells within `half_side` [m] of `center` along each axis."""
        square = CellSquare.around(center, half_side)
        shape = (square.side, square.side)
        reading = np.zeros((LEVELS.size, *shape), dtype=np.float32)
        return cls(square.corner, reading, np.zeros(shape, dtype=np.uint16))

    @property
    def side(self) -> int:
        """Cells along each side."""
        return self.looks.shape[0]

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Shape (n, n), whether a cell has been read at least once."""
        return self.looks > 0

    def fused(self, observation: Observation, lidar: Lidar) -> SafetyBelief:
        """The belief after one more look; itself if the look has no map."""
        if not observation.has_map:
            return self
        log_likelihood, looks = self.log_likelihood.copy(), self.looks.copy()
        target = observation.target
        _fuse_into(
            observation.safety_map,
            _LookSquare(
                float(target[0]) - self.corner[0], float(target[1]) - self.corner[1], observation.width
            ),
            observation.state.position - np.array([self.corner[0], self.corner[1], target[2]]),
            _SensorNumbers(lidar.noise / lidar.noise_range, math.tan(lidar.off_nadir_limit)),
            LEVELS,
            log_likelihood,
            looks,
        )
        return SafetyBelief(self.corner, log_likelihood, looks)

    def probability(self) -> NDArray[np.float32]:
        """Shape (n, n), posterior probability that each cell is safe, from its own readings alone."""
        prior = float(LEVEL_SHARES[LEVELS.size // 2 :].sum() / LEVEL_SHARES.sum())
        out = np.full(self.looks.shape, prior, dtype=np.float32)
        _posterior_into(self.log_likelihood, self.looks, np.log(LEVEL_SHARES), out)
        return out

    def cell(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the cell under `site`, or None outside the square."""
        return CellSquare(self.corner, self.side).cell(site)

    def site(self, row: int, column: int, plane: float) -> Array:
        """[m] shape (3,), centre of a cell at the height of the target plane."""
        return CellSquare(self.corner, self.side).site(row, column, plane)


@compile_kernel
def log_reading(value: float, level: float, deviation: float) -> float:
    """Log-likelihood of a clipped reading of `level` under Gaussian noise."""
    if value <= 0.0:
        return math.log(max(0.5 * math.erfc(level / (deviation * math.sqrt(2.0))), 1e-300))
    if value >= 1.0:
        return math.log(max(0.5 * math.erfc((1.0 - level) / (deviation * math.sqrt(2.0))), 1e-300))
    score = (value - level) / deviation
    return -0.5 * score * score - math.log(deviation * math.sqrt(2.0 * math.pi))


class _LookSquare(NamedTuple):
    """[m] centre of a look, from the corner of the belief's square, and its width."""

    east: float
    north: float
    width: float


class _SensorNumbers(NamedTuple):
    """Deviation of a reading over its range [1/m], and the tangent of the off-nadir limit."""

    noise_per_metre: float
    off_nadir_slope: float


@compile_kernel
def _fuse_into(
    safety_map: NDArray[np.float32],
    look: _LookSquare,
    position: Array,
    sensor: _SensorNumbers,
    levels: Array,
    log_likelihood: NDArray[np.float32],
    looks: NDArray[np.uint16],
) -> None:
    """Add one look; lengths from the corner of the belief's square."""
    target_x, target_y, width = look
    side = looks.shape[0]
    n = safety_map.shape[0]
    height = position[2]
    seen_squared = (sensor.off_nadir_slope * height) ** 2 * (1.0 - 1e-9)
    for i in range(n):
        y = target_y + ((i + 0.5) / n - 0.5) * width
        row = math.floor(y)
        for j in range(n):
            x = target_x + ((j + 0.5) / n - 0.5) * width
            column = math.floor(x)
            across = (x - position[0]) ** 2 + (y - position[1]) ** 2
            if across > seen_squared or not (0 <= row < side and 0 <= column < side):
                continue
            deviation = max(sensor.noise_per_metre * math.sqrt(across + height * height), _LEAST_DEVIATION)
            looks[row, column] += 1
            for k in range(levels.size):
                log_likelihood[k, row, column] += log_reading(safety_map[i, j], levels[k], deviation)


@compile_kernel
def _posterior_into(
    log_likelihood: NDArray[np.float32],
    looks: NDArray[np.uint16],
    log_prior: Array,
    out: NDArray[np.float32],
) -> None:
    """Share of the posterior on the upper half of the levels, for the cells that were seen."""
    levels, rows, columns = log_likelihood.shape
    for row in range(rows):
        for column in range(columns):
            if looks[row, column] == 0:
                continue
            most = -np.inf
            for k in range(levels):
                most = max(most, log_prior[k] + log_likelihood[k, row, column])
            total, safe = 0.0, 0.0
            for k in range(levels):
                weight = math.exp(log_prior[k] + log_likelihood[k, row, column] - most)
                total += weight
                if 2 * k >= levels:
                    safe += weight
            out[row, column] = safe / total
