"""Readings of the map that looks gave, cell by cell: what they say of each level, and of safe ground.

They are kept on the rectangle of cells that holds them: far less than the square that a policy prices.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_vector_kernel

_LEAST_DEVIATION = 1e-3  # of a noiseless sensor: a level stands for an interval, not for one number
_LEAST_LIKELIHOOD = 1e-300
_NO_TAIL = 27.0  # erfc beyond is less than twice that


@dataclass(frozen=True, eq=False)
class CellReadings:
    """All readings so far, on a rectangle of cells; row grows north, column east.

    Attributes:
        row: of the rectangle's first cell in the square.
        column: of the same cell.
        log_likelihood: shape (rows, columns, levels), of all readings of a cell given each level.
        count: shape (rows, columns), number of readings of each cell.
        safe: shape (rows, columns), posterior probability that a cell is safe.
    """

    row: int
    column: int
    log_likelihood: NDArray[np.float32] = field(repr=False)
    count: NDArray[np.uint16] = field(repr=False)
    safe: NDArray[np.float32] = field(repr=False)

    @classmethod
    def none(cls, levels: int) -> CellReadings:
        """No readings, on no cells."""
        nothing = np.zeros((0, 0, levels), dtype=np.float32)
        return cls(0, 0, nothing, np.zeros((0, 0), dtype=np.uint16), np.zeros((0, 0), dtype=np.float32))

    @property
    def place(self) -> tuple[slice, slice]:
        """Rows and columns of the square that the rectangle takes."""
        rows, columns = self.count.shape
        return slice(self.row, self.row + rows), slice(self.column, self.column + columns)

    def copied_onto(self, rows: slice, columns: slice, prior: float) -> CellReadings:
        """A copy on the smallest rectangle that holds this one and another.

        Args:
            rows: of the other, in the square.
            columns: of the other.
            prior: probability that a cell without a reading is safe.
        """
        down, across = self.place
        if self.count.size:
            rows = slice(min(rows.start, down.start), max(rows.stop, down.stop))
            columns = slice(min(columns.start, across.start), max(columns.stop, across.stop))
        shape = rows.stop - rows.start, columns.stop - columns.start
        out = CellReadings(
            rows.start,
            columns.start,
            np.zeros((*shape, self.log_likelihood.shape[2]), dtype=np.float32),
            np.zeros(shape, dtype=np.uint16),
            np.full(shape, prior, dtype=np.float32),
        )
        inside = (
            slice(down.start - rows.start, down.stop - rows.start),
            slice(across.start - columns.start, across.stop - columns.start),
        )
        if self.count.size:
            for name in ("log_likelihood", "count", "safe"):
                getattr(out, name)[inside] = getattr(self, name)
        return out


@compile_vector_kernel
def _add_reading(value: float, levels: Array, deviation: float, log_likelihood: NDArray[np.float32]) -> None:
    """Add the log-likelihood of a clipped reading given each level, under Gaussian noise."""
    if 0.0 < value < 1.0:
        constant = math.log(deviation * math.sqrt(2.0 * math.pi))
        for k in range(levels.size):
            score = (value - levels[k]) / deviation
            log_likelihood[k] += -0.5 * score * score - constant
        return
    for k in range(levels.size):
        beyond = levels[k] if value <= 0.0 else 1.0 - levels[k]
        score = beyond / (deviation * math.sqrt(2.0))
        tail = 0.5 * math.erfc(score) if score < _NO_TAIL else 0.0
        log_likelihood[k] += math.log(max(tail, _LEAST_LIKELIHOOD))


@compile_vector_kernel
def _safe_share(log_likelihood: NDArray[np.float32], log_prior: Array) -> float:
    """Share of a cell's posterior on the upper half of the levels."""
    levels = log_prior.size
    most = -np.inf
    for k in range(levels):
        most = max(most, log_prior[k] + log_likelihood[k])
    total, safe = 0.0, 0.0
    for k in range(levels):
        weight = math.exp(log_prior[k] + log_likelihood[k] - most)
        total += weight
        if 2 * k >= levels:
            safe += weight
    return safe / total


@compile_vector_kernel
def fuse_into(
    safety_map: NDArray[np.float32],
    look: tuple[float, float, float],
    lander: tuple[float, float, float],
    sensor: tuple[float, float],
    assumed: tuple[Array, Array],
    cells: tuple[int, int, NDArray[np.float32], NDArray[np.uint16], NDArray[np.float32]],
) -> None:
    """Add one look to the cells that it read; lengths from the square's corner.

    Args:
        safety_map: shape (n, n).
        look: [m] (x, y) of its centre, and its width.
        lander: [m] (x, y), and the height above the plane.
        sensor: deviation of a reading over its range [1/m], and the tangent of the off-nadir limit.
        assumed: levels and the logarithm of their prior, shape (levels,) each.
        cells: the attributes of a `CellReadings`, in order.
    """
    center_x, center_y, width = look
    lander_x, lander_y, height = lander
    noise_per_metre, off_nadir_slope = sensor
    levels, log_prior = assumed
    first_row, first_column, log_likelihood, count, safe = cells
    rows, columns = count.shape
    n = safety_map.shape[0]
    seen_squared = (off_nadir_slope * height) ** 2 * (1.0 - 1e-9)
    for i in range(n):
        y = center_y + ((i + 0.5) / n - 0.5) * width
        row = math.floor(y) - first_row
        for j in range(n):
            x = center_x + ((j + 0.5) / n - 0.5) * width
            column = math.floor(x) - first_column
            across = (x - lander_x) ** 2 + (y - lander_y) ** 2
            if across > seen_squared or not (0 <= row < rows and 0 <= column < columns):
                continue
            deviation = max(noise_per_metre * math.sqrt(across + height * height), _LEAST_DEVIATION)
            count[row, column] += 1
            _add_reading(safety_map[i, j], levels, deviation, log_likelihood[row, column])
            safe[row, column] = np.nan  # to be worked out below
    for row in range(rows):
        for column in range(columns):
            if np.isnan(safe[row, column]):
                safe[row, column] = _safe_share(log_likelihood[row, column], log_prior)
