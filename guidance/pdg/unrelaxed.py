"""The unrelaxed problem from the flight of the relaxed one, where relaxing lost something."""

from __future__ import annotations

from dataclasses import replace

from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.trajectory import Trajectory

_LOCAL_GAP = 2e-3  # of the cost, over the relaxed flight's: not worth another guess


def plan_unrelaxed(
    lost: Plan, relaxed: Trajectory, time_of_flight: float | None, weight: float | None = None
) -> Plan:
    """Ask a local method from several guesses.

    A flight that costs hardly more than the relaxed one ends the search; otherwise the best of all counts.

    Args:
        lost: the answer of the convex method, without a flight.
        relaxed: its relaxed flight.
        time_of_flight: [s] or None to leave it free.
        weight: [kg/m] price of the landing error; None lands at the target.
    """
    from guidance.reference.casadi_planner import plan_casadi
    from guidance.reference.trajectory_guess import swing_sideways

    problem, solves = lost.problem, lost.solves

    def cost(plan: Plan) -> float:
        return plan.propellant + (0.0 if weight is None else weight * plan.landing_error)

    bound = cost(Plan.of_flight(PlanStatus.OPTIMAL, problem, lost.method, relaxed))
    best, said = lost, []
    for guess in (relaxed, swing_sideways(problem, relaxed, in_plane=True), None):
        start = None if guess is None else Plan.of_flight(PlanStatus.OPTIMAL, problem, lost.method, guess)
        found = plan_casadi(problem, relaxed.nodes, time_of_flight, start, landing_error_weight=weight)
        solves += found.solves
        said.append(found.message)
        if found.status.has_flight and not cost(best) <= cost(found):
            best = found
        if cost(best) <= (1.0 + _LOCAL_GAP) * bound:
            break
    message = best.message if best.status.has_flight else said[0]
    return replace(best, solves=solves, message=f"{message}; {lost.message}")
