"""Plans that end with a velocity: closed forms, three methods, a moving frame, every planner."""

from dataclasses import replace

import numpy as np
import pytest
from descents import COMPLETE, GRAVITY, TARGET, arrival_velocity, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, Lander, Limits, PlanStatus, State, propagate
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_primer_flight
from guidance.flight_time.time_window import guess_time, time_window
from guidance.planning.convex_task import ConvexTask
from guidance.planning.deferred_decision import plan_deferred
from guidance.planning.reachability import reachable_set
from guidance.tracking.reference import make_reference
from guidance.tracking.retarget import shift_landing_point

START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]
VELOCITY = np.array([4.0, -3.0, -12.0])


def problem_to(velocity, start=START, lander=PAPER_LANDER, **limits):
    given = {"target_velocity": np.asarray(velocity, float), **limits}
    return LandingProblem(State.parse(start), TARGET, lander, GRAVITY, **given)


def check_arrival(plan, velocity):
    flown = plan.residuals
    assert plan.status is PlanStatus.OPTIMAL
    np.testing.assert_allclose(plan.position[-1], TARGET, atol=1e-3)
    np.testing.assert_allclose(plan.velocity[-1], velocity, atol=1e-4)
    assert flown.position < 0.05
    assert flown.landing_velocity < 0.01
    assert flown.altitude < 0.02
    assert flown.thrust_above < 12.0
    assert flown.propellant < 1e-3


@pytest.mark.parametrize("method", ["convex", "cvxpy"])
@pytest.mark.parametrize("push", [1.0, -1.0])
def test_along_the_vertical_it_coasts_and_then_burns_at_full_thrust(push, method):
    """Optimal by Pontryagin's principle, up against the fall and down with it; the burn is Tsiolkovsky's."""
    burn = 4.0
    state = State(np.array([0.0, 0.0, 950.0]), np.array([0.0, 0.0, -30.0]), 1200.0)
    lit = propagate(state, [0.0, 0.0, 0.0], 12.0, PAPER_LANDER)
    end = propagate(lit, [0.0, 0.0, push * PAPER_LANDER.max_thrust], burn, PAPER_LANDER)
    plan = guidance.solve_pdg(state, end.position, target_velocity=end.velocity, method=method, nodes=121)
    assert plan.propellant == pytest.approx(burn * PAPER_LANDER.max_mass_flow, abs=0.01)
    assert plan.time_of_flight == pytest.approx(12.0 + burn, abs=0.2)


@pytest.mark.parametrize("method", COMPLETE)
@pytest.mark.parametrize("climb", [-10.0, 5.0])
def test_the_velocity_of_free_fall_costs_nothing(climb, method):
    speed = np.array([5.0, -3.0, climb])
    start = State(TARGET - 10.0 * speed - 50.0 * GRAVITY, speed, 1200.0)
    arrival = speed + 10.0 * GRAVITY
    plan = guidance.solve_pdg(start, TARGET, target_velocity=arrival, method=method)
    assert plan.propellant < 2e-3
    assert plan.time_of_flight == pytest.approx(10.0, abs=5e-3)
    assert plan.residuals.landing_velocity < 1e-3
    upright = guidance.solve_pdg(start, TARGET, target_velocity=arrival, lander=Lander(pointing_limit=0.5))
    assert upright.residuals.pointing == 0.0  # an engine that is off points nowhere


@pytest.mark.parametrize("seed", range(6))
def test_methods_agree_on_dispersed_starts_and_velocities(seed):
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    velocity = arrival_velocity(rng, start)
    plans = [
        guidance.solve_pdg(start, TARGET, target_velocity=velocity, nodes=41, method=method)
        for method in COMPLETE
    ]
    for plan in plans:
        check_arrival(plan, velocity)
    masses = [plan.mass[-1] for plan in plans]
    assert max(masses) - min(masses) < 0.02


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_any_start_and_velocity_gives_a_plan_that_flies(seed):
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    velocity = arrival_velocity(rng, start)
    plan = guidance.solve_pdg(start, TARGET, target_velocity=velocity, nodes=41, throw=False)
    if plan.status is PlanStatus.INFEASIBLE:  # too fast sideways for the propellant
        assert plan.certificate is not None
        assert plan.certificate.verified
        return
    check_arrival(plan, velocity)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), stretch=st.floats(0.9, 1.4))
def test_in_a_frame_that_moves_with_the_velocity_it_is_a_landing_at_rest(seed, stretch):
    """The equations of motion are the same there; the altitude floor alone is not, and it does not bind."""
    rng = np.random.default_rng(seed)
    start = paper_start(rng)
    problem = problem_to([*rng.normal(0.0, 10.0, 2), -rng.uniform(0.0, 20.0)], start)
    time, drift = stretch * guess_time(problem, time_window(problem)), problem.target_velocity
    state = problem.state
    moving = replace(
        problem,
        state=State(state.position + drift * time, state.velocity - drift, state.mass),
        target_velocity=np.zeros(3),
    )
    here, there = ConvexTask(problem, 31).solve(time), ConvexTask(moving, 31).solve(time)
    assert here.solved == there.solved
    if here.solved:
        assert here.value == pytest.approx(there.value, rel=1e-6)
        a, b = here.trajectory(problem), there.trajectory(moving)
        np.testing.assert_allclose(a.velocity, b.velocity + drift, atol=0.2)
        np.testing.assert_allclose(a.mass, b.mass, atol=0.05)


@pytest.mark.parametrize(
    "task",
    [
        ConvexTask(problem_to(VELOCITY), 31),
        ConvexTask(problem_to(VELOCITY), 31, condense=False),
        ConvexTask(problem_to(VELOCITY, limits=Limits(speed=40.0)), 31),
        ConvexTask(problem_to(VELOCITY, lander=Lander(min_thrust=900.0, pointing_limit=0.9)), 31),
        ConvexTask(problem_to(VELOCITY, [0, 0, 950, 8, 0, -30, 1200]), 31, free_landing_point=True),
    ],
    ids=["condensed", "whole", "speed", "engine", "free landing point"],
)
@pytest.mark.parametrize("time", [27.0, 30.0, 38.0])
def test_slope_is_the_derivative_of_the_optimum(task, time):
    task, h = replace(task, tolerance=1e-10), 2e-4 * time
    reference = task.solve(time).log_mass
    middle, below, above = (task.solve(t, reference) for t in (time, time - h, time + h))
    difference = (above.value - below.value) / (2.0 * h)
    scale = 1.62 / PAPER_LANDER.exhaust_velocity
    assert middle.slope == pytest.approx(difference, rel=2e-2, abs=2e-3 * scale)


def test_nearest_arrives_with_the_velocity_as_near_as_it_can():
    far = np.array([2500.0, 600.0, 50.0])
    for time in (None, 30.0):
        plan = guidance.solve_pdg(
            START, far, target_velocity=VELOCITY, unreachable="nearest", time_of_flight=time
        )
        assert plan.status is PlanStatus.NEAREST
        np.testing.assert_allclose(plan.velocity[-1], VELOCITY, atol=1e-3)
        assert plan.residuals.landing_velocity < 0.05
        assert plan.position[-1, 2] == pytest.approx(50.0, abs=1e-3)
    landing = guidance.solve_pdg(START, far, target_velocity=VELOCITY, unreachable="nearest").position[-1]
    there = guidance.solve_pdg(START, landing, target_velocity=VELOCITY, throw=False)
    assert there.status is PlanStatus.OPTIMAL
    nearer = landing + 5.0 * (far - landing) / np.linalg.norm(far - landing)
    beyond = guidance.solve_pdg(START, nearer, target_velocity=VELOCITY, throw=False)
    assert beyond.status is PlanStatus.INFEASIBLE


def test_rest_is_what_is_asked_for_unless_another_velocity_is_given():
    plain = guidance.solve_pdg(START, TARGET)
    asked = guidance.solve_pdg(START, TARGET, target_velocity=(0.0, 0.0, 0.0))
    assert asked.thrust.tobytes() == plain.thrust.tobytes()
    assert plain.problem.target_velocity.tolist() == [0.0, 0.0, 0.0]
    assert find_primer_flight(plain.problem) is not None
    assert find_primer_flight(problem_to((0.0, 0.0, -1e-3))) is None  # it knows flights to rest alone
    nearly = guidance.solve_pdg(START, TARGET, target_velocity=(0.0, 0.0, -1e-3))
    assert nearly.propellant == pytest.approx(plain.propellant, abs=0.01)


def test_residuals_measure_from_the_velocity_that_was_asked_for():
    plan = guidance.solve_pdg(START, TARGET, target_velocity=VELOCITY)
    assert plan.residuals.landing_velocity < 1e-3
    other = replace(plan, problem=replace(plan.problem, target_velocity=VELOCITY + np.array([0.0, 3.0, 4.0])))
    assert other.residuals.landing_velocity == pytest.approx(5.0, abs=1e-3)


def test_an_earlier_plan_guides_the_next():
    plan = guidance.solve_pdg(START, TARGET, target_velocity=VELOCITY)
    here = [*plan.position[20], *plan.velocity[20], plan.mass[20]]
    for method in ("convex", "casadi"):
        again = guidance.solve_pdg(here, TARGET, target_velocity=VELOCITY, guess=plan, method=method)
        assert again.mass[-1] == pytest.approx(plan.mass[-1], abs=0.05)
        check_arrival(again, VELOCITY)


def test_deferred_branches_arrive_with_the_velocity():
    sites = np.array([[0.0, 0.0, 50.0], [20.0, 0.0, 50.0], [-10.0, 25.0, 50.0]])
    answer = plan_deferred(problem_to(VELOCITY), sites, 1.0, 26.0)
    assert answer.shared_nodes > 1
    for plan, site in zip(answer.plans, sites, strict=True):
        np.testing.assert_allclose(plan.velocity[-1], VELOCITY, atol=1e-4)
        np.testing.assert_allclose(plan.position[-1], site, atol=1e-3)
        assert plan.residuals.landing_velocity < 0.02
    assert plan_deferred(problem_to((0.0, 0.0, 2.0)), sites, 1.0, 26.0).unreachable == (0, 1, 2)


def test_sites_within_reach_are_reached_with_the_velocity():
    reach = reachable_set(problem_to(VELOCITY))
    vertex = reach.slices[-1].vertices[0]
    inward = 0.99 * vertex + 0.01 * reach.slices[-1].vertices.mean(axis=0)
    assert reach.contains(inward)
    plan = guidance.solve_pdg(START, [*inward, 50.0], target_velocity=VELOCITY, throw=False)
    assert plan.status is PlanStatus.OPTIMAL
    assert not reachable_set(problem_to((0.0, 0.0, 2.0)), times=[30.0]).slices


def test_a_plan_with_a_velocity_is_sampled_and_shifted_as_others_are():
    plan = guidance.solve_pdg(START, TARGET, target_velocity=VELOCITY)
    times = np.linspace(0.0, plan.time_of_flight, 40)
    reference = make_reference(*plan.states_at(times), times[1], GRAVITY)
    moved = shift_landing_point(reference, TARGET + np.array([6.0, -2.0, 0.0]), GRAVITY)
    for path, site in ((reference, TARGET), (moved, TARGET + np.array([6.0, -2.0, 0.0]))):
        np.testing.assert_allclose(path.position[-1], site, atol=1e-3)
        np.testing.assert_allclose(path.velocity[-1], VELOCITY, atol=1e-3)
