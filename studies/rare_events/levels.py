"""Levels of danger: where a flight stands before a look, by what the true map says of its target.

Three things make a level: whether the sensor will see the target in the looks to come, how far the target
lies from the nearest hazard, and how much safe ground there is about it. The policy never learns of them:
they only decide which flights are worth flying on, and how often.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.state import State
from hda.flight.episode import Flight
from hda.task.scenario import Scenario, ground_point

_SIGHTS = (0.95, 1.05)  # of the off-nadir limit
_MARGINS = (0.06, 0.15, 0.4, 1.0)  # [m] to the nearest hazard
_SHARES = (0.05, 0.25, 0.5)  # of safe ground about a site
_ROUND = 12  # [m] about it
_REACH = math.ceil(_MARGINS[-1])
_HAZARD, _LOST = len(_MARGINS) + 1, len(_MARGINS) + 2

SHAPE = (len(_SIGHTS) + 1, len(_MARGINS) + 3, len(_SHARES) + 1)
"""Classes of sight, margin and room; the last two margins are those of a hazardous target, which has safe
ground in view, or none."""


def find_level(scenario: Scenario, flight: Flight) -> int:
    """Number of the level of a flight before its next look, below the product of SHAPE.

    A hazardous target is judged by the nearest safe ground in view, where a policy may go from it.
    """
    rules, lidar, safe = scenario.preset.rules, scenario.preset.lidar, scenario.tile.deterministic
    target, state = ground_point(scenario, flight.target), flight.state
    row, column = math.floor(target[1]), math.floor(target[0])
    if scenario.tile.is_safe(target):
        margin = int(np.searchsorted(_MARGINS, hazard_distance(safe, target, _REACH)))
    else:
        reach = math.ceil(0.5 * lidar.width(state.position, target))
        found = nearest_safe_cell(safe, row, column, reach)
        margin = _LOST if found is None else _HAZARD
        row, column = found or (row, column)
        target = np.array([column + 0.5, row + 0.5, target[2]])
    limit, interval = math.tan(lidar.off_nadir_limit), rules.decision_interval
    sight = int(np.searchsorted(_SIGHTS, widest_slope(state, target, flight.time_to_go, interval) / limit))
    room = int(np.searchsorted(_SHARES, safe_share(safe, row, column, _ROUND)))
    return int(np.ravel_multi_index((sight, margin, room), SHAPE))


def widest_slope(state: State, site: Array, time_to_go: float, interval: float) -> float:
    """Greatest tangent of the angle from the vertical under which the looks to come will see a site.

    The flight is taken to be that of least energy to rest at the site, a cubic of the time to go
    (D'Souza, AIAA 97-3709): with offset e and velocity v at the time to go t, at the time to go s it is
    (3 e / t^2 + v / t) s^2 - (2 e / t^3 + v / t^2) s^3. Of the last second nothing is asked.

    Args:
        state: at this look.
        site: [m] shape (3,).
        time_to_go: [s] at this look.
        interval: [s] between looks.

    Returns:
        The tangent; 0 where no look is to come.
    """
    left = np.arange(time_to_go - interval, 1.0, -interval)
    if left.size == 0:
        return 0.0
    offset, velocity, t = state.position - site, state.velocity, time_to_go
    square, cube = 3.0 * offset / t**2 + velocity / t, 2.0 * offset / t**3 + velocity / t**2
    east, north, up = square[:, None] * left**2 - cube[:, None] * left**3
    return float((np.hypot(east, north) / np.maximum(up, 1e-3)).max())


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


def nearest_safe_cell(safe: NDArray[np.bool_], row: int, column: int, reach: int) -> tuple[int, int] | None:
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
