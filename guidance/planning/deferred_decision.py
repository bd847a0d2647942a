"""Deferred-decision trajectory optimisation: one trunk, and a branch from it to each candidate site.

The branches share the first nodes of the flight: state, mass and thrust are the same variables there. Each
candidate may cost no more than its own cheapest flight of the same time and a budget. The longest trunk that
this allows keeps every candidate open for as long as possible; of the flights that have it, the one of least
expected propellant is given. More shared nodes are more constraints, so the longest trunk is found by a
search outward from a likely length, one second-order cone programme a step.

Source: Elango, Sarsilmaz and Acikmese, "Deferred-decision trajectory optimization", 2025; Hayner, Buckner et
al., "HALO: hazard-aware landing optimization for autonomous systems", ICRA 2023.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.convex.branched_programme import solve_branches
from guidance.convex.clarabel_solver import SolveStatus
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.programme import ConvexSolution
from guidance.convex.scaling import scale_problem
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import forbidden_by
from guidance.planning.convex_task import ConvexTask, bounds_hold
from guidance.validation import finite_number, finite_vector

METHOD = "deferred decision"
_MOST_REFINEMENTS = 4
_LEAST_WEIGHT = 1e-2  # in the expected propellant, so that no branch is left without a price
_LIKELY_SHARE = 0.75  # of the flight that is shared, where nothing is known of it
_SLACK = 1e-7  # in ln(mass), on each budget: rounding of the solver


@dataclass(frozen=True, eq=False)
class TrunkOptions:
    """How a trunk is planned.

    Attributes:
        nodes: N of every branch, trunk included.
        weights: shape (k,), chance that each candidate will be the one; None for equal chances.
        parting_time: [s] when the branches will part, as far as is known: the search starts there. It changes
            nothing but the time that the search takes.
    """

    nodes: int = 21
    weights: ArrayLike | None = None
    parting_time: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        finite_number("nodes", self.nodes, at_least=3)
        if self.parting_time is not None:
            finite_number("parting_time", self.parting_time)


@dataclass(frozen=True, eq=False)
class DeferredDecision:
    """A trunk with a branch to each candidate.

    Attributes:
        plans: one for each candidate, in order; equal up to node `shared_nodes` - 1. Empty where the
            candidates cannot all be reached in the time.
        shared_nodes: nodes of the trunk; 0 where the flights have nothing in common but the start.
        unreachable: numbers of the candidates that cannot be reached in the time, alone.
        solves: conic programmes solved.
    """

    plans: tuple[Plan, ...]
    shared_nodes: int
    unreachable: tuple[int, ...]
    solves: int

    @property
    def parting_time(self) -> float:
        """[s] time at which the branches part; 0 without a trunk."""
        return float(self.plans[0].time[self.shared_nodes - 1]) if self.shared_nodes else 0.0


@dataclass(frozen=True, eq=False)
class _Question:
    """One call: the candidates' problems, their numbers with the budgets, their weights, a likely trunk."""

    problems: list[LandingProblem]
    time: float
    nodes: int
    limits: list[float]
    weights: Array
    likely: int

    def solve(self, shared_nodes: int, log_mass: list[Array]) -> list[ConvexSolution] | None:
        """Branches that share some nodes; thrust bounds linearised at the log-masses."""
        scaled = []
        for problem, limit, history in zip(self.problems, self.limits, log_mass, strict=True):
            numbers = scale_problem(problem, self.time, self.nodes, history)
            scaled.append(replace(numbers, propellant=limit / numbers.kappa))
        chosen = ConstraintSet.of(self.problems[0], self.nodes)
        return solve_branches(chosen, shared_nodes, scaled, self.weights)

    def refine(
        self, shared_nodes: int, solutions: list[ConvexSolution], log_mass: list[Array]
    ) -> tuple[list[ConvexSolution] | None, int]:
        """Linearise anew until the true thrust bounds hold on every branch; how many solves it took."""
        for solves in range(_MOST_REFINEMENTS):
            pairs = zip(self.problems, solutions, log_mass, strict=True)
            if all(bounds_hold(problem, solution, history) for problem, solution, history in pairs):
                return solutions, solves
            log_mass = [solution.log_mass for solution in solutions]
            found = self.solve(shared_nodes, log_mass)
            if found is None:
                return None, solves + 1
            solutions = found
        return None, _MOST_REFINEMENTS


def plan_deferred(
    problem: LandingProblem,
    targets: ArrayLike,
    budget: float,
    time_of_flight: float,
    options: TrunkOptions = TrunkOptions(),
) -> DeferredDecision:
    """Keep every candidate open for as long as a budget of propellant allows.

    Args:
        problem: the landing problem; of its target only the altitude counts.
        targets: [m] shape (k, 3), the candidates, all at the altitude of the problem's target.
        budget: [kg] by which each branch may exceed that candidate's cheapest flight of the same time.
        time_of_flight: [s] of every branch.
        options: nodes, weights, and what is known of the trunk.

    Returns:
        The trunk and its branches.

    Raises:
        ValueError: an argument is out of range or of the wrong shape.
    """
    sites = np.atleast_2d(np.asarray(targets, dtype=np.float64))
    if sites.ndim != 2 or sites.shape[1] != 3 or not np.isfinite(sites).all():
        raise ValueError(f"targets must be finite, of shape (k, 3), got shape {sites.shape}")
    if np.abs(sites[:, 2] - problem.target[2]).max() > 1e-6:
        raise ValueError("targets must lie at the altitude of the problem's target")
    finite_number("budget", budget, at_least=0.0)
    finite_number("time_of_flight", time_of_flight, above=0.0)
    nodes, weights = options.nodes, options.weights
    chances = np.ones(len(sites)) if weights is None else finite_vector("weights", weights, len(sites))
    if (chances < 0.0).any() or not chances.any():
        raise ValueError("weights must not be negative, and not all zero")
    chances = np.maximum(chances / chances.sum(), _LEAST_WEIGHT)
    problems = [replace(problem, target=site) for site in sites]
    alone, solves = _cheapest_alone(problems, time_of_flight, nodes)
    missing = tuple(
        k
        for k, (own, solution) in enumerate(zip(problems, alone, strict=True))
        if not solution.solved or forbidden_by(own, time_of_flight)
    )
    if missing:
        return DeferredDecision((), 0, missing, solves)
    extra = -np.log1p(-budget / problem.state.mass)
    limits = [min(part.log_mass_ratio + extra, problem.log_mass_ratio) + _SLACK for part in alone]
    parting = _LIKELY_SHARE * time_of_flight if options.parting_time is None else options.parting_time
    likely = 1 + math.ceil(parting / time_of_flight * (nodes - 1))  # seen nearer, branches part later
    question = _Question(problems, time_of_flight, nodes, limits, chances / chances.sum(), likely)
    shared, flights, more = _longest_trunk(question, alone)
    plans = tuple(
        Plan.of_flight(
            PlanStatus.OPTIMAL, own, METHOD, flight.trajectory(problems[0] if shared else own), solves + more
        )
        for own, flight in zip(problems, flights, strict=True)
    )
    return DeferredDecision(plans, shared, (), solves + more)


def _cheapest_alone(
    problems: list[LandingProblem], time: float, nodes: int
) -> tuple[list[ConvexSolution], int]:
    """Each candidate's own cheapest flight with the propellant on board, with the true thrust bounds."""
    out, solves = [], 0
    for problem in problems:
        task = ConvexTask(problem, nodes)
        solution, more = task.refine(task.solve(time))
        solves += 1 + more
        if solution.solved and solution.log_mass_ratio > problem.log_mass_ratio + _SLACK:
            solution = replace(solution, answer=replace(solution.answer, status=SolveStatus.INFEASIBLE))
        out.append(solution)
    return out, solves


def _longest_trunk(question: _Question, alone: list[ConvexSolution]) -> tuple[int, list[ConvexSolution], int]:
    """Most nodes that can be shared, the flights that share them, and the solves it took."""
    log_mass = [solution.log_mass for solution in alone]
    longest, flights, solves = 0, alone, 0

    def shareable(nodes: int) -> bool:
        nonlocal longest, flights, solves
        found = question.solve(nodes, log_mass)
        solves += 1
        if found is not None:
            found, more = question.refine(nodes, found, log_mass)
            solves += more
        if found is None:
            return False
        if nodes > longest:
            longest, flights = nodes, found
        return True

    low, high = 0, 1 + (question.nodes if len(alone) == 1 else question.nodes - 1)
    most, nodes, tried = high, min(max(question.likely, 1), high - 1), 0
    while high - low > 1:
        if shareable(nodes):
            low = nodes
        else:
            high = nodes
        if low == 0 or high == most:  # one end is not known yet
            stride = 1 << max(tried - 1, 0)  # 1, 1, 2, 4, ...
            nodes = max(high - stride, 1) if low == 0 else min(low + stride, most - 1)
            tried += 1
        else:
            nodes = (low + high) // 2
    return longest, flights, solves
