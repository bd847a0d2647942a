"""What rounding takes from a limit at the start breaks none: one allowance, by every method."""

import math
from dataclasses import replace

import numpy as np
import pytest
from descents import COMPLETE, GRAVITY, TARGET
from hypothesis import given
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, Lander, Limits, PlanStatus, State
from guidance.descent.problem import ROUNDING, LandingProblem, lies_below
from guidance.pdg.solve import ARRIVED
from guidance.tracking.soft_landing import DEFAULT_OPTIONS, plan_soft_landing


def problem_from(start, target=TARGET, **limits):
    return LandingProblem(State.parse(start), np.asarray(target, float), PAPER_LANDER, GRAVITY, **limits)


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("depth", [0.0, 1e-9, 2e-5])
def test_a_start_on_the_altitude_of_the_target_or_below_it_by_rounding_can_fly(depth, method):
    plan = guidance.solve_pdg([30, 0, 50 - depth, 0, 0, 0, 1200], TARGET, method=method)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.propellant == pytest.approx(5.56, abs=0.01)
    assert plan.residuals.altitude < 1e-5
    assert plan.residuals.position < 1e-4


@pytest.mark.parametrize("depth", [3.1e-5, 1e-3, 0.1])
def test_a_start_below_by_more_is_refused(depth):
    with pytest.raises(ValueError, match="altitude"):
        guidance.solve_pdg([30, 0, 50 - depth, 0, 0, 0, 1200], TARGET)


@given(
    distance=st.floats(0.0, 1e5),
    bearing=st.floats(0.0, 2.0 * math.pi),
    share=st.floats(0.0, 3.0),
    height=st.floats(-2000.0, 2000.0),
)
def test_the_allowance_grows_with_the_distance_and_the_start_is_lifted_by_it(
    distance, bearing, share, height
):
    target = np.array([10.0, -20.0, height])
    allowed = ROUNDING * max(1.0, distance)
    across = distance * np.array([math.cos(bearing), math.sin(bearing)])
    start = target + np.array([*across, -share * allowed])
    if abs(share - 1.0) > 1e-3:
        assert lies_below(start, target) == (share > 1.0)
    if not lies_below(start, target):
        offset = problem_from([*start, 0, 0, 0, 1200], target).offset
        assert offset[2] == 0.0
        np.testing.assert_allclose(offset[:2], across, atol=1e-9)


def test_a_flight_may_sink_below_neither_the_target_nor_such_a_start():
    plan = guidance.solve_pdg([30, 0, 50 - 1e-5, 0, 0, 0, 1200], TARGET)
    level = replace(plan, problem=replace(plan.problem, target=TARGET + np.array([0.0, 0.0, 1e-6])))
    assert level.residuals.altitude < 1e-5  # of the start; the target is a little higher
    lower = replace(plan, trajectory=replace(plan.trajectory, thrust=0.9 * plan.thrust))
    assert lower.residuals.altitude > 0.01


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("time_of_flight", [None, 33.0])
def test_a_start_too_fast_by_rounding_can_fly(time_of_flight, method):
    start = [20, 0, 950, 0, 0, -30 * (1 + 5e-7), 1200]
    plan = guidance.solve_pdg(
        start, TARGET, speed_limit=30.0, method=method, time_of_flight=time_of_flight, nodes=41
    )
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.residuals.speed < 1e-3
    faster = guidance.solve_pdg(start, TARGET, speed_limit=29.9999, method=method, throw=False)
    assert faster.message == "speed"


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("time_of_flight", [None, 26.0])
def test_a_start_outside_the_glide_slope_by_rounding_can_fly(time_of_flight, method):
    limits = {"glide_slope_limit": math.pi / 4, "method": method, "time_of_flight": time_of_flight}
    start = [300 * (1 + 5e-7), 0, 350, -12, 0, -5, 1200]
    plan = guidance.solve_pdg(start, TARGET, nodes=31, **limits)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.residuals.glide_slope < 1e-3
    start[0] = 300.01
    assert guidance.solve_pdg(start, TARGET, throw=False, **limits).message == "glide slope"


@given(angle=st.floats(0.05, 1.5), bearing=st.floats(0.0, 6.0), share=st.floats(0.0, 0.99))
def test_a_start_outside_the_cone_by_rounding_is_moved_onto_it(angle, bearing, share):
    axis = np.array(
        [math.sin(angle) * math.cos(bearing), math.sin(angle) * math.sin(bearing), math.cos(angle)]
    )
    normal = np.array(
        [math.cos(angle) * math.cos(bearing), math.cos(angle) * math.sin(bearing), -math.sin(angle)]
    )
    start = TARGET + 400.0 * axis + share * 400.0 * ROUNDING * normal
    problem = problem_from([*start, 0, 0, 0, 1200], limits=Limits(glide_slope=angle))
    assert problem.outside_glide_slope(problem.offset) < 1e-10
    np.testing.assert_allclose(problem.offset, 400.0 * axis, atol=1e-9)


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("start", [[0, 0, 50], [0, 0, 50 - 5e-7], [1e-7, 0, 50], [0, 0, 50 + 1e-7]])
def test_at_rest_on_the_target_no_flight_is_needed_and_the_plan_says_so(start, method):
    plan = guidance.solve_pdg([*start, 0, 0, 0, 1200], TARGET, method=method)
    assert plan.status is PlanStatus.OPTIMAL
    assert plan.message.endswith(ARRIVED)
    assert plan.propellant < 0.01
    assert plan.time_of_flight < 0.01
    assert plan.residuals.landing_position < 1e-5
    wait = guidance.solve_pdg([*start, 0, 0, 0, 1200], TARGET, method=method, time_of_flight=8.0)
    assert ARRIVED not in wait.message
    assert wait.propellant == pytest.approx(1200 * 1.62 * 8.0 / PAPER_LANDER.exhaust_velocity, rel=0.01)


@pytest.mark.parametrize(
    ("velocity", "lander", "status"),
    [
        (-5.0, PAPER_LANDER, PlanStatus.INFEASIBLE),  # it would go on through the ground
        (0.0, Lander(max_thrust=1500.0), PlanStatus.INFEASIBLE),
    ],
)
def test_where_the_target_is_the_start_and_no_flight_exists_both_are_said(velocity, lander, status):
    arrival = (0.0, 0.0, velocity)
    plan = guidance.solve_pdg(
        [0, 0, 50, *arrival, 1200], TARGET, target_velocity=arrival, lander=lander, throw=False
    )
    assert plan.status is status
    assert plan.certificate is not None
    assert plan.message.endswith(ARRIVED)


def test_a_soft_landing_may_start_at_its_gate():
    gate = 0.5 * DEFAULT_OPTIONS.terminal_deceleration * (DEFAULT_OPTIONS.terminal_periods * 0.5) ** 2
    start = State(np.array([40.0, 0.0, 50.0 + gate - 1e-9]), np.zeros(3), 1200.0)
    assert plan_soft_landing(start, TARGET, PAPER_LANDER, 0.5).status is PlanStatus.OPTIMAL
    lower = State(np.array([40.0, 0.0, 50.0 + gate - 1e-3]), np.zeros(3), 1200.0)
    with pytest.raises(ValueError, match="gate"):
        plan_soft_landing(lower, TARGET, PAPER_LANDER, 0.5)
