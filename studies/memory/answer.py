"""When does memory help? Agents with memory against the one without, over training seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.memory.scores import AgentScore
from studies.statistics.ratios import Interval
from studies.statistics.seeds import (
    improvement_interval,
    interquartile_mean_interval,
    probability_of_improvement,
)

MEASURES = ("safe_site_percent", "success_percent")
_NAN = math.nan


@dataclass(frozen=True)
class GroupRow:
    """An agent on a preset, over its seeds.

    Attributes:
        preset: setting.
        agent: recipe.
        measure: of `MEASURES`.
        seeds: trained agents.
        episodes: that each flew.
        interquartile_mean: with its interval.
        improvement: probability that a run of it beats one of the reference; nan for the reference itself.
        difference: mean minus the reference's mean [points], Welch's interval over seeds.
    """

    preset: str
    agent: str
    measure: str
    seeds: int
    episodes: int
    interquartile_mean: Interval
    improvement: Interval
    difference: Interval

    @property
    def verdict(self) -> str:
        """What the interval of the difference says."""
        if math.isnan(self.difference.estimate):
            return ""
        if self.difference.low > 0.0:
            return "helps"
        return "harms" if self.difference.high < 0.0 else "no difference shown"


def compare_groups(
    scores: Sequence[AgentScore], reference: str, rng: np.random.Generator
) -> tuple[GroupRow, ...]:
    """A row per preset, agent and measure; the reference first.

    Args:
        scores: trained agents.
        reference: the agent without memory.
        rng: draws the resamples.

    Raises:
        ValueError: a group mixes settings, or the episodes are not equal.
    """
    if len({score.episodes for score in scores}) > 1:
        raise ValueError(
            f"the agents flew unequal episodes: {sorted({score.episodes for score in scores})};"
            " set --validation-episodes to those of the cards"
        )
    groups: dict[tuple[str, str], list[AgentScore]] = {}
    for score in scores:
        groups.setdefault((score.preset, score.agent), []).append(score)
    for (preset, agent), members in groups.items():
        if len({member.settings for member in members}) > 1:
            names = ", ".join(member.source for member in members)
            raise ValueError(f"{agent} on {preset} mixes runs of different settings: {names}")
    order = sorted(groups, key=lambda key: (key[0], key[1] != reference, key[1]))
    return tuple(
        _compare(groups[preset, agent], groups.get((preset, reference), []), measure, rng)
        for preset, agent in order
        for measure in MEASURES
    )


def _compare(
    group: Sequence[AgentScore], reference: Sequence[AgentScore], measure: str, rng: np.random.Generator
) -> GroupRow:
    values, others = (np.array([getattr(s, measure) for s in part]) for part in (group, reference))
    unknown = Interval(_NAN, _NAN, _NAN)
    improvement = difference = unknown
    if len(others) and group[0].agent != reference[0].agent:
        improvement = Interval(probability_of_improvement(values, others), 0.0, 1.0)
        difference = welch_interval(values, others)
        if min(len(values), len(others)) > 1:
            improvement = improvement_interval(values, others, rng)
    several = len(values) > 1
    mean = interquartile_mean_interval(values, rng) if several else Interval(float(values[0]), _NAN, _NAN)
    first = group[0]
    return GroupRow(
        first.preset, first.agent, measure, len(values), first.episodes, mean, improvement, difference
    )


def welch_interval(
    values: NDArray[np.float64], others: NDArray[np.float64], confidence: float = 0.95
) -> Interval:
    """Difference of two means with Welch's interval; without bounds where a sample has one value.

    Seeds are few and their spreads differ, so neither normal quantiles nor a pooled variance will do
    (Welch, The generalization of Student's problem, Biometrika 34, 1947).
    """
    from scipy.special import stdtrit

    estimate = float(values.mean() - others.mean())
    if min(len(values), len(others)) < 2:
        return Interval(estimate, -math.inf, math.inf)
    parts = [float(np.var(part, ddof=1)) / len(part) for part in (values, others)]
    spread = sum(parts)
    if spread == 0.0:
        return Interval(estimate, estimate, estimate)
    freedom = spread**2 / sum(v**2 / (len(p) - 1) for v, p in zip(parts, (values, others), strict=True))
    half = float(stdtrit(freedom, 0.5 + 0.5 * confidence)) * math.sqrt(spread)
    return Interval(estimate, estimate - half, estimate + half)


def conclude(rows: Sequence[GroupRow], reference: str) -> list[str]:
    """The answer in sentences, computed from the rows; safe ratio."""
    sentences = []
    for row in rows:
        if row.measure != MEASURES[0] or not row.verdict:
            continue
        d, p = row.difference, row.improvement
        shown = row.verdict in ("helps", "harms")
        answer = f"{row.agent} {row.verdict}" if shown else f"{row.verdict} for {row.agent}"
        sentences.append(
            f"On {row.preset}, {answer}: {d.estimate:+.1f} points of safe landings against"
            f" {reference} ({d.low:+.1f} to {d.high:+.1f}), probability of improvement {p.estimate:.2f}"
            f" ({p.low:.2f} to {p.high:.2f}), {row.seeds} seeds."
        )
    return sentences
