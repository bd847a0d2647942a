"""The flight of the indirect method as a plan: exact burns and coast, where no limit of the problem binds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from guidance.descent.certificate import Certificate
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.flight_time.nearest_landing import NearestLanding
from guidance.flight_time.primer_trajectory import lay_nodes
from guidance.flight_time.primer_vector import PrimerFlight

METHOD = "indirect"
NOT_FOUND = (
    "the indirect method found no flight that keeps the limits; it knows no least thrust, no velocity at the"
    " target and no limit that binds but a touch of the ground, and method 'auto' asks others then"
)

TANK_ALL_BUT_EMPTY = "the tank is all but empty: no cheaper flight to a point next to it was found"


def plan_indirect(
    problem: LandingProblem,
    nodes: int,
    flight: PrimerFlight | None,
    proof: Callable[[Plan], Certificate | None] | None = None,
) -> Plan:
    """Plan along a flight of the indirect method.

    Args:
        problem: what it solves.
        nodes: N, shared among the arcs; two for each arc at least.
        flight: what `find_primer_flight` found.
        proof: what makes the plan's certificate.

    Returns:
        A plan that is OPTIMAL; or LIMIT_REACHED where there is no flight: others may find one.
    """
    if flight is None:
        return Plan(PlanStatus.LIMIT_REACHED, problem, METHOD, message=NOT_FOUND)
    laid = lay_nodes(problem, flight, nodes)
    return Plan.of_flight(PlanStatus.OPTIMAL, problem, METHOD, laid, proof=proof)


def plan_nearest_indirect(problem: LandingProblem, nodes: int, nearest: NearestLanding | None) -> Plan:
    """Plan to the point nearest to the target that the tank pays for.

    Args:
        problem: what cannot be reached.
        nodes: as of `plan_indirect`.
        nearest: what `find_nearest_landing` found; None if it was not asked.

    Returns:
        A plan that is NEAREST, whose message says where it is not the cheapest next to the nearest point; or
        LIMIT_REACHED where the method finds none.
    """
    if nearest is None or nearest.flight is None:
        return Plan(PlanStatus.LIMIT_REACHED, problem, METHOD, message=NOT_FOUND)
    laid = lay_nodes(nearest.problem, nearest.flight, nodes)
    plan = Plan.of_flight(PlanStatus.NEAREST, problem, METHOD, laid)
    return plan if nearest.cheapest else replace(plan, message=f"{plan.message}; {TANK_ALL_BUT_EMPTY}")
