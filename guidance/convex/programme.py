"""Least propellant (or least landing error) at a fixed time of flight, as a second-order cone programme.

Assembled straight into Clarabel. One solver is built per (nodes, constraint set) from fixed nominal numbers
and kept for the process; every solve replaces all numbers, so an answer has the same bits whatever was
solved before.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from guidance.arrays import Array
from guidance.convex import constraints
from guidance.convex.clarabel_solver import ConicAnswer, ConicSolver, SolveStatus
from guidance.convex.condensed import CondensedLayout, burnt_mass, expand
from guidance.convex.constraint_set import ConstraintSet, Family
from guidance.convex.constraints import Rows
from guidance.convex.layout import Layout
from guidance.convex.scaling import ScaledProblem, scale_problem
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.state import State

_CONSTANT_FAMILIES: frozenset[Family] = frozenset(
    {burnt_mass, constraints.altitude_floor, constraints.thrust_cone}
)


@dataclass(frozen=True, eq=False)
class ConvexSolution:
    """Answer of one fixed-time solve.

    Attributes:
        answer: the conic solver's answer, in scaled units; its dual solution belongs to `rows`.
        layout: indices into the primal one.
        scaled: the numbers it was solved with.
        rows: the constraint rows it was solved with, condensed or whole.
        value: what was minimised: ln(start mass / final mass), or the landing error [m].
        slope: derivative of `value` with respect to the time of flight, from the dual solution.
    """

    answer: ConicAnswer
    layout: Layout
    scaled: ScaledProblem
    rows: list[Rows]
    value: float
    slope: float

    @property
    def solved(self) -> bool:
        """Whether there is an optimum."""
        return self.answer.status is SolveStatus.SOLVED

    @property
    def time(self) -> float:
        """[s] time of flight."""
        return self.scaled.time

    @cached_property
    def log_mass(self) -> Array:
        """ln(m / m_start) at the nodes, shape (N,)."""
        return self.scaled.kappa * self.answer.primal[self.layout.log_mass]

    @property
    def propellant_share(self) -> float:
        """ln(start mass / final mass)."""
        return -float(self.log_mass[-1])

    @property
    def landing_error(self) -> float:
        """[m] distance between landing point and target, in the target's plane."""
        return float(np.linalg.norm(self.answer.primal[self.layout.position[-1, :2]])) * self.scaled.length

    def trajectory(self, problem: LandingProblem) -> Trajectory:
        """The flight in SI and the site frame."""
        primal, layout, scaled = self.answer.primal, self.layout, self.scaled
        mass = problem.state.mass * np.exp(self.log_mass)
        position = primal[layout.position] * scaled.length + problem.target
        velocity = primal[layout.velocity] * (scaled.acceleration * scaled.time)
        position[0], velocity[0], mass[0] = problem.state.position, problem.state.velocity, problem.state.mass
        thrust = primal[layout.acceleration] * scaled.acceleration * mass[:, None]
        time = np.linspace(0.0, scaled.time, layout.nodes)
        return Trajectory(time, position, velocity, mass, thrust, problem.lander.exhaust_velocity)


class ConvexTemplate:
    """The assembled problem of one ConstraintSet."""

    def __init__(
        self, constraint_set: ConstraintSet, tolerance: float = 1e-8, condensed: bool = False
    ) -> None:
        """Fix sparsity and scaling from nominal numbers that no caller can change.

        Args:
            constraint_set: what is asked.
            tolerance: of the conic solver.
            condensed: leave out the states, and with them the altitude floor.
        """
        from scipy.sparse import csc_matrix

        self._whole = Layout(constraint_set.nodes, constraint_set.free_landing_point)
        self._condensed = CondensedLayout(constraint_set.nodes) if condensed else None
        self.layout = self._condensed or self._whole
        self._families = constraint_set.condensed_families if condensed else constraint_set.families
        self._constant: dict[Family, Rows] = {}
        nominal = nominal_numbers(constraint_set.nodes)
        rows = self.rows(nominal)
        for family in _CONSTANT_FAMILIES.intersection(self._families):
            self._constant[family] = family(self.layout, nominal)
        first = np.cumsum([0] + [part.bound.size for part in rows])
        moves = [(bool(part.value_power.any()), bool(part.bound_rate.any())) for part in rows]
        self._timed = [(k, int(first[k]), *move) for k, move in enumerate(moves) if any(move)]
        self._row = np.concatenate([part.row + offset for part, offset in zip(rows, first, strict=False)])
        self._column = np.concatenate([part.column for part in rows])
        self._order = np.lexsort((self._row, self._column))
        counts = np.bincount(self._column, minlength=self.layout.size)
        pointer = np.concatenate([[0], np.cumsum(counts)])
        values, bound = self._numbers(rows)
        shape = (int(first[-1]), self.layout.size)
        matrix = csc_matrix((values[self._order], self._row[self._order], pointer), shape=shape)
        self._assembled = matrix, bound, self.cost(False), cones_of(rows), tolerance
        self._solver = ConicSolver(*self._assembled)
        self._careful: ConicSolver | None = None

    def rows(self, scaled: ScaledProblem) -> list[Rows]:
        """Constraint rows for given numbers."""
        return [self._constant.get(family) or family(self.layout, scaled) for family in self._families]

    @staticmethod
    def _numbers(rows: list[Rows]) -> tuple[Array, Array]:
        return np.concatenate([part.value for part in rows]), np.concatenate([part.bound for part in rows])

    def cost(self, least_error: bool) -> Array:
        """Cost vector: the landing error, or the negative final log-mass."""
        cost = np.zeros(self.layout.size)
        if least_error:
            cost[self._whole.landing_error] = 1.0
        else:
            cost[self.layout.log_mass[-1]] = -1.0
        return cost

    def solve(self, scaled: ScaledProblem, least_error: bool = False) -> ConvexSolution:
        """Solve with new numbers."""
        rows = self.rows(scaled)
        values, bound = self._numbers(rows)
        cost = self.cost(least_error)
        answer = self._solver.solve(values[self._order], bound, cost)
        unsure = answer.status in (SolveStatus.FAILED, SolveStatus.LIMIT_REACHED)
        if unsure and self._condensed is None:
            self._careful = self._careful or ConicSolver(*self._assembled, refine=True)
            answer = self._careful.solve(values[self._order], bound, cost)
        if answer.status is not SolveStatus.SOLVED:
            return ConvexSolution(answer, self._whole, scaled, rows, np.nan, np.nan)
        unit, power = (scaled.length, 2) if least_error else (scaled.kappa, 1)
        value = float(cost @ answer.primal)
        sensitivity = self._sensitivity(rows, answer)
        slope = unit * (power * value + sensitivity) / scaled.time
        if self._condensed is not None:
            answer = replace(answer, primal=expand(self._condensed, scaled, answer.primal))
        return ConvexSolution(answer, self._whole, scaled, rows, unit * value, slope)

    def _sensitivity(self, rows: list[Rows], answer: ConicAnswer) -> float:
        """T d(optimum)/dT at fixed units: dual' (T dA/dT x - T db/dT), each number being a power of T."""
        total = 0.0
        for index, first, value_moves, bound_moves in self._timed:
            part = rows[index]
            dual = answer.dual[first : first + part.bound.size]
            if value_moves:
                weight = part.value_power * part.value * answer.primal[part.column]
                total += float(dual[part.row] @ weight)
            if bound_moves:
                total -= float((dual * part.bound_rate).sum())
        return total


def cones_of(rows: list[Rows]) -> tuple[tuple[str, int], ...]:
    """(name, size) of each cone that the rows stand in, in their order."""
    cones: list[tuple[str, int]] = []
    for part in rows:
        if part.cone == "second_order":
            cones += [(part.cone, part.cone_size)] * (part.bound.size // part.cone_size)
        else:
            cones.append((part.cone, part.bound.size))
    return tuple(cones)


def nominal_numbers(nodes: int) -> ScaledProblem:
    """Numbers of the size that a descent has; only the solver's internal scaling depends on them."""
    from guidance.constants import MOON_GRAVITY
    from guidance.lander import Lander

    problem = LandingProblem(
        State(np.array([200.0, 100.0, 900.0]), np.array([-8.0, -4.0, -30.0]), 1200.0),
        np.zeros(3),
        Lander(min_thrust=1000.0, pointing_limit=1.0),
        np.array(MOON_GRAVITY),
        glide_slope_limit=1.0,
        speed_limit=100.0,
        target_velocity=np.array([2.0, 1.0, -5.0]),
    )
    return scale_problem(problem, 30.0, nodes)


class _TemplateCache(threading.local):
    """Templates of one thread: a solver object must not be shared while it solves."""

    def __init__(self) -> None:
        self.templates: dict[tuple[ConstraintSet, float, bool], ConvexTemplate] = {}


_CACHE = _TemplateCache()


def convex_template(
    constraint_set: ConstraintSet, tolerance: float = 1e-8, condensed: bool = False
) -> ConvexTemplate:
    """The assembled problem for a constraint set: built once per thread, then kept."""
    key = (constraint_set, tolerance, condensed)
    template = _CACHE.templates.get(key)
    if template is None:
        template = _CACHE.templates[key] = ConvexTemplate(*key)
    return template
