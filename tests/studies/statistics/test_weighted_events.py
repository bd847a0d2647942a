"""The interval of weighted counts: exact where weights are equal, honest on few events and few tiles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from studies.statistics.weighted_events import relative_error, weighted_interval


def test_equal_weights_and_many_tiles_give_the_exact_poisson_interval() -> None:
    """Garwood's interval; the quantile of Student is that of the normal to a part in a thousand here."""
    number, failed = 4000, 7
    events = np.zeros(number)
    events[:failed] = 1.0
    interval = weighted_interval(events, np.ones(number), np.arange(number))
    assert interval.estimate == failed / number
    assert interval.low == pytest.approx(chi2.ppf(0.025, 2 * failed) / 2 / number, rel=5e-3)
    assert interval.high == pytest.approx(chi2.isf(0.025, 2 * failed + 2) / 2 / number, rel=5e-3)


def test_no_event_leaves_what_the_greatest_weight_allows() -> None:
    weights = np.ones(2000)
    plain = weighted_interval(np.zeros(2000), weights, np.arange(2000))
    assert (plain.estimate, plain.low) == (0.0, 0.0)
    assert plain.high == pytest.approx(3.689 / 2000, rel=5e-3)
    weights[3] = 5.0
    heavy = weighted_interval(np.zeros(2000), weights, np.arange(2000))
    assert heavy.high == pytest.approx(5.0 * plain.high)


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 9.0), st.integers(0, 4)), min_size=1, max_size=30)
)
def test_the_estimate_lies_in_its_interval(starts: list[tuple[float, float, int]]) -> None:
    events = [share * weight for share, weight, _ in starts]
    interval = weighted_interval(events, [start[1] for start in starts], [start[2] for start in starts])
    assert 0.0 <= interval.low <= interval.estimate <= interval.high
    if len({start[2] for start in starts}) == 1:
        assert (interval.low, interval.high) == (0.0, max(1.0, interval.estimate))


def test_it_covers_where_tiles_differ() -> None:
    """18 tiles of 40 starts, failures of 3 % in the mean; 300 repeats, of which 5 % may miss.

    At a true share of 6 %, 35 or more miss with a probability of 3e-4.
    """
    rng, missed = np.random.default_rng(8), 0
    tiles = np.repeat(np.arange(18), 40)
    for _ in range(300):
        chance = rng.beta(0.6, 19.4, 18)  # mean 3 %
        weight = rng.choice([0.0, 2.0], tiles.size)  # half of the starts are given up
        failed = rng.random(tiles.size) < chance[tiles]
        interval = weighted_interval(weight * failed, weight, tiles)
        missed += not interval.low <= 0.03 <= interval.high
    assert missed < 35


def test_clustered_failures_widen_it() -> None:
    events = np.zeros(200)
    events[:10] = 1.0
    apart = weighted_interval(events, np.ones(200), np.arange(200) % 20)
    together = weighted_interval(events, np.ones(200), np.arange(200) // 10)
    assert together.high - together.low > apart.high - apart.low


def test_the_relative_error_of_plain_counts_is_the_binomial_one() -> None:
    events = np.array([1.0] * 4 + [0.0] * 396)
    assert relative_error(events) == pytest.approx(np.sqrt((1 - 0.01) / (0.01 * 400)))
    assert np.isnan(relative_error(np.zeros(5)))


@pytest.mark.parametrize(
    ("events", "weights", "tile", "message"),
    [
        ([], [], [], "non-empty one-dimensional arrays of one shape"),
        ([1.0], [1.0, 1.0], [0], "of one shape"),
        ([2.0], [1.0], [0], "events must lie between zero and weights"),
        ([-1.0], [1.0], [0], "events must lie between zero and weights"),
    ],
)
def test_what_is_no_weight_is_refused(
    events: list[float], weights: list[float], tile: list[int], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        weighted_interval(events, weights, tile)
