"""Levels of danger: where a flight stands before a look, by what the true map says of its target.

The policy never learns of them: they only decide which flights are worth flying on, and how often.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.flight.episode import Flight
from hda.ground.tile import Tile
from hda.task.scenario import Scenario, ground_point

_EDGES = (0.06, 0.15, 0.4, 1.0)  # [m] from a site to the nearest hazard
_SHARES = (0.05, 0.25, 0.5)  # of safe ground about it
_ROUND = 12  # [m] about it
_MARGINS, _ROOMS = len(_EDGES) + 1, len(_SHARES) + 1
LOST = (_MARGINS + 1) * _ROOMS
"""Level of a hazardous target without safe ground in view."""
LEVELS = LOST + 1
"""Levels of the ground: a safe target by its margin and room, a hazardous one by the room of the nearest safe
ground, and LOST."""


@dataclass(frozen=True)
class Standing:
    """Where a flight stands before a look.

    Attributes:
        stage: looks to come after this one, by the time to go.
        level: of the ground, below LEVELS.
    """

    stage: int
    level: int


def stand(scenario: Scenario, flight: Flight) -> Standing:
    """Find the level of a flight before its next look."""
    rules, tile = scenario.preset.rules, scenario.tile
    stage = int(flight.time_to_go / rules.decision_interval)
    target = ground_point(scenario, flight.target)
    width = scenario.preset.lidar.width(flight.state.position, target)
    return Standing(min(stage, rules.max_decisions), _level(tile, target, 0.5 * width))


def _level(tile: Tile, target: Array, reach: float) -> int:
    safe, row, column = tile.deterministic, math.floor(target[1]), math.floor(target[0])
    if tile.is_safe(target):
        margin = int(np.searchsorted(_EDGES, hazard_distance(safe, target, math.ceil(_EDGES[-1]))))
        return margin * _ROOMS + _room(safe, row, column)
    found = nearest_safe_cell(safe, row, column, math.ceil(reach))
    return LOST if found is None else _MARGINS * _ROOMS + _room(safe, *found)


def hazard_distance(safe: NDArray[np.bool_], point: Array, reach: int) -> float:
    """[m] from a point to the nearest unsafe cell, of those up to `reach` cells away; infinite without one.

    The outside of the map is unsafe.
    """
    row, column = math.floor(point[1]), math.floor(point[0])
    rows, columns = np.arange(row - reach, row + reach + 1), np.arange(column - reach, column + reach + 1)
    inside = ((rows >= 0) & (rows < safe.shape[0]))[:, None] & ((columns >= 0) & (columns < safe.shape[1]))
    near = safe[rows.clip(0, safe.shape[0] - 1)[:, None], columns.clip(0, safe.shape[1] - 1)] & inside
    north = np.maximum(np.maximum(rows - point[1], point[1] - rows - 1.0), 0.0)
    east = np.maximum(np.maximum(columns - point[0], point[0] - columns - 1.0), 0.0)
    distance = np.hypot(north[:, None], east)
    return float(np.where(near, np.inf, distance).min())


def nearest_safe_cell(
    safe: NDArray[np.bool_], row: int, column: int, reach: int
) -> tuple[int, int] | None:
    """The safe cell nearest to (row, column) within `reach` cells along each axis, or None."""
    first_row, first_column = max(row - reach, 0), max(column - reach, 0)
    near = safe[first_row : max(row + reach + 1, 0), first_column : max(column + reach + 1, 0)]
    rows, columns = np.nonzero(near)
    if rows.size == 0:
        return None
    rows, columns = rows + first_row, columns + first_column
    best = int(np.argmin((rows - row) ** 2 + (columns - column) ** 2))
    return int(rows[best]), int(columns[best])


def safe_share(safe: NDArray[np.bool_], row: int, column: int, radius: int) -> float:
    """Share of safe cells in the square of 2 radius + 1 cells about a cell; outside the map is unsafe."""
    near = safe[max(row - radius, 0) : row + radius + 1, max(column - radius, 0) : column + radius + 1]
    return float(np.count_nonzero(near)) / (2 * radius + 1) ** 2


def _room(safe: NDArray[np.bool_], row: int, column: int) -> int:
    return int(np.searchsorted(_SHARES, safe_share(safe, row, column, _ROUND)))
