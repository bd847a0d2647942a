"""What a sensor that is fixed to a body will see on its way: its price, and the plans that it makes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.arrays import Array
from guidance.rigid_body import DEFAULT_BODY, RigidState
from guidance.tracking.looks_ahead import LooksAhead, bend_flights, price_missed_looks
from guidance.tracking.reference import TrackingReference
from guidance.tracking.turning_descent import DEFAULT_TURNING, plan_turning_descent

LOOKS = LooksAhead(interval=5.0, half_angle=math.radians(5.7), least_time=8.0)
SITE = np.array([0.0, 0.0, 50.0])
SEEING = replace(DEFAULT_TURNING, looks=LOOKS)


def one_flight(angle: float, time: float) -> tuple[Array, Array, Array]:
    """A flight whose axis is `angle` [rad] off its site all the way: sight, thrust, time."""
    sight = np.tile([30.0, 40.0, 600.0], (9, 1, 1, 1))
    across = np.cross(sight, [0.0, 0.0, 1.0])
    across *= np.linalg.norm(sight[0, 0, 0]) / np.linalg.norm(across[0, 0, 0])
    return sight, math.cos(angle) * sight + math.sin(angle) * across, np.array([time])


@given(angle=st.floats(0.0, 0.4), time=st.floats(10.0, 60.0))
def test_a_look_costs_by_the_angle_that_it_is_off(angle: float, time: float):
    """Nothing on the axis, half its price at half the field of view, all of it at the whole of it."""
    counted = sum(5.0 * k <= time + 5.0 - 8.0 for k in range(1, 20))
    expected = 10.0 * counted * min(angle / (2.0 * LOOKS.half_angle), 1.0)
    found = price_missed_looks(*one_flight(angle, time), 5.0, LOOKS)
    np.testing.assert_allclose(found, [[expected]], rtol=1e-6, atol=1e-5)


@given(seed=st.integers(0, 2**32 - 1))
def test_detours_keep_the_ends_and_reach_halfway_what_they_say(seed: int):
    rng = np.random.default_rng(seed)
    flights, course = rng.standard_normal((6, 2, 3, 3)), rng.standard_normal(2)
    bent = bend_flights(flights, course)
    assert bent.shape == (7, 2, 21, 3)
    straight = np.concatenate([flights, np.zeros((1, 2, 3, 3))])
    moved = bent.reshape(7, 2, 3, 7, 3) - straight[:, :, :, None]
    for share in (0.0, 1.0):
        for order in range(3):
            row = [math.perm(p, order) * share ** max(p - order, 0) for p in range(7)]
            np.testing.assert_allclose(np.tensordot(row, moved, 1), 0.0, atol=1e-9)
    halfway = np.tensordot(0.5 ** np.arange(7), moved, 1)[0, 0]
    np.testing.assert_allclose(np.linalg.norm(halfway, axis=1), [0.0, 50.0, 25.0, 10.0, 10.0, 25.0, 50.0])
    np.testing.assert_allclose(halfway[:, 2], 0.0)
    np.testing.assert_allclose(np.cross(np.append(course, 0.0), halfway), 0.0, atol=1e-9)
    np.testing.assert_array_equal(bend_flights(flights, np.zeros(2))[:6, :, 0], flights[:, :, 0])


def start(distance: float) -> RigidState:
    return RigidState(np.array([-distance, 0.0, 950.0]), np.array([7.5, 0.0, -27.0]), 1200.0)


def cost(plan: TrackingReference) -> float:
    return float(np.linalg.norm(plan.thrust_acceleration, axis=1).sum()) * plan.control_period


def missed(plan: TrackingReference) -> float:
    """[m/s] what the looks of a plan miss, by its own nodes."""
    total, each = 0.0, round(LOOKS.interval / plan.control_period)
    for node in range(each, len(plan.thrust_acceleration), each):
        if (len(plan.thrust_acceleration) - node) * plan.control_period < LOOKS.least_time:
            continue
        sight, thrust = plan.position[node] - SITE, plan.thrust_acceleration[node]
        cosine = sight @ thrust / (np.linalg.norm(sight) * np.linalg.norm(thrust))
        total += LOOKS.price * min(math.acos(min(cosine, 1.0)) / (2.0 * LOOKS.half_angle), 1.0)
    return total


@pytest.mark.parametrize("distance", [10.0, 50.0, 100.0, 225.0])
def test_a_plan_pays_for_its_looks_no_more_than_they_are_worth(distance: float):
    state = start(distance)
    plain = plan_turning_descent(state, SITE, DEFAULT_BODY, 0.5)
    seeing = plan_turning_descent(state, SITE, DEFAULT_BODY, 0.5, SEEING)
    assert plain is not None
    assert seeing is not None
    slack = 6.0  # [m/s] fewer durations are tried, and looks are read between 33 instants
    assert cost(seeing) + missed(seeing) < cost(plain) + missed(plain) + slack
    assert missed(seeing) < 0.9 * missed(plain)
    np.testing.assert_allclose(seeing.position[-1], SITE, atol=1e-9)
    np.testing.assert_allclose(seeing.velocity[-1], 0.0, atol=1e-9)


def test_where_a_gentle_braking_ends_the_axis_points_at_the_site_all_the_way():
    """The easiest landing lies about v t / 2 ahead, and its looks are seen without paying for them."""
    plans = {d: plan_turning_descent(start(d), SITE, DEFAULT_BODY, 0.5) for d in (10.0, 160.0, 225.0)}
    prices = {d: missed(plan) for d, plan in plans.items() if plan is not None}
    costs = {d: cost(plan) for d, plan in plans.items() if plan is not None}
    assert prices[160.0] < 0.5 * min(prices[10.0], prices[225.0])
    assert costs[160.0] < min(costs[10.0], costs[225.0])
    easiest = plans[160.0]
    assert easiest is not None
    assert abs(0.5 * 7.5 * easiest.duration - 160.0) < 25.0


@pytest.mark.parametrize("name", ["interval", "half_angle", "least_time", "price"])
def test_looks_that_mean_nothing_are_refused(name: str):
    with pytest.raises(ValueError, match=name):
        replace(LOOKS, **{name: -1.0})
