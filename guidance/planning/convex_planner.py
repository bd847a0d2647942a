"""Plans by convex optimisation: to the target, to the softly reachable point nearest to it, or between."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from guidance.convex.programme import ConvexSolution
from guidance.descent.certificate import Certificate
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.flight_time.time_window import forbidden_by
from guidance.planning.convex_task import ConvexTask, relaxation_tight
from guidance.planning.infeasibility import prove_fixed_time, prove_free_time
from guidance.planning.minimum_propellant import (
    COARSE_NODES,
    LOG_MASS_TOLERANCE,
    TimeOutcome,
    minimise_over_time,
    minimise_with_true_bounds,
    promised_gain,
)

METHOD = "convex"
_OVERDRAFT = 1e-9  # in ln(mass): rounding of the solver
_REPLAN_TOLERANCE = 1.5e-5  # in ln(mass), as LOG_MASS_TOLERANCE: 18 g at 1200 kg
_WORTH_A_SEARCH = 4e-5  # gain in ln(mass) that a time found with relaxed bounds may promise to another time
_ERROR_TOLERANCE = 0.02  # [m] gain in landing error below which the time search stops
_MOST_PRICES = 6  # of a kilogram, each at the final mass of the flight before
_SETTLED_MASS = 1e-4  # in ln(mass)
_ERROR_SLACK = 0.05  # [m] landing error granted to the least-propellant step


@dataclass(frozen=True, eq=False)
class ConvexAnswer:
    """What the convex problem says.

    Attributes:
        plan: the plan, or one without a flight.
        lossy_flight: the relaxed flight, where it breaks min_thrust, the pointing limit, or the bounds of
            an engine that cannot stop; else None.
    """

    plan: Plan
    lossy_flight: Trajectory | None = None


def plan_convex(
    problem: LandingProblem,
    nodes: int,
    time_of_flight: float | None = None,
    guess_time: float | None = None,
    provisional: bool = False,
    flight: PrimerFlight | None = None,
) -> ConvexAnswer:
    """Least propellant to the target.

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to search for the best.
        guess_time: [s] start of that search where the indirect method has none; None to find one on a
            coarse mesh.
        provisional: whether a flight near the best time will do.
        flight: what the indirect method found, to start that search from; None where it found none.

    Returns:
        A plan that is OPTIMAL, or one without a flight: INFEASIBLE without a certificate means "not found,
        proof still to come".
        Where relaxing lost something, the relaxed flight beside it.
    """
    task = ConvexTask(problem, nodes)
    if time_of_flight is not None:
        cause = forbidden_by(problem, time_of_flight)
        if cause:
            return ConvexAnswer(Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=cause))
        outcome = TimeOutcome(task.solve(time_of_flight), 1)
    else:
        tolerance = LOG_MASS_TOLERANCE if guess_time is None else _REPLAN_TOLERANCE
        outcome = minimise_over_time(task, tolerance, guess_time, guess_time is None, flight)
        if outcome.solution is None and outcome.cause:
            return ConvexAnswer(Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=outcome.cause))
    worth = _worth_a_search(time_of_flight, provisional)
    return _finish(task, outcome, PlanStatus.OPTIMAL, worth)


def _worth_a_search(time_of_flight: float | None, provisional: bool) -> float | None:
    """Gain in ln(mass) above which a free time is searched anew; None where it is given."""
    if time_of_flight is not None:
        return None
    return math.inf if provisional else _WORTH_A_SEARCH


def _finish(
    task: ConvexTask, outcome: TimeOutcome, status: PlanStatus, worth_a_search: float | None
) -> ConvexAnswer:
    """Refine a solution until the true thrust bounds hold, check the tank, and make it a Plan.

    Where the time of flight is free it is searched anew if the true bounds refuse it, or promise a gain in
    ln(mass) above `worth_a_search` at another; None keeps it.
    """
    problem, found, solves = task.problem, outcome.solution, outcome.solves
    message = "no feasible time of flight found"
    none = Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=message, solves=solves)
    if found is None:
        return ConvexAnswer(none)
    if not found.solved:
        return ConvexAnswer(replace(none, message=f"no flight of {found.time:g} s ({found.answer.words})"))
    if not _affordable(problem, found):
        return ConvexAnswer(replace(none, message=_shortage(problem, found)))
    solution, more = task.refine(found)
    solves += more
    affordable = _affordable(problem, solution)
    if worth_a_search is not None and (not affordable or promised_gain(task, solution) > worth_a_search):
        known = solution if affordable else None
        again = minimise_with_true_bounds(task, LOG_MASS_TOLERANCE, found.time, known, outcome.window)
        solution, solves = again.solution or solution, solves + again.solves
    none = replace(none, solves=solves)
    if not _affordable(problem, solution):
        words = "feasible only with thrust bounds relaxed outward: on the edge of what the lander can do"
        none = replace(none, status=PlanStatus.LIMIT_REACHED, message=words)
        return ConvexAnswer(none, found.trajectory(problem) if problem.lander.min_thrust > 0.0 else None)
    if not relaxation_tight(problem, solution):
        words = "the relaxed optimum breaks min_thrust or the pointing limit"
        none = replace(none, status=PlanStatus.LIMIT_REACHED, message=words)
        return ConvexAnswer(none, solution.trajectory(problem))
    return ConvexAnswer(Plan.of_flight(status, problem, METHOD, solution.trajectory(problem), solves))


def _affordable(problem: LandingProblem, solution: ConvexSolution) -> bool:
    """Whether there is a flight, and the propellant on board suffices for it."""
    return solution.solved and solution.log_mass_ratio <= problem.log_mass_ratio + _OVERDRAFT


def _shortage(problem: LandingProblem, solution: ConvexSolution) -> str:
    needed = problem.state.mass * -math.expm1(-solution.log_mass_ratio)
    return (
        f"propellant: the cheapest flight found needs {needed:.2f} kg, "
        f"{problem.state.mass - problem.lander.dry_mass:.2f} kg are on board"
    )


def prove_infeasible(
    problem: LandingProblem, nodes: int, time_of_flight: float | None, free_landing_point: bool = False
) -> Certificate | ConvexSolution | None:
    """Certificate that no flight exists, or a solution that refutes it, or None where neither was found."""
    task = ConvexTask(problem, nodes, free_landing_point)
    if time_of_flight is not None:
        return prove_fixed_time(task, time_of_flight)
    return prove_free_time(task)


def _cheapest_anywhere(anywhere: ConvexTask) -> tuple[ConvexSolution | Plan, int]:
    """The cheapest soft landing in the target's plane, or a plan that says there is none; solves it took."""
    problem, cheapest = anywhere.problem, minimise_over_time(anywhere)
    found, solves = cheapest.solution, cheapest.solves
    if found is not None and found.log_mass_ratio <= problem.log_mass_ratio:
        return found, solves
    message = "no soft landing anywhere in the target's plane was found"
    if found is not None:
        message += f"; {_shortage(problem, found)}"
    return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=message, solves=solves), solves


def plan_weighed(
    problem: LandingProblem,
    nodes: int,
    weight: float,
    time_of_flight: float | None = None,
    provisional: bool = False,
) -> ConvexAnswer:
    """Land softly in the target's plane with the least propellant + weight x landing error.

    The propellant is not convex in ln(mass), so that a kilogram is priced at the final mass of the solution
    before; that mass hardly changes.

    Args:
        problem: what to solve.
        nodes: N.
        weight: [kg/m] at least zero.
        time_of_flight: [s] or None to search for the best.
        provisional: whether a flight near the best time will do.

    Returns:
        A plan that is WEIGHED, or one without a flight, as `plan_convex` gives.
    """
    anywhere = ConvexTask(problem, nodes, free_landing_point=True)
    if time_of_flight is not None:
        cause = forbidden_by(problem, time_of_flight, free_landing_point=True)
        if cause:
            return ConvexAnswer(Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=cause))
        best, solves = anywhere.solve(time_of_flight), 1
    else:
        best, solves = _cheapest_anywhere(anywhere)
        if isinstance(best, Plan):
            return ConvexAnswer(best)
    task, worth = anywhere, _worth_a_search(time_of_flight, provisional)
    for _ in range(_MOST_PRICES):
        if not best.solved:
            break
        before = best.log_mass_ratio
        price = weight / problem.state.mass * math.exp(before)
        task = replace(anywhere, limit_propellant=True, error_price=price)
        if time_of_flight is not None:
            found, more = task.solve(time_of_flight), 1
        else:
            outcome = minimise_over_time(task, LOG_MASS_TOLERANCE, best.time, coarse_first=False)
            found, more = outcome.solution or task.solve(best.time), outcome.solves
        best, solves = found, solves + more
        if not best.solved or abs(best.log_mass_ratio - before) < _SETTLED_MASS:
            break
    return _finish(task, TimeOutcome(best, solves), PlanStatus.WEIGHED, worth)


def plan_nearest(
    problem: LandingProblem,
    nodes: int,
    time_of_flight: float | None = None,
    provisional: bool = False,
    near: float | None = None,
) -> Plan:
    """Land softly as near to the target as possible, in its plane, then with the least propellant.

    Three convex problems: the cheapest soft landing anywhere (which tells whether there is one), the least
    landing error with the propellant on board, the least propellant to within that error (Blackmore,
    Acikmese and Scharf, JGCD 33(4), 2010, "prioritized" scheme).

    Args:
        problem: what to solve.
        nodes: N.
        time_of_flight: [s] or None to search for the best.
        provisional: whether a flight near the best time will do.
        near: [s] a likely time of flight: where the tank pays for a landing then, the first of the three is
            left out; None if none is known.

    Returns:
        A plan that is NEAREST, or one without a flight (no soft landing anywhere was found).
    """
    anywhere = ConvexTask(problem, nodes, free_landing_point=True)
    nearest = replace(anywhere, least_error=True, limit_propellant=True)
    if time_of_flight is not None:
        cause = forbidden_by(problem, time_of_flight, free_landing_point=True)
        if cause:
            return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=cause)
        least = nearest.solve(time_of_flight)
        solves = 1
    else:
        begin, solves = near, 1
        if begin is None or not replace(nearest, nodes=COARSE_NODES).solve(begin).solved:
            found, solves = _cheapest_anywhere(anywhere)
            if isinstance(found, Plan):
                return found
            begin = found.time
        outcome = minimise_over_time(nearest, _ERROR_TOLERANCE, begin)
        solves += outcome.solves
        least = outcome.solution or nearest.solve(begin)
    if not least.solved:
        message = f"no soft landing anywhere in the target's plane ({least.answer.words})"
        return Plan(PlanStatus.INFEASIBLE, problem, METHOD, message=message, solves=solves)
    refined, more = nearest.refine(least)
    solves += more
    error = (refined if refined.solved else least).landing_error
    economical = replace(anywhere, error_limit=1.001 * error + _ERROR_SLACK)
    if time_of_flight is not None:
        outcome = TimeOutcome(economical.solve(time_of_flight), 1)
    else:
        outcome = minimise_over_time(economical, LOG_MASS_TOLERANCE, least.time, coarse_first=False)
        if outcome.solution is not None and not _affordable(problem, outcome.solution):
            outcome = TimeOutcome(economical.solve(least.time), outcome.solves + 1)
    outcome = replace(outcome, solves=solves + outcome.solves)
    worth = _worth_a_search(time_of_flight, provisional)
    return _finish(economical, outcome, PlanStatus.NEAREST, worth).plan
