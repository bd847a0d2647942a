"""`solve_pdg_6dof`: the least-propellant descent of a body that must turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from guidance.constants import MOON_GRAVITY
from guidance.descent.plan import InfeasibleError, Plan, PlanStatus, SolverFailedError
from guidance.descent.problem import LandingProblem
from guidance.pdg import solve_pdg
from guidance.rigid_body.body import DEFAULT_BODY, RigidBody
from guidance.rigid_body.state import RigidState
from guidance.rigid_descent.first_guess import easily_followed, guess_flight
from guidance.rigid_descent.plan import RigidPlan
from guidance.rigid_descent.problem import RigidLandingProblem
from guidance.state import State
from guidance.successive.iteration import Ending, iterate_programmes
from guidance.successive.units import Iterate, RigidUnits
from guidance.validation import finite_vector, unknown_name, whole_number

METHOD = "successive"
RigidPlanningMethod = Literal["successive", "casadi"]
"""Who plans: successive convexification, or the independent reference."""
DEFAULT_NODES = 31
"""Nodes of a plan unless asked otherwise."""
FEWEST_NODES = 5
"""Of a plan."""


def solve_pdg_6dof(
    state: RigidState | State | Sequence[float] | np.ndarray,
    target: ArrayLike,
    body: RigidBody = DEFAULT_BODY,
    *,
    gravity: ArrayLike = MOON_GRAVITY,
    target_velocity: ArrayLike = (0.0, 0.0, 0.0),
    glide_slope_limit: float | None = None,
    free_attitude: bool = False,
    objective: str = "propellant",
    nodes: int = DEFAULT_NODES,
    method: RigidPlanningMethod = "successive",
    throw: bool = True,
) -> RigidPlan:
    """Plan a descent that ends upright and at rest, within the body's thrust, torque, rate and tilt limits.

    By successive convexification on Clarabel, with a virtual control, a penalised trust region and free time
    of flight (Szmuk and Acikmese, AIAA 2018-0617), from a point mass's plan. Both methods are local: an
    OPTIMAL plan is a local optimum on its mesh, and `plan.relaxation_gap` bounds what a better one saves.

    Args:
        state: RigidState, or what `solve_pdg` takes, for a body that stands upright at rest, engine off.
        target: [m] shape (3,), site frame; the trajectory never goes below its altitude.
        body: the vehicle.
        gravity: [m/s^2] shape (3,).
        target_velocity: [m/s] shape (3,), at the target.
        glide_slope_limit: [rad] greatest angle, seen from the target, between the vehicle and the z axis.
        free_attitude: whether the attitude at the start is free.
        objective: 'propellant', or 'time' for the shortest flight.
        nodes: N, for N - 1 equal intervals.
        method: 'successive', or 'casadi' for the independent reference: collocation, by IPOPT.
        throw: raise where there is no flight; otherwise return a plan that says why.

    Returns:
        A RigidPlan; an OPTIMAL one was flown open loop through the true motion and kept every limit.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape.
        InfeasibleError: not even a point mass that turns at once has a flight; proved by
            `error.plan.certificate`.
        SolverFailedError: no flight was found, or the flight that was found does not keep its limits between
            the nodes; nothing is proved. `error.plan` is of the type of every planner's: a Plan of the point
            mass without a flight, with this status and message. `throw=False` gives the RigidPlan itself.
    """
    nodes = whole_number("nodes", nodes, FEWEST_NODES)
    problem = RigidLandingProblem(
        RigidState.parse(state),
        finite_vector("target", target, 3),
        body,
        finite_vector("gravity", gravity, 3),
        finite_vector("target_velocity", target_velocity, 3),
        glide_slope_limit,
        free_attitude,
        objective,
    )
    if method not in get_args(RigidPlanningMethod):
        raise ValueError(unknown_name("method", method, get_args(RigidPlanningMethod)))
    plan = _plan(problem, nodes, method)
    if throw and not plan.status.has_flight:
        raise _error(plan)
    return plan


def _error(plan: RigidPlan) -> InfeasibleError | SolverFailedError:
    assert plan.point_mass is not None
    words, label = f"{plan.status.value}: {plan.message}", plan.point_mass
    if plan.status is PlanStatus.INFEASIBLE:
        return InfeasibleError(words, label)
    return SolverFailedError(
        words, Plan(plan.status, label.problem, plan.method, message=plan.message, solves=plan.solves)
    )


def _plan(problem: RigidLandingProblem, nodes: int, method: RigidPlanningMethod) -> RigidPlan:
    easy = _plan_point(problem.point_mass)
    if not easy.status.has_flight:
        words = f"the point mass has no plan ({easy.message})"
        return RigidPlan(easy.status, problem, method, message=words, point_mass=easy, solves=easy.solves)
    lead, solves = easy, easy.solves
    followed = easily_followed(problem)
    if followed.lander != easy.problem.lander:
        other = _plan_point(followed)
        lead, solves = other if other.status.has_flight else easy, solves + other.solves
    first = guess_flight(problem, lead, nodes)
    if method == "casadi":
        from guidance.reference import plan_rigid_casadi

        plan = plan_rigid_casadi(problem, first)
        return replace(plan, point_mass=easy, solves=solves + plan.solves)
    units = RigidUnits.of(problem)
    guess = Iterate.of_flight(first, problem, units)
    ending = iterate_programmes(problem, units, guess)
    return _judge(problem, units, replace(ending, solves=solves + ending.solves), easy)


def _plan_point(point: LandingProblem) -> Plan:
    return solve_pdg(
        point.state,
        point.target,
        lander=point.lander,
        gravity=point.gravity,
        target_velocity=point.target_velocity,
        limits=point.limits,
        throw=False,
    )


def _judge(problem: RigidLandingProblem, units: RigidUnits, ending: Ending, easy: Plan) -> RigidPlan:
    """Fly what the iteration found, and say what it is."""
    solves = ending.solves
    if ending.status is not PlanStatus.OPTIMAL:
        words = ending.words
        return RigidPlan(ending.status, problem, METHOD, message=words, point_mass=easy, solves=solves)
    flight = ending.iterate.flight(problem, units)
    return RigidPlan(PlanStatus.OPTIMAL, problem, METHOD, flight, "optimal", easy, solves).checked()
