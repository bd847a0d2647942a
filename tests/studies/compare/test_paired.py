"""Paired differences: the written formula, coverage by simulation, and bounds that must hold."""

import csv
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hda.flight.episode_row import MEASURES, EpisodeRow
from studies.campaign.monte_carlo import Chunk
from studies.compare.differences import compare_pairs, write_paired
from studies.compare.scores import StudyScores, score_study
from studies.statistics.paired import holm_adjust, paired_ratio_interval


def pairs(both: int, only_one: int, only_other: int, neither: int) -> tuple[np.ndarray, np.ndarray]:
    one = np.repeat([1, 1, 0, 0], [both, only_one, only_other, neither])
    other = np.repeat([1, 0, 1, 0], [both, only_one, only_other, neither])
    return one, other


def wilson(hits: int, count: int) -> tuple[float, float]:
    z = 1.959963984540054
    middle, half = 2 * hits + z * z, z * math.sqrt(z * z + 4 * hits * (1 - hits / count))
    return (middle - half) / (2 * (count + z * z)), (middle + half) / (2 * (count + z * z))


@pytest.mark.parametrize(
    "table", [(36, 12, 2, 0), (20, 12, 2, 16), (18, 12, 2, 18), (36, 14, 0, 0), (54, 0, 0, 0), (3, 20, 9, 2)]
)
def test_the_interval_is_newcombes(table: tuple[int, int, int, int]) -> None:
    """Method 10 as it is written: from the four counts, by the closed form of Wilson's limits."""
    a, b, c, d = table
    n = a + b + c + d
    product = a * d - b * c
    used = product - n / 2 if product > n / 2 else min(product, 0)
    margins = (a + b) * (c + d) * (a + c) * (b + d)
    phi = used / math.sqrt(margins) if margins else 0.0
    p1, p2 = (a + b) / n, (a + c) / n
    (l1, u1), (l2, u2) = wilson(a + b, n), wilson(a + c, n)
    down = (p1 - l1) ** 2 - 2 * phi * (p1 - l1) * (u2 - p2) + (u2 - p2) ** 2
    up = (p2 - l2) ** 2 - 2 * phi * (p2 - l2) * (u1 - p1) + (u1 - p1) ** 2
    interval = paired_ratio_interval(*pairs(*table))
    assert interval.estimate == pytest.approx((b - c) / n)
    assert interval.low == pytest.approx((b - c) / n - math.sqrt(down))
    assert interval.high == pytest.approx((b - c) / n + math.sqrt(up))


@given(counts=st.tuples(*[st.integers(0, 40)] * 4).filter(lambda c: sum(c) > 0))
def test_it_holds_the_difference_and_changes_sign_with_the_order(counts: tuple[int, int, int, int]) -> None:
    one, other = pairs(*counts)
    forth, back = paired_ratio_interval(one, other), paired_ratio_interval(other, one)
    assert -1.0 <= forth.low <= forth.estimate <= forth.high <= 1.0
    assert forth.low < forth.high
    assert (back.estimate, back.low, back.high) == pytest.approx((-forth.estimate, -forth.high, -forth.low))


@pytest.mark.parametrize(
    ("episodes", "shares"), [(100, (0.85, 0.1, 0.03, 0.02)), (1000, (0.88, 0.1, 0.01, 0.01))]
)
def test_coverage(episodes: int, shares: tuple[float, ...]) -> None:
    """2000 studies at a true coverage of 95 % stray by 2 points (four standard errors) once in 16 000."""
    rng = np.random.default_rng(5)
    truth = shares[1] - shares[2]
    held = 0
    distinct, counts = np.unique(rng.multinomial(episodes, shares, size=2000), axis=0, return_counts=True)
    for table, times in zip(distinct, counts, strict=True):
        interval = paired_ratio_interval(*pairs(*table))
        held += int(times) * (interval.low <= truth <= interval.high)
    assert 0.93 <= held / 2000 <= 0.985


def test_holm_on_the_textbook_example() -> None:
    adjusted = holm_adjust([0.01, 0.04, 0.03, 0.005])
    assert adjusted.tolist() == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm_adjust([]).size == 0


@given(values=st.lists(st.floats(0.0, 1.0), max_size=12))
def test_holm_never_lowers_keeps_the_order_and_rejects_what_bonferroni_does(values: list[float]) -> None:
    adjusted = holm_adjust(values)
    plain = np.array(values)
    assert np.all(adjusted >= plain)
    assert np.all(adjusted <= np.minimum(1.0, plain * len(values)) + 1e-15)
    assert np.all(np.diff(adjusted[np.argsort(plain, kind="stable")]) >= 0.0)


def test_holm_keeps_the_family_wise_error() -> None:
    """At six true hypotheses: 4000 families; 5 % plus five standard errors is 6.8 %."""
    drawn = np.random.default_rng(2).random((4000, 6))
    wrong = np.mean([holm_adjust(family).min() <= 0.05 for family in drawn])
    assert 0.03 < wrong < 0.068


@pytest.mark.parametrize("wrong", [[-0.1], [1.1], [float("nan")], [[0.5]]])
def test_what_is_no_probability_is_refused(wrong: list[float]) -> None:
    with pytest.raises(ValueError, match="p_values"):
        holm_adjust(wrong)


def rows(policy: str, safe: np.ndarray, speed: float) -> list[EpisodeRow]:
    return [
        EpisodeRow(
            policy, k, 1000, "", bool(s), bool(s), 0.0, speed + k, 67.0, 71.0, 4500.0, 0.0, 45.0, 9, 0, 0, 0
        )
        for k, s in enumerate(safe)
    ]


def scored(reference: np.ndarray, other: np.ndarray) -> StudyScores:
    both = {"single-divert": rows("single-divert", reference, 1.0), "other": rows("other", other, 0.75)}
    chunk = Chunk(0, reference.size, both, {name: np.ones(3) for name in both})
    return score_study(tuple(both), "single-divert", [chunk])


def test_differences_are_those_of_the_rows(tmp_path) -> None:
    rng = np.random.default_rng(1)
    first, second = rng.random(80) < 0.7, rng.random(80) < 0.9
    found = compare_pairs(scored(first, second), ["single-divert", "other"])
    assert [difference.policy for difference in found] == ["other"]
    assert found[0].ratios["safe_site"] == paired_ratio_interval(second, first)
    speed = found[0].means["touchdown_speed_mps"]
    assert (speed.low, speed.estimate, speed.high) == (-0.25, -0.25, -0.25)
    assert found[0].holm_p == found[0].mcnemar_p
    write_paired(tmp_path / "paired.csv", found)
    assert found[0].means_by_tile["touchdown_speed_mps"].low == -math.inf  # one tile
    with (tmp_path / "paired.csv").open() as stream:
        line = next(csv.DictReader(stream))
    assert float(line["safe_site_points"]) == pytest.approx(100.0 * (second.mean() - first.mean()))
    assert {f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")} <= set(line)


def test_other_episodes_are_refused() -> None:
    with pytest.raises(ValueError, match="'other' and 'single-divert' must have flown the same episodes"):
        scored(np.ones(5), np.ones(4))
