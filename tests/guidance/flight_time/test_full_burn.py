"""Flights that burn all the way: made backward from the target by another integrator, and found again."""

import math
from typing import Any

import numpy as np
import pytest
from descents import GRAVITY, TARGET
from scipy.integrate import solve_ivp

from guidance import PAPER_LANDER, PlanStatus, State, solve_pdg
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_extremal_flight

MASS = 1200.0


def burn_backward(rng):
    """A start from which full thrust along an affine primer lands, its time [s] and its primer's ends.

    The primer's length grows from about the middle on; the switching function is positive where it is least.
    """
    lander, time = PAPER_LANDER, rng.uniform(4.0, 9.0)
    begin = np.append(rng.normal(0.0, 0.6, 2), rng.uniform(0.3, 1.0))
    end = np.append(rng.normal(0.0, 0.6, 2), rng.uniform(0.3, 1.0))

    def rates(before, state):
        primer = end + (begin - end) * before / time
        mass = MASS - lander.max_mass_flow * (time - before)
        push = lander.max_thrust / mass * primer / np.linalg.norm(primer)
        return np.concatenate([-state[3:], -(push + GRAVITY)])

    landed = np.concatenate([TARGET, np.zeros(3)])
    path: Any = solve_ivp(
        rates, (0.0, time), landed, method="DOP853", rtol=1e-12, atol=1e-10, dense_output=True
    )
    slope = (end - begin) / time
    middle = min(max(-float(begin @ slope) / float(slope @ slope), 0.0), time)
    switching = slope @ path.sol(time - middle)[3:] - (begin + slope * middle) @ GRAVITY
    heights = path.sol(np.linspace(0.0, time, 60))[2]
    start = np.append(path.y[:, -1], MASS)
    return start, time, begin, end, float(switching), float(heights[1:].min())


def flights(seed, count):
    """Starts above the ground whose flight without a coast is the optimum, with what `burn_backward` says."""
    rng, made = np.random.default_rng(seed), 0
    while made < count:
        start, time, begin, end, switching, lowest = burn_backward(rng)
        if switching > 0.05 and lowest >= TARGET[2] and start[2] > TARGET[2] + 1.0:
            made += 1
            yield start, time, begin, end


def test_a_flight_that_was_made_backward_is_found_again():
    found = 0
    for start, time, begin, end in flights(61, 60):
        flight = find_extremal_flight(LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY))
        if flight is None:
            continue
        found += 1
        assert flight.time == pytest.approx(time, rel=1e-6)
        burnt = MASS * -math.expm1(-flight.log_mass_ratio)
        assert burnt == pytest.approx(PAPER_LANDER.max_mass_flow * time, rel=1e-6)
        for at, primer in ((0.0, begin), (flight.time, end)):
            assert flight.direction_at(at) == pytest.approx(primer / np.linalg.norm(primer), abs=1e-5)
    assert found > 30  # from some the iteration does not converge: the convex problem answers those


def test_its_plan_lands_and_the_bound_says_that_no_flight_is_cheaper():
    exact = 0
    for start, time, _, _ in flights(62, 20):
        plan = solve_pdg(start, TARGET)
        assert plan.status is PlanStatus.OPTIMAL
        if plan.method != "indirect":
            continue
        exact += 1
        assert plan.keeps_limits
        assert plan.time_of_flight == pytest.approx(time, rel=1e-6)
        assert plan.residuals.landing_position < 1e-3
        assert plan.residuals.landing_velocity < 1e-3
        assert -1e-6 < plan.optimality_gap < 0.05
        assert np.linalg.norm(plan.thrust, axis=1).max() <= PAPER_LANDER.max_thrust * (1.0 + 1e-12)
    assert exact >= 3


def test_the_convex_problem_agrees():
    for start, _, _, _ in flights(63, 4):
        exact, mesh = solve_pdg(start, TARGET), solve_pdg(start, TARGET, method="convex", nodes=101)
        assert -1e-3 < mesh.propellant - exact.propellant < 0.05
