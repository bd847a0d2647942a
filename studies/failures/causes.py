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

from hda.flight.episode import fly
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.flight.touchdown_report import TouchdownFault
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.presets import Preset
from hda.task.scenario import ground_point
from studies.campaign.monte_carlo import Study
from studies.failures.readings import count_safe_cells, last_reading

SAFE_READING = 0.5
_SATURATED = 0.999  # of the greatest thrust, by the command
_LEANS = frozenset({TouchdownFault.TILT, TouchdownFault.TURN_RATE})


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
    LEANT = "it leaned or turned too far at the touchdown"
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
    report = record.outcome.report
    if report is not None and report.faults and _LEANS.issuperset(report.faults):
        return Cause.LEANT
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
