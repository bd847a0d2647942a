"""Tanks that pay for no landing: anywhere in the target's plane, or but for next to nothing at the target."""

from dataclasses import replace

import numpy as np
import pytest
from descents import GRAVITY, TARGET, harsh_start

from guidance import PAPER_LANDER, PlanStatus, State, solve_pdg
from guidance.convex.farkas import FarkasProof
from guidance.descent.certificate import Certificate
from guidance.descent.dual_bound import DualBound
from guidance.descent.outer_bound import OuterBound
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import find_extremal_flight
from guidance.flight_time.time_window import guess_time, time_window
from guidance.lower_bound import bound_outside, prove_no_landing
from guidance.planning.convex_task import ConvexTask
from guidance.planning.infeasibility import prove_free_time
from guidance.planning.minimum_propellant import minimise_over_time

GRAM = 1e-3


def problem_from(start, dry_mass=PAPER_LANDER.dry_mass):
    lander = replace(PAPER_LANDER, dry_mass=dry_mass)
    return LandingProblem(State.parse(start), TARGET, lander, GRAVITY)


def harsh_problems(seed, count):
    """Harsh problems with little in the tank to which closed forms admit a landing, and a likely time."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        problem = problem_from([*harsh_start(rng)[:6], rng.uniform(1155.0, 1175.0)])
        window = time_window(problem, free_landing_point=True)
        if not window.empty:
            yield problem, guess_time(problem, window)


def needed_anywhere(problem):
    """[kg] that the cheapest landing anywhere burns, by the cones on a mesh; inf where they find none."""
    found = minimise_over_time(ConvexTask(problem, 61, free_landing_point=True)).solution
    return np.inf if found is None else -problem.state.mass * np.expm1(-found.log_mass_ratio)


def test_the_cones_agree_where_a_tank_pays_for_no_landing_anywhere():
    refused = granted = 0
    for problem, time in harsh_problems(11, 130):
        tank, needed = problem.state.mass - problem.lander.dry_mass, needed_anywhere(problem)
        certificate = prove_no_landing(problem, time)
        if needed < 0.999 * tank:
            granted += 1
            assert certificate is None
        elif certificate is not None:
            refused += 1
            assert needed > tank
            assert certificate.verified
    assert granted >= 5
    assert refused >= 5


def test_the_proof_holds_for_every_target_in_the_plane():
    rng, checked = np.random.default_rng(12), 0
    for problem, time in harsh_problems(13, 150):
        certificate = prove_no_landing(problem, time)
        if certificate is None:
            continue
        (bound,) = certificate.proofs
        assert isinstance(bound, DualBound)
        assert bound.anywhere
        aside = replace(problem, target=TARGET + np.append(rng.normal(0.0, 300.0, 2), 0.0))
        assert replace(bound, problem=aside).verified
        lower = replace(problem, state=replace(problem.state, velocity=0.5 * problem.state.velocity))
        assert not replace(bound, problem=lower).verified
        checked += 1
    assert checked >= 3


def tanks_on_the_edge(seed, count):
    """Problems whose tank lacks half a gram to a few of what the best flight burns."""
    rng = np.random.default_rng(seed)
    while count:
        start = harsh_start(rng)
        flight = find_extremal_flight(problem_from(start, 1000.0))
        if flight is None or flight.broken:
            continue
        count -= 1
        burnt = float(flight.burnt_at(np.array([flight.time]))[0]) * start[6]
        yield start, start[6] - burnt, rng.uniform(0.5, 4.0) * GRAM


def test_a_tank_that_lacks_a_gram_is_refused_and_one_that_has_it_is_not():
    by_cones = 0
    for start, dry_mass, gap in tanks_on_the_edge(17, 25):
        plan = solve_pdg(start, TARGET, lander=replace(PAPER_LANDER, dry_mass=dry_mass - gap))
        assert plan.status is PlanStatus.OPTIMAL
        lacking = replace(PAPER_LANDER, dry_mass=dry_mass + gap)
        refused = solve_pdg(start, TARGET, lander=lacking, throw=False)
        assert refused.status is PlanStatus.INFEASIBLE
        assert refused.certificate is not None
        assert refused.certificate.verified
        (proof,) = refused.certificate.proofs
        assert refused.method == ("convex" if isinstance(proof, OuterBound) else "dual bound")
        by_cones += isinstance(proof, OuterBound)
    assert by_cones >= 3


def test_cones_are_asked_only_at_times_that_the_bound_leaves_open():
    found = 0
    for start, dry_mass, _ in tanks_on_the_edge(18, 15):
        problem = problem_from(start, dry_mass + GRAM)
        outer = bound_outside(problem, guess_time(problem, time_window(problem)))
        if not isinstance(outer, OuterBound):
            continue
        found += 1
        assert outer.verified
        assert outer.forbids_outside
        assert not outer.supports(np.inf)  # of the span it says nothing
        assert not Certificate("", (), (outer,)).verified
        assert outer.after.shortest < 1.3 * outer.before.longest
        assert not outer.supports(1.0)
        assert not OuterBound(outer.after, outer.before).forbids_outside
        dearer = replace(outer.before, bound=1.01 * outer.before.bound)
        assert not replace(outer, before=dearer).verified
        richer = replace(problem, lander=replace(problem.lander, dry_mass=dry_mass - 1.0))
        assert not replace(outer, before=replace(outer.before, problem=richer)).forbids_outside
    assert found >= 5


def test_cones_prove_both_ends_of_the_open_span_and_the_extremals_time():
    found = 0
    for start, dry_mass, _ in tanks_on_the_edge(18, 4):
        problem = problem_from(start, dry_mass + GRAM)
        flight = find_extremal_flight(problem)
        assert flight is not None
        certificate = prove_free_time(ConvexTask(problem, 61), flight.time)
        assert isinstance(certificate, Certificate)
        (outer,) = certificate.proofs
        if not isinstance(outer, OuterBound):
            continue
        found += 1
        assert certificate.verified
        times = [proof.time for proof in outer.between]
        low, high = outer.before.longest, outer.after.shortest
        assert times[0] == low
        assert times[-1] == high
        assert len(times) >= 4
        assert flight.time in times or not low < flight.time < high
        assert all(isinstance(proof, FarkasProof) for proof in outer.between)
        for part in (outer.between[1:], outer.between[:-1], outer.between[::-1], ()):
            assert not replace(certificate, proofs=(replace(outer, between=part),)).verified
    assert found >= 3


@pytest.mark.parametrize("time", [0.01, 0.1])
def test_without_gravity_nothing_is_claimed_beyond_the_last_time_of_the_grid(time):
    """From rest the longest flights burn next to nothing, though each time of the grid may be too short."""
    lander = replace(PAPER_LANDER, dry_mass=1199.9, min_thrust=0.0)
    start = State.parse([0.0, 0.0, 500.0, 0.0, 0.0, 0.0, 1200.0])
    problem = LandingProblem(start, np.zeros(3), lander, np.zeros(3))
    assert bound_outside(problem, time) is None


@pytest.mark.parametrize("seed", [3, 4])
def test_no_landing_anywhere_is_said_and_proved(seed):
    said = 0
    for problem, _ in harsh_problems(seed, 100):
        plan = solve_pdg(problem.state, TARGET, unreachable="nearest", throw=False)
        if plan.status is not PlanStatus.INFEASIBLE:
            continue
        said += 1
        assert plan.certificate is not None
        assert plan.certificate.verified
        assert "anywhere" in plan.message
    assert said >= 2
