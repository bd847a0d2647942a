"""Intervals cover as often as they say; tests alarm as seldom as they say.

Simulated coverages are gated at five of their own standard errors, a false alarm of 3e-7 a gate, and every
stream is seeded, so a run repeats. Where the distribution can be summed it is, and no chance is left.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from studies.statistics.ratios import (
    Interval,
    clustered_interval,
    least_passing,
    mcnemar_p_value,
    power,
    wilson_interval,
)

CONFIDENCES = st.sampled_from([0.5, 0.8, 0.9, 0.95, 0.99])


def gate(covered: float, nominal: float, repeats: int) -> bool:
    """Whether a simulated coverage is no more than five standard errors below a nominal one."""
    return covered >= nominal - 5.0 * math.sqrt(nominal * (1.0 - nominal) / repeats)


def covers(interval: Interval, truth: float) -> bool:
    return interval.low <= truth <= interval.high


# ---- Wilson


def test_wilson_closed_forms():
    """None of n: [0, z^2/(n + z^2)]; all: its mirror image; half: 1/2 -+ z/(2 sqrt(n + z^2))."""
    square = 1.959963984540054**2
    none, every, half = (wilson_interval(successes, 1000) for successes in (0, 1000, 500))
    reach, width = square / (1000.0 + square), 0.5 * math.sqrt(square / (1000.0 + square))
    assert (none.estimate, every.estimate, half.estimate) == (0.0, 1.0, 0.5)
    assert (none.low, none.high) == pytest.approx((0.0, reach), abs=1e-12)
    assert (every.low, every.high) == pytest.approx((1.0 - reach, 1.0), abs=1e-12)
    assert (half.low, half.high) == pytest.approx((0.5 - width, 0.5 + width), abs=1e-12)


@given(episodes=st.integers(1, 3000), share=st.floats(0.0, 1.0), confidence=CONFIDENCES)
def test_wilson_is_ordered_symmetric_and_in_the_unit_interval(episodes, share, confidence):
    successes = round(share * episodes)
    interval = wilson_interval(successes, episodes, confidence)
    mirrored = wilson_interval(episodes - successes, episodes, confidence)
    assert 0.0 <= interval.low <= interval.estimate <= interval.high <= 1.0
    assert interval.low < interval.high
    assert mirrored.low == pytest.approx(1.0 - interval.high, abs=1e-12)
    assert mirrored.high == pytest.approx(1.0 - interval.low, abs=1e-12)


def test_wilson_half_width_of_the_study():
    interval = wilson_interval(475, 500)
    assert 0.5 * (interval.high - interval.low) == pytest.approx(0.019, abs=0.0005)


def test_wilson_coverage_summed_over_all_outcomes():
    episodes = 200
    intervals = [wilson_interval(k, episodes) for k in range(episodes + 1)]
    low, high = np.array([i.low for i in intervals]), np.array([i.high for i in intervals])
    ratios = np.linspace(0.05, 0.95, 901)
    chance = binom.pmf(np.arange(episodes + 1), episodes, ratios[:, None])
    coverage = (chance * ((low <= ratios[:, None]) & (ratios[:, None] <= high))).sum(axis=1)
    assert coverage.mean() == pytest.approx(0.95, abs=0.003)
    assert coverage.min() > 0.92
    assert coverage.max() < 0.98


# ---- clustered by tile


def flown(rng: np.random.Generator, sizes: np.ndarray, ratio: float, spread: float):
    """Episodes on tiles whose own success ratios scatter by `spread` about `ratio` (beta distributed)."""
    if spread > 0.0:
        strength = ratio * (1.0 - ratio) / spread**2 - 1.0
        of_tile = rng.beta(ratio * strength, (1.0 - ratio) * strength, sizes.size)
    else:
        of_tile = np.full(sizes.size, ratio)
    tile = np.repeat(np.arange(sizes.size), sizes)
    return rng.random(tile.size) < of_tile[tile], tile


@pytest.mark.parametrize(
    ("tiles", "per_tile", "ratio", "spread"),
    [(18, 55, 0.9, 0.05), (18, 55, 0.5, 0.1), (60, 100, 0.9, 0.05), (5, 100, 0.9, 0.05), (18, 55, 0.9, 0.0)],
)
def test_clustered_coverage(tiles, per_tile, ratio, spread):
    """At least 94 % for 95 %, short of it by no more than chance."""
    rng, repeats = np.random.default_rng([1, tiles, per_tile]), 3000
    sizes = np.full(tiles, per_tile)
    covered = np.mean(
        [covers(clustered_interval(*flown(rng, sizes, ratio, spread)), ratio) for _ in range(repeats)]
    )
    assert gate(float(covered), 0.94, repeats)


def test_clustered_covers_where_wilson_does_not():
    """Tiles that differ by 5 points, 18 of them: the independent interval is wrong one time in five."""
    rng, repeats = np.random.default_rng(2), 3000
    sizes = np.full(18, 55)
    wilson = clustered = 0
    for _ in range(repeats):
        success, tile = flown(rng, sizes, 0.9, 0.05)
        wilson += covers(wilson_interval(int(success.sum()), success.size), 0.9)
        clustered += covers(clustered_interval(success, tile), 0.9)
    assert wilson / repeats < 0.85
    assert gate(clustered / repeats, 0.94, repeats)


def test_clustered_coverage_with_unequal_tiles():
    """Sizes from 1 to several hundred: a little short of 95 %, as the docstring says."""
    rng, repeats = np.random.default_rng(3), 3000
    covered = np.mean(
        [
            covers(clustered_interval(*flown(rng, rng.geometric(1.0 / 55.0, 18), 0.9, 0.05)), 0.9)
            for _ in range(repeats)
        ]
    )
    assert gate(float(covered), 0.91, repeats)


def test_clustered_closed_form():
    """Of 50 on each of two tiles, 40 and 30 succeed: residuals +-5, variance 2 (25 + 25)/100^2 = 0.01."""
    success = np.concatenate([np.arange(50) < 40, np.arange(50) < 30])
    interval = clustered_interval(success, np.repeat([0, 1], 50))
    normal, student = 1.959963984540054, 12.706204736432095
    effective = 100.0 / (0.01 / 0.0021) * (normal / student) ** 2
    square = normal**2 / effective
    centre = (0.7 + square / 2.0) / (1.0 + square)
    half = math.sqrt(square * (0.21 + square / 4.0)) / (1.0 + square)
    assert interval.estimate == 0.7
    assert interval.low == pytest.approx(centre - half, rel=1e-10)
    assert interval.high == pytest.approx(centre + half, rel=1e-10)


@given(
    outcomes=st.lists(st.tuples(st.booleans(), st.integers(0, 5)), min_size=1, max_size=60),
    confidence=CONFIDENCES,
)
def test_clustered_contains_wilson_and_mirrors(outcomes, confidence):
    success = np.array([outcome for outcome, _ in outcomes])
    tile = np.array([label for _, label in outcomes])
    interval = clustered_interval(success, tile, confidence)
    wilson = wilson_interval(int(success.sum()), success.size, confidence)
    assert 0.0 <= interval.low <= interval.estimate <= interval.high <= 1.0
    assert interval.estimate == wilson.estimate
    assert interval.low <= wilson.low + 1e-12
    assert interval.high >= wilson.high - 1e-12
    mirrored = clustered_interval(~success, tile, confidence)
    assert mirrored.low == pytest.approx(1.0 - interval.high, abs=1e-12)
    assert mirrored.high == pytest.approx(1.0 - interval.low, abs=1e-12)


@given(
    outcomes=st.lists(st.tuples(st.booleans(), st.integers(0, 5)), min_size=1, max_size=60),
    order=st.randoms(use_true_random=False),
)
def test_clustered_ignores_order_and_labels(outcomes, order):
    shuffled = list(outcomes)
    order.shuffle(shuffled)
    one = clustered_interval([s for s, _ in outcomes], [t for _, t in outcomes])
    other = clustered_interval([int(s) for s, _ in shuffled], [f"tile-{9 - t}" for _, t in shuffled])
    assert other.low == pytest.approx(one.low, abs=1e-12)
    assert other.high == pytest.approx(one.high, abs=1e-12)


def test_clustered_nears_wilson_where_every_episode_has_its_own_tile():
    success = np.arange(3000) % 10 > 0
    interval, wilson = clustered_interval(success, np.arange(3000)), wilson_interval(2700, 3000)
    assert interval.low == pytest.approx(wilson.low, abs=2e-5)
    assert interval.high == pytest.approx(wilson.high, abs=2e-5)


def test_clustered_counts_tiles_where_a_tile_decides_all():
    """Episodes that only repeat their tile add nothing: 200 tiles of 50 tell no more than 200 episodes."""
    of_tile = np.arange(200) % 5 > 0
    many = clustered_interval(np.repeat(of_tile, 50), np.repeat(np.arange(200), 50))
    few = clustered_interval(of_tile, np.arange(200))
    assert many.low == pytest.approx(few.low, abs=1e-6)
    assert many.high == pytest.approx(few.high, abs=1e-6)


@pytest.mark.parametrize("value", [True, False])
def test_clustered_where_all_end_alike(value):
    interval = clustered_interval(np.full(1000, value), np.arange(1000) % 18)
    wilson = wilson_interval(1000 * value, 1000)
    assert interval.estimate == float(value)
    assert 0.003 < interval.high - interval.low < 1.3 * (wilson.high - wilson.low)


def test_one_tile_says_nothing_of_others():
    assert clustered_interval([True, True, False], [7, 7, 7]) == Interval(2 / 3, 0.0, 1.0)


# ---- McNemar


@given(pairs=st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=80))
def test_mcnemar_is_the_binomial_sum_over_discordant_pairs(pairs):
    first, second = np.array(pairs).T
    only_first, only_second = int((first & ~second).sum()), int((second & ~first).sum())
    discordant = only_first + only_second
    tail = sum(math.comb(discordant, k) for k in range(min(only_first, only_second) + 1))
    expected = min(Fraction(1), Fraction(2 * tail, 2**discordant))
    found = mcnemar_p_value(first, second)
    assert found == pytest.approx(float(expected), rel=1e-10)
    assert mcnemar_p_value(second, first) == found
    assert mcnemar_p_value(~first, ~second) == found


def test_mcnemar_examples():
    assert mcnemar_p_value([True, False, True], [True, False, True]) == 1.0
    # 10 discordant pairs, all one way: 2/1024
    first = np.arange(500) < 450
    assert mcnemar_p_value(first, np.arange(500) < 440) == pytest.approx(2.0 / 1024.0, rel=1e-12)
    # 1 against 9: 2 (1 + 10)/1024
    second = np.where(np.arange(500) < 9, False, first) | (np.arange(500) == 460)
    assert mcnemar_p_value(first, second) == pytest.approx(22.0 / 1024.0, rel=1e-12)


@pytest.mark.parametrize("discordant", [1, 5, 20, 61])
@pytest.mark.parametrize("level", [0.05, 0.01])
def test_mcnemar_keeps_its_level(discordant, level):
    """Summed over all outcomes under equal policies, it rejects at most as often as it says."""
    chances = binom.pmf(np.arange(discordant + 1), discordant, 0.5)
    rejected = 0.0
    for k in range(discordant + 1):
        first = np.arange(discordant) < k
        rejected += float(chances[k]) * (mcnemar_p_value(first, ~first) <= level)
    assert rejected <= level


# ---- regression gate


@pytest.mark.parametrize(
    ("episodes", "reference", "least", "against_five", "against_ten"),
    [
        (200, 0.95, 177, 0.20, 0.90),
        (500, 0.95, 455, 0.75, 1.00),
        (1000, 0.95, 923, 0.99, 1.00),
        (500, 0.80, 366, 0.16, 0.94),
    ],
)
def test_gate_of_the_usual_sizes(episodes, reference, least, against_five, against_ten):
    assert least_passing(episodes, reference) == least
    assert power(episodes, reference, 0.05) == pytest.approx(against_five, abs=0.005)
    assert power(episodes, reference, 0.10) == pytest.approx(against_ten, abs=0.005)


def chance_below(least: int, episodes: int, ratio: Fraction) -> Fraction:
    """Exact probability of fewer than `least` successes."""
    chances = (math.comb(episodes, k) * ratio**k * (1 - ratio) ** (episodes - k) for k in range(least))
    return sum(chances, Fraction(0))


@settings(max_examples=60)
@given(
    episodes=st.integers(1, 150),
    percent=st.integers(0, 100),
    false_alarm=st.sampled_from([1e-6, 1e-4, 1e-2, 0.3]),
)
def test_gate_keeps_its_false_alarm_and_could_not_be_tighter(episodes, percent, false_alarm):
    ratio, allowed = Fraction(percent, 100), Fraction(false_alarm)
    least = least_passing(episodes, percent / 100, false_alarm)
    assert 0 <= least <= episodes
    assert chance_below(least, episodes, ratio) <= allowed * Fraction(1 + 1e-9)
    if least < episodes:
        assert chance_below(least + 1, episodes, ratio) > allowed * Fraction(1 - 1e-9)


@settings(max_examples=60)
@given(
    episodes=st.integers(1, 150),
    percent=st.integers(0, 100),
    drop_percent=st.integers(0, 100),
)
def test_power_is_the_chance_to_fall_below_the_gate(episodes, percent, drop_percent):
    assume(drop_percent <= percent)
    least = least_passing(episodes, percent / 100)
    expected = chance_below(least, episodes, Fraction(percent - drop_percent, 100))
    assert power(episodes, percent / 100, drop_percent / 100) == pytest.approx(float(expected), rel=1e-7)


def test_power_grows_with_the_drop_and_the_episodes():
    drops = [power(500, 0.9, drop) for drop in (0.0, 0.02, 0.05, 0.1, 0.2, 0.9)]
    assert drops == sorted(drops)
    assert drops[0] <= 1e-4
    assert drops[-1] == 1.0
    sizes = [power(episodes, 0.9, 0.05) for episodes in (100, 300, 1000, 3000)]
    assert sizes == sorted(sizes)


# ---- bad input


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("episodes", lambda: wilson_interval(0, 0)),
        ("episodes", lambda: wilson_interval(0, 2.5)),  # type: ignore[arg-type]
        ("successes", lambda: wilson_interval(-1, 10)),
        ("successes", lambda: wilson_interval(11, 10)),
        ("confidence", lambda: wilson_interval(5, 10, 1.0)),
        ("confidence", lambda: wilson_interval(5, 10, 0.0)),
        ("confidence", lambda: wilson_interval(5, 10, math.nan)),
        ("success", lambda: clustered_interval([], [])),
        ("success", lambda: clustered_interval([[True]], [0])),
        ("success", lambda: clustered_interval([0.0, 0.5], [0, 1])),
        ("success", lambda: clustered_interval([1.0, math.nan], [0, 1])),
        ("tile", lambda: clustered_interval([True, False], [0])),
        ("confidence", lambda: clustered_interval([True, False], [0, 1], 95.0)),
        ("first", lambda: mcnemar_p_value([2, 0], [1, 0])),
        ("second", lambda: mcnemar_p_value([True, False], [math.nan, 0.0])),
        ("second", lambda: mcnemar_p_value([True, False], [True])),
        ("episodes", lambda: least_passing(0, 0.9)),
        ("reference_ratio", lambda: least_passing(10, 1.1)),
        ("reference_ratio", lambda: least_passing(10, math.nan)),
        ("false_alarm", lambda: least_passing(10, 0.9, 0.0)),
        ("drop", lambda: power(10, 0.9, 0.91)),
        ("drop", lambda: power(10, 0.9, -0.1)),
    ],
)
def test_wrong_argument_is_named(name, call):
    with pytest.raises(ValueError, match=rf"^{name} must"):
        call()


def test_wilson_agrees_with_the_exact_interval_in_the_middle():
    """Clopper and Pearson's is a little wider; the two agree to a tenth of their width."""
    wilson, exact = wilson_interval(600, 1000), binomtest(600, 1000).proportion_ci(method="exact")
    assert wilson.low == pytest.approx(exact.low, abs=0.003)
    assert wilson.high == pytest.approx(exact.high, abs=0.003)
