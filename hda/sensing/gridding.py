"""From the points of scans to an elevation map, in the frame in which the vehicle believes itself to be.

The lattice is fixed to the frame: cells of one size lie in the same place at each look, so that the points of
several looks fall into the same cells. A cell without a point is NaN, never filled: a hole behind a rock is
evidence of the rock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import finite_number

PIXEL_SIZES = (1.0, 1.25, 1.75, 2.5, 3.0, 3.5, 5.0, 6.0, 8.0)
"""[m] sides that a cell may have. The true map's cells are of 1 m. Up to 3 m a lander of 10 m on this raster
is no smaller than the true one."""


@dataclass(frozen=True)
class Gridding:
    """How points become an elevation map.

    Attributes:
        rays_per_pixel: least number of ray spacings on the ground that a cell is wide; above 1, as relief
            spreads the rays.
        percentile: of the points' heights that becomes the cell's; None for their mean. The mean sinks a rock
            into the ground around it; 100, the highest point, keeps it and rises with the noise.

    Raises:
        ValueError: a field is out of range.
    """

    rays_per_pixel: float = 1.05
    percentile: float | None = 100.0

    def __post_init__(self) -> None:
        """Refuse what gives no map."""
        finite_number("rays_per_pixel", self.rays_per_pixel, above=0.0)
        if self.percentile is not None:
            finite_number("percentile", self.percentile, at_least=0.0, at_most=100.0)

    def pixel_size(self, ray_spacing: float) -> float:
        """[m] side of the cells for rays that meet the ground `ray_spacing` [m] apart."""
        wanted = self.rays_per_pixel * ray_spacing * (1.0 - 1e-9)
        return next((size for size in PIXEL_SIZES if size >= wanted), PIXEL_SIZES[-1])


@dataclass(frozen=True)
class PixelGrid:
    """Square cells with sides along the axes; row grows north, column east.

    Attributes:
        first_row: cells from the origin of the frame to the southern edge.
        first_column: cells from the origin of the frame to the western edge.
        pixel_size: [m] side of a cell.
        rows: number of cells north.
        columns: number of cells east.
    """

    first_row: int
    first_column: int
    pixel_size: float
    rows: int
    columns: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.rows, self.columns

    @property
    def corner(self) -> tuple[float, float]:
        """(x, y) of the south-western corner [m]."""
        return self.first_column * self.pixel_size, self.first_row * self.pixel_size

    def rows_of(self, y: Array) -> NDArray[np.int64]:
        """Row that holds each y [m]; below 0 or from `rows` on outside the grid."""
        return np.floor(np.asarray(y) / self.pixel_size).astype(np.int64) - self.first_row

    def columns_of(self, x: Array) -> NDArray[np.int64]:
        """Column that holds each x [m]; below 0 or from `columns` on outside the grid."""
        return np.floor(np.asarray(x) / self.pixel_size).astype(np.int64) - self.first_column


@dataclass(frozen=True, eq=False)
class ElevationMap:
    """Heights as measured; all of shape (rows, columns), NaN and 0 where no point fell.

    Attributes:
        grid: where the cells lie.
        height: [m].
        spread: [m] one standard deviation: the sensor's and that of the points in the cell about their mean.
        count: points in the cell.
    """

    grid: PixelGrid
    height: Array
    spread: Array
    count: NDArray[np.int32]


def lay_grid(points: Array, pixel_size: float, most: int) -> PixelGrid:
    """Lay cells over points, (k, 3) [m]: over their bounding rectangle, at most `most` cells along a side.

    Where the points reach further, as over the rim of a pit, the grid is centred on their middle.
    """
    if len(points) == 0:
        return PixelGrid(0, 0, pixel_size, 0, 0)
    firsts, sizes = [], []
    for axis in (1, 0):
        low = math.floor(points[:, axis].min() / pixel_size)
        size = math.floor(points[:, axis].max() / pixel_size) - low + 1
        firsts.append(low + max(size - most, 0) // 2)
        sizes.append(min(size, most))
    return PixelGrid(firsts[0], firsts[1], pixel_size, sizes[0], sizes[1])


class _Lattice(NamedTuple):
    """`PixelGrid` for the kernel: south-western corner in cells, and the cells' side [m]."""

    first_row: int
    first_column: int
    pixel_size: float


class _Cells(NamedTuple):
    """Where the kernel writes: `ElevationMap` without its grid."""

    height: Array
    spread: Array
    points: NDArray[np.int32]


def grid_points(
    points: Array, deviation: Array, grid: PixelGrid, percentile: float | None = 100.0
) -> ElevationMap:
    """Sort points into cells.

    Args:
        points: [m] shape (k, 3), in the frame of the grid.
        deviation: [m] shape (k,), one sigma of each point's height.
        grid: the cells; points outside are left out.
        percentile: of the heights, with linear interpolation between points; None for their mean.
    """
    height, spread = np.full(grid.shape, np.nan), np.full(grid.shape, np.nan)
    count = np.zeros(grid.shape, dtype=np.int32)
    _grid_into(
        points,
        deviation,
        _Lattice(grid.first_row, grid.first_column, grid.pixel_size),
        -1.0 if percentile is None else percentile,
        _Cells(height, spread, count),
    )
    return ElevationMap(grid, height, spread, count)


@compile_kernel
def _grid_into(points: Array, deviation: Array, lattice: _Lattice, percentile: float, cells: _Cells) -> None:
    """Sort the heights by cell, then reduce each cell's; `percentile` below 0 is the mean."""
    height, spread, count = cells
    rows, columns = count.shape
    place = np.empty(points.shape[0], dtype=np.int64)
    for k in range(points.shape[0]):
        row = math.floor(points[k, 1] / lattice.pixel_size) - lattice.first_row
        column = math.floor(points[k, 0] / lattice.pixel_size) - lattice.first_column
        place[k] = -1
        if 0 <= row < rows and 0 <= column < columns:
            place[k] = row * columns + column
            count[row, column] += 1
    first = np.zeros(rows * columns + 1, dtype=np.int64)
    for cell in range(rows * columns):
        first[cell + 1] = first[cell] + count[cell // columns, cell % columns]
    heights, variances = np.empty(first[-1]), np.zeros(rows * columns)
    filled = first[:-1].copy()
    for k in range(points.shape[0]):
        if place[k] >= 0:
            heights[filled[place[k]]] = points[k, 2]
            filled[place[k]] += 1
            variances[place[k]] += deviation[k] ** 2
    for cell in range(rows * columns):
        n = first[cell + 1] - first[cell]
        if n > 0:
            own = heights[first[cell] : first[cell + 1]]
            row, column = cell // columns, cell % columns
            mean, variance = _mean_and_variance(own)
            height[row, column] = mean if percentile < 0.0 else _quantile(own, percentile)
            spread[row, column] = math.sqrt(variances[cell] / n + variance)


@compile_kernel
def _mean_and_variance(values: Array) -> tuple[float, float]:
    """Mean, and variance about it (of the population that was sampled; 0 for one value)."""
    n, total, square = values.size, 0.0, 0.0
    for value in values:
        total += value
    for value in values:
        square += (value - total / n) ** 2
    return total / n, square / (n - 1) if n > 1 else 0.0


@compile_kernel
def _quantile(values: Array, percentile: float) -> float:
    """Percentile of a few numbers, with linear interpolation; sorts them in place, by insertion."""
    for k in range(1, values.size):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    share = 0.01 * percentile * (values.size - 1)
    low = min(int(share), values.size - 1)
    high = min(low + 1, values.size - 1)
    return values[low] + (share - low) * (values[high] - values[low])
