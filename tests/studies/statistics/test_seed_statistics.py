"""Statistics across training seeds: closed forms, symmetry, and coverage by simulation.

Simulated coverages are gated at five of their own standard errors, a false alarm of 3e-7 a gate; streams are
seeded.
"""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu, norm

from studies.statistics.seeds import (
    improvement_interval,
    interquartile_mean,
    interquartile_mean_interval,
    probability_of_improvement,
)

SCORES = st.lists(st.integers(-50, 50), min_size=2, max_size=12)
REPEATS = 400


def gate(covered: int, nominal: float) -> bool:
    return covered / REPEATS >= nominal - 5.0 * math.sqrt(nominal * (1.0 - nominal) / REPEATS)


def test_the_interquartile_mean_is_the_mean_of_the_middle_half() -> None:
    assert interquartile_mean([100.0, 2.0, 3.0, -70.0]) == 2.5
    assert interquartile_mean(np.arange(8.0)) == pytest.approx(np.mean([2, 3, 4, 5]))
    assert interquartile_mean([1.0, 2.0, 6.0]) == 3.0  # a quarter of three is none
    assert interquartile_mean([[1.0, 100.0], [2.0, 3.0]]) == 2.5  # over seeds and tasks together


@given(scores=SCORES, other=SCORES)
def test_improvement_is_mann_whitneys_count_and_changes_sides(scores: list[int], other: list[int]) -> None:
    found = probability_of_improvement(scores, other)
    assert found == pytest.approx(mannwhitneyu(scores, other).statistic / (len(scores) * len(other)))
    assert probability_of_improvement(other, scores) == pytest.approx(1.0 - found)


def test_improvement_is_averaged_over_tasks() -> None:
    scores, other = np.array([[1.0, 0.0], [2.0, 0.0]]), np.array([[0.0, 0.0], [0.5, 0.0], [3.0, 0.0]])
    assert probability_of_improvement(scores, other) == pytest.approx((4.0 / 6.0 + 0.5) / 2.0)


@given(scores=SCORES, other=SCORES, seed=st.integers(0, 99))
def test_the_intervals_hold_their_estimates_and_repeat(
    scores: list[int], other: list[int], seed: int
) -> None:
    mean = interquartile_mean_interval(scores, np.random.default_rng(seed), resamples=50)
    better = improvement_interval(scores, other, np.random.default_rng(seed), resamples=50)
    assert min(scores) - 1e-9 <= mean.low <= mean.estimate <= mean.high <= max(scores) + 1e-9
    assert 0.0 <= better.low <= better.estimate <= better.high <= 1.0
    assert better == improvement_interval(scores, other, np.random.default_rng(seed), resamples=50)


@pytest.mark.parametrize(
    ("seeds", "tasks", "nominal"), [(3, 1, 0.75), (5, 1, 0.93), (10, 1, 0.95), (20, 1, 0.95), (3, 5, 0.95)]
)
def test_coverage_of_the_interquartile_mean(seeds: int, tasks: int, nominal: float) -> None:
    """As the docstring says. Symmetric scores: the interquartile mean of many is their centre."""
    rng, covered = np.random.default_rng([1, seeds, tasks]), 0
    for _ in range(REPEATS):
        interval = interquartile_mean_interval(rng.normal(0.9, 0.1, (seeds, tasks)), rng, resamples=400)
        covered += interval.low <= 0.9 <= interval.high
    assert gate(covered, nominal)
    assert covered < REPEATS  # nor is it so wide that it cannot miss


@pytest.mark.parametrize(("seeds", "tasks"), [(3, 1), (5, 1), (10, 1), (5, 3)])
@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_coverage_of_the_probability_of_improvement(seeds: int, tasks: int, shift: float) -> None:
    rng, covered = np.random.default_rng([2, seeds, tasks]), 0
    truth = float(norm.cdf(shift / math.sqrt(2.0)))
    shape = (seeds, tasks)
    for _ in range(REPEATS):
        interval = improvement_interval(
            rng.normal(shift, 1.0, shape), rng.normal(0.0, 1.0, shape), rng, 0.95, 400
        )
        covered += interval.low <= truth <= interval.high
    assert gate(covered, 0.95)


def test_runs_that_all_win_are_as_sure_as_their_number() -> None:
    """Five pairs that all win: p^5 = 2.5 % at p = 0.478."""
    rng = np.random.default_rng(0)
    low, high = np.arange(5.0), 10.0 + np.arange(7.0)
    interval = improvement_interval(high, low, rng)
    assert (interval.estimate, interval.high) == (1.0, 1.0)
    assert interval.low == pytest.approx(0.025**0.2)
    mirrored = improvement_interval(low, high, rng)
    assert (mirrored.low, mirrored.estimate, mirrored.high) == (0.0, 0.0, pytest.approx(1.0 - 0.025**0.2))


def test_memory_is_bounded() -> None:
    scores = np.random.default_rng(3).normal(size=(200, 50))
    tracemalloc.start()
    interquartile_mean_interval(scores, np.random.default_rng(4), resamples=1000)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 80e6  # all the resamples at once would take 160 MB of indices


@pytest.mark.parametrize(
    ("message", "call"),
    [
        ("scores must have shape", lambda rng: interquartile_mean([])),
        ("scores must have shape", lambda rng: interquartile_mean(np.zeros((2, 2, 2)))),
        ("scores must be finite", lambda rng: interquartile_mean([1.0, math.nan])),
        ("other must have the tasks", lambda rng: probability_of_improvement([[1.0, 2.0]], [1.0])),
        ("scores must hold at least 2 seeds", lambda rng: interquartile_mean_interval([1.0], rng)),
        ("other must hold at least 2 seeds", lambda rng: improvement_interval([1.0, 2.0], [1.0], rng)),
        ("confidence", lambda rng: interquartile_mean_interval([1.0, 2.0], rng, 1.0)),
        ("resamples", lambda rng: interquartile_mean_interval([1.0, 2.0], rng, resamples=0)),
    ],
)
def test_a_wrong_argument_is_named(message: str, call) -> None:
    with pytest.raises(ValueError, match=message):
        call(np.random.default_rng(0))
