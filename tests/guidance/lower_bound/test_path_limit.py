"""The altitude and the glide slope in the bound: never above a flight that keeps them, and checked."""

import math
from dataclasses import replace

import numpy as np
import pytest
from admissible_flights import random_flight
from descents import GRAVITY, TARGET, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

import guidance
from guidance import PAPER_LANDER, Limits, PlanStatus, State
from guidance.descent.dual_bound import DualBound
from guidance.descent.problem import LandingProblem
from guidance.lower_bound import prove_least_propellant, prove_no_flight


def bound_of(plan) -> DualBound:
    assert plan.certificate is not None
    (proof,) = plan.certificate.proofs
    assert isinstance(proof, DualBound)
    return proof


def kinked(proof: DualBound) -> list:
    return [piece for piece in proof.pieces if piece.path_multiplier.any()]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_no_flight_that_keeps_the_glide_slope_burns_less(seed):
    flight = random_flight(np.random.default_rng(seed))
    problem = flight.problem
    if flight.slope < 0.49 * math.pi:
        problem = replace(problem, limits=Limits(glide_slope=flight.slope * (1.0 + 1e-9)))
    propellant = problem.state.mass * -math.expm1(-flight.spent / problem.lander.exhaust_velocity)
    proof = prove_least_propellant(problem, propellant, flight.time)
    assert proof.lower_bound <= propellant * (1.0 + 1e-9)
    assert proof.verified
    alone = prove_least_propellant(problem, propellant, flight.time, this_time_alone=True)
    assert alone.lower_bound <= propellant * (1.0 + 1e-9)
    assert alone.verified
    assert prove_no_flight(problem, flight.time) is None


def test_a_glide_slope_that_binds_is_in_the_bound():
    """Just wider than the start's own angle: the bound beats what it is without the limit, mostly."""
    rng, gains = np.random.default_rng(3), []
    for _ in range(12):
        start = paper_start(rng)
        angle = math.atan2(math.hypot(*start[:2]), start[2] - TARGET[2])
        plan = guidance.solve_pdg(start, TARGET, glide_slope_limit=1.06 * angle, nodes=121)
        proof, free = bound_of(plan), guidance.solve_pdg(start, TARGET)
        assert proof.verified
        assert plan.optimality_gap > 0.0
        if kinked(proof):
            gains.append(proof.propellant - bound_of(free).propellant)
    assert len(gains) >= 6
    assert np.median(gains) > 5e-4
    assert max(gains) > 2e-3


def test_the_gap_of_a_flight_that_skims_the_ground_closes():
    """Low and fast sideways: the altitude binds, and the bound knows it."""
    gaps, used = [], 0
    for side in (18.0, 22.0, 26.0):
        plan = guidance.solve_pdg([-60.0, 20.0, 95.0, side, 0.0, -24.0, 1200.0], TARGET, nodes=121)
        proof = bound_of(plan)
        assert proof.verified
        used += bool(kinked(proof))
        gaps.append(plan.optimality_gap)
    assert used
    assert 0.0 < max(gaps) < 0.05


def test_a_spoilt_multiplier_is_refused():
    rng = np.random.default_rng(3)
    while True:
        start = paper_start(rng)
        angle = math.atan2(math.hypot(*start[:2]), start[2] - TARGET[2])
        plan = guidance.solve_pdg(start, TARGET, glide_slope_limit=1.06 * angle, throw=False)
        if plan.status is PlanStatus.OPTIMAL and kinked(bound_of(plan)):
            break
    proof = bound_of(plan)
    assert proof.verified

    def spoilt(**changes) -> DualBound:
        pieces = tuple(
            replace(piece, **changes) if piece.path_multiplier.any() else piece for piece in proof.pieces
        )
        return replace(proof, pieces=pieces)

    for multiplier in ([0.0, 0.0, -0.1], [1.0, 0.0, 0.1], [np.nan, 0.0, 1.0], [0.0, 0.0, np.inf]):
        assert not spoilt(path_multiplier=np.array(multiplier)).verified
    assert not spoilt(path_time=-1.0).verified
    assert not spoilt(path_multiplier=3.0 * kinked(proof)[0].path_multiplier).verified
    level = replace(proof.problem, limits=Limits())
    assert not replace(proof, problem=level).verified  # a sideways multiplier needs the glide slope


@pytest.mark.parametrize("seed", range(4))
def test_a_multiplier_at_a_time_beyond_the_flight_changes_nothing(seed):
    problem = LandingProblem(
        State.parse(paper_start(np.random.default_rng(seed))), TARGET, PAPER_LANDER, GRAVITY
    )
    plan = guidance.solve_pdg(problem.state, TARGET)
    proof = bound_of(plan)
    last = proof.pieces[-1]
    finite = tuple(
        replace(piece, path_multiplier=np.array([0.0, 0.0, 0.5]), path_time=last.begin + 1.0)
        for piece in proof.pieces[:-1]
    )
    assert replace(proof, pieces=(*finite, last)).verified
