"""One task at a fixed time of flight, refined until the true thrust bounds hold; the checks of its answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.condensed import keeps_altitude
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.programme import ConvexSolution, ConvexTemplate, convex_template
from guidance.convex.scaling import ScaledProblem, scale_problem
from guidance.descent.problem import LandingProblem
from guidance.descent.residuals import FLIGHT_TOLERANCE
from guidance.descent.thrust_direction import final_thrust_excess, pointing_excess

_THRUST_TOLERANCE = 5e-4  # relative; half of what a plan promises
_RATE_TOLERANCE = 0.5 * FLIGHT_TOLERANCE.thrust_rate
_DIP = FLIGHT_TOLERANCE.thrust_dip
MOST_REFINEMENTS = 8
"""Linearisations of the thrust bounds before a time of flight is given up."""


@dataclass(frozen=True, eq=False)
class ConvexTask:
    """What is minimised, under which limits, on how many nodes; only the time of flight is left open.

    Attributes:
        problem: the landing problem.
        nodes: N.
        free_landing_point: whether the landing point may move in the target's plane.
        least_error: whether to minimise the landing error in place of the propellant.
        error_limit: [m] greatest landing error; None for none.
        error_price: [1/m] what a landing error costs beside the propellant, in ln(mass).
        limit_propellant: whether the dry mass bounds the flight (see `guidance.convex.scaling`).
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
    error_price: float = 0.0

    def solve(self, time: float, log_mass: Array | None = None) -> ConvexSolution:
        """One conic solve; thrust bounds linearised at `log_mass` (any length), or outward if None."""
        if log_mass is not None and log_mass.size != self.nodes:
            fractions = np.linspace(0.0, 1.0, log_mass.size)
            log_mass = np.interp(np.linspace(0.0, 1.0, self.nodes), fractions, log_mass)
        chosen = ConstraintSet.of(self.problem, self.nodes, self.free_landing_point)
        scaled = scale_problem(
            self.problem, time, self.nodes, log_mass, self.error_limit, self.limit_propellant
        )
        if self.condense and chosen.can_condense:
            solution = self.ask(convex_template(chosen, self.tolerance, condensed=True), scaled)
            if solution.solved and keeps_altitude(solution.layout, solution.answer.primal):
                return solution
            if solution.answer.status is SolveStatus.INFEASIBLE:
                return solution
        return self.ask(convex_template(chosen, self.tolerance), scaled)

    def ask(self, template: ConvexTemplate, scaled: ScaledProblem) -> ConvexSolution:
        """Have one programme solved; a comparison of solvers puts another one here."""
        return template.solve(scaled, self.least_error, self.error_price)

    def refine(self, solution: ConvexSolution, reference: Array | None = None) -> tuple[ConvexSolution, int]:
        """Linearise anew until the true thrust bounds hold.

        Args:
            solution: a solved answer of this task.
            reference: the log-mass it was linearised at; None if it was relaxed outward.

        Returns:
            The refined solution, unsolved if the bounds cannot be met; how many solves it took.
        """
        for solves in range(MOST_REFINEMENTS):
            if not solution.solved or bounds_hold(self.problem, solution, reference):
                return solution, solves
            reference = solution.log_mass
            solution = self.solve(solution.time, reference)
        return solution, MOST_REFINEMENTS


def bounds_hold(problem: LandingProblem, solution: ConvexSolution, reference: Array | None) -> bool:
    """Whether the true bounds on mass times acceleration hold, and no thrust is given away, to 0.05 %.

    Its change per second is held to 0.5 %.
    """
    log_mass = solution.log_mass
    thrust = solution.answer.primal[solution.layout.slack] * np.exp(log_mass)  # share of the full thrust
    ratio = problem.lander.min_thrust / problem.lander.max_thrust
    if thrust.max() > 1.0 + _THRUST_TOLERANCE or thrust.min() < ratio * (1.0 - _THRUST_TOLERANCE):
        return False
    if not _rate_holds(problem, solution):
        return False
    if reference is None:
        return True
    if reference.size != log_mass.size:
        return False
    return 0.5 * float(np.max((log_mass - reference) ** 2)) < _THRUST_TOLERANCE


def _rate_holds(problem: LandingProblem, solution: ConvexSolution) -> bool:
    """Whether the thrust changes from node to node no faster than it may, to 0.5 %."""
    limit = problem.limits.thrust_rate
    if limit is None:
        return True
    share = solution.answer.primal[solution.layout.acceleration] * np.exp(solution.log_mass)[:, None]
    step = np.linalg.norm(np.diff(share, axis=0), axis=1).max() * problem.lander.max_thrust
    return bool(step * (share.shape[0] - 1) <= (1.0 + _RATE_TOLERANCE) * limit * solution.time)


def relaxation_tight(problem: LandingProblem, solution: ConvexSolution) -> bool:
    """Whether the thrust itself, not only its slack, keeps min_thrust and its direction's limits to 0.1 %.

    It does wherever the convexification is lossless. It may not where the time of flight is fixed and too
    long, where the engine's least thrust exceeds the weight, or where the thrust turns round from one node to
    the next and dips on the way.
    """
    acceleration = solution.answer.primal[solution.layout.acceleration]
    size = np.linalg.norm(acceleration, axis=1)
    ratio, limit = problem.lander.min_thrust / problem.lander.max_thrust, problem.lander.pointing_limit
    thrust = size * np.exp(solution.log_mass)
    if thrust.min() < ratio * (1.0 - 2.0 * _THRUST_TOLERANCE):
        return False
    between = _least_between(acceleration) * np.exp(solution.log_mass[1:])
    if ratio > 0.0 and between.min() < ratio * (1.0 - _DIP):
        return False
    if final_thrust_excess(acceleration, problem, 1.0) > FLIGHT_TOLERANCE.pointing:
        return False
    return pointing_excess(acceleration, limit, 1.0) <= FLIGHT_TOLERANCE.pointing


def _least_between(acceleration: Array) -> Array:
    """Least magnitude on the straight way from each row to the next, shape (N - 1,)."""
    way = np.diff(acceleration, axis=0)
    length = np.maximum((way**2).sum(axis=1), 1e-300)
    fraction = np.clip(-(acceleration[:-1] * way).sum(axis=1) / length, 0.0, 1.0)
    return np.linalg.norm(acceleration[:-1] + fraction[:, None] * way, axis=1)
