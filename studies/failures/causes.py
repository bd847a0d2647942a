"""Why an episode failed, computed from its record and the true map.

A landing on hazardous ground is followed back: was the site itself safe, had a look shown truly safe
ground, was some of it within reach at that look, and what did the last look that read the site say of it?

Of the cells counted as seen, those out of reach are proved to be: that rests on fact 1 of
`hda.policies.privileged.knowable_ground` alone, which holds whatever the sensor. Seen are the pixels of the
safety map. Where the sensor gives ranges, the elevation map reaches some metres past them, so that a policy
that reads it may know more ground than is counted here.

Beside the cause stand the single changes that would have made the episode a success: the same episode flown
again with a noiseless map (or with twice the rays, where the sensor gives ranges), an exact engine, or exact
navigation. Twice the rays have other noise: the errors common to a scan stay, those of each ray are drawn
anew, so that such a success may be luck. So it is where no safe ground had been seen.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from guidance.state import State
from hda.flight.episode import fly
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.flight.touchdown_report import TouchdownFault
from hda.policies.privileged.knowable_ground import KnowableGround
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.observation import Observation
from hda.task.presets import Preset
from hda.task.scenario import Scenario, ground_point, true_heights
from studies.campaign.monte_carlo import Study

SAFE_READING = 0.5
_SATURATED = 0.999  # of the greatest thrust


class Cause(StrEnum):
    """Why an episode failed."""

    NONE_SEEN = "no safe ground in any look"
    OUT_OF_REACH = "safe ground was seen, but none within reach"
    MISSED = "the site was safe, the touchdown beside it was not"
    NEVER_READ = "no look read the site"
    BETWEEN_PIXELS = "the pixel over the site showed safe ground beside it"
    MISREAD = "noise: the site's last reading called it safe"
    KNOWN_HAZARD = "the site's last reading called it a hazard"
    NO_PLAN = "hard touchdown: the planner gave no answer"
    SATURATED = "hard touchdown: the engine was at its limit in the last interval"
    LATE_DIVERT = "hard touchdown: the site changed in the last two looks"
    HARD = "hard touchdown on an unhurried approach"
    STRIKE = "it struck the ground on its way to the site"
    TANK_EMPTY = "the tank ran dry"
    TIMED_OUT = "still in flight after the last decision"


@dataclass(frozen=True)
class Failure:
    """What is known of one failed episode.

    Attributes:
        episode: number.
        tile: number of the tile.
        ending: one word for the end.
        cause: why.
        safe_cells_seen: distinct truly safe cells that some look read.
        safe_cells_in_reach: of these, those that were within reach at a look that read them.
        last_reading: of the site, in the last look that read it; nan if none did.
        last_reading_s: time from that look to the touchdown; nan if none read it.
        last_change_s: time from the last change of site to the touchdown.
        touchdown_speed_mps: speed at the plane or the ground.
        miss_m: distance from the touchdown to the site.
        remedies: single changes that make the episode a success.
        faults: what failed at a touchdown on real ground; empty where flights end on the target plane.
    """

    episode: int
    tile: int
    ending: str
    cause: Cause
    safe_cells_seen: int
    safe_cells_in_reach: int
    last_reading: float
    last_reading_s: float
    last_change_s: float
    touchdown_speed_mps: float
    miss_m: float
    remedies: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


def read_pixels(
    scenario: Scenario, observation: Observation
) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.bool_]]:
    """Cells that a look's pixels show: rows (n,), columns (n,), and which pixels (n, n) read the ground.

    Row i of the look shows row rows[i] of the tile. A pixel too far from the vertical, outside the map, or in
    a look without a map reads nothing; nor does one of a ranging LIDAR where Algorithm 1 has a hole.
    """
    error = scenario.navigation_error
    aim = ground_point(scenario, observation.target)
    position = observation.state.position - error[:3]
    x, y = aim[0] + observation.pixel_offset, aim[1] + observation.pixel_offset
    across = (x[None, :] - position[0]) ** 2 + (y[:, None] - position[1]) ** 2
    limit = math.tan(scenario.preset.lidar.off_nadir_limit) * (position[2] - aim[2])
    rows, columns = np.floor(y).astype(int), np.floor(x).astype(int)
    height, width = scenario.tile.deterministic.shape
    inside = ((rows >= 0) & (rows < height))[:, None] & ((columns >= 0) & (columns < width))[None, :]
    read = (across <= limit * limit) & inside
    if observation.ground is not None:
        read &= observation.ground.known_map(observation.target, observation.width, rows.size)
    elif isinstance(scenario.preset.lidar, Lidar) and scenario.preset.lidar.dropout > 0.0:
        read &= observation.has_map
    return rows, columns, read


def count_safe_cells(record: EpisodeRecord) -> tuple[int, int]:
    """(distinct truly safe cells that looks read, those of them within reach at such a look)."""
    scenario = record.scenario
    truth = scenario.tile.deterministic
    seen: set[tuple[int, int]] = set()
    reached: set[tuple[int, int]] = set()
    for observation in record.observations:
        rows, columns, read = read_pixels(scenario, observation)
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
        rows, columns, read = read_pixels(scenario, observation)
        if read[pixel]:
            safe = bool(scenario.tile.deterministic[rows[pixel[0]], columns[pixel[1]]])
            return index, float(observation.safety_map[pixel]), safe
    return None


def last_change(record: EpisodeRecord) -> int:
    """Number of the decision that chose the final site."""
    site = record.decisions[-1].site
    for index in range(len(record.decisions) - 1, -1, -1):
        if not np.array_equal(record.decisions[index].site, site):
            return index + 1
    return 0


def explain_failure(record: EpisodeRecord) -> Failure:
    """Say why an episode failed; `remedies` is left empty (see `find_remedies`).

    Raises:
        ValueError: the episode is a success.
    """
    outcome = record.outcome
    if outcome.success:
        raise ValueError(f"episode {record.scenario.streams.episode} of {record.policy} is a success")
    seen, reached = count_safe_cells(record)
    reading = last_reading(record)
    end = float(record.time[-1])
    return Failure(
        episode=record.scenario.streams.episode,
        tile=record.scenario.tile.number,
        ending=str(outcome.ending),
        cause=_find_cause(record, seen, reached, reading),
        safe_cells_seen=seen,
        safe_cells_in_reach=reached,
        last_reading=math.nan if reading is None else reading[1],
        last_reading_s=math.nan if reading is None else end - record.observations[reading[0]].time,
        last_change_s=end - record.observations[last_change(record)].time,
        touchdown_speed_mps=outcome.touchdown_speed,
        miss_m=outcome.miss_distance,
        faults=() if outcome.report is None else tuple(str(fault) for fault in outcome.report.faults),
    )


def _find_cause(
    record: EpisodeRecord, seen: int, reached: int, reading: tuple[int, float, bool] | None
) -> Cause:
    ending, scenario = record.outcome.ending, record.scenario
    if ending is Ending.TANK_EMPTY:
        return Cause.TANK_EMPTY
    if ending is Ending.TIMED_OUT:
        return Cause.TIMED_OUT
    report = record.outcome.report
    if report is not None and TouchdownFault.STRIKE in report.faults:
        return Cause.STRIKE
    if ending in (Ending.HARD_LANDING, Ending.CRASH):
        return _find_hard_cause(record)
    if scenario.tile.is_safe(ground_point(scenario, record.decisions[-1].site)):
        return Cause.MISSED
    if seen == 0:
        return Cause.NONE_SEEN
    if reached == 0:
        return Cause.OUT_OF_REACH
    if reading is None:
        return Cause.NEVER_READ
    if reading[2]:
        return Cause.BETWEEN_PIXELS
    return Cause.MISREAD if reading[1] >= SAFE_READING else Cause.KNOWN_HAZARD


def _find_hard_cause(record: EpisodeRecord) -> Cause:
    if any(decision.status.is_fallback for decision in record.decisions[-2:]):
        return Cause.NO_PLAN
    limit = _SATURATED * record.scenario.preset.lander.max_thrust
    if float(np.linalg.norm(record.segments[-1].commanded, axis=1).max()) >= limit:
        return Cause.SATURATED
    looks = len(record.decisions)
    if looks > 2 and last_change(record) >= looks - 2:
        return Cause.LATE_DIVERT
    return Cause.HARD


def count_causes(failures: Iterable[Failure]) -> list[str]:
    """How many failed of each cause, in words, the most frequent first."""
    counts = Counter(failure.cause.value for failure in failures)
    return [f"{count} x {cause}" for cause, count in counts.most_common()]


def find_remedies(study: Study, policy: str, record: EpisodeRecord) -> tuple[str, ...]:
    """Which single change of the setting would have made a failed episode a success."""
    preset = record.scenario.preset
    rules = preset.rules
    changes: dict[str, Preset] = {}
    if isinstance(preset.lidar, Lidar) and preset.lidar.noise > 0.0:
        changes["noiseless map"] = replace(preset, lidar=replace(preset.lidar, noise=0.0))
    if isinstance(preset.lidar, RangingLidar):
        doubled = replace(preset.lidar, rays=2 * preset.lidar.rays)
        changes["twice the rays (each with other noise)"] = replace(preset, lidar=doubled)
    if rules.thrust_error > 0.0:
        changes["exact engine"] = replace(preset, rules=replace(rules, thrust_error=0.0))
    if rules.navigation_position_error > 0.0 or rules.navigation_velocity_error > 0.0:
        exact = replace(rules, navigation_position_error=0.0, navigation_velocity_error=0.0)
        changes["exact navigation"] = replace(preset, rules=exact)
    if preset.navigation is not None:
        changes["exact navigation"] = replace(preset, navigation=None)
    pilot = study.make_policy(policy)
    return tuple(
        name
        for name, changed in changes.items()
        if fly(pilot, replace(record.scenario, preset=changed)).outcome.success
    )
