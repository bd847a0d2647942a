"""Powered-descent guidance: `solve_pdg`, the public entry to every solver.

python -m guidance.pdg --state 200 100 950 -8 -4 -30 1200 --target 0 0 50 --plot plan.png
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from guidance.constants import MOON_GRAVITY
from guidance.descent.certificate import Certificate
from guidance.descent.plan import InfeasibleError, Plan, PlanStatus, SolverFailedError
from guidance.descent.problem import LandingProblem
from guidance.lander import PAPER_LANDER, Lander
from guidance.state import State
from guidance.validation import finite_number, finite_vector

DEFAULT_NODES = 61
"""Nodes of a plan unless asked otherwise: they cost about 5 g of propellant on the paper's descents."""
FEWEST_NODES = 5
MOST_NODES = 1000
"""A plan that does not keep its limits on so many nodes is none."""
_CURED_BY_NODES = ("position", "velocity", "altitude", "glide_slope", "speed", "thrust_above", "thrust_dip")
ARRIVED = "the start is the target, with its velocity: no flight is needed"
"""Said of a plan with free time of flight: the shorter it is, the better."""
METHODS = ("convex", "casadi", "cvxpy")
UNREACHABLE = ("raise", "nearest")


def solve_pdg(
    state: State | Sequence[float] | np.ndarray,
    target: ArrayLike,
    *,
    lander: Lander = PAPER_LANDER,
    gravity: ArrayLike = MOON_GRAVITY,
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
    glide_slope_limit: float | None = None,
    speed_limit: float | None = None,
    time_of_flight: float | None = None,
    nodes: int = DEFAULT_NODES,
    method: Literal["convex", "casadi", "cvxpy"] = "convex",
    unreachable: Literal["raise", "nearest"] = "raise",
    guess: Plan | None = None,
    throw: bool = True,
) -> Plan:
    """Plan the descent from `state` to `target` that burns the least propellant.

    Args:
        state: State, or seven numbers (x, y, z, vx, vy, vz, mass).
        target: [m] shape (3,), site frame; the trajectory never goes below its altitude.
        lander: the vehicle. Its pointing limit is measured from the z axis.
        gravity: [m/s^2] shape (3,).
        target_velocity: [m/s] shape (3,), at the target; rest unless given. One that points up is infeasible:
            it can only be reached from below the target's altitude.
        glide_slope_limit: [rad] greatest angle from the z axis, seen from the landing point, in (0, pi/2].
        speed_limit: [m/s] greatest speed.
        time_of_flight: [s] None searches for the best.
        nodes: N; the plan has N - 1 intervals of equal duration. Where the plan, flown, does not keep its
            limits between so few nodes, it gets more.
        method: 'convex' (lossless convexification in Clarabel; where that loses min_thrust or the pointing
            limit it asks 'casadi', and `plan.method` says so), 'cvxpy' (the same problem, for reading) or
            'casadi' (the unrelaxed nonconvex problem by fatrop or IPOPT).
        unreachable: what to do where the target is out of reach: 'raise', or plan to the softly reachable
            point 'nearest' to it in its plane (always by the convex method).
        guess: an earlier Plan of nearly the same flight: what is left of it seeds the search where the
            indirect method finds no flight within the limits.
        throw: raise where there is no flight; otherwise return a Plan that says why.

    Returns:
        A Plan. With `throw=False` its status may be one without a flight.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape.
        InfeasibleError: no flight within the limits exists; proved by `error.plan.certificate`.
        SolverFailedError: the solver gave no answer.
    """
    problem = LandingProblem(
        State.parse(state),
        finite_vector("target", target, 3),
        lander,
        finite_vector("gravity", gravity, 3),
        glide_slope_limit,
        speed_limit,
        finite_vector("target_velocity", target_velocity, 3),
    )
    _check_choices(nodes, method, unreachable, guess)
    if time_of_flight is not None:
        time_of_flight = finite_number("time_of_flight", time_of_flight, above=0.0)
    plan = _plan(problem, nodes, time_of_flight, method, guess)
    if plan.status is PlanStatus.OPTIMAL:
        plan = _within_limits(plan, lambda finer, found: _plan(problem, finer, time_of_flight, method, found))
    else:
        plan = _without_flight(plan, nodes, time_of_flight, unreachable)
    if problem.arrived and time_of_flight is None:
        plan = replace(plan, message=f"{plan.message}; {ARRIVED}")
    if throw and not plan.status.has_flight:
        raise _error(plan)
    return plan


def _error(plan: Plan) -> InfeasibleError | SolverFailedError:
    kind = InfeasibleError if plan.status is PlanStatus.INFEASIBLE else SolverFailedError
    return kind(f"{plan.status.value}: {plan.message}", plan)


def _check_choices(nodes: int, method: str, unreachable: str, guess: Plan | None) -> None:
    if isinstance(nodes, bool) or not isinstance(nodes, int | np.integer) or nodes < FEWEST_NODES:
        raise ValueError(f"nodes must be an integer of at least {FEWEST_NODES}, got {nodes!r}")
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if unreachable not in UNREACHABLE:
        raise ValueError(f"unreachable must be one of {', '.join(UNREACHABLE)}, got {unreachable!r}")
    if guess is not None and not isinstance(guess, Plan):
        raise ValueError(f"guess must be a Plan, got {type(guess).__name__}")


def time_left(guess: Plan, state: State) -> float | None:
    """[s] what is left of an earlier plan at its node nearest to `state`; None if nothing is."""
    if guess.nodes == 0:
        return None
    pace = guess.time_of_flight
    gap = np.linalg.norm(guess.position - state.position, axis=1) + 0.1 * pace * np.linalg.norm(
        guess.velocity - state.velocity, axis=1
    )
    left = guess.time_of_flight - float(guess.time[int(gap.argmin())])
    return left if left > 0.0 else None


def _plan(
    problem: LandingProblem, nodes: int, time_of_flight: float | None, method: str, guess: Plan | None
) -> Plan:
    """Plan by the chosen method; a plan without a flight still lacks its proof."""
    if method == "convex":
        from guidance.planning.convex_planner import plan_convex

        seed = None if guess is None else time_left(guess, problem.state)
        return plan_convex(problem, nodes, time_of_flight, seed)
    if method == "cvxpy":
        from guidance.reference.cvxpy_planner import plan_cvxpy

        return plan_cvxpy(problem, nodes, time_of_flight)
    from guidance.reference.casadi_planner import plan_casadi

    plan = plan_casadi(problem, nodes, time_of_flight, guess)
    plan = _within_limits(plan, lambda finer, found: plan_casadi(problem, finer, time_of_flight, found))
    if plan.status in (PlanStatus.SOLVER_FAILED, PlanStatus.LIMIT_REACHED):
        from guidance.planning.convex_planner import plan_convex

        convex = plan_convex(problem, nodes, time_of_flight)
        if convex.status.has_flight and convex.method == plan.method:  # relaxing lost: it has asked already
            return replace(convex, solves=plan.solves + convex.solves)
        if convex.status.has_flight:  # the case is feasible: the local solver had a poor start
            again = plan_casadi(problem, nodes, time_of_flight, convex)
            return replace(again, solves=plan.solves + convex.solves + again.solves)
    return plan


def _within_limits(plan: Plan, plan_again: Callable[[int, Plan], Plan]) -> Plan:
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
        if finer > MOST_NODES or turns or worst not in _CURED_BY_NODES or stalls == 2:
            return missed
        before = excess[worst]
        again = plan_again(finer, plan)
        plan = replace(again if again.status.has_flight else missed, solves=plan.solves + again.solves)
    return plan


def _without_flight(plan: Plan, nodes: int, time_of_flight: float | None, unreachable: str) -> Plan:
    """Tell infeasible from failed by a certificate, or fly to the nearest reachable point."""
    from guidance.planning.convex_planner import plan_convex, plan_nearest, prove_infeasible

    problem, anywhere = plan.problem, False
    if unreachable == "nearest":
        nearest = plan_nearest(problem, nodes, time_of_flight)
        nearest = replace(nearest, solves=plan.solves + nearest.solves)
        if nearest.status.has_flight:
            return _within_limits(nearest, lambda finer, _: plan_nearest(problem, finer, time_of_flight))
        anywhere = nearest.status is PlanStatus.INFEASIBLE
        if anywhere:
            plan = replace(nearest, method=plan.method)
    proof = prove_infeasible(problem, nodes, time_of_flight, anywhere)
    if isinstance(proof, Certificate):
        limits = ", ".join(proof.causes)
        told = plan.message.startswith("propellant") or plan.message == limits
        message = plan.message if told else f"{plan.message} (limits: {limits})"
        return replace(plan, status=PlanStatus.INFEASIBLE, certificate=proof, message=message)
    if plan.method == "convex" and proof is not None and time_of_flight is None and not anywhere:
        retry = plan_convex(problem, nodes, None, proof.time)
        if retry.status.has_flight:
            retry = replace(retry, solves=plan.solves + retry.solves)
            return _within_limits(retry, lambda finer, found: _plan(problem, finer, None, "convex", found))
    if plan.status is PlanStatus.INFEASIBLE:
        message = f"{plan.message}; infeasibility could not be proved"
        return replace(plan, status=PlanStatus.LIMIT_REACHED, message=message)
    return plan


if __name__ == "__main__":
    from guidance.pdg.__main__ import main

    main()
