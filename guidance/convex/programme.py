"""Least propellant (or least landing error) at a fixed time of flight, as a second-order cone programme.

One programme is assembled per (nodes, constraint set) and kept for the thread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.convex import constraints
from guidance.convex.assembly import Assembly, nominal_numbers, once_per_thread
from guidance.convex.clarabel_solver import DEFAULT_TOLERANCE, ConicAnswer, SolveStatus
from guidance.convex.condensed import burnt_mass, expand
from guidance.convex.constraint_set import ConstraintSet, Family
from guidance.convex.constraints import Rows
from guidance.convex.layout import CondensedLayout, Layout
from guidance.convex.scaling import ScaledProblem
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory

CONSTANT_FAMILIES: frozenset[Family] = frozenset(
    {burnt_mass, constraints.altitude_floor, constraints.thrust_cone}
)
"""Those whose rows are the same at every solve."""


@dataclass(frozen=True, eq=False)
class ConvexSolution:
    """Answer of one fixed-time solve.

    Attributes:
        answer: the conic solver's answer, in scaled units; its dual solution belongs to `rows`.
        layout: indices into the primal one.
        scaled: the numbers it was solved with.
        rows: the constraint rows it was solved with, condensed or whole.
        value: what was minimised: ln(start mass / final mass), with the price of the landing error where it
            has one; or the landing error [m].
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
    def log_mass_ratio(self) -> float:
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


class _Timed(NamedTuple):
    """A part of the rows that depends on the time of flight: its number, its first row, and what depends."""

    part: int
    first_row: int
    values_move: bool
    bounds_move: bool


class ConvexTemplate:
    """The assembled problem of one ConstraintSet."""

    def __init__(
        self, constraint_set: ConstraintSet, tolerance: float = DEFAULT_TOLERANCE, condensed: bool = False
    ) -> None:
        """Assemble it from nominal numbers.

        Args:
            constraint_set: what is asked.
            tolerance: of the conic solver.
            condensed: leave out the states, and with them the altitude floor.
        """
        self._whole = Layout(constraint_set.nodes, constraint_set.free_landing_point)
        self._condensed = CondensedLayout(constraint_set.nodes) if condensed else None
        self.layout = self._condensed or self._whole
        self._families = constraint_set.condensed_families if condensed else constraint_set.families
        self._constant: dict[Family, Rows] = {}
        nominal = nominal_numbers(constraint_set.nodes)
        rows = self.rows(nominal)
        for family in CONSTANT_FAMILIES.intersection(self._families):
            self._constant[family] = family(self.layout, nominal)
        self._assembly = Assembly(rows, self.cost(False), tolerance)
        timed = [
            _Timed(k, int(first), bool(part.value_power.any()), bool(part.bound_rate.any()))
            for k, (part, first) in enumerate(zip(rows, self._assembly.first, strict=False))
        ]
        self._timed = [part for part in timed if part.values_move or part.bounds_move]

    def rows(self, scaled: ScaledProblem) -> list[Rows]:
        """Constraint rows for given numbers."""
        return [self._constant.get(family) or family(self.layout, scaled) for family in self._families]

    def cost(self, least_error: bool, price: float = 0.0) -> Array:
        """Cost vector: the landing error, or the negative final log-mass and the landing error at a price."""
        cost = np.zeros(self.layout.size)
        if least_error:
            cost[self._whole.landing_error] = 1.0
        else:
            cost[self.layout.log_mass[-1]] = -1.0
        if price > 0.0:
            cost[self._whole.landing_error] = price
        return cost / (1.0 + price)

    def solve(
        self, scaled: ScaledProblem, least_error: bool = False, error_price: float = 0.0
    ) -> ConvexSolution:
        """Solve with new numbers.

        Args:
            scaled: the numbers.
            least_error: whether to minimise the landing error in place of the propellant.
            error_price: [1/m] what a landing error costs beside the propellant, in ln(mass).
        """
        price = error_price * scaled.length / scaled.kappa
        rows, cost = self.rows(scaled), self.cost(least_error, price)
        answer = self._assembly.solve(rows, cost)
        unsure = answer.status in (SolveStatus.FAILED, SolveStatus.LIMIT_REACHED)
        if unsure and self._condensed is None:
            answer = self._assembly.solve(rows, cost, refine=True)
        return self.read_answer(scaled, rows, answer, least_error, price)

    def read_answer(
        self,
        scaled: ScaledProblem,
        rows: list[Rows],
        answer: ConicAnswer,
        least_error: bool = False,
        price: float = 0.0,
    ) -> ConvexSolution:
        """What a conic solver's answer to `rows(scaled)` and `cost(least_error, price)` says."""
        if answer.status is not SolveStatus.SOLVED:
            return ConvexSolution(answer, self._whole, scaled, rows, np.nan, np.nan)
        cost = self.cost(least_error, price)
        unit, power = (scaled.length, 2) if least_error else (scaled.kappa * (1.0 + price), 1)
        value = float(cost @ answer.primal)
        sensitivity = self._sensitivity(rows, answer)
        if price > 0.0:  # it goes with the time of flight
            sensitivity += float(cost[self._whole.landing_error] * answer.primal[self._whole.landing_error])
        slope = unit * (power * value + sensitivity) / scaled.time
        if self._condensed is not None:
            answer = replace(answer, primal=expand(self._condensed, scaled, answer.primal))
        return ConvexSolution(answer, self._whole, scaled, rows, unit * value, slope)

    def _sensitivity(self, rows: list[Rows], answer: ConicAnswer) -> float:
        """T d(optimum)/dT at fixed units: dual' (T dA/dT x - T db/dT), each number being a power of T."""
        total = 0.0
        for timed in self._timed:
            part = rows[timed.part]
            dual = answer.dual[timed.first_row : timed.first_row + part.bound.size]
            if timed.values_move:
                weight = part.value_power * part.value * answer.primal[part.column]
                total += float(dual[part.row] @ weight)
            if timed.bounds_move:
                total -= float((dual * part.bound_rate).sum())
        return total


@once_per_thread
def _kept_template(key: tuple[ConstraintSet, float, bool]) -> ConvexTemplate:
    return ConvexTemplate(*key)


def convex_template(
    constraint_set: ConstraintSet, tolerance: float = DEFAULT_TOLERANCE, condensed: bool = False
) -> ConvexTemplate:
    """The assembled problem for a constraint set: built once per thread, then kept."""
    return _kept_template((constraint_set, tolerance, condensed))
