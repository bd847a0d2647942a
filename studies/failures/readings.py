"""What the looks of an episode showed, by the true map: which pixels read the ground, and what they said."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.state import State
from hda.flight.record import EpisodeRecord
from hda.policies.privileged.knowable_ground import KnowableGround
from hda.sensing.lidar import Lidar
from hda.sensing.sensor_axis import sensor_axis
from hda.task.scenario import Scenario, ground_point, true_heights


def read_pixels(
    record: EpisodeRecord, index: int
) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.bool_]]:
    """Cells that the pixels of look `index` show: rows (n,), columns (n,), and which (n, n) read the ground.

    Row i of the look shows row rows[i] of the tile. A pixel too far from the vertical, outside the map, or in
    a look without a map reads nothing; nor does one of a ranging LIDAR where Algorithm 1 has a hole. On a
    rigid body the limit counts from its own axis; there the holes of a ranging LIDAR alone tell.
    """
    scenario, observation = record.scenario, record.observations[index]
    error = scenario.navigation_error
    aim = ground_point(scenario, observation.target)
    position = observation.state.position - error[:3]
    x, y = aim[0] + observation.pixel_offset, aim[1] + observation.pixel_offset
    rows, columns = np.floor(y).astype(int), np.floor(x).astype(int)
    height, width = scenario.tile.deterministic.shape
    inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))[None, :]
    rays = np.empty((y.size, x.size, 3))
    rays[..., 0], rays[..., 1] = x - position[0], (y - position[1])[:, None]
    rays[..., 2] = aim[2] - position[2]
    read = _within_limit(record, index, rays) & inside
    if observation.ground is not None:
        read &= observation.ground.known_map(observation.target, observation.width, rows.size)
    elif isinstance(scenario.preset.lidar, Lidar) and scenario.preset.lidar.dropout > 0.0:
        read &= observation.has_map
    return rows, columns, read


def _within_limit(record: EpisodeRecord, index: int, rays: Array) -> NDArray[np.bool_]:
    """Which rays [m] to the ground, shape (n, n, 3), the sensor's off-nadir limit allows."""
    limit, flown = record.scenario.preset.lidar.off_nadir_limit, record.segments[index].body_path
    if flown is None:
        farthest = -math.tan(limit) * rays[..., 2]
        return rays[..., 0] ** 2 + rays[..., 1] ** 2 <= farthest * farthest
    if record.observations[index].ground is not None:
        return np.ones(rays.shape[:2], dtype=bool)
    return rays @ sensor_axis(flown[0, 6:10]) >= math.cos(limit) * np.linalg.norm(rays, axis=2)


def count_safe_cells(record: EpisodeRecord) -> tuple[int, int]:
    """(distinct truly safe cells that looks read, those of them within reach at such a look)."""
    scenario = record.scenario
    truth = scenario.tile.deterministic
    seen: set[tuple[int, int]] = set()
    reached: set[tuple[int, int]] = set()
    for index, observation in enumerate(record.observations):
        rows, columns, read = read_pixels(record, index)
        where = np.argwhere(read)
        cells = {(int(rows[i]), int(columns[j])) for i, j in where if truth[rows[i], columns[j]]}
        seen |= cells
        aim = ground_point(scenario, observation.target)
        state = _true_state(scenario, observation.state)
        ground = KnowableGround(
            state, aim, observation.width, scenario.view, scenario.preset.rules.soft_speed
        )
        left = np.array(sorted(cells - reached), dtype=int).reshape(-1, 2)
        heights = true_heights(scenario, left[:, 0], left[:, 1])
        reached |= {
            (row, column)
            for (row, column), height in zip(left.tolist(), heights, strict=True)
            if ground.within_reach(np.array([column + 0.5, row + 0.5, height]))
        }
    return len(seen), len(reached)


def _true_state(scenario: Scenario, estimate: State) -> State:
    """The state that the lander estimates so."""
    error = scenario.navigation_error
    return State(estimate.position - error[:3], estimate.velocity - error[3:], estimate.mass)


def last_reading(record: EpisodeRecord) -> tuple[int, float, bool] | None:
    """(look, reading, whether the pixel's own cell is safe) of the last look that read the final site."""
    scenario, site = record.scenario, record.decisions[-1].site
    for index in range(len(record.observations) - 1, -1, -1):
        observation = record.observations[index]
        pixel = observation.pixel(site)
        if pixel is None:
            continue
        rows, columns, read = read_pixels(record, index)
        if read[pixel]:
            safe = bool(scenario.tile.deterministic[rows[pixel[0]], columns[pixel[1]]])
            return index, float(observation.safety_map[pixel]), safe
    return None
