"""One episode as one row: the only product of a run, from which every score is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from hda.flight.record import EpisodeRecord

RATIOS = ("safe_site", "success")
"""Columns whose ratios stand in the table."""

MEASURES = (
    "miss_distance_m",
    "touchdown_speed_mps",
    "propellant_percent",
    "minimum_slant_angle_deg",
    "maximum_thrust_n",
    "reward",
)
"""Columns whose means stand in the table."""


@dataclass(frozen=True)
class EpisodeRow:
    """What an episode gave; units are in the names.

    Attributes:
        policy: name of the policy.
        episode: number of the episode in the study.
        tile: number of the tile that was flown over.
        outcome: one word for the end (`hda.Ending`).
        safe_site: the touchdown cell is safe, the paper's ratio.
        success: safe site, soft touchdown, propellant left, no crash.
        miss_distance_m: from the touchdown to the last target.
        touchdown_speed_mps: speed at the target plane.
        propellant_percent: propellant burnt over propellant at the start.
        minimum_slant_angle_deg: least elevation of the lander seen from the target at decision instants.
        maximum_thrust_n: greatest applied thrust (`EpisodeRecord.maximum_thrust`).
        reward: undiscounted sum.
        flight_time_s: from the start to the plane.
        decisions: number of looks.
        fallbacks: decisions in which the policy's own law gave no answer.
        touchdown_x_m: east of the map's corner.
        touchdown_y_m: north of the map's corner.
    """

    policy: str
    episode: int
    tile: int
    outcome: str
    safe_site: bool
    success: bool
    miss_distance_m: float
    touchdown_speed_mps: float
    propellant_percent: float
    minimum_slant_angle_deg: float
    maximum_thrust_n: float
    reward: float
    flight_time_s: float
    decisions: int
    fallbacks: int
    touchdown_x_m: float
    touchdown_y_m: float


ROW_COLUMNS = tuple(field.name for field in fields(EpisodeRow))


def summarize_episode(record: EpisodeRecord) -> EpisodeRow:
    """Reduce a record to its row."""
    outcome = record.outcome
    return EpisodeRow(
        policy=record.policy,
        episode=record.scenario.streams.episode,
        tile=record.scenario.tile.number,
        outcome=str(outcome.ending),
        safe_site=outcome.safe_site,
        success=outcome.success,
        miss_distance_m=outcome.miss_distance,
        touchdown_speed_mps=outcome.touchdown_speed,
        propellant_percent=100.0 * outcome.propellant_fraction,
        minimum_slant_angle_deg=math.degrees(record.minimum_slant_angle),
        maximum_thrust_n=record.maximum_thrust,
        reward=record.total_reward,
        flight_time_s=float(record.time[-1]),
        decisions=len(record.decisions),
        fallbacks=record.fallbacks,
        touchdown_x_m=float(outcome.touchdown[0]),
        touchdown_y_m=float(outcome.touchdown[1]),
    )
