"""Standings against a reference: by failures first, then by propellant where both land."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hda.flight.episode_row import EpisodeRow
from studies.trade_off.standings import Standing, compare_to, judge, tell_standings

REFERENCE = "hazard-aware"
TILES = 9


def rows_of(policy: str, landed: list[bool], burnt: list[float]) -> tuple[EpisodeRow, ...]:
    return tuple(
        EpisodeRow(
            policy=policy,
            episode=k,
            tile=1000 + k % TILES,
            outcome="success" if success else "unsafe-site",
            safe_site=success,
            success=success,
            miss_distance_m=0.1,
            touchdown_speed_mps=0.5,
            propellant_percent=propellant,
            minimum_slant_angle_deg=72.0,
            maximum_thrust_n=4600.0,
            reward=1.0,
            flight_time_s=40.0,
            decisions=8,
            fallbacks=0,
            touchdown_x_m=500.0,
            touchdown_y_m=500.0,
        )
        for k, (success, propellant) in enumerate(zip(landed, burnt, strict=True))
    )


def drawn(policy: str, fails: float, burns: float, rng: np.random.Generator) -> tuple[EpisodeRow, ...]:
    episodes = 20 * TILES
    return rows_of(
        policy, (rng.random(episodes) >= fails).tolist(), rng.normal(60.0 + burns, 1.0, episodes).tolist()
    )


@pytest.mark.parametrize(("fails", "burns"), list(product((-1, 0, 1), repeat=2)))
def test_a_standing_turns_round_with_the_two_that_are_compared(fails: int, burns: int) -> None:
    turned = {
        Standing.AHEAD: Standing.BEHIND,
        Standing.SAFER: Standing.CHEAPER,
        Standing.UNDECIDED: Standing.UNDECIDED,
        Standing.CHEAPER: Standing.SAFER,
        Standing.BEHIND: Standing.AHEAD,
    }
    assert judge(-fails, -burns) is turned[judge(fails, burns)]
    assert (judge(fails, burns) is Standing.AHEAD) == (max(fails, burns) <= 0 and fails + burns < 0)


@pytest.mark.parametrize(
    ("own", "other", "standing"),
    [
        ((0.02, 0.0), (0.3, 0.0), Standing.BEHIND),
        ((0.02, 0.0), (0.3, 3.0), Standing.BEHIND),
        ((0.02, 0.0), (0.3, -3.0), Standing.CHEAPER),
        ((0.3, 0.0), (0.02, 3.0), Standing.SAFER),
        ((0.3, 0.0), (0.02, -3.0), Standing.AHEAD),
        ((0.0, 0.0), (0.0, -3.0), Standing.AHEAD),
        ((0.0, 0.0), (0.0, 3.0), Standing.BEHIND),
    ],
)
def test_great_differences_are_decided(
    own: tuple[float, float], other: tuple[float, float], standing: Standing
) -> None:
    rng = np.random.default_rng(1)
    rows = {REFERENCE: drawn(REFERENCE, *own, rng), "alhat": drawn("alhat", *other, rng)}
    first, second = compare_to("paper", rows, REFERENCE)
    assert (first.standing, second.standing) == (Standing.REFERENCE, standing)


def test_equal_policies_are_hardly_ever_told_apart() -> None:
    """Holm's correction and the interval's confidence each let one of seven be told apart in 5 % of studies.

    Sixty studies with more than sixteen such are one alarm in 20 000 at the sum of both rates.
    """
    rng, names = np.random.default_rng(2), ("alhat", "alhat+convex", "sac", "td3", "oracle", "no-divert", "x")
    told = 0
    for _ in range(60):
        rows = {name: drawn(name, 0.1, 0.0, rng) for name in (REFERENCE, *names)}
        told += any(
            line.standing not in (Standing.REFERENCE, Standing.UNDECIDED)
            for line in compare_to("paper", rows, REFERENCE)
        )
    assert told <= 16


@given(
    st.lists(
        st.tuples(st.booleans(), st.booleans(), st.floats(40.0, 90.0), st.floats(40.0, 90.0)),
        min_size=TILES,
        max_size=60,
    )
)
def test_differences_are_those_of_the_episodes(
    flights: list[tuple[bool, bool, float, float]],
) -> None:
    own, other, burnt, theirs = (list(column) for column in zip(*flights, strict=True))
    rows = {"alhat": rows_of("alhat", other, theirs), REFERENCE: rows_of(REFERENCE, own, burnt)}
    line, reference = compare_to("paper", rows, REFERENCE)
    assert (line.policy, reference.policy) == ("alhat", REFERENCE)
    assert (line.failures, reference.failures) == (other.count(False), own.count(False))
    assert np.isnan([*vars(reference.fails_more).values(), reference.holm_p]).all()
    assert line.fails_more.estimate == pytest.approx((line.failures - reference.failures) / len(flights))
    assert line.fails_more.low <= line.fails_more.estimate <= line.fails_more.high
    both = [b - a for (x, y, a, b) in flights if x and y]
    if both:
        assert line.burns_more.estimate == pytest.approx(np.mean(both), abs=1e-9)
    else:
        assert np.isnan(line.burns_more.estimate)


def test_the_best_of_the_others_is_told_and_sees_no_truth() -> None:
    landed, missed = [True] * 18, [False] + [True] * 17
    rows = {
        "alhat": rows_of("alhat", landed, [67.0] * 18),
        "alhat+convex": rows_of("alhat+convex", landed, [56.0] * 18),
        "td3": rows_of("td3", missed, [55.0] * 18),
        "oracle-fuel": rows_of("oracle-fuel", landed, [53.0] * 18),
        REFERENCE: rows_of(REFERENCE, landed, [54.0] * 18),
    }
    assert tell_standings(compare_to("lidar", rows, REFERENCE)) == (
        "lidar: against hazard-aware (0 failures of 18, 54.00 % of the propellant) 3 behind;"
        " the best is alhat+convex (0 failures of 18, 56.00 % of the propellant)"
    )
    alone = {name: rows[name] for name in ("oracle-fuel", REFERENCE)}
    assert tell_standings(compare_to("lidar", alone, REFERENCE)).endswith(
        "no other policy that sees no truth"
    )
