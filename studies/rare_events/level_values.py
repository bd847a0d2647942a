"""What a pilot says of each level: how likely a flight there fails, and how many steps it still takes.

Both follow backward along the steps that the pilot saw: the value of a level is the mean of the values of the
levels that came next. Levels that were seen seldom lean on the mean of their stage.

The windows are those of efficiency: roulette where the second moment of the outcome is worth less than the
steps to come, splitting where its variance is worth more (Rath et al., EARS: Efficiency-Aware Russian
Roulette and Splitting, ACM Transactions on Graphics 41(4), 2022). For an event of probability p these are p
and p (1 - p), so that a flight that is certain to fail is flown to its end, and not split.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from studies.rare_events.levels import LEVELS, Standing
from studies.rare_events.splitting import Window

_PRIOR = 2.0  # visits that the stage's mean counts as
_LEAST = 0.03  # of the mean probability: below it a level is not trusted to be safe
_SWEEPS = 60
_SLACK = 0.7  # roulette spares what is but little too light; so is a branch that was just split


@dataclass(frozen=True)
class Passage:
    """One flight of a pilot.

    Attributes:
        stages: of each look.
        levels: of each look.
        failed: how it ended.
    """

    stages: tuple[int, ...]
    levels: tuple[int, ...]
    failed: bool


@dataclass(frozen=True, eq=False)
class LevelValues:
    """Values of the levels.

    Attributes:
        failure: shape (stages, LEVELS), probability that a flight fails from there.
        steps: the same shape, expected number of steps to come.
        visits: the same shape, mean number of looks there of a flight.
    """

    failure: Array
    steps: Array
    visits: Array

    def desired(self, standing: Standing) -> float:
        """Density of branches that a level is worth, in a unit of its own."""
        return float(np.sqrt(self.failure[self._place(standing)] / self.steps[self._place(standing)]))

    def window(self, standing: Standing, scale: float) -> Window:
        """Window of weights in a level; `scale` is the weight at a density of 1."""
        failure = float(self.failure[self._place(standing)])
        desired = scale / self.desired(standing)
        return Window(_SLACK * desired, desired / math.sqrt(max(1.0 - failure, 1e-9)))

    def scale(self, steps: float) -> float:
        """The scale at which a start costs about `steps` steps.

        Levels are taken to be visited by branches of the weight that is desired there.
        """
        density = np.sqrt(self.failure / self.steps)
        return float((self.visits * density).sum()) / steps

    def _place(self, standing: Standing) -> tuple[int, int]:
        return min(standing.stage, self.failure.shape[0] - 1), standing.level


def fit_values(passages: Sequence[Passage]) -> LevelValues:
    """Fit the values to the flights of a pilot.

    Raises:
        ValueError: there is no flight.
    """
    if not passages:
        raise ValueError("pilot must fly at least one flight")
    stages = 1 + max(max(passage.stages) for passage in passages)
    shape, states = (stages, LEVELS), stages * LEVELS
    moves, fails = np.zeros((states, states)), np.zeros(states)
    for passage in passages:
        places = [s * LEVELS + k for s, k in zip(passage.stages, passage.levels, strict=True)]
        for place, following in zip(places, places[1:], strict=False):
            moves[place, following] += 1.0
        fails[places[-1]] += passage.failed
    visits = np.zeros(states)
    for passage in passages:
        for s, k in zip(passage.stages, passage.levels, strict=True):
            visits[s * LEVELS + k] += 1.0
    share = (0.5 + sum(passage.failed for passage in passages)) / (1.0 + len(passages))
    failure, steps = np.full(states, share), np.ones(states)
    for _ in range(_SWEEPS):
        failure = _lean(moves @ failure + fails, visits, stages, share)
        steps = _lean(moves @ steps + visits, visits, stages, 1.0)
    failure = np.clip(failure, _LEAST * share, 1.0)
    return LevelValues(
        failure.reshape(shape), np.maximum(steps, 1.0).reshape(shape), visits.reshape(shape) / len(passages)
    )


def _lean(totals: Array, visits: Array, stages: int, otherwise: float) -> Array:
    """Means over the visits, leaning on the mean of their level, and that on the mean of all."""
    table, count = totals.reshape(stages, -1), visits.reshape(stages, -1)
    by_level = (table.sum(axis=0) + _PRIOR * otherwise) / (count.sum(axis=0) + _PRIOR)
    return ((table + _PRIOR * by_level) / (count + _PRIOR)).ravel()
