"""Powered-descent guidance: `solve_pdg`, the public entry to every solver.

python -m guidance.pdg --state 200 100 950 -8 -4 -30 1200 --target 0 0 50 --plot plan.png
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.descent.limits import NO_LIMITS, Limits
from guidance.descent.plan import InfeasibleError, Plan, PlanStatus, SolverFailedError
from guidance.descent.problem import LandingProblem
from guidance.lander import PAPER_LANDER, Lander
from guidance.pdg.fallbacks import answer
from guidance.pdg.request import Request
from guidance.state import State
from guidance.validation import finite_number, whole_number

DEFAULT_NODES = 61
"""Nodes of a plan unless asked otherwise: they cost about 5 g of propellant on the paper's descents."""
FEWEST_NODES = 5
ARRIVED = "the start is the target, with its velocity: no flight is needed"
"""Said of a plan with free time of flight: the shorter it is, the better."""
PlanningMethod = Literal["auto", "indirect", "convex", "casadi", "cvxpy"]
"""Planners that can be asked for by name."""
METHODS: tuple[PlanningMethod, ...] = get_args(PlanningMethod)
UNREACHABLE = ("raise", "nearest")


def solve_pdg(
    state: State | Sequence[float] | np.ndarray,
    target: ArrayLike,
    *,
    lander: Lander = PAPER_LANDER,
    gravity: ArrayLike = MOON_GRAVITY,
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
    limits: Limits = NO_LIMITS,
    glide_slope_limit: float | None = None,
    speed_limit: float | None = None,
    time_of_flight: float | None = None,
    nodes: int = DEFAULT_NODES,
    method: PlanningMethod = "auto",
    unreachable: Literal["raise", "nearest"] = "raise",
    landing_error_weight: float | None = None,
    guess: Plan | None = None,
    throw: bool = True,
) -> Plan:
    """Plan the descent from `state` to `target` that burns the least propellant.

    Args:
        state: State, or seven numbers (x, y, z, vx, vy, vz, mass).
        target: [m] shape (3,), site frame; the trajectory never goes below its altitude.
        lander: the vehicle. Its pointing limit is measured from the z axis.
        gravity: [m/s^2] shape (3,).
        angular_velocity: [rad/s] shape (3,), of the site frame about an axis through its origin.
        target_velocity: [m/s] shape (3,), at the target; one that points up, from below, is infeasible.
        limits: what the path has to keep.
        glide_slope_limit: [rad] shorthand for `limits.glide_slope`.
        speed_limit: [m/s] shorthand for `limits.speed`.
        time_of_flight: [s] None searches for the best.
        nodes: N, for N - 1 intervals, equal ones or those of each arc of 'indirect'; more where the flown
            plan does not keep its limits on so few, or the arcs need them.
        method: 'auto' ('indirect' where it has a flight that keeps the limits, else 'convex'; `plan.method`
            says which), 'indirect' (the primer vector: exact burns and coast), 'convex' (lossless
            convexification in Clarabel; where that loses min_thrust or the pointing limit it asks 'casadi'),
            'cvxpy' (the same problem, for reading) or 'casadi' (the unrelaxed nonconvex problem by fatrop or
            IPOPT).
        unreachable: what to do where the target is out of reach: 'raise', or plan to the softly reachable
            point 'nearest' to it in its plane (by 'auto' from the indirect method, else the convex one).
        landing_error_weight: [kg/m] minimise propellant + weight x landing error, with a landing point that
            is free in the target's plane; by 'auto', 'convex' or 'casadi'. None lands at the target.
        guess: an earlier Plan of nearly the same flight, for a search that the indirect method cannot start.
        throw: raise where there is no flight; otherwise return a Plan that says why.

    Returns:
        A Plan. With `throw=False` its status may be one without a flight.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape.
        InfeasibleError: no flight within the limits exists; proved by `error.plan.certificate`.
        SolverFailedError: the solver gave no answer.
    """
    vectors = (target, gravity, target_velocity, angular_velocity)
    place, pull, arrival, spin = (cast("Array", vector) for vector in vectors)  # the problem checks them
    limits = with_shorthands(limits, glide_slope=glide_slope_limit, speed=speed_limit)
    problem = LandingProblem(State.parse(state), place, lander, pull, limits, arrival, spin)
    _check_choices(nodes, method, unreachable, guess)
    weight = _weight(landing_error_weight, method)
    request = Request(problem, nodes, _seconds(time_of_flight), method, guess, landing_error_weight=weight)
    plan = answer(request, unreachable)
    if problem.arrived and time_of_flight is None:
        plan = replace(plan, message=f"{plan.message}; {ARRIVED}")
    if throw and not plan.status.has_flight:
        raise _error(plan)
    return plan


def replan(
    problem: LandingProblem, nodes: int, time_of_flight: float | None, method: str, unreachable: str
) -> Plan:
    """A plan for the closed loop, which replaces it before it is flown to its end; a failure is a status.

    It is taken as the planner finds it: not flown first, so that it may miss a limit between nodes, and near
    the best time of flight rather than at it; and where there is none, why is not proved for 'raise'.
    `solve_pdg` gives plans that are flown as they are.

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to search for the best.
        method: as in `solve_pdg`.
        unreachable: as in `solve_pdg`.

    Raises:
        ValueError: an argument is out of range.
    """
    _check_choices(nodes, method, unreachable, None)
    return answer(Request(problem, nodes, _seconds(time_of_flight), method, provisional=True), unreachable)


def with_shorthands(limits: Limits, **shorthands: float | None) -> Limits:
    """The limits with those that were given by a keyword of their own, `NAME_limit`; ValueError for both."""
    if not isinstance(limits, Limits):
        raise ValueError(f"limits must be a Limits, got {limits!r}")
    for name, value in shorthands.items():
        if value is None:
            continue
        if getattr(limits, name) is not None:
            raise ValueError(f"{name}_limit and limits.{name} are the same limit: give one of them")
        try:
            limits = replace(limits, **{name: value})
        except ValueError as error:
            raise ValueError(str(error).replace(f"limits.{name}", f"{name}_limit")) from None
    return limits


def _weight(landing_error_weight: float | None, method: str) -> float | None:
    if landing_error_weight is None:
        return None
    if method in ("indirect", "cvxpy"):
        raise ValueError(f"landing_error_weight: method '{method}' lands at the target")
    return finite_number("landing_error_weight", landing_error_weight, at_least=0.0)


def _seconds(time_of_flight: float | None) -> float | None:
    return None if time_of_flight is None else finite_number("time_of_flight", time_of_flight, above=0.0)


def _error(plan: Plan) -> InfeasibleError | SolverFailedError:
    kind = InfeasibleError if plan.status is PlanStatus.INFEASIBLE else SolverFailedError
    return kind(f"{plan.status.value}: {plan.message}", plan)


def _check_choices(nodes: int, method: str, unreachable: str, guess: Plan | None) -> None:
    whole_number("nodes", nodes, FEWEST_NODES)
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if unreachable not in UNREACHABLE:
        raise ValueError(f"unreachable must be one of {', '.join(UNREACHABLE)}, got {unreachable!r}")
    if guess is not None and not isinstance(guess, Plan):
        raise ValueError(f"guess must be a Plan, got {type(guess).__name__}")
