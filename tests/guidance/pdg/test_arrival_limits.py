"""Velocities at the target that cannot be had, and proofs and bounds that exclude nothing that flies."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import COMPLETE, GRAVITY, TARGET, arrival_velocity, paper_start
from hypothesis import given, reject, settings
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, Lander, Limits, PlanStatus, State, propagate
from guidance.convex.farkas import FarkasProof
from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import forbidden_by, guess_time, time_window
from guidance.planning.convex_task import ConvexTask
from guidance.planning.infeasibility import prove_at

START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]


def random_flight(rng):
    """Problem and time of flight of random burns, cut where the flight is at its lowest; None if nowhere."""
    lander = Lander(max_thrust=rng.uniform(1500.0, 20000.0), specific_impulse=rng.uniform(200.0, 400.0))
    start = State(rng.uniform(-500.0, 500.0, 3), rng.uniform(-60.0, 60.0, 3), rng.uniform(1155.0, 1400.0))
    path, times, least = [start], [0.0], lander.max_thrust
    for _ in range(rng.integers(1, 5)):
        push = rng.normal(size=3) + np.array([0.0, 0.0, rng.uniform(0.0, 2.0)])
        throttle, step = rng.uniform(0.0, 1.0) ** 0.3, rng.exponential(4.0) / 20.0
        thrust = throttle * lander.max_thrust * push / np.linalg.norm(push)
        least = min(least, throttle * lander.max_thrust)
        for _ in range(20):
            path.append(propagate(path[-1], thrust, step, lander, GRAVITY))
            times.append(times[-1] + step)
    height = np.array([state.position[2] for state in path])
    lowest = [
        k
        for k in range(1, len(path))
        if path[k].velocity[2] <= 0.0 and height[k] < height[:k].min() and path[k].mass > lander.dry_mass
    ]
    if not lowest:
        return None
    k = rng.choice(lowest)
    speed = max(float(np.linalg.norm(state.velocity)) for state in path[: k + 1])
    engine = replace(lander, min_thrust=least)
    return LandingProblem(
        start, path[k].position, engine, GRAVITY, Limits(speed=speed), path[k].velocity
    ), times[k]


@settings(max_examples=400)
@given(seed=st.integers(0, 1_000_000))
def test_no_flight_is_excluded_by_the_closed_form_bounds(seed):
    flight = random_flight(np.random.default_rng(seed))
    if flight is None:
        reject()
    problem, time = flight
    for free in (False, True):
        window = time_window(problem, free)
        assert not window.empty, window.cause
        assert window.low <= time <= window.high * (1.0 + 1e-9)
        assert not forbidden_by(problem, time, free)
    assert window.low <= guess_time(problem, window) <= window.high


@pytest.mark.parametrize("seed", range(10))
def test_a_feasible_time_is_not_disproved_and_one_too_short_is(seed):
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    arrival = arrival_velocity(rng, start)
    problem = LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY, target_velocity=arrival)
    plan = guidance.solve_pdg(start, TARGET, target_velocity=problem.target_velocity, nodes=31, throw=False)
    assert plan.certificate is not None
    assert plan.status.has_flight == math.isfinite(plan.certificate.lower_bound)
    task = ConvexTask(problem, 31)
    if plan.status.has_flight:
        assert not isinstance(prove_at(task, 1.005 * plan.time_of_flight), FarkasProof)
    assert isinstance(prove_at(task, 4.0), FarkasProof)


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("time_of_flight", [None, 27.0])
@pytest.mark.parametrize("unreachable", ["raise", "nearest"])
@pytest.mark.parametrize(
    ("velocity", "limits", "cause"),
    [
        ((0.0, 0.0, 0.1), {}, "altitude"),
        ((3.0, 0.0, 8.0), {"speed_limit": 100.0}, "altitude"),
        ((0.0, 0.0, -41.0), {"speed_limit": 40.0}, "speed"),
        ((9.0, 0.0, -3.0), {"glide_slope_limit": 0.9}, "glide slope"),
    ],
)
def test_what_the_velocity_itself_forbids_is_told_without_a_solve(
    velocity, limits, cause, unreachable, time_of_flight, method
):
    plan = guidance.solve_pdg(
        START,
        TARGET,
        target_velocity=velocity,
        method=method,
        time_of_flight=time_of_flight,
        unreachable=unreachable,
        throw=False,
        **limits,
    )
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.causes == (cause,)
    assert not plan.certificate.proofs
    assert cause in plan.message


@pytest.mark.parametrize(
    ("start", "velocity", "feasible"),
    [
        ([0, 0, 110, 0, 0, -60, 1200], -40.0, False),  # full thrust leaves 50 m/s at the target
        ([0, 0, 110, 0, 0, -60, 1200], -52.0, True),
        ([0, 0, 50, 0, 0, -5, 1200], -15.0, False),  # on the ground, sinking: below it at once
        ([0, 0, 50, 0, 0, 5, 1200], -5.0, True),
    ],
)
@pytest.mark.parametrize("time_of_flight", [None, 20.0])
def test_a_start_too_fast_to_stop_may_only_arrive_fast_and_soon(start, velocity, feasible, time_of_flight):
    feasible = feasible and (time_of_flight is None or start[5] > 0.0)
    plan = guidance.solve_pdg(
        start, TARGET, target_velocity=(0, 0, velocity), time_of_flight=time_of_flight, nodes=21, throw=False
    )
    assert plan.status is (PlanStatus.OPTIMAL if feasible else PlanStatus.INFEASIBLE)
    if not feasible:
        assert plan.certificate is not None
        assert plan.certificate.causes == ("altitude",)


def test_the_slowest_arrival_of_a_start_too_fast_to_stop_is_found_on_the_edge():
    """60 m at 60 m/s: with the mass of the start full thrust leaves sqrt(60^2 - 2 60 (10 - 1.62)) m/s."""
    burnt = propagate(
        State(np.array([0.0, 0.0, 110.0]), np.array([0.0, 0.0, -60.0]), 1200.0),
        [0.0, 0.0, PAPER_LANDER.max_thrust],
        1.0822,
        PAPER_LANDER,
    )
    assert burnt.position[2] == pytest.approx(50.0, abs=0.2)
    arrival = burnt.velocity[2]
    for change, status in ((-0.3, PlanStatus.OPTIMAL), (0.3, PlanStatus.INFEASIBLE)):
        plan = guidance.solve_pdg(
            [0, 0, 110, 0, 0, -60, 1200], TARGET, target_velocity=(0, 0, arrival + change), throw=False
        )
        assert plan.status is status
