"""Flights along the ground: from two impulses as a first guess; and those that touch it on their way."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, PlanStatus, State
from guidance.descent.dual_bound import DualBound
from guidance.descent.plan import Plan
from guidance.descent.problem import LandingProblem
from guidance.dynamics import integrate
from guidance.flight_time.extremal import no_touch, touches
from guidance.flight_time.path_limits import PROPELLANT
from guidance.flight_time.primer_trajectory import PrimerTrajectory
from guidance.flight_time.primer_vector import PrimerFlight, find_extremal_flight, find_primer_flight

ALONG_THE_GROUND = [-187.0, 1.8, 61.6, 20.0, -26.9, -2.1, 1191.0]
"""Low, far and fast; no suicide burn is near its flight, which hops over without touching."""
TOUCHING = [
    [-164.2, -138.1, 179.3, -2.2, -29.1, -46.7, 1199.0],  # flies away from the target, sinking
    [-11.3, 0.4, 202.6, 17.4, 25.7, -48.7, 1194.5],
    [9.4, -38.2, 103.7, 8.9, 27.0, -29.2, 1186.2],
]


def problem_from(start) -> LandingProblem:
    return LandingProblem(State.parse(start), TARGET, PAPER_LANDER, GRAVITY)


def flight_from(start) -> PrimerFlight:
    flight = find_primer_flight(problem_from(start))
    assert flight is not None
    return flight


def flight_of(plan: Plan) -> PrimerFlight:
    assert isinstance(plan.trajectory, PrimerTrajectory)
    return plan.trajectory.flight


def fly_past(problem: LandingProblem, flight: PrimerFlight) -> tuple[np.ndarray, np.ndarray]:
    """Times and states by DOP853, restarted at the touch and at both switches; the flight's own thrust."""
    state, times, states = problem.state, [], []
    marks = (0.0, float(flight.extremal.touch[0]), flight.first_burn, flight.braking, flight.time)
    for arc, (begin, end) in enumerate(itertools.pairwise(marks)):
        force = 0.0 if arc == 2 else problem.lander.max_thrust
        span = np.linspace(begin, end, 81)

        def thrust_at(time, force=force):
            return force * flight.direction_at(time)

        path = integrate(state, thrust_at, span, problem.lander, problem.gravity)
        state = State(path[-1, :3], path[-1, 3:6], float(path[-1, 6]))
        times.append(span)
        states.append(path)
    return np.concatenate(times), np.concatenate(states)


@pytest.mark.parametrize("start", TOUCHING)
def test_it_touches_the_ground_once_at_no_vertical_speed_under_another_integrator(start):
    problem, flight = problem_from(start), flight_from(start)
    x = flight.extremal
    assert touches(x)
    assert 0.0 < x.touch[0] < flight.first_burn
    times, states = fly_past(problem, flight)
    height = states[:, 2] - TARGET[2]
    assert np.linalg.norm(states[-1, :3] - TARGET) < 1e-5
    assert np.linalg.norm(states[-1, 3:6]) < 1e-5
    at = int(np.argmin(np.abs(times - x.touch[0])))
    assert height[at] == pytest.approx(0.0, abs=1e-5)
    assert states[at, 5] == pytest.approx(0.0, abs=1e-5)
    away = (np.abs(times - x.touch[0]) > 0.2) & (times < flight.time - 0.1)
    assert height.min() > -1e-5
    assert height[away].min() > 0.02


@pytest.mark.parametrize("start", TOUCHING)
def test_its_primer_bends_upward_at_the_touch_and_the_hamiltonian_vanishes_after_it(start):
    """Without the touch's two conditions met the kink would be zero or the other way round."""
    problem, flight = problem_from(start), flight_from(start)
    x = flight.extremal
    assert x.touch[1] > 0.0
    before, touch, after = (flight.direction_at(float(x.touch[0]) + step) for step in (-1e-7, 0.0, 1e-7))
    np.testing.assert_allclose(before, touch, atol=1e-5)  # the thrust turns, it does not jump
    np.testing.assert_allclose(after, touch, atol=1e-5)
    slope = (x.primer[1] - x.primer[0]) / (x.times[1] - x.times[0])
    times, states = fly_past(problem, flight)
    coast = int(np.argmin(np.abs(times - 0.5 * (flight.first_burn + flight.braking))))
    primer = x.primer[0] + slope * (times[coast] - x.times[0])
    terms = float(primer @ problem.gravity), float(slope @ states[coast, 3:6])
    assert terms[0] == pytest.approx(terms[1], abs=1e-5)
    assert np.linalg.norm(primer) < 1.0


def test_the_cones_find_the_same_flight_on_a_fine_mesh():
    """On 61 nodes they dip between nodes, which saves up to a tenth of a kilogram; on 201 next to nothing."""
    rng, compared = np.random.default_rng(77), 0
    for _ in range(1500):
        plan = guidance.solve_pdg(harsh_start(rng), TARGET, throw=False)
        if plan.method != "indirect" or not touches(flight_of(plan).extremal):
            continue
        convex = guidance.solve_pdg(plan.problem.state, TARGET, method="convex", throw=False, nodes=201)
        if convex.status is PlanStatus.OPTIMAL:
            compared += 1
            assert plan.propellant == pytest.approx(convex.propellant, abs=0.02)
    assert compared >= 15


def test_its_gap_is_proved_by_a_kinked_primer():
    plan = guidance.solve_pdg(TOUCHING[1], TARGET)
    assert plan.method == "indirect"
    assert 0.0 <= plan.optimality_gap < 0.1
    assert plan.certificate is not None
    (bound,) = plan.certificate.proofs
    assert isinstance(bound, DualBound)
    assert any(piece.path_multiplier[2] > 0.0 for piece in bound.pieces)
    assert bound.verified


def test_a_touch_is_one_node_and_the_nodes_are_as_many_as_asked_for():
    for nodes in (5, 8, 61):
        plan = guidance.solve_pdg(TOUCHING[1], TARGET, nodes=nodes)
        flight = flight_of(plan)
        assert plan.nodes == max(nodes, 7)
        assert np.all(np.diff(plan.time) > 0.0)
        assert np.count_nonzero(plan.time == flight.extremal.touch[0]) == 1
        touch = int(np.flatnonzero(plan.time == flight.extremal.touch[0])[0])
        assert plan.position[touch, 2] == pytest.approx(TARGET[2], abs=1e-6)
        np.testing.assert_allclose(plan.thrust_at(plan.time), plan.thrust, atol=1e-6)


def test_two_impulses_lead_to_the_flight_that_no_suicide_burn_is_near():
    plan = guidance.solve_pdg(ALONG_THE_GROUND, TARGET)
    convex = guidance.solve_pdg(ALONG_THE_GROUND, TARGET, method="convex", nodes=121)
    assert plan.method == "indirect"
    assert not touches(flight_of(plan).extremal)
    assert plan.propellant == pytest.approx(convex.propellant, abs=0.02)
    assert plan.optimality_gap < 0.05


def test_a_flight_that_overdraws_the_tank_says_so_and_leads_the_proof():
    start = [-242.4, 158.0, 148.2, 27.6, 16.4, -21.3, 1171.2]
    problem = problem_from(start)
    flight = find_extremal_flight(problem)
    assert flight is not None
    assert flight.broken == PROPELLANT
    assert find_primer_flight(problem) is None
    richer = replace(problem, lander=replace(PAPER_LANDER, dry_mass=1100.0))
    assert find_primer_flight(richer) is not None
    plan = guidance.solve_pdg(start, TARGET, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.method == "dual bound"


def test_there_is_no_touch_unless_it_is_found():
    assert no_touch()[0] == -math.inf
    assert not touches(flight_from(ALONG_THE_GROUND).extremal)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6))
@example(seed=107743)  # its primer turns by a right angle within milliseconds
@example(seed=12189)
def test_any_harsh_flight_of_the_indirect_method_is_flown_within_its_limits(seed):
    plan = guidance.solve_pdg(harsh_start(np.random.default_rng(seed)), TARGET, throw=False)
    assume(plan.method == "indirect" and plan.status is PlanStatus.OPTIMAL)
    assert plan.residuals.position < 5e-3
    assert plan.residuals.altitude < 5e-3
    assert plan.residuals.landing_velocity < 1e-3


@pytest.mark.parametrize("start", TOUCHING)
@pytest.mark.parametrize("share", [0.97, 1.04, 1.15])
def test_a_touch_is_known_at_a_given_time_of_flight_too(start, share):
    best = guidance.solve_pdg(start, TARGET)
    time = share * best.time_of_flight
    plan = guidance.solve_pdg(start, TARGET, time_of_flight=time)
    convex = guidance.solve_pdg(start, TARGET, time_of_flight=time, method="convex", nodes=201)
    assert plan.method == "indirect"
    assert plan.time_of_flight == time
    assert touches(flight_of(plan).extremal)
    assert plan.keeps_limits
    assert plan.residuals.altitude < 5e-3
    assert best.propellant < plan.propellant == pytest.approx(convex.propellant, abs=0.05)
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert plan.certificate.lower_bound <= plan.propellant


def test_a_touch_at_a_given_time_has_a_slope_of_the_cost_that_vanishes_at_the_best_time():
    """Propellant over the time of flight is least where the free search ends, and smooth there."""
    best = guidance.solve_pdg(TOUCHING[1], TARGET)
    steps = np.array([-0.02, -0.01, 0.0, 0.01, 0.02])
    burnt = [
        guidance.solve_pdg(TOUCHING[1], TARGET, time_of_flight=(1.0 + step) * best.time_of_flight).propellant
        for step in steps
    ]
    slope, bend = np.polyfit(steps, burnt, 2)[1::-1]
    assert bend > 0.0
    assert abs(slope) < 0.05 * bend * 0.02
