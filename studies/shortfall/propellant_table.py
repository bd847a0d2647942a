"""The table of the parts of propellant: means of policies, and differences on the same episodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from studies.columns import Column
from studies.shortfall.encoded_sight import SAME_SITE
from studies.shortfall.flights import FlownEpisode
from studies.shortfall.propellant_parts import PropellantParts
from studies.shortfall.table import EARLY
from studies.statistics.moments import collect_moments, mean_intervals
from studies.statistics.ratios import Interval


@dataclass(frozen=True)
class PartRow:
    """Means over the flights of a policy, or of its differences from another's on the same episodes.

    Attributes:
        policy: name, or both.
        whole: [%] propellant, clustered by tile, as are its parts.
            `direct`, `early`, `late` and `guidance` add up to it.
        direct: [%] with the last site known from the start.
        first: [%] for the site of the first look, which `early` counts in.
        early: [%] for sites that were not the last, above `EARLY`.
        late: [%] below.
        guidance: [%] for another guidance law.
        moves: decisions that moved the target by a metre at least.
        moved: [m] by which all of them moved it.
        offset: [m] from the first target to the last site.
        time: [s] of the flight.
    """

    policy: str
    whole: Interval
    direct: Interval
    first: Interval
    early: Interval
    late: Interval
    guidance: Interval
    moves: float
    moved: float
    offset: float
    time: float


def average_parts(
    policy: str, flown: Sequence[FlownEpisode], beside: Sequence[FlownEpisode] | None = None
) -> PartRow:
    """Means of the parts over flights, less those of `beside`, another policy's on the same episodes."""
    tiles = [flight.tile for flight in flown]
    values = np.array([_numbers(flight.parts) for flight in flown])
    if beside is not None:
        values -= np.array([_numbers(flight.parts) for flight in beside])
    intervals = [mean_intervals(collect_moments(part, tiles), 0)[1] for part in values.T[:6]]
    whole, direct, first, early, late, guidance = intervals
    moves, moved, offset, time = values[:, 6:].mean(axis=0).tolist()
    return PartRow(policy, whole, direct, first, early, late, guidance, moves, moved, offset, time)


def _numbers(parts: PropellantParts) -> list[float]:
    early = sum(move.cost for move in parts.moves if move.height >= EARLY)
    late = sum(move.cost for move in parts.moves if move.height < EARLY)
    lengths = [move.length for move in parts.moves if move.length >= SAME_SITE]
    spent = [parts.whole, parts.direct, parts.moves[0].cost, early, late, parts.guidance]
    return [*spent, len(lengths), sum(lengths), parts.offset, parts.time]


def _percent_column(name: str, heading: str, value: Callable[[PartRow], Interval]) -> Column[PartRow]:
    return Column(f"{name}_percent", heading, value, digits=2, unit="%", interval=True)


PART_COLUMNS: tuple[Column[PartRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    _percent_column("propellant", "propellant", lambda row: row.whole),
    _percent_column("direct", "last site known from the start", lambda row: row.direct),
    _percent_column("early", f"other sites above {EARLY:g} m", lambda row: row.early),
    _percent_column("first", "of these the first look's", lambda row: row.first),
    _percent_column("late", "below", lambda row: row.late),
    _percent_column("guidance", "guidance", lambda row: row.guidance),
    Column("moves", "moves", lambda row: row.moves, digits=1),
    Column("moved_m", "moved", lambda row: row.moved, digits=1, unit="m"),
    Column("offset_m", "last from first target", lambda row: row.offset, digits=1, unit="m"),
    Column("time_s", "time", lambda row: row.time, digits=1, unit="s"),
)
"""parts.csv, parts.md and the console read this list."""
