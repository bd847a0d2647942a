"""The best time of flight of a convex task."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from guidance.arrays import Array
from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.programme import ConvexSolution
from guidance.flight_time.primer_vector import PrimerFlight
from guidance.flight_time.search import TimeModel, TimeSearch
from guidance.flight_time.time_window import TimeWindow, guess_time, time_window
from guidance.planning.bracket_search import BracketSearch
from guidance.planning.convex_task import MOST_REFINEMENTS, ConvexTask, bounds_hold

COARSE_NODES = 13
"""Of the mesh on which a search begins."""
_NEAR_DEAD_TIME = 0.97  # first steps are small where the guess is good
_STEPS_FROM_EDGE = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)  # changes of a time that the true bounds refuse
LOG_MASS_TOLERANCE = 4e-6
"""Gain in ln(mass) below which the time search stops: 5 g of propellant at 1200 kg."""


@dataclass(frozen=True)
class _Search:
    """How the best time of a task is searched.

    Attributes:
        kind: the search that suits the cost.
        coarse_tolerance: of the search on a coarse mesh, in tolerances.
    """

    kind: type[TimeSearch[ConvexSolution]]
    coarse_tolerance: float

    @classmethod
    def of(cls, task: ConvexTask) -> _Search:
        """The search for a task: J has a known shape, unless the flight ends with a velocity.

        There it has kinks too where burns meet the nodes of a coarse mesh. In a frame that turns, or with a
        price on the landing error, it is not known either.
        """
        unknown = not task.problem.ends_at_rest or task.problem.rotates or task.error_price > 0.0
        return cls(BracketSearch, 20.0) if unknown else cls(TimeSearch, 2.0)


@dataclass(frozen=True, eq=False)
class TimeOutcome:
    """What a search over the time of flight found.

    Attributes:
        solution: the cheapest flight; None if no time tried was feasible.
        solves: conic solves that it took, coarse ones included.
        cause: the limit that leaves no time of flight, by closed-form bounds; empty if they leave one.
        window: the times about the solution that no solve with relaxed bounds refused; None if none is known.
    """

    solution: ConvexSolution | None
    solves: int
    cause: str = ""
    window: TimeWindow | None = None


def _asymptote(task: ConvexTask) -> float:
    """Slope of the cost at long times: the price of hovering; unknown for a landing error."""
    if task.least_error:
        return 0.0
    return float(np.linalg.norm(task.problem.gravity)) / task.problem.lander.exhaust_velocity


def minimise_over_time(
    task: ConvexTask,
    tolerance: float = LOG_MASS_TOLERANCE,
    guess: float | None = None,
    coarse_first: bool = True,
    flight: PrimerFlight | None = None,
) -> TimeOutcome:
    """Search the time of flight of least cost.

    Where the indirect method has a flight to the target one solve at its time settles the matter, if the dual
    solution says that no other time is better by more than the tolerance. Elsewhere the time, the thrust
    bounds' linearisation and the curvature of the cost come from a search on a coarse mesh first, so that one
    or two solves are left for the fine one.

    Args:
        task: what is solved at each time.
        tolerance: gain below which the search stops, in units of the task's cost.
        guess: [s] time to start from without a flight; None for coast and brake.
        coarse_first: False where the guess is good enough to go without the coarse mesh.
        flight: what the indirect method found; None where it found none, or the landing point is free.
    """
    if flight is not None:
        outcome = _search_from_primer(task, tolerance, flight)
        if outcome is not None:
            return outcome
    window = time_window(task.problem, task.free_landing_point)
    if window.empty:
        return TimeOutcome(None, 0, window.cause)
    model = TimeModel(_asymptote(task), dead_time=0.75 if coarse_first else _NEAR_DEAD_TIME)
    reference: Array | None = None
    start = guess_time(task.problem, window) if guess is None else guess
    start = min(max(start, window.low), window.high)
    solves = 0
    chosen = _Search.of(task)
    if coarse_first and task.nodes > 1.5 * COARSE_NODES:
        coarse = replace(task, nodes=COARSE_NODES, tolerance=1e-6)
        search = chosen.kind(coarse.solve, window, chosen.coarse_tolerance * tolerance, model)
        found = search.run(start)
        solves = len(search.samples)
        if found is not None:
            start, model = found.time, search.model
            if not bounds_hold(task.problem, found, None):
                refined, more = coarse.refine(found)
                solves += more
                reference = refined.log_mass if refined.solved else None
    search = chosen.kind(_evaluation(task, reference), window, tolerance, model)
    best = search.run(start)
    return TimeOutcome(best, solves + len(search.samples), window=_not_refused(search.samples, best, window))


def _not_refused(
    samples: list[ConvexSolution], best: ConvexSolution | None, window: TimeWindow
) -> TimeWindow | None:
    """The window up to the nearest times on either side of the best that were proved infeasible."""
    if best is None:
        return None
    refused = [s.time for s in samples if s.answer.status is SolveStatus.INFEASIBLE]
    low = max((time for time in refused if time < best.time), default=window.low)
    return TimeWindow(low, min((time for time in refused if time > best.time), default=window.high))


def minimise_with_true_bounds(
    task: ConvexTask,
    tolerance: float,
    near: float,
    known: ConvexSolution | None = None,
    window: TimeWindow | None = None,
) -> TimeOutcome:
    """Search the time of least cost with every time judged by the true thrust bounds.

    The relaxed bounds admit flights that are a little too short. Where the optimum is the shortest flight
    there is, or the burns are long, the relaxed search ends on a time that the true bounds refuse or price
    much higher.

    Args:
        task: what is solved at each time.
        tolerance: gain below which the search stops, in units of the task's cost.
        near: [s] where the relaxed search ended.
        known: a solution at that time that keeps the true bounds; None if they refuse it.
        window: where to look, as the relaxed search left it; None for all that closed-form bounds admit.
    """
    solves, reference = 0, None if known is None else known.log_mass

    def evaluate(time: float) -> ConvexSolution:
        nonlocal solves, reference
        solution, more = _with_true_bounds(task, time, reference)
        solves += more
        if solution.solved:
            reference = solution.log_mass
        return solution

    window = window or time_window(task.problem, task.free_landing_point)
    search, model = _Search.of(task).kind, TimeModel(_asymptote(task))
    if known is not None:
        return TimeOutcome(search(evaluate, window, tolerance, model).run(near, known), solves)
    for step in _STEPS_FROM_EDGE:
        for time in (near * (1.0 + step), near / (1.0 + step)):
            if not window.low <= time <= window.high:
                continue
            first = evaluate(time)
            if first.solved:
                low, high = (near, window.high) if time > near else (window.low, near)
                best = search(evaluate, TimeWindow(low, high), tolerance, model).run(time, first)
                return TimeOutcome(best, solves)
    return TimeOutcome(None, solves)


def promised_gain(task: ConvexTask, solution: ConvexSolution) -> float:
    """What another time of flight promises by the derivative at this one, in units of the task's cost."""
    return TimeModel(_asymptote(task)).gain(solution)


def _with_true_bounds(task: ConvexTask, time: float, reference: Array | None) -> tuple[ConvexSolution, int]:
    """A solution that keeps the true thrust bounds, or one that is not solved; and the solves it took."""
    first, solves = task.solve(time, reference), 1
    solution, more = task.refine(first, reference)
    solves += more
    if not solution.solved and reference is not None:
        solution, more = task.refine(task.solve(time))
        solves += 1 + more
    if solution.solved and more == MOST_REFINEMENTS:
        solution = replace(solution, answer=replace(solution.answer, status=SolveStatus.LIMIT_REACHED))
    return solution, solves


def _evaluation(task: ConvexTask, reference: Array | None) -> Callable[[float], ConvexSolution]:
    """Fixed-time solve with thrust bounds linearised at `reference`, or outward where that has no answer."""

    def evaluate(time: float) -> ConvexSolution:
        solution = task.solve(time, reference)
        return solution if solution.solved or reference is None else task.solve(time)

    return evaluate


def _search_from_primer(task: ConvexTask, tolerance: float, flight: PrimerFlight) -> TimeOutcome | None:
    """Search from the indirect method's flight; None where its time has none on this mesh."""
    reference = flight.log_mass(task.nodes)
    first = task.solve(flight.time, reference)
    if not first.solved:
        return None
    model = TimeModel(_asymptote(task))
    if model.gain(first) < tolerance:
        return TimeOutcome(first, 1)
    window = time_window(task.problem)
    search = _Search.of(task).kind(_evaluation(task, reference), window, tolerance, model)
    return TimeOutcome(search.run(flight.time, first), len(search.samples))
