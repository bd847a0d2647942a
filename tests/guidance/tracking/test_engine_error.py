"""What a plan leaves to an engine whose error is bounded, and what the feedback assumes of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.tracking.engine_error import assumed_error, bearing_margin
from guidance.tracking.reference import TrackingReference

PERIODS = 10
BOUNDS = st.floats(0.01, 0.6)


def reference_of(*sizes: float) -> TrackingReference:
    """A reference that asks for these thrust accelerations [m/s^2], upward."""
    n = len(sizes)
    acceleration = np.zeros((n, 3))
    acceleration[:, 2] = sizes
    return TrackingReference(0.5, np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), acceleration)


@given(BOUNDS, st.floats(0.0, 0.7))
def test_the_margin_covers_the_bound_and_what_the_feedback_needs(bound: float, least: float) -> None:
    margin = bearing_margin(bound, least)
    assert margin in (bound, least)
    assert margin >= max(bound, least)


def test_the_margin_leaves_an_engine_to_plan_with() -> None:
    assert bearing_margin(0.9, 0.1) == 0.75


@given(BOUNDS, st.lists(st.floats(0.0, 1.0), min_size=2, max_size=16), st.floats(0.0, 1.0))
def test_the_weakest_engine_can_give_later_what_it_lacks_at_first(
    bound: float, shares: list[float], extra: float
) -> None:
    greatest, margin = 10.0, bound * (1.0 + 0.5 * extra)
    asked = (1.0 - margin) * greatest * np.array(shares)
    assumed = assumed_error(reference_of(*asked), greatest, bound, margin, PERIODS)
    assert -bound <= assumed <= 0.0
    burning = np.flatnonzero(asked[:PERIODS] > 0.05)
    if burning.size == 0 or margin >= 2.0 * bound / (1.0 + bound):
        assert assumed == 0.0
        return
    first = burning[0]
    given_at_first = asked[first] * (1.0 - bound) / (1.0 + assumed)
    spare = np.maximum((1.0 - bound) * greatest - asked[first + 1 : first + 4], 0.0).sum()
    assert asked[first] - given_at_first <= spare + 1e-9
    if assumed < 0.0:  # no more prejudice than it takes
        assert asked[first] - given_at_first == pytest.approx(spare, abs=1e-9)


def test_a_burn_before_a_coast_is_flown_without_prejudice_and_one_that_goes_on_with_all() -> None:
    assert assumed_error(reference_of(7.0, *[0.0] * 9), 10.0, 0.3, 0.3, PERIODS) == 0.0
    assert assumed_error(reference_of(*[7.0] * 10), 10.0, 0.3, 0.3, PERIODS) == pytest.approx(-0.3)


def test_the_error_of_the_presets_is_covered_by_the_feedbacks_own_margin() -> None:
    assert bearing_margin(0.05, 0.1) == 0.1
    assert assumed_error(reference_of(*[9.0] * 10), 10.0, 0.05, 0.1, PERIODS) == 0.0
