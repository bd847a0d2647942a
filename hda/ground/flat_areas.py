"""Areas of one exact height in an elevation model, and how the ground around each goes on.

Measured ground is continuous: beyond the shore of a flat area it climbs about as much over the first pixels
as over the next ones, even where heights are whole metres or pixels are repeated. A value that stands for
unknown ground breaks off instead: most of its surroundings lie elsewhere, and are smooth among themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel

REACH = 6
"""[pixels] How far beyond an area its surroundings are looked at: a climb over three, compared with the next
three, since resampling blurs the edge of a void over one or two."""

_NEAR = 3


@dataclass(frozen=True, eq=False)
class FlatAreas:
    """Connected areas of one exact height, single pixels included; arrays of shape (areas,).

    Attributes:
        height: [m].
        pixels: how many it covers of the part that was asked for.
        sides: places of its outline beyond which the ground could be followed.
        cliffs: those of them where it breaks off.
        steps: neighbouring pixels of another height.
        high_steps: those of them that are higher or lower by more than any ground.
    """

    height: Array
    pixels: NDArray[Any]
    sides: NDArray[Any]
    cliffs: NDArray[Any]
    steps: NDArray[Any]
    high_steps: NDArray[Any]


def find_flat_areas(
    heights: Array, core: tuple[int, int, int, int], least_climb: float, high_step: float
) -> FlatAreas:
    """Areas of one exact height that touch the core of a block.

    Args:
        heights: [m] shape (rows, columns), NaN where unknown; the surroundings of the core too.
        core: first row, last row, first column, last column of the part that is asked for.
        least_climb: [m] a lower climb is no cliff.
        high_step: [m] between neighbours.
    """
    return FlatAreas(*_measure_areas(heights, *core, least_climb, high_step))


@compile_kernel
def _root(parents: NDArray[np.int32], place: int) -> int:
    while parents[place] != place:
        parents[place] = parents[parents[place]]
        place = parents[place]
    return place


@compile_kernel
def _connect(heights: Array) -> NDArray[np.int32]:
    """Union-find over neighbours of equal height: the parent of each pixel, in row-major order."""
    rows, columns = heights.shape
    parents = np.arange(rows * columns).astype(np.int32)
    for row in range(rows):
        for column in range(columns):
            place = row * columns + column
            if column > 0 and heights[row, column] == heights[row, column - 1]:
                parents[_root(parents, place)] = _root(parents, place - 1)
            if row > 0 and heights[row, column] == heights[row - 1, column]:
                parents[_root(parents, place)] = _root(parents, place - columns)
    return parents


@compile_kernel
def _follow(heights: Array, row: int, column: int, down: int, right: int) -> tuple[float, float]:
    """Climb over the first pixels beyond (row, column), and over the next; NaN where there are none."""
    rows, columns = heights.shape
    height = heights[row, column]
    known = 0
    for step in range(1, REACH + 1):
        y, x = row + step * down, column + step * right
        if y < 0 or y >= rows or x < 0 or x >= columns or np.isnan(heights[y, x]):
            break
        if step <= _NEAR and heights[y, x] == height:  # the area itself again, behind a speck
            return np.nan, np.nan
        known = step
    near = min(known, _NEAR)
    if near == 0:
        return np.nan, np.nan
    beyond = heights[row + near * down, column + near * right]
    climb = abs(beyond - height)
    if known == near:
        return climb, np.nan
    return climb, abs(heights[row + known * down, column + known * right] - beyond)


@compile_kernel
def _measure_areas(
    heights: Array,
    first_row: int,
    last_row: int,
    first_column: int,
    last_column: int,
    least_climb: float,
    high_step: float,
) -> tuple[
    Array,
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
]:
    rows, columns = heights.shape
    parents = _connect(heights)
    numbers = np.full(rows * columns, -1, np.int32)
    areas = 0
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            root = _root(parents, row * columns + column)
            if numbers[root] < 0 and not np.isnan(heights[row, column]):
                numbers[root] = areas
                areas += 1
    height = np.empty(areas)
    counts = np.zeros((5, areas), np.int64)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            here = heights[row, column]
            if np.isnan(here):
                continue
            area = numbers[_root(parents, row * columns + column)]
            height[area] = here
            counts[0, area] += 1
            for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                y, x = row + down, column + right
                if y < 0 or y >= rows or x < 0 or x >= columns:
                    continue
                there = heights[y, x]
                if np.isnan(there) or there == here:
                    continue
                counts[3, area] += 1
                counts[4, area] += abs(there - here) > high_step
                climb, further = _follow(heights, row, column, down, right)
                if not np.isnan(further):
                    counts[1, area] += 1
                    counts[2, area] += climb > 2.0 * further + least_climb
    return height, counts[0], counts[1], counts[2], counts[3], counts[4]
