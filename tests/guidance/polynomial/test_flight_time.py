"""The time of flight that a polynomial descent is given."""

import math
from dataclasses import replace

import numpy as np
import pytest

import guidance
from guidance.polynomial import Arrival, cheapest_time_of_flight, meet_arrival

GRAVITY = np.array(guidance.MOON_GRAVITY)
LANDER = guidance.PAPER_LANDER
TIMES = np.arange(15.0, 90.0, 0.25)
SITE = np.array([0.0, 0.0, 50.0])
START = guidance.State(np.array([200.0, 100.0, 950.0]), np.array([-8.0, -4.0, -30.0]), 1200.0)
ARRIVALS = [Arrival(SITE), Arrival(SITE, acceleration=np.array([0.0, 0.0, 2.5]))]


def thrust_of(arrival: Arrival, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """[s] and [m/s^2] finely along a descent."""
    time = np.linspace(0.0, seconds, 2001)
    return time, meet_arrival(START, arrival, seconds).acceleration_at(time) - GRAVITY


def velocity_change(arrival: Arrival, seconds: float) -> float:
    time, thrust = thrust_of(arrival, seconds)
    return float(np.trapezoid(np.linalg.norm(thrust, axis=1), time))


@pytest.mark.parametrize("arrival", ARRIVALS, ids=["e-guidance", "apollo"])
def test_it_is_the_cheapest_of_the_times_that_the_lander_can_fly(arrival):
    chosen = cheapest_time_of_flight(START, arrival, TIMES, LANDER, GRAVITY)
    possible = [
        seconds
        for seconds in TIMES
        if np.linalg.norm(thrust_of(arrival, seconds)[1], axis=1).max() * START.mass
        <= 0.95 * LANDER.max_thrust
        and meet_arrival(START, arrival, seconds).position_at(np.linspace(0.0, seconds, 2001))[:, 2].min()
        >= SITE[2] - 1e-9
    ]
    least = min(velocity_change(arrival, seconds) for seconds in possible)
    assert velocity_change(arrival, chosen) <= 1.002 * least  # its integral has 16 steps


@pytest.mark.parametrize("arrival", ARRIVALS, ids=["e-guidance", "apollo"])
def test_e_guidances_time_costs_less_than_the_quartics(arrival):
    chosen = cheapest_time_of_flight(START, arrival, TIMES, LANDER, GRAVITY)
    assert velocity_change(arrival, chosen) < velocity_change(ARRIVALS[0], guidance.time_to_go(START, SITE))


def test_a_weak_engine_and_a_pointing_limit_are_kept():
    weak = replace(LANDER, max_thrust=5000.0, pointing_limit=math.radians(20.0))
    for arrival in ARRIVALS:
        seconds = cheapest_time_of_flight(START, arrival, TIMES, weak, GRAVITY)
        _, thrust = thrust_of(arrival, seconds)
        assert np.linalg.norm(thrust, axis=1).max() * START.mass <= weak.max_thrust
        tilt = np.arctan2(np.hypot(thrust[:, 0], thrust[:, 1]), thrust[:, 2])
        assert tilt.max() <= math.radians(20.0)


def test_without_a_pointing_limit_the_cheapest_time_may_begin_with_thrust_downward():
    """From rest straight above its site, a fall that an upside-down engine hastens costs the least.

    With d m below and t s to go its thrust acceleration is linear, -6 d/t^2 + g first and 6 d/t^2 + g last.
    """
    rest = guidance.State(SITE + np.array([0.0, 0.0, 900.0]), np.zeros(3), 1200.0)

    def cost(seconds: float) -> float:
        first, last = (sign * 6.0 * 900.0 / seconds**2 - GRAVITY[2] for sign in (-1.0, 1.0))
        share = np.linspace(0.0, 1.0, 2001)
        return seconds * float(np.abs(first + share * (last - first)).mean())

    free = cheapest_time_of_flight(rest, ARRIVALS[0], TIMES, LANDER, GRAVITY)
    assert free == 45.25
    assert cost(free) <= 1.002 * min(map(cost, TIMES))  # its integral has 16 steps
    upright = replace(LANDER, pointing_limit=math.radians(45.0))
    assert cheapest_time_of_flight(rest, ARRIVALS[0], TIMES, upright, GRAVITY) == 57.75


def test_where_no_time_will_do_the_least_excess_is_taken():
    feeble = replace(LANDER, max_thrust=100.0)
    seconds = cheapest_time_of_flight(START, ARRIVALS[0], TIMES, feeble, GRAVITY)
    greatest = [np.linalg.norm(thrust_of(ARRIVALS[0], time)[1], axis=1).max() for time in TIMES]
    assert seconds == TIMES[int(np.argmin(greatest))]


def test_it_needs_times():
    with pytest.raises(ValueError, match="times"):
        cheapest_time_of_flight(START, ARRIVALS[0], np.array([]), LANDER, GRAVITY)
    with pytest.raises(ValueError, match="times"):
        cheapest_time_of_flight(START, ARRIVALS[0], np.array([0.0, 1.0]), LANDER, GRAVITY)
