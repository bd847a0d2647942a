"""Several scans on one lattice: what they say together of the height of each cell.

Cells of one size lie in the same place at each look, so the points of two scans fall into the same cells, and
the statistics of a cell are all that has to be kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.sensing.gridding import ElevationMap, PixelGrid


def cover_grids(first: PixelGrid, second: PixelGrid) -> PixelGrid:
    """The least grid that holds two of one cell size.

    Raises:
        ValueError: their cells are of different sizes.
    """
    if first.pixel_size != second.pixel_size:
        raise ValueError(
            f"grids must have one pixel_size, got {first.pixel_size:g} and {second.pixel_size:g} m"
        )
    if 0 in first.shape or 0 in second.shape:
        return second if 0 in first.shape else first
    row, column = min(first.first_row, second.first_row), min(first.first_column, second.first_column)
    north = max(first.first_row + first.rows, second.first_row + second.rows)
    east = max(first.first_column + first.columns, second.first_column + second.columns)
    return PixelGrid(row, column, first.pixel_size, north - row, east - column)


def place_on(grid: PixelGrid, elevation: ElevationMap) -> ElevationMap:
    """The same heights on a larger grid; NaN and 0 elsewhere."""
    own = elevation.grid
    row, column = own.first_row - grid.first_row, own.first_column - grid.first_column
    part = np.s_[row : row + own.rows, column : column + own.columns]
    height, spread = np.full(grid.shape, np.nan), np.full(grid.shape, np.nan)
    count = np.zeros(grid.shape, dtype=np.int32)
    height[part], spread[part], count[part] = elevation.height, elevation.spread, elevation.count
    return ElevationMap(grid, height, spread, count)


def fuse_elevations(
    earlier: ElevationMap, later: ElevationMap, percentile: float | None = 100.0
) -> ElevationMap:
    """What two scans say together, over the ground of both.

    The variances of a cell are averaged by the numbers of points. Of means the same is true, and their
    difference adds to the variance: all is then as if the points had been sorted in at once. Of percentiles
    the higher is kept, exact for the highest point: what one scan stepped over, the other may have hit.

    Args:
        earlier: on a grid of the same cell size.
        later: the scan that is added.
        percentile: by which both were gridded; None for the mean.

    Raises:
        ValueError: the cells are of different sizes.
    """
    grid = cover_grids(earlier.grid, later.grid)
    first, second = place_on(grid, earlier), place_on(grid, later)
    count = first.count + second.count
    weight = np.divide(second.count, count, out=np.zeros(grid.shape), where=count > 0)
    one, other = np.nan_to_num(first.height), np.nan_to_num(second.height)
    variance = (1.0 - weight) * np.nan_to_num(first.spread) ** 2 + weight * np.nan_to_num(second.spread) ** 2
    if percentile is None:
        height = (1.0 - weight) * one + weight * other
        variance += weight * (1.0 - weight) * (one - other) ** 2
    else:
        height = np.fmax(first.height, second.height)
    seen = count > 0
    return ElevationMap(grid, _only(height, seen), _only(np.sqrt(variance), seen), count)


def _only(values: Array, seen: NDArray[np.bool_]) -> Array:
    """The values where something was seen, else NaN."""
    return np.where(seen, values, np.nan)
