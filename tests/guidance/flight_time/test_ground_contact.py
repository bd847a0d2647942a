"""Starts that cannot stop: the closed form against an integrator, and against every flight there is."""

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start
from hypothesis import given
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, PlanStatus, State
from guidance.descent.problem import LandingProblem
from guidance.dynamics import integrate
from guidance.flight_time.ground_contact import find_ground_contact


def falling(height, sink, mass) -> LandingProblem:
    state = State(np.array([40.0, -10.0, 50.0 + height]), np.array([3.0, 5.0, -sink]), mass)
    return LandingProblem(state, TARGET, PAPER_LANDER, GRAVITY)


def climb(problem, times):
    """States under full thrust straight up, by DOP853."""
    up = np.array([0.0, 0.0, problem.lander.max_thrust])
    return integrate(problem.state, lambda _: up, times, problem.lander, problem.gravity)


@given(st.floats(1.0, 300.0), st.floats(5.0, 90.0), st.floats(1165.0, 1200.0))
def test_it_is_where_full_thrust_straight_up_meets_the_ground(height, sink, mass):
    problem = falling(height, sink, mass)
    contact = find_ground_contact(problem)
    empty = (mass - problem.lander.dry_mass) / problem.lander.max_mass_flow
    if contact is None:
        lowest = climb(problem, np.linspace(0.0, empty, 60))[:, 2].min()
        assert lowest > TARGET[2] - 0.05 * height  # between the sixty times it may be a little lower
        return
    assert 0.0 < contact.time <= empty
    end = climb(problem, np.array([0.0, contact.time]))[-1]
    assert end[2] == pytest.approx(TARGET[2], abs=1e-5)
    assert end[5] == pytest.approx(-contact.sink, abs=1e-5)
    assert contact.sink > 0.0


@given(st.integers(0, 10**6))
def test_no_thrust_keeps_a_vehicle_higher(seed):
    """Random thrusts, each held for a while: none is above full thrust straight up at any time."""
    rng = np.random.default_rng(seed)
    problem = falling(rng.uniform(1.0, 300.0), rng.uniform(5.0, 90.0), 1200.0)
    times = np.linspace(0.0, 0.99 * (1200.0 - 1150.0) / problem.lander.max_mass_flow, 8)
    best, state = climb(problem, times), problem.state
    for k in range(times.size - 1):
        direction = rng.normal(size=3) + np.array([0.0, 0.0, 2.0])
        force = rng.choice([1.0, rng.random()]) * 12000.0 * direction / np.linalg.norm(direction)
        path = integrate(state, lambda _, f=force: f, times[k : k + 2], problem.lander, problem.gravity)
        state = State(path[-1, :3], path[-1, 3:6], float(path[-1, 6]))
        assert state.position[2] <= best[k + 1, 2] + 1e-6
        assert state.velocity[2] <= best[k + 1, 5] + 1e-6


def test_what_it_forbids_no_reference_flies_and_what_it_admits_by_a_hair_flies():
    """The lowest height from which a fall can be stopped, straight above the target, by bisection."""
    low, high = 20.0, 300.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        problem = falling(middle, 40.0, 1200.0)
        low, high = (middle, high) if find_ground_contact(problem) is not None else (low, middle)
    still = [0.0, 0.0, 50.0 + high + 0.05, 0.0, 0.0, -40.0, 1200.0]
    assert guidance.solve_pdg(still, TARGET, nodes=121).status is PlanStatus.OPTIMAL
    still[2] = 50.0 + low - 0.05
    forbidden = guidance.solve_pdg(still, TARGET, throw=False)
    assert forbidden.status is PlanStatus.INFEASIBLE
    assert forbidden.certificate is not None
    assert forbidden.certificate.causes == ("altitude",)
    assert not forbidden.certificate.proofs


def test_no_flight_of_the_reference_is_forbidden():
    rng, forbidden = np.random.default_rng(4), 0
    for _ in range(60):
        start = harsh_start(rng)
        problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)
        if find_ground_contact(problem) is None:
            continue
        forbidden += 1
        if forbidden <= 6:
            plan = guidance.solve_pdg(start, TARGET, method="casadi", throw=False)
            assert not plan.status.has_flight
    assert forbidden > 10


def test_a_start_that_rises_and_an_engine_weaker_than_the_weight_have_none():
    assert find_ground_contact(falling(100.0, -5.0, 1200.0)) is None
    weak = guidance.Lander(max_thrust=1500.0)
    problem = falling(10.0, 60.0, 1200.0)
    assert find_ground_contact(LandingProblem(problem.state, TARGET, weak, GRAVITY)) is None
