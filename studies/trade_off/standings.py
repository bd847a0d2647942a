"""How each policy stands against a reference on the same episodes: who fails more, and who burns more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from hda.registry import policy_entry
from studies.campaign.points import Rows
from studies.campaign.score import (
    PROPELLANT_COLUMN,
    RATIO_COLUMNS,
    Score,
    propellant_rise,
    score_rows,
    success_drop,
)
from studies.columns import Column, format_p, points_interval
from studies.statistics.paired import CHANCE, decide_leads
from studies.statistics.ratios import NO_INTERVAL, Interval, scaled


class Standing(StrEnum):
    """What two decisions say of a policy: who fails more, and who burns more where both land.

    Neither decision comes before the other. An undecided one is no proof of equality: who stands ahead may
    yet fail more.

    Attributes:
        REFERENCE: it is the policy that the others are held against.
        AHEAD: it is decided that the policy fails less or burns less, and not that it does more of the other.
        SAFER: it is decided that it fails less, and that it burns more.
        UNDECIDED: neither is decided.
        CHEAPER: it is decided that it burns less, and that it fails more.
        BEHIND: it is decided that it fails more or burns more, and not that it does less of the other.
    """

    REFERENCE = "the reference"
    AHEAD = "ahead"
    SAFER = "safer, costlier"
    UNDECIDED = "undecided"
    CHEAPER = "cheaper, less safe"
    BEHIND = "behind"


@dataclass(frozen=True)
class StandingRow:
    """One policy on one preset.

    Attributes:
        preset: name of the setting.
        policy: name.
        score: every figure with its intervals.
        failures: episodes without success.
        fails_more: ratio of failures less that of the reference, with Newcombe's paired interval; nan for
            the reference itself.
        holm_p: exact McNemar test of the successes, corrected for the policies of the preset; nan likewise.
        burns_more: [%] of propellant more than the reference, over the episodes in which both succeed,
            clustered by tile; nan likewise.
        standing: what it comes to.
    """

    preset: str
    policy: str
    score: Score
    failures: int
    fails_more: Interval
    holm_p: float
    burns_more: Interval
    standing: Standing


def judge(fails: int, burns: int) -> Standing:
    """The standing, from two decisions that weigh the same.

    Args:
        fails: 1 where it is decided that the policy fails more than the reference, -1 less, else 0.
        burns: the same of the propellant.
    """
    if fails * burns < 0:
        return Standing.CHEAPER if fails > 0 else Standing.SAFER
    if fails == burns == 0:
        return Standing.UNDECIDED
    return Standing.BEHIND if fails + burns > 0 else Standing.AHEAD


def compare_to(preset: str, rows: Rows, reference: str) -> list[StandingRow]:
    """The line of every policy of a preset, in the order given.

    Who fails more is decided by `decide_leads`, over all policies of the preset. Who burns more is decided by
    the interval clustered by tile, at a confidence that keeps the chance of one false word among all of them
    (Bonferroni). Each has a chance of up to `CHANCE` of its own, so that of one false standing or more on a
    preset is up to twice that.

    Args:
        preset: name of the setting.
        rows: of each policy, over the same episodes.
        reference: name of the policy that the others are held against; one of `rows`.
    """
    own, others = rows[reference], [name for name in rows if name != reference]
    kept = [row.success for row in own]
    leads = decide_leads(
        [(kept, [row.success for row in rows[name]]) for name in others], [row.tile for row in own]
    )
    decided = dict(zip(others, leads, strict=True))
    found = []
    for name, flown in rows.items():
        line = StandingRow(
            preset=preset,
            policy=name,
            score=score_rows(flown),
            failures=sum(not row.success for row in flown),
            fails_more=NO_INTERVAL,
            holm_p=math.nan,
            burns_more=NO_INTERVAL,
            standing=Standing.REFERENCE,
        )
        if name != reference:
            surely = propellant_rise(own, flown, 1.0 - CHANCE / len(others))
            burns = int(surely.low > 0.0) - int(surely.high < 0.0)
            line = replace(
                line,
                fails_more=success_drop(own, flown),
                holm_p=decided[name].holm_p,
                burns_more=propellant_rise(own, flown),
                standing=judge(decided[name].sign, burns),
            )
        found.append(line)
    return found


def tell_standings(rows: Sequence[StandingRow]) -> str:
    """Of one preset in words: where the others stand, and which of those that see no truth is the best.

    The best has the fewest failures, and of equal ones burns the least.
    """
    (reference,) = (row for row in rows if row.standing is Standing.REFERENCE)
    others = [row for row in rows if row is not reference]
    fair = [row for row in others if not policy_entry(row.policy).privileged]
    if not fair:
        return f"{reference.preset}: no other policy that sees no truth"
    counts = {word: sum(row.standing is word for row in fair) for word in Standing}
    words = ", ".join(f"{count} {word.value}" for word, count in counts.items() if count)
    best = min(fair, key=lambda row: (row.failures, row.score.propellant.estimate))
    return (
        f"{reference.preset}: against {reference.policy} ({_tell(reference)}) {words};"
        f" the best is {best.policy} ({_tell(best)})"
    )


def _tell(row: StandingRow) -> str:
    failures = f"{row.failures} failure{'' if row.failures == 1 else 's'}"
    return f"{failures} of {row.score.episodes}, {row.score.propellant.estimate:.2f} % of the propellant"


_SAFE_SITE, _SUCCESS = RATIO_COLUMNS

COLUMNS: tuple[Column[StandingRow], ...] = (
    Column("preset", "preset", lambda row: row.preset, words=True),
    Column(
        "policy",
        "policy",
        lambda row: row.policy,
        words=True,
        mark=lambda row: " *" if policy_entry(row.policy).privileged else "",
    ),
    replace(_SAFE_SITE, brief=True).through(lambda row: row.score),
    replace(_SUCCESS, by_tile=None).through(lambda row: row.score),
    PROPELLANT_COLUMN.through(lambda row: row.score),
    points_interval(
        "fails_more_points", "fails more by", lambda row: scaled(row.fails_more, 100.0), stem="fails_more"
    ),
    Column("holm_p", "p (Holm)", lambda row: row.holm_p, form=format_p),
    points_interval(
        "burns_more_points", "burns more by", lambda row: row.burns_more, digits=2, stem="burns_more"
    ),
    Column("standing", "stands", lambda row: row.standing.value, words=True),
)
"""A line for each preset and policy, against the reference."""
