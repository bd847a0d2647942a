"""Proofs that a landing is impossible: for one time of flight, and for all that closed-form bounds admit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.farkas import FarkasProof
from guidance.convex.programme import ConvexSolution, convex_template
from guidance.convex.scaling import scale_problem
from guidance.descent.certificate import Certificate
from guidance.descent.dual_bound import DualBound
from guidance.descent.problem import LandingProblem
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.flight_time.time_window import TimeWindow, forbidden_by, guess_time, time_window
from guidance.lower_bound.proof import bound_outside, certify_bound, prove_no_flight, prove_no_landing
from guidance.planning.convex_task import ConvexTask


def prove_at(task: ConvexTask, time: float) -> FarkasProof | ConvexSolution:
    """Proof that no flight lasts `time`, or the solution that kept it from being found.

    The thrust bounds are relaxed outward. Where the relaxed problem is infeasible the solver's dual vector is
    the proof, whatever the solver calls it: it may stop for numerical reasons on a good one, and what counts
    is that our own check verifies it. Where the problem is feasible, but its cheapest flight overdraws the
    tank, the dual solution y of "propellant >= y-bound" becomes a proof by giving the tank's row the
    multiplier one.
    """
    cheapest = replace(task, least_error=False, limit_propellant=False, condense=False)
    solution = cheapest.solve(time)
    if not np.isfinite(solution.answer.dual).all():
        return solution
    problem, nodes = task.problem, task.nodes
    scaled = scale_problem(problem, time, nodes, None, task.error_limit, limit_propellant=True)
    rows = convex_template(ConstraintSet.of(problem, nodes, task.free_landing_point)).rows(scaled)
    multipliers = solution.answer.dual.copy()
    if solution.solved:
        first = 0
        for part in rows:
            if part.name == "propellant":
                multipliers[first] += 1.0
            first += part.bound.size
    proof = FarkasProof(time, rows, multipliers, scaled.unknown_bound)
    return proof if proof.verified else solution


def prove_by_window(window: TimeWindow) -> Certificate:
    """What closed-form bounds say where they admit no time of flight."""
    scope = f"every time of flight, on any mesh: closed-form bound on {window.cause}"
    return Certificate(scope, (window.cause,))


def prove_fixed_time(task: ConvexTask, time: float) -> Certificate | None:
    """Certificate for one time of flight; None if there is no verified proof."""
    window = time_window(task.problem, task.free_landing_point)
    if window.empty:
        return prove_by_window(window)
    cause = forbidden_by(task.problem, time, task.free_landing_point)
    if cause:
        return Certificate(f"time of flight {time:g} s, on any mesh: closed-form bound on {cause}", (cause,))
    proof = prove_at(task, time)
    if not isinstance(proof, FarkasProof):
        return None
    scope = (
        f"time of flight {time:g} s, {task.nodes} nodes, thrust bounds relaxed outward: verified Farkas proof"
    )
    return Certificate(scope, proof.causes, (proof,))


def prove_by_dual_bound(
    problem: LandingProblem, flight: PrimerFlight | None = None, window: TimeWindow | None = None
) -> Certificate | None:
    """Proof that the tank does not pay for any flight to the target; None where the bound shows none.

    Args:
        problem: the landing problem.
        flight: an extremal that breaks a limit, to begin with; None if none is known.
        window: times of flight that closed-form bounds admit; None to work them out.
    """
    window = window or time_window(problem)
    if window.empty:
        return None
    return prove_no_flight(problem, guess_time(problem, window) if flight is None else flight.time, flight)


def prove_no_landing_anywhere(problem: LandingProblem, window: TimeWindow) -> Certificate | None:
    """Proof that the tank pays for no landing in the target's plane; None where the bound shows none.

    Args:
        problem: the landing problem.
        window: times of flight that closed-form bounds admit for such a landing; not empty.
    """
    return None if problem.rotates else prove_no_landing(problem, guess_time(problem, window))


def prove_free_time(task: ConvexTask, likely: float | None = None) -> Certificate | ConvexSolution | None:
    """Certificate for a free time of flight: Farkas proofs at the times that no other bound forbids.

    Dual bounds forbid all times but a span; where they show none, closed-form bounds forbid all but a window.
    The proofs are made at both ends and on a grid between; between its times nothing is proved.

    Args:
        task: what was to be solved.
        likely: [s] the time of an extremal, which joins the grid where it lies in the span that dual
            bounds leave; None if none is known.

    Returns:
        The certificate; or a solution, where a time on the grid turns out to be feasible; or None, where a
        proof could not be verified.
    """
    window = time_window(task.problem, task.free_landing_point)
    if window.empty:
        return prove_by_window(window)
    if task.problem.rotates:  # no closed form bounds the time of flight
        return None
    outer = bound_outside(task.problem, guess_time(task.problem, window), task.free_landing_point)
    if isinstance(outer, DualBound):
        return certify_bound(outer)
    times, beyond = window.grid(), "closed-form bounds"
    if outer is not None:
        low, high = outer.before.longest, outer.after.shortest
        times, beyond = TimeWindow(low, high).grid(), f"dual bounds, up to {low:.4g} and from {high:.4g} s"
        if likely is not None and low < likely < high:
            times = np.union1d(times, likely)
    proofs: list[FarkasProof] = []
    for time in times:
        proof = prove_at(task, float(time))
        if isinstance(proof, FarkasProof):
            proofs.append(proof)
            continue
        if proof.solved and proof.log_mass_ratio <= task.problem.log_mass_ratio:
            return proof
        return None
    causes = tuple(dict.fromkeys(cause for proof in proofs for cause in proof.causes))
    scope = (
        f"at {len(proofs)} times of flight from {min(times):.4g} to {max(times):.4g} s, not between them, "
        f"{task.nodes} nodes, thrust bounds relaxed outward: verified Farkas proofs; "
        f"all times outside: {beyond}"
    )
    between = tuple(proofs)
    return Certificate(scope, causes, between if outer is None else (replace(outer, between=between),))
