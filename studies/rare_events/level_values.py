"""What a pilot says of each level: how likely a flight fails from there, and how many branches that is worth.

The probability is the share of the pilot's flights through the level, at this look, that failed. Branches
are as dense as the root of the second moment of what they will show, the best that weights can do where
levels are all that is known (Garvels, The Splitting Method in Rare Event Simulation, University of Twente,
2000); for an event of probability p that is sqrt(p). A branch is split by its variance, sqrt(p (1 - p))
(Rath et al., EARS: Efficiency-Aware Russian Roulette and Splitting, ACM Transactions on Graphics 41(4),
2022), so that one that is certain to fail is flown to its end, and not split.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from studies.rare_events.levels import SHAPE
from studies.rare_events.splitting import Window

_PRIOR = 1.0  # failures that what is expected of a level counts as
_LIGHTEST, _HEAVIEST = 0.1, 2.0  # of the look's mean: a pilot is not trusted further
_DENSITY = (1.7, 1.2, 1.0)  # of branches at the first looks: what is given up later was worth a look
_SLACK = 0.6  # roulette spares what is but little too light
_ROULETTES = 4  # first looks at which it is played: later too little is left to fly
_LEVELS = math.prod(SHAPE)


@dataclass(frozen=True)
class Passage:
    """One flight of a pilot.

    Attributes:
        levels: of each look.
        failed: how it ended.
    """

    levels: tuple[int, ...]
    failed: bool


@dataclass(frozen=True, eq=False)
class LevelValues:
    """Values of the levels.

    Attributes:
        failure: shape (looks, levels), probability that a flight fails from there.
        weight: the same shape, weight of the branches that a level is worth, if an episode may cost a whole
            flight.
    """

    failure: Array
    weight: Array

    def window(self, look: int, level: int, effort: float) -> Window:
        """Window of weights in a level before a look, where an episode may cost `effort` whole flights."""
        place = min(look, self.failure.shape[0] - 1), level
        failure, desired = float(self.failure[place]), float(self.weight[place]) / effort
        low = _SLACK * desired if look < _ROULETTES else 0.0
        return Window(low, desired, desired / math.sqrt(max(1.0 - failure, 1e-9)))


def fit_values(passages: Sequence[Passage]) -> LevelValues:
    """Fit the values to the flights of a pilot.

    Raises:
        ValueError: there is no flight.
    """
    if not passages:
        raise ValueError("pilot must fly at least one flight")
    looks = max(len(passage.levels) for passage in passages)
    visits, fails = np.zeros((looks, _LEVELS)), np.zeros((looks, _LEVELS))
    for passage in passages:
        for look, level in enumerate(passage.levels):
            visits[look, level] += 1.0
            fails[look, level] += passage.failed
    share = (0.5 + sum(passage.failed for passage in passages)) / (1.0 + len(passages))
    failure = np.array([_lean_on_classes(*each, share) for each in zip(fails, visits, strict=True)])
    density = np.sqrt(failure)
    mean = ((density * visits).sum(axis=1) + math.sqrt(share)) / (visits.sum(axis=1) + 1.0)
    weight = np.clip(mean[:, None] / density, _LIGHTEST, _HEAVIEST)
    for look in range(looks):
        weight[look] /= _DENSITY[min(look, len(_DENSITY) - 1)]
    return LevelValues(failure, weight)


def _lean_on_classes(fails: Array, visits: Array, share: float) -> Array:
    """Probabilities at a look from failures and visits of each level; where few failed, from its classes.

    A level is expected to fail as all do, times the ratio of each of its classes to that. Ratios and levels
    are leant on 1 and on that as gamma distributed rates are, by _PRIOR failures.

    Args:
        fails: shape (levels,).
        visits: shape (levels,).
        share: of all flights that fail.
    """
    failed, seen, expected = fails.reshape(SHAPE), visits.reshape(SHAPE), np.full(SHAPE, share)
    for axis in range(len(SHAPE)):
        others = tuple(k for k in range(len(SHAPE)) if k != axis)
        ratio = (failed.sum(axis=others) + _PRIOR) / (share * seen.sum(axis=others) + _PRIOR)
        expected *= ratio.reshape([-1 if k == axis else 1 for k in range(len(SHAPE))])
    leant = (failed + _PRIOR) / (seen + _PRIOR / np.minimum(expected, 1.0))
    return np.minimum(leant, 1.0).ravel()
