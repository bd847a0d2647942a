"""Bounds over all times of flight: never above a flight, tight, and checked by code of their own."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
import pytest
from admissible_flights import random_flight
from descents import GRAVITY, TARGET, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import guidance
from guidance import PAPER_LANDER, Lander, PlanStatus, State
from guidance.descent.dual_bound import DualBound, DualPiece
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_primer_flight
from guidance.lower_bound import prove_least_propellant, prove_no_flight

GAP = 5e-3  # [kg] on the paper's descents
REFERENCE_GRANTS = 2e-3  # [kg] what casadi's flight may save by its tolerances


def paper_problem(rng):
    return LandingProblem(State.parse(paper_start(rng)), TARGET, PAPER_LANDER, GRAVITY)


def least_propellant(problem):
    """[kg] of the indirect method's flight, and the flight."""
    flight = find_primer_flight(problem)
    assert flight is not None
    return problem.state.mass * -math.expm1(-flight.log_mass_ratio), flight


def test_the_gap_is_a_few_grams_on_every_paper_start():
    rng = np.random.default_rng(17)
    for k in range(500):
        problem = paper_problem(rng)
        propellant, flight = least_propellant(problem)
        proof = prove_least_propellant(problem, propellant, flight.time, flight)
        assert 0.0 <= propellant - proof.lower_bound < GAP
        assert k % 25 or proof.verified


def test_the_bound_needs_neither_the_best_flight_nor_the_indirect_method():
    rng = np.random.default_rng(18)
    for _ in range(20):
        problem = paper_problem(rng)
        propellant, flight = least_propellant(problem)
        proof = prove_least_propellant(problem, propellant + 0.5, flight.time * rng.uniform(0.8, 1.3))
        assert propellant - 2 * GAP < proof.lower_bound <= propellant
        assert proof.verified


def vertical_descent(height, sink, lander, mass, pull):
    """Propellant [kg] and time [s] of the best vertical descent: free fall, then full thrust."""
    c, flow = lander.exhaust_velocity, lander.max_mass_flow

    def braking_time(speed):
        """[s] of full thrust that stop the vehicle."""

        def excess(time):
            return -c * math.log1p(-flow * time / mass) - pull * time - speed

        return cast("float", brentq(excess, 0.0, 0.999 * mass / flow, xtol=1e-13))

    def left_over(speed):
        """[m] height left where the brakes, begun at this speed, have stopped the vehicle."""
        time = braking_time(speed)
        rest = 1.0 - flow * time / mass
        braking = speed * time - c * (time + mass / flow * rest * math.log(rest)) + 0.5 * pull * time**2
        return height - (speed**2 - sink**2) / (2.0 * pull) - braking

    speed = cast("float", brentq(left_over, sink, math.sqrt(sink**2 + 2.0 * pull * height), xtol=1e-13))
    return flow * braking_time(speed), (speed - sink) / pull + braking_time(speed)


@settings(max_examples=40, deadline=None)
@given(st.floats(100.0, 2000.0), st.floats(1.0, 60.0), st.floats(2.0, 7.0), st.floats(1.5, 10.0))
def test_vertical_descents_are_bounded_to_their_closed_form(height, sink, thrust_to_weight, pull):
    mass = 1200.0
    lander = Lander(600.0, mass * pull * thrust_to_weight, 325.0)
    lift = pull * (thrust_to_weight - 1.0)
    if sink**2 > 1.8 * lift * height:
        sink = math.sqrt(1.8 * lift * height)
    start = State(np.array([0.0, 0.0, height]), np.array([0.0, 0.0, -sink]), mass)
    problem = LandingProblem(start, np.zeros(3), lander, np.array([0.0, 0.0, -pull]))
    best, time = vertical_descent(height, sink, lander, mass, pull)
    for share, guess, gap in ((1.0, time, 1e-3), (1.01, 1.2 * time, 1e-2)):
        proof = prove_least_propellant(problem, best * share, guess)
        assert best * (1.0 - gap) < proof.lower_bound <= best * (1.0 + 1e-7)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_admissible_flight_burns_less_or_is_proved_impossible(seed):
    flight = random_flight(np.random.default_rng(seed))
    problem = flight.problem
    burnt = problem.state.mass * -math.expm1(-flight.spent / problem.lander.exhaust_velocity)
    if burnt < 1e-6 * problem.state.mass:
        return
    proof = prove_least_propellant(problem, burnt, flight.time)
    assert proof.lower_bound <= burnt
    spare = replace(problem.lander, dry_mass=(problem.state.mass - burnt) * (1.0 - 1e-6))
    assert prove_no_flight(replace(problem, lander=spare), flight.time) is None


def test_the_tank_is_too_small_just_below_the_bound_and_never_above_a_flight():
    rng = np.random.default_rng(19)
    for _ in range(50):
        problem = paper_problem(rng)
        propellant, flight = least_propellant(problem)
        bound = prove_least_propellant(problem, propellant, flight.time, flight).lower_bound
        for content, proved in ((bound - 2 * GAP, True), (propellant + 1e-6, False)):
            dry = replace(PAPER_LANDER, dry_mass=problem.state.mass - content)
            proof = prove_no_flight(replace(problem, lander=dry), flight.time)
            assert (proof is not None) == proved
        assert proof is None


def test_a_proof_is_verified_and_a_spoilt_one_is_not():
    problem = paper_problem(np.random.default_rng(20))
    propellant, flight = least_propellant(problem)
    proof = prove_least_propellant(problem, propellant, flight.time, flight).proofs[0]
    assert isinstance(proof, DualBound)
    assert proof.verified
    first, second, *rest = proof.pieces
    spoilt = {
        "claims more": replace(proof, bound=proof.bound + 0.01),
        "more than it speaks of": replace(proof, spent_at_most=proof.bound - 0.01),
        "a hole": replace(proof, pieces=(replace(first, end=first.end - 0.1), second, *rest)),
        "no first time": replace(proof, pieces=(second, *rest)),
        "one primer for all": replace(proof, pieces=(replace(first, end=second.end), *rest)),
        "turned primer": replace(proof, pieces=(replace(first, primer=-first.primer), second, *rest)),
        "for ever": replace(proof, pieces=(replace(first, end=math.inf),)),
        "nothing": replace(proof, pieces=()),
        "a time before the start": replace(
            proof, shortest=-1.0, pieces=(replace(first, begin=-1.0), second, *rest)
        ),
        "no number": replace(proof, pieces=(replace(first, primer=first.primer * math.nan), second, *rest)),
        "no number of a time": replace(proof, pieces=(replace(first, end=math.nan), second, *rest)),
        "speaks of nothing": replace(proof, spent_at_most=0.0, bound=0.0),
        "speaks of everything": replace(proof, spent_at_most=1e9),
    }
    for words, other in spoilt.items():
        assert not other.verified, words


def test_a_long_horizon_hides_no_braking_burn():
    """Twelve equal pieces and a far last time: integrated in few steps, the burn would be missed."""
    problem = LandingProblem(State.parse([200, 100, 950, -8, -4, -30, 1200]), TARGET, PAPER_LANDER, GRAVITY)
    time, claim = 23.5336, 85.0
    primer = np.array([0.32059, 0.13901, 1.24420, *(np.array([-0.98937, -0.40955, -0.55850]) / time)])
    marks = np.linspace(time, (claim - 30.0) / 1.62, 13)
    pieces = [DualPiece(a, b, primer) for a, b in pairwise(marks)]
    pieces.append(DualPiece(float(marks[-1]), 1e6, np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])))
    assert not DualBound(problem, 90.0, 70.7, tuple(pieces), time, 1e6).verified


def test_a_certificate_claims_no_more_than_its_proofs():
    plan = guidance.solve_pdg(paper_start(np.random.default_rng(26)), TARGET)
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert not replace(plan.certificate, lower_bound=plan.certificate.lower_bound + 1e-3).verified
    assert not replace(plan.certificate, lower_bound=math.inf).verified


WEAK_GRAVITY = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]


@pytest.mark.parametrize("gravity", [0.0, 1e-12, 1e-4, 1e-2])
def test_with_next_to_no_gravity_the_change_of_velocity_is_the_bound(gravity):
    """The slower the flight, the nearer to |v_0|: no time of flight is best."""
    plan = guidance.solve_pdg(WEAK_GRAVITY, TARGET, gravity=(0, 0, -gravity))
    assert plan.certificate is not None
    assert plan.certificate.verified
    least = 1200.0 * -math.expm1(-np.linalg.norm(WEAK_GRAVITY[3:6]) / PAPER_LANDER.exhaust_velocity)
    assert 0.999 * least < plan.certificate.lower_bound
    assert plan.optimality_gap < 0.15 * plan.propellant


@pytest.mark.parametrize("sideways", [0.0, 4.4])
def test_starts_that_move_up_are_bounded_as_well(sideways):
    """Found by an adversary: cells next to a time of zero were left without a primer."""
    start = [187.67863519952533, 51.14470468223607, 113.5501359130744, 4.354, sideways, 56.443, 1200.0]
    plan = guidance.solve_pdg(start, [0, 0, 0], lander=Lander(dry_mass=545.99), gravity=(0, 0, -1.62))
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert plan.optimality_gap < 0.01 * plan.propellant


def test_a_burn_that_outlasts_the_tank_of_any_vehicle_raises_nothing():
    lander = Lander(dry_mass=600, specific_impulse=60)
    plan = guidance.solve_pdg([0, 0, 1e5, 0, 0, -1, 1200], [0, 0, 0], gravity=(0, 0, 0), lander=lander)
    assert plan.certificate is not None
    assert 0.0 <= plan.certificate.lower_bound <= plan.propellant


def test_every_plan_that_is_called_optimal_carries_its_proof():
    rng = np.random.default_rng(21)
    for method in ("convex", "casadi", "cvxpy"):
        plan = guidance.solve_pdg(paper_start(rng), TARGET, method=method)
        assert plan.certificate is not None
        assert plan.certificate.verified
        assert -1e-3 < plan.optimality_gap < 0.05
        assert "every time of flight" in plan.certificate.scope
        assert plan.optimality_gap == plan.propellant - plan.certificate.lower_bound


def test_a_plan_of_a_given_duration_is_bounded_for_that_duration():
    start = paper_start(np.random.default_rng(25))
    best = guidance.solve_pdg(start, TARGET)
    for share in (0.9, 1.3):
        plan = guidance.solve_pdg(start, TARGET, time_of_flight=share * best.time_of_flight)
        assert plan.certificate is not None
        assert plan.certificate.verified
        assert "time of flight" in plan.certificate.scope
        assert -1e-3 < plan.optimality_gap < 0.2
        assert plan.certificate.lower_bound > best.propellant + 0.2


def test_more_nodes_close_the_gap():
    start = paper_start(np.random.default_rng(22))
    gaps = [guidance.solve_pdg(start, TARGET, nodes=nodes).optimality_gap for nodes in (21, 61, 241)]
    assert gaps[0] > gaps[1] > gaps[2]
    assert gaps[2] < GAP


def test_a_plan_without_a_flight_has_no_gap():
    plan = guidance.solve_pdg([200, 100, 950, -8, -4, -30, 1160], [900, 0, 50], throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert math.isnan(plan.optimality_gap)
    assert plan.certificate is not None
    assert plan.certificate.lower_bound == math.inf
    assert plan.certificate.verified
    assert plan.solves == 0


def undercut(rng, count):
    """[kg] by how much the nonconvex reference's flight comes below the bound, for each dispersed start."""
    out = []
    while len(out) < count:
        start = [*rng.uniform(-500, 500, 2), rng.uniform(300, 1000), *rng.uniform(-30, 30, 2)]
        start += [rng.uniform(-50, 5), 1200.0]
        plan = guidance.solve_pdg(start, TARGET, method="casadi", throw=False)
        if plan.status is PlanStatus.OPTIMAL:
            out.append(-plan.optimality_gap)
    return np.array(out)


def test_the_nonconvex_reference_finds_nothing_below_the_bound():
    assert undercut(np.random.default_rng(23), 30).max() < REFERENCE_GRANTS


@pytest.mark.slow
def test_the_nonconvex_reference_finds_nothing_below_the_bound_on_thousands_of_starts():
    assert undercut(np.random.default_rng(24), 2000).max() < REFERENCE_GRANTS
