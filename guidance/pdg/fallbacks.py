"""Who is asked next where a planner has no answer: the one place where planners meet.

1. The method that was chosen. That is, for 'auto': the indirect method; where it has no flight that keeps the
   limits, closed forms and the dual bound, which may show that there is none; then the convex problem. With
   a time of flight, a landing error's price or a turning site, the convex problem comes at once after it.
2. Where relaxing lost min_thrust or the pointing limit, the unrelaxed problem from several guesses.
3. Where the unrelaxed problem's local method finds nothing, the convex problem for a guess.
4. Where the flown plan misses its limits, the same on a finer mesh.
5. Without a flight: the reachable point nearest to the target, if asked for, by the indirect method where
   'auto' was chosen and the time of flight is free, else by the convex problem; then, if the first step has
   brought none, a proof that there is no flight; where that search meets a feasible time instead, the convex
   problem from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from guidance.descent.certificate import Certificate
from guidance.descent.dual_bound import DualBound
from guidance.descent.plan import Plan, PlanStatus
from guidance.flight_time.path_limits import PROPELLANT
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.flight_time.time_window import time_window
from guidance.pdg.request import Request, remaining_time
from guidance.pdg.unrelaxed import plan_unrelaxed
from guidance.planning.indirect_planner import plan_indirect, plan_nearest_indirect

if TYPE_CHECKING:
    from guidance.convex.programme import ConvexSolution

MOST_NODES = 1000
"""A plan that does not keep its limits on so many nodes is none."""

_NOT_CURED_BY_NODES = ("thrust_below", "pointing", "final_thrust_direction", "propellant")
_NOWHERE = "the thrust and the propellant on board suffice for no landing anywhere in the target's plane"
_OUT_OF_REACH = "the thrust and the propellant on board do not suffice for any flight to the target"


def answer(request: Request, unreachable: str) -> Plan:
    """Plan, fly the plan, and say what became of it; without an exception.

    Args:
        request: what is asked.
        unreachable: 'raise', or 'nearest' to fly to the reachable point nearest to the target.
    """
    plan = plan_by_method(request)
    if request.provisional and unreachable == "raise":
        return plan
    if not plan.status.has_flight:
        plan = answer_without_flight(plan, request, unreachable)
    if request.provisional:
        return plan
    plan = within_limits(plan, lambda finer, found: _plan_again(request, finer, found))
    return _bounded(plan, request)


def _bounded(plan: Plan, request: Request) -> Plan:
    """The plan with a way to prove what no flight undercuts; of its duration, where that was asked for."""
    if plan.status is not PlanStatus.OPTIMAL or plan.proof is not None or plan.problem.rotates:
        return plan
    return replace(plan, proof=_prover(request))


def _prover(request: Request) -> Callable[[Plan], Certificate | None]:
    """What proves that no flight undercuts a plan that answers a request."""
    this_time_alone = request.time_of_flight is not None
    return partial(_prove_bound, None if this_time_alone else request.flight, this_time_alone)


def _prove_bound(flight: PrimerFlight | None, this_time_alone: bool, plan: Plan) -> Certificate | None:
    from guidance.lower_bound.proof import prove_least_propellant

    if not plan.propellant > 0.0:
        return None
    return prove_least_propellant(plan.problem, plan.propellant, plan.time_of_flight, flight, this_time_alone)


def _plan_again(request: Request, nodes: int, found: Plan) -> Plan:
    """The plan that was found once more, on more nodes."""
    from guidance.planning.convex_planner import plan_nearest

    if found.status is PlanStatus.NEAREST:
        return plan_nearest(request.problem, nodes, request.time_of_flight)
    finer = request.finer(nodes, found)
    if request.method in ("auto", "convex"):  # only the cones are on a mesh, and there is a flight
        return _plan_convex(finer)
    return plan_by_method(finer)


def plan_by_method(request: Request) -> Plan:
    """Plan by the chosen method; a plan without a flight still lacks its proof."""
    if request.method in ("auto", "indirect"):
        proof = None if request.provisional else _prover(request)
        plan = plan_indirect(request.problem, request.nodes, request.flight, proof)
        kept = plan.status.has_flight and (request.provisional or plan.keeps_limits)
        if kept or request.method == "indirect":  # a limit may break between the places that it looks at
            return plan
    if request.bounds_first and request.flight is None:
        none = _refuse(request)
        if none is not None:
            return none
    if request.method in ("auto", "convex"):
        return _plan_convex(request)
    if request.method == "cvxpy":
        from guidance.reference.cvxpy_planner import plan_cvxpy

        return plan_cvxpy(request.problem, request.nodes, request.time_of_flight)
    return _plan_casadi(request)


def _refuse(request: Request) -> Plan | None:
    """Proof that no flight exists, before any search for one; None where these bounds show none.

    It takes no solver but where the tank lacks next to nothing: there the cones are asked at the times of
    flight that the dual bound leaves open.
    """
    from guidance.planning.infeasibility import prove_by_dual_bound, prove_by_window

    problem, window = request.problem, time_window(request.problem)
    if window.empty:
        proof = prove_by_window(window)
        return Plan(PlanStatus.INFEASIBLE, problem, "closed form", message=window.cause, proof=proof)
    proof = prove_by_dual_bound(problem, request.extremal, window)
    overdrawn = request.extremal is not None and request.extremal.broken == PROPELLANT
    if proof is None and overdrawn and not request.provisional:
        proof = request.refusal_by_cones
    if not isinstance(proof, Certificate):
        return None
    by_bound = all(isinstance(part, DualBound) for part in proof.proofs)
    method = "dual bound" if by_bound else "convex"
    return Plan(PlanStatus.INFEASIBLE, problem, method, message=_OUT_OF_REACH, proof=proof)


def _plan_convex(request: Request) -> Plan:
    """The convex problem; where relaxing lost something, the unrelaxed one from the relaxed flight."""
    guess = request.guess
    return _plan_convex_from(request, None if guess is None else remaining_time(guess, request.problem.state))


def _plan_convex_from(request: Request, seed: float | None) -> Plan:
    """The same, with the time [s] from which the search starts where the indirect method has none."""
    from guidance.planning.convex_planner import plan_convex, plan_weighed

    problem, nodes, weight = request.problem, request.nodes, request.landing_error_weight
    flight = None if request.time_of_flight is not None else request.flight
    if weight is None:
        found = plan_convex(problem, nodes, request.time_of_flight, seed, request.provisional, flight)
    else:
        found = plan_weighed(problem, nodes, weight, request.time_of_flight, request.provisional)
    if found.lossy_flight is None:
        return found.plan
    return plan_unrelaxed(found.plan, found.lossy_flight, request.time_of_flight, weight)


def _plan_casadi(request: Request) -> Plan:
    """The unrelaxed problem; where its local method finds no flight, from that of the convex problem."""
    from guidance.reference.casadi_planner import plan_casadi

    def ask(nodes: int, guess: Plan | None) -> Plan:
        weight = request.landing_error_weight
        return plan_casadi(request.problem, nodes, request.time_of_flight, guess, landing_error_weight=weight)

    plan = ask(request.nodes, request.guess)
    if not request.provisional:
        plan = within_limits(plan, ask)
    if plan.status not in (PlanStatus.SOLVER_FAILED, PlanStatus.LIMIT_REACHED):
        return plan
    convex = _plan_convex(replace(request, guess=None))
    if not convex.status.has_flight:
        return plan
    if convex.method == plan.method:  # relaxing lost: it has asked already
        return replace(convex, solves=plan.solves + convex.solves)
    again = ask(request.nodes, convex)
    return replace(again, solves=plan.solves + convex.solves + again.solves)


def within_limits(plan: Plan, plan_again: Callable[[int, Plan], Plan]) -> Plan:
    """Fly the plan; where it misses its limits plan again on a finer mesh, or say that it misses them.

    What a mesh hides falls with the square of its intervals.

    Args:
        plan: a plan with a flight.
        plan_again: (nodes, plan found so far) -> plan.
    """
    before, stalls = math.inf, 0
    while plan.status.has_flight:
        if plan.keeps_limits:
            return plan
        excess = plan.residuals.excess(plan.problem)
        worst = max(excess, key=lambda name: excess[name])
        finer = 1 + math.ceil((plan.nodes - 1) * min(max(1.2 * math.sqrt(excess[worst]), 1.5), 4.0))
        words = f"flown on {plan.nodes} nodes the plan misses {worst} by {getattr(plan.residuals, worst):.3g}"
        missed = Plan(PlanStatus.LIMIT_REACHED, plan.problem, plan.method, message=words, solves=plan.solves)
        # a relaxed thrust that turns round does so within one interval of any mesh
        turns = worst == "thrust_dip" and plan.method != "casadi"
        stalls = stalls + 1 if excess[worst] > 0.7 * before else 0
        if finer > MOST_NODES or turns or worst in _NOT_CURED_BY_NODES or stalls == 2:
            return missed
        before = excess[worst]
        again = plan_again(finer, plan)
        plan = replace(again if again.status.has_flight else missed, solves=plan.solves + again.solves)
    return plan


def answer_without_flight(plan: Plan, request: Request, unreachable: str) -> Plan:
    """Fly to the nearest reachable point, where asked to, or tell infeasible from failed by a certificate."""
    time_of_flight, anywhere = request.time_of_flight, request.landing_error_weight is not None
    if unreachable == "nearest" and not anywhere:
        nearest = _plan_nearest(request)
        nearest = replace(nearest, solves=plan.solves + nearest.solves)
        if nearest.status.has_flight:
            return nearest
        anywhere = nearest.status is PlanStatus.INFEASIBLE
        if anywhere:
            plan = replace(nearest, method=plan.method)
    if plan.certificate is not None:
        return plan
    proof = _prove_infeasible(request, anywhere)
    if isinstance(proof, Certificate):
        return _proved(plan, proof)
    if request.method in ("auto", "convex") and proof is not None and time_of_flight is None and not anywhere:
        retry = _plan_convex_from(request, proof.time)
        if retry.status.has_flight:
            return replace(retry, solves=plan.solves + retry.solves)
    if plan.status is PlanStatus.INFEASIBLE:
        message = f"{plan.message}; infeasibility could not be proved"
        return replace(plan, status=PlanStatus.LIMIT_REACHED, message=message)
    return plan


def _plan_nearest(request: Request) -> Plan:
    """The reachable point nearest to the target: by the indirect method, else by the convex problem."""
    problem, nodes = request.problem, request.nodes
    if request.method == "auto" and request.time_of_flight is None:
        plan = _plan_nearest_without_solver(request)
        if plan is not None:
            return plan
    from guidance.planning.convex_planner import plan_nearest

    near = None if request.provisional or request.nearest is None else request.nearest.time
    return plan_nearest(problem, nodes, request.time_of_flight, request.provisional, near)


def _plan_nearest_without_solver(request: Request) -> Plan | None:
    """The same by the indirect method, or proof that there is no landing anywhere; None without either."""
    from guidance.planning.infeasibility import prove_by_window, prove_no_landing_anywhere

    problem, window = request.problem, time_window(request.problem, free_landing_point=True)
    if window.empty:
        proof, method = prove_by_window(window), "closed form"
    else:
        plan = plan_nearest_indirect(problem, request.nodes, request.nearest)
        if plan.status.has_flight and (request.provisional or plan.keeps_limits):
            return plan
        proof = None if request.provisional else prove_no_landing_anywhere(problem, window)
        method = "dual bound"
    if proof is None:
        return None
    words = f"{_NOWHERE} (limits: {', '.join(proof.causes)})"
    return Plan(PlanStatus.INFEASIBLE, problem, method, message=words, proof=proof)


def _prove_infeasible(request: Request, anywhere: bool) -> Certificate | ConvexSolution | None:
    """Certificate that no flight exists, or a solution that refutes it, or None where neither was found."""
    from guidance.planning.convex_planner import prove_infeasible
    from guidance.planning.infeasibility import prove_by_dual_bound

    bounded = request.bounds_first or request.problem.rotates
    if request.time_of_flight is None and not bounded and not anywhere:
        proof = prove_by_dual_bound(request.problem, request.extremal)
        if proof is not None:
            return proof
    if request.time_of_flight is None and not anywhere:
        return request.refusal_by_cones
    return prove_infeasible(request.problem, request.nodes, request.time_of_flight, anywhere)


def _proved(plan: Plan, proof: Certificate) -> Plan:
    limits = ", ".join(proof.causes)
    told = plan.message.startswith("propellant") or plan.message == limits
    message = plan.message if told else f"{plan.message} (limits: {limits})"
    return replace(plan, status=PlanStatus.INFEASIBLE, proof=proof, message=message)
