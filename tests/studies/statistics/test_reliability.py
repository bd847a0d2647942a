"""Exact intervals and order statistics: published sample sizes, and coverage by simulation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import betaincinv

from studies.statistics.reliability import (
    allowed_failures,
    exact_interval,
    exact_lower_bound,
    needed_episodes,
    order_bound,
)


@pytest.mark.parametrize(
    ("reliability", "confidence", "failures", "episodes"),
    [  # Hanson and Beard 2010; the first column is ln(risk) / ln(reliability), rounded up
        (0.99, 0.9, 0, 230),
        (0.99, 0.9, 1, 388),
        (0.99, 0.9, 2, 531),
        (0.9973, 0.9, 0, 852),
        (0.9973, 0.9, 1, 1440),
        (0.99865, 0.9, 0, 1705),
        (0.99865, 0.9, 1, 2880),
        (0.99865, 0.9, 2, 3941),
        (0.95, 0.9, 0, 45),
        (0.95, 0.9, 1, 77),
        (0.999, 0.95, 0, 2995),
    ],
)
def test_known_sample_sizes(reliability: float, confidence: float, failures: int, episodes: int) -> None:
    assert needed_episodes(reliability, confidence, failures) == episodes
    assert allowed_failures(episodes, reliability, confidence) == failures
    before = allowed_failures(episodes - 1, reliability, confidence)
    assert before == (failures - 1 if failures else None)


@given(episodes=st.integers(1, 500), data=st.data())
def test_the_exact_interval_is_the_beta_quantiles(episodes: int, data: st.DataObject) -> None:
    hits = data.draw(st.integers(0, episodes))
    interval = exact_interval(hits, episodes)
    low = 0.0 if hits == 0 else float(betaincinv(hits, episodes - hits + 1, 0.025))
    high = 1.0 if hits == episodes else float(betaincinv(hits + 1, episodes - hits, 0.975))
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=1e-9)
    assert interval.low <= interval.estimate <= interval.high


@pytest.mark.parametrize(("episodes", "ratio"), [(20, 0.9), (100, 0.95), (300, 0.995)])
def test_the_exact_interval_covers_at_least_what_it_says(episodes: int, ratio: float) -> None:
    """Summed over every count with its probability: no simulation, no false alarm."""
    from scipy.stats import binom

    covered = 0.0
    for hits in range(episodes + 1):
        interval = exact_interval(hits, episodes)
        covered += float(binom.pmf(hits, episodes, ratio)) * (interval.low <= ratio <= interval.high)
    assert covered >= 0.95


@pytest.mark.parametrize(("episodes", "ratio"), [(20, 0.9), (300, 0.98), (1000, 0.9973)])
def test_the_lower_bound_holds_as_often_as_it_says(episodes: int, ratio: float) -> None:
    """Summed over every count with its probability; also the reliability that so many failures still show."""
    from scipy.stats import binom

    bounds = [exact_lower_bound(hits, episodes, 0.9) for hits in range(episodes + 1)]
    chances = binom.pmf(np.arange(episodes + 1), episodes, ratio)
    assert chances[np.array(bounds) <= ratio].sum() >= 0.9
    for failures in (0, 1, 5):
        bound = bounds[episodes - failures]
        assert allowed_failures(episodes, bound - 1e-9, 0.9) == failures
        assert (allowed_failures(episodes, bound + 1e-6, 0.9) or -1) < failures


def test_order_bounds_cover_as_they_say() -> None:
    """4000 samples of 600: the ratio of bounds above the true quantile strays by 5 errors of 0.5 %."""
    rng = np.random.default_rng(4)
    held = 0
    reached = 0.0
    for _ in range(4000):
        bound = order_bound(rng.exponential(size=600), reliability=0.99, confidence=0.9)
        held += bound.value >= -np.log(0.01)
        reached = bound.confidence
    assert reached >= 0.9
    assert held / 4000 == pytest.approx(reached, abs=0.025)


@given(values=st.lists(st.floats(allow_nan=False), min_size=45, max_size=200))
def test_so_many_values_lie_above_the_bound(values: list[float]) -> None:
    bound = order_bound(values, reliability=0.95)
    assert bound.value in values
    assert sum(value > bound.value for value in values) <= bound.exceeded
    assert sorted(values)[len(values) - 1 - bound.exceeded] == bound.value


def test_too_few_values_say_how_many_it_takes() -> None:
    with pytest.raises(ValueError, match=r"99\.7300% at 90% confidence takes at least 852 values, got 851"):
        order_bound(np.zeros(851))
    assert order_bound(np.zeros(852)).exceeded == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: order_bound([1.0, float("nan")]), "without NaN"),
        (lambda: order_bound([]), "non-empty"),
        (lambda: order_bound(np.zeros(900), reliability=1.0), "reliability must be below 1"),
        (lambda: needed_episodes(0.0), "reliability"),
        (lambda: needed_episodes(0.9, confidence=1.0), "confidence"),
        (lambda: needed_episodes(0.9, failures=-1), "failures"),
        (lambda: allowed_failures(0, 0.9), "episodes"),
        (lambda: exact_interval(3, 2), "successes"),
        (lambda: exact_interval(0, 0), "episodes"),
    ],
)
def test_a_wrong_argument_is_named(call, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()
