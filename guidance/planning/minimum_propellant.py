"""One fixed-time task refined until the true thrust bounds hold, and the best time of flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.condensed import keeps_altitude
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.programme import ConvexSolution, convex_template
from guidance.convex.scaling import scale_problem
from guidance.descent.problem import LandingProblem
from guidance.descent.residuals import FLIGHT_TOLERANCE, pointing_excess
from guidance.flight_time.bracket_search import BracketSearch
from guidance.flight_time.primer_vector import find_primer_flight
from guidance.flight_time.search import TimeModel, TimeSearch
from guidance.flight_time.time_window import TimeWindow, guess_time, time_window

Array = NDArray[np.float64]

_THRUST_TOLERANCE = 5e-4  # relative; half of what a plan promises
_DIP = FLIGHT_TOLERANCE.thrust_dip
_COARSE_NODES = 13
_NEAR_DEAD_TIME = 0.97  # first steps are small where the guess is good
_MOST_REFINEMENTS = 8
_STEPS_FROM_EDGE = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)  # changes of a time that the true bounds refuse
_COARSE_TOLERANCE = 20.0  # of a bracket's search on the coarse mesh: J has kinks where burns meet its nodes
SHARE_TOLERANCE = 4e-6
"""Gain in ln(mass) below which the time search stops: 5 g of propellant at 1200 kg."""


@dataclass(frozen=True, eq=False)
class ConvexTask:
    """What is minimised, under which limits, on how many nodes; only the time of flight is left open.

    Attributes:
        problem: the landing problem.
        nodes: N.
        free_landing_point: whether the landing point may move in the target's plane.
        least_error: whether to minimise the landing error in place of the propellant.
        error_limit: [m] greatest landing error; None for none.
        limit_propellant: whether the dry mass bounds the flight (see `guidance.convex.scaling.scale_problem`).
        tolerance: of the conic solver.
        condense: whether to try the problem without its states first; False where the dual solution of the
            whole problem is wanted.
    """

    problem: LandingProblem
    nodes: int
    free_landing_point: bool = False
    least_error: bool = False
    error_limit: float | None = None
    limit_propellant: bool = False
    tolerance: float = 1e-8
    condense: bool = True

    def solve(self, time: float, log_mass: Array | None = None) -> ConvexSolution:
        """One conic solve; thrust bounds linearised at `log_mass` (any length), or outward if None."""
        if log_mass is not None and log_mass.size != self.nodes:
            shares = np.linspace(0.0, 1.0, log_mass.size)
            log_mass = np.interp(np.linspace(0.0, 1.0, self.nodes), shares, log_mass)
        chosen = ConstraintSet.of(self.problem, self.nodes, self.free_landing_point)
        scaled = scale_problem(
            self.problem, time, self.nodes, log_mass, self.error_limit, self.limit_propellant
        )
        if self.condense and chosen.can_condense:
            solution = convex_template(chosen, self.tolerance, condensed=True).solve(scaled)
            if solution.solved and keeps_altitude(solution.layout, solution.answer.primal):
                return solution
            if solution.answer.status is SolveStatus.INFEASIBLE:
                return solution
        return convex_template(chosen, self.tolerance).solve(scaled, self.least_error)

    def refine(self, solution: ConvexSolution, reference: Array | None = None) -> tuple[ConvexSolution, int]:
        """Linearise anew until the true thrust bounds hold.

        Args:
            solution: a solved answer of this task.
            reference: the log-mass it was linearised at; None if it was relaxed outward.

        Returns:
            The refined solution, unsolved if the bounds cannot be met; how many solves it took.
        """
        for solves in range(_MOST_REFINEMENTS):
            if not solution.solved or bounds_hold(self.problem, solution, reference):
                return solution, solves
            reference = solution.log_mass
            solution = self.solve(solution.time, reference)
        return solution, _MOST_REFINEMENTS


def bounds_hold(problem: LandingProblem, solution: ConvexSolution, reference: Array | None) -> bool:
    """Whether the true bounds on mass times acceleration hold, and no thrust is given away, to 0.05 %."""
    log_mass = solution.log_mass
    thrust = solution.answer.primal[solution.layout.slack] * np.exp(log_mass)  # share of the full thrust
    ratio = problem.lander.min_thrust / problem.lander.max_thrust
    if thrust.max() > 1.0 + _THRUST_TOLERANCE or thrust.min() < ratio * (1.0 - _THRUST_TOLERANCE):
        return False
    if reference is None:
        return True
    if reference.size != log_mass.size:
        return False
    return 0.5 * float(np.max((log_mass - reference) ** 2)) < _THRUST_TOLERANCE


def relaxation_tight(problem: LandingProblem, solution: ConvexSolution) -> bool:
    """Whether the thrust itself, not only its slack, keeps min_thrust and the pointing limit to 0.1 %.

    It does wherever the convexification is lossless. It may not where the time of flight is fixed and too
    long, where the engine's least thrust exceeds the weight, or where the thrust turns round from one node to
    the next and dips on the way.
    """
    push = solution.answer.primal[solution.layout.acceleration]
    size = np.linalg.norm(push, axis=1)
    ratio, limit = problem.lander.min_thrust / problem.lander.max_thrust, problem.lander.pointing_limit
    thrust = size * np.exp(solution.log_mass)
    if thrust.min() < ratio * (1.0 - 2.0 * _THRUST_TOLERANCE):
        return False
    if ratio > 0.0 and (_least_between(push) * np.exp(solution.log_mass[1:])).min() < ratio * (1.0 - _DIP):
        return False
    return pointing_excess(push, limit, 1.0) <= FLIGHT_TOLERANCE.pointing


def _least_between(push: Array) -> Array:
    """Least magnitude on the straight way from each row to the next, shape (N - 1,)."""
    way = np.diff(push, axis=0)
    length = np.maximum((way**2).sum(axis=1), 1e-300)
    share = np.clip(-(push[:-1] * way).sum(axis=1) / length, 0.0, 1.0)
    return np.linalg.norm(push[:-1] + share[:, None] * way, axis=1)


@dataclass(frozen=True, eq=False)
class TimeOutcome:
    """What a search over the time of flight found.

    Attributes:
        solution: the cheapest flight; None if no time tried was feasible.
        solves: conic solves that it took, coarse ones included.
        cause: the limit that leaves no time of flight, by closed-form bounds; empty if they leave one.
    """

    solution: ConvexSolution | None
    solves: int
    cause: str = ""


def _asymptote(task: ConvexTask) -> float:
    """Slope of the cost at long times: the price of hovering; unknown for a landing error."""
    if task.least_error:
        return 0.0
    return float(np.linalg.norm(task.problem.gravity)) / task.problem.lander.exhaust_velocity


def minimise_over_time(
    task: ConvexTask,
    tolerance: float = SHARE_TOLERANCE,
    guess: float | None = None,
    coarse_first: bool = True,
) -> TimeOutcome:
    """Search the time of flight of least cost.

    The indirect method guesses it, and one solve settles the matter where the dual solution says that no
    other time is better by more than the tolerance. Elsewhere the time, the thrust bounds' linearisation and
    the curvature of the cost come from a search on a coarse mesh first, so that one or two solves are left
    for the fine one.

    Args:
        task: what is solved at each time.
        tolerance: gain below which the search stops, in units of the task's cost.
        guess: [s] time to start from where the indirect method has none; None for coast and brake.
        coarse_first: False where the guess is good enough to go without the coarse mesh.
    """
    if not task.free_landing_point:
        outcome = _search_from_primer(task, tolerance)
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
    kind, share = (
        (BracketSearch, _COARSE_TOLERANCE) if task.problem.target_velocity.any() else (TimeSearch, 2.0)
    )
    if coarse_first and task.nodes > 1.5 * _COARSE_NODES:
        coarse = replace(task, nodes=_COARSE_NODES, tolerance=1e-6)
        search = kind(coarse.solve, window, share * tolerance, model)
        found = search.run(start)
        solves = len(search.samples)
        if found is not None:
            start, model = found.time, search.model
            if not bounds_hold(task.problem, found, None):
                refined, more = coarse.refine(found)
                solves += more
                reference = refined.log_mass if refined.solved else None
    search = kind(_evaluation(task, reference), window, tolerance, model)
    return TimeOutcome(search.run(start), solves + len(search.samples))


def minimise_with_true_bounds(
    task: ConvexTask, tolerance: float, near: float, known: ConvexSolution | None = None
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
    """
    solves, reference = 0, None if known is None else known.log_mass

    def evaluate(time: float) -> ConvexSolution:
        nonlocal solves, reference
        solution, more = _with_true_bounds(task, time, reference)
        solves += more
        if solution.solved:
            reference = solution.log_mass
        return solution

    window = time_window(task.problem, task.free_landing_point)
    model = TimeModel(_asymptote(task))
    if known is not None:
        return TimeOutcome(TimeSearch(evaluate, window, tolerance, model).run(near, known), solves)
    for step in _STEPS_FROM_EDGE:
        for time in (near * (1.0 + step), near / (1.0 + step)):
            if not window.low <= time <= window.high:
                continue
            first = evaluate(time)
            if first.solved:
                low, high = (near, window.high) if time > near else (window.low, near)
                search = TimeSearch(evaluate, TimeWindow(low, high), tolerance, model)
                best = search.run(time, first)
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
    if solution.solved and more == _MOST_REFINEMENTS:
        solution = replace(solution, answer=replace(solution.answer, status=SolveStatus.LIMIT_REACHED))
    return solution, solves


def _evaluation(task: ConvexTask, reference: Array | None) -> Callable[[float], ConvexSolution]:
    """Fixed-time solve with thrust bounds linearised at `reference`, or outward where that has no answer."""

    def evaluate(time: float) -> ConvexSolution:
        solution = task.solve(time, reference)
        return solution if solution.solved or reference is None else task.solve(time)

    return evaluate


def _search_from_primer(task: ConvexTask, tolerance: float) -> TimeOutcome | None:
    """Search from the indirect method's flight; None where it has none, or its time none on this mesh."""
    flight = find_primer_flight(task.problem)
    if flight is None:
        return None
    reference = flight.log_mass(task.nodes)
    first = task.solve(flight.time, reference)
    if not first.solved:
        return None
    model = TimeModel(_asymptote(task))
    if model.gain(first) < tolerance:
        return TimeOutcome(first, 1)
    window = time_window(task.problem)
    search = TimeSearch(_evaluation(task, reference), window, tolerance, model)
    return TimeOutcome(search.run(flight.time, first), len(search.samples))
