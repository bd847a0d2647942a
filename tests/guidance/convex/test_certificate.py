"""Farkas proofs: they hold where they should, and a spoilt one is refused."""

from dataclasses import replace

import numpy as np
import pytest
from descents import FEASIBLE, GRAVITY, TARGET, arguments, problem_of

import guidance
from guidance import PAPER_LANDER, InfeasibleError, Lander, PlanStatus, State
from guidance.convex.farkas import FarkasProof
from guidance.descent.certificate import Certificate
from guidance.descent.problem import LandingProblem
from guidance.planning.convex_task import ConvexTask
from guidance.planning.infeasibility import prove_at, prove_by_dual_bound, prove_fixed_time, prove_free_time

START = [180.0, 120.0, 940.0, -7.0, -4.0, -28.0, 1200.0]


def task(start=START, target=TARGET, **changes):
    problem = LandingProblem(State.parse(start), np.asarray(target, float), PAPER_LANDER, GRAVITY)
    return ConvexTask(replace(problem, **changes), 31)


def test_too_short_a_flight_is_disproved_by_thrust():
    proof = prove_at(task(), 12.0)
    assert isinstance(proof, FarkasProof)
    assert proof.verified
    assert proof.margin > 0.9
    assert "maximum thrust" in proof.causes


def test_too_dear_a_flight_is_disproved_by_propellant():
    proof = prove_at(task(), 80.0)
    assert isinstance(proof, FarkasProof)
    assert proof.verified
    assert "propellant" in proof.causes


def test_a_feasible_time_is_not_disproved():
    assert not isinstance(prove_at(task(), 27.0), FarkasProof)
    assert prove_fixed_time(task(), 27.0) is None
    refuted = prove_free_time(task())
    assert not isinstance(refuted, Certificate)
    assert refuted is not None
    assert refuted.solved


@pytest.mark.parametrize("case", FEASIBLE, ids=lambda case: case["name"])
def test_nothing_disproves_the_reference_optima(case):
    free = ConvexTask(problem_of(case), 61)
    assert not isinstance(prove_at(free, 1.005 * case["optimal_time_of_flight"]), FarkasProof)


@pytest.mark.parametrize("seed", range(20))
def test_a_spoilt_proof_is_refused(seed):
    """Any change of the multipliers that leaves A'y far from zero must be noticed."""
    proof = prove_at(task(), 12.0)
    assert isinstance(proof, FarkasProof)
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=proof.multipliers.size) * np.abs(proof.multipliers).max()
    assert not replace(proof, multipliers=proof.multipliers + 0.1 * noise).verified
    assert not replace(proof, multipliers=-proof.multipliers).verified
    assert not replace(proof, multipliers=0.0 * proof.multipliers).verified
    assert not replace(proof, multipliers=np.nan * proof.multipliers).verified


def test_the_solution_of_a_feasible_problem_proves_nothing():
    solution = task().solve(27.0)
    proof = FarkasProof(27.0, solution.rows, solution.answer.dual, solution.scaled.unknown_bound)
    assert not proof.verified


def test_proofs_survive_scaling_but_not_a_wider_bound():
    proof = prove_at(task(), 12.0)
    assert isinstance(proof, FarkasProof)
    assert replace(proof, multipliers=1e-6 * proof.multipliers).verified
    assert not replace(proof, unknown_bound=1e15).verified


def test_free_time_names_its_scope():
    far = task(target=np.array([4000.0, 0.0, 50.0]))
    lander = Lander(max_thrust=3077.663, specific_impulse=388.5878, min_thrust=307.766, pointing_limit=2.2)
    start = [-34.3, 36.7, 205.5, -3.1, 5.6, -16.4, 1233.466]
    steep = task(start, np.zeros(3), lander=lander, limits=guidance.Limits(glide_slope=0.35))
    for certificate, cause, words in (
        (prove_by_dual_bound(far.problem), "propellant", "dual bound"),
        (prove_free_time(far), "propellant", "dual bound"),
        (prove_free_time(steep), "glide slope", "Farkas"),
    ):
        assert isinstance(certificate, Certificate)
        assert certificate.verified
        assert cause in certificate.causes
        assert words in certificate.scope


def test_error_carries_the_certificate_and_says_the_cause():
    with pytest.raises(InfeasibleError, match="propellant") as caught:
        guidance.solve_pdg(START, [1900.0, 0.0, 50.0])
    plan = caught.value.plan
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert plan.certificate.proofs
    assert "every time of flight" in plan.certificate.scope


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"glide_slope_limit": 0.1}, "glide slope"),
        ({"speed_limit": 20.0}, "speed"),
        ({"lander": guidance.Lander(pointing_limit=0.02)}, "pointing"),
    ],
)
def test_limits_that_forbid_a_flight_are_named(change, cause):
    plan = guidance.solve_pdg(START, TARGET, throw=False, **change)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert plan.certificate.verified
    assert cause in plan.certificate.causes


def test_fixed_time_infeasibility():
    plan = guidance.solve_pdg(START, TARGET, time_of_flight=10.0, throw=False)
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.certificate is not None
    assert "10 s" in plan.certificate.scope
    case = arguments(FEASIBLE[1])
    assert guidance.solve_pdg(**case, time_of_flight=30.0).time_of_flight == 30.0
