"""Bounds that hold without any assumption on how values are distributed, and how many episodes they need.

The form is the guidance community's: "the requirement is met in 99.73 % of flights, with 90 % confidence"
(Hanson and Beard, Applying Monte Carlo Simulation to Launch Vehicle Design and Requirements Verification,
NASA/TP-2010-216447).
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from guidance.validation import finite_number
from studies.statistics.ratios import Interval


@dataclass(frozen=True)
class OrderBound:
    """A value that is not exceeded with a reliability, at a confidence.

    Attributes:
        value: the bound; one of the sample.
        exceeded: how many values of the sample lie above it in order.
        confidence: what is really reached, at least what was asked for.
    """

    value: float
    exceeded: int
    confidence: float


def exact_interval(successes: int, episodes: int, confidence: float = 0.95) -> Interval:
    """Interval of a success ratio that never covers less than it says (Clopper and Pearson 1934).

    Args:
        successes: from 0 to `episodes`.
        episodes: at least 1; independent.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: an argument is out of range.
    """
    return _clopper_pearson(successes, episodes, confidence, "two-sided")


def exact_lower_bound(successes: int, episodes: int, confidence: float = 0.9) -> float:
    """One-sided bound of a success ratio, "at least this, with 90 % confidence" (Clopper and Pearson 1934).

    Args:
        successes: from 0 to `episodes`.
        episodes: at least 1; independent.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: an argument is out of range.
    """
    return _clopper_pearson(successes, episodes, confidence, "greater").low


def _clopper_pearson(
    successes: int, episodes: int, confidence: float, alternative: Literal["two-sided", "greater"]
) -> Interval:
    from scipy.stats import binomtest

    finite_number("episodes", episodes, at_least=1)
    finite_number("successes", successes, at_least=0, at_most=episodes)
    level = finite_number("confidence", confidence, above=0.0, at_most=0.9999)
    test = binomtest(successes, episodes, alternative=alternative)
    ends = test.proportion_ci(confidence_level=level, method="exact")
    return Interval(successes / episodes, float(ends.low), float(ends.high))


def allowed_failures(episodes: int, reliability: float, confidence: float = 0.9) -> int | None:
    """Greatest number of failures that still shows that a requirement is met with a reliability.

    Args:
        episodes: at least 1; independent.
        reliability: ratio of flights that meet it, in (0, 1).
        confidence: one less the consumer's risk, in (0, 0.9999].

    Returns:
        The number, or None where even no failure shows too little: more episodes are needed.

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.stats import binom

    count = int(finite_number("episodes", episodes, at_least=1))
    failure = 1.0 - _below_one(reliability)
    risk = 1.0 - finite_number("confidence", confidence, above=0.0, at_most=0.9999)
    most = int(binom.ppf(risk, count, failure))
    while most >= 0 and binom.cdf(most, count, failure) > risk:
        most -= 1
    return most if most >= 0 else None


def needed_episodes(reliability: float, confidence: float = 0.9, failures: int = 0) -> int:
    """Least number of episodes in which so many failures may occur and the requirement is still shown.

    Args:
        reliability: ratio of flights that must meet it, in (0, 1).
        confidence: in (0, 0.9999].
        failures: failures to allow for, at least 0.

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.stats import binom

    failure = 1.0 - _below_one(reliability)
    risk = 1.0 - finite_number("confidence", confidence, above=0.0, at_most=0.9999)
    allowed = int(finite_number("failures", failures, at_least=0))
    high = allowed + 1  # at one less everything may fail
    while binom.cdf(allowed, high, failure) > risk:
        high *= 2
    return bisect_left(range(high), True, key=lambda count: binom.cdf(allowed, count, failure) <= risk)


def order_bound(values: ArrayLike, reliability: float = 0.9973, confidence: float = 0.9) -> OrderBound:
    """Upper bound of a quantile from order statistics: no distribution is assumed.

    Args:
        values: shape (n,), independent, no NaN; infinity counts as the worst.
        reliability: ratio of flights that stay below the bound, in (0, 1).
        confidence: in (0, 0.9999].

    Raises:
        ValueError: there are too few values for such a bound (the message says how many it takes), or an
            argument is out of range.
    """
    from scipy.stats import binom

    sample = np.sort(np.asarray(values, dtype=np.float64))
    if sample.ndim != 1 or sample.size == 0 or np.isnan(sample).any():
        raise ValueError("values must be a non-empty one-dimensional array without NaN")
    exceeded = allowed_failures(sample.size, reliability, confidence)
    if exceeded is None:
        raise ValueError(
            f"values: a bound for {reliability:.4%} at {confidence:.0%} confidence takes at least"
            f" {needed_episodes(reliability, confidence)} values, got {sample.size}"
        )
    reached = 1.0 - float(binom.cdf(exceeded, sample.size, 1.0 - reliability))
    return OrderBound(float(sample[sample.size - 1 - exceeded]), exceeded, reached)


def _below_one(reliability: float) -> float:
    finite_number("reliability", reliability, above=0.0)
    if reliability >= 1.0:
        raise ValueError(
            f"reliability must be below 1: no sample shows that nothing ever fails, got {reliability:g}"
        )
    return reliability
