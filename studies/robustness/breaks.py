"""Where each policy breaks along a factor, and by what.

A policy breaks at the first level, going outward from the preset's own, at which its ratio of successes has
fallen by more than chance allows: the 95 % interval of the paired difference lies below zero there, and at
every level beyond. The same episode numbers are compared, so starts and noise are the same draws.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hda.flight.episode_row import EpisodeRow
from studies.campaign.points import Rows
from studies.campaign.score import success_drop
from studies.statistics.ratios import Interval


@dataclass(frozen=True)
class Break:
    """Where a policy breaks on one side of the preset's own value.

    Attributes:
        factor: name.
        policy: name.
        side: `below` or `above` the preset's own value.
        level: value at which it breaks.
        step: how many levels outward, from 1.
        success: its ratio of successes there.
        drop: fall of that ratio against the preset's own value, with its 95 % interval.
        ending: the failure that became more frequent by most.
        more: failures of that kind there, less those at the preset's own value.
        episodes: those that failed there but not at the preset's own value.
        causes: of the first of these, in words, the most frequent first; empty until they are explained.
    """

    factor: str
    policy: str
    side: str
    level: float
    step: int
    success: float
    drop: Interval
    ending: str
    more: int
    episodes: tuple[int, ...]
    causes: str = ""


def find_breaks(factor: str, own: float, nominal: Rows, levels: Mapping[float, Rows]) -> list[Break]:
    """Breaks of every policy along a factor, the earliest first; at one step, the deepest fall first.

    Args:
        factor: name.
        own: the preset's own value.
        nominal: rows at that value.
        levels: other value -> rows.
    """
    breaks = []
    for side, values in (
        ("below", sorted((value for value in levels if value < own), reverse=True)),
        ("above", sorted(value for value in levels if value > own)),
    ):
        for policy, reference in nominal.items():
            drops = [success_drop(reference, levels[value][policy]) for value in values]
            fallen = [drop.low > 0.0 for drop in drops]
            for step, (value, drop) in enumerate(zip(values, drops, strict=True)):
                if all(fallen[step:]):
                    breaks.append(
                        _describe(factor, side, (step + 1, value), drop, reference, levels[value][policy])
                    )
                    break
    return sorted(breaks, key=lambda found: (found.step, -found.drop.estimate, found.policy))


def _describe(
    factor: str,
    side: str,
    place: tuple[int, float],
    drop: Interval,
    nominal: Sequence[EpisodeRow],
    rows: Sequence[EpisodeRow],
) -> Break:
    before = Counter(row.outcome for row in nominal if not row.success)
    after = Counter(row.outcome for row in rows if not row.success)
    ending = max(sorted(after), key=lambda name: after[name] - before[name])
    fine = {row.episode for row in nominal if row.success}
    return Break(
        factor=factor,
        policy=rows[0].policy,
        side=side,
        level=place[1],
        step=place[0],
        success=sum(row.success for row in rows) / len(rows),
        drop=drop,
        ending=ending,
        more=after[ending] - before[ending],
        episodes=tuple(row.episode for row in rows if row.outcome == ending and row.episode in fine),
    )
