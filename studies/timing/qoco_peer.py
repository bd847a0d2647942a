"""The conic solver QOCO (PyPI `qoco`, C) on the cone programmes of solve_pdg: solver against solver.

Rows, units, mesh, search of the time of flight and refinements of the thrust bounds are those of
`guidance.convex` and `guidance.planning`, for both solvers alike; proofs, fallbacks and the flight that
solve_pdg makes before it calls a plan optimal are left out for both. Each keeps its object for a sparsity and
gets new numbers, and has the same tolerance. QOCO (0.3.2) has no status for an infeasible programme: it ends
at its iteration limit or in a numerical error, or calls it solved inaccurately. After anything but a solution
its object is dropped.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from guidance.arrays import Array
from guidance.convex.assembly import cones_of
from guidance.convex.clarabel_solver import ConicAnswer, SolveStatus
from guidance.convex.constraints import Rows
from guidance.convex.programme import ConvexSolution, ConvexTemplate
from guidance.convex.scaling import ScaledProblem
from guidance.descent.plan import Plan, PlanStatus
from guidance.descent.problem import LandingProblem
from guidance.planning.convex_task import ConvexTask
from guidance.planning.minimum_propellant import minimise_over_time
from studies.timing.first_time import first_time

QOCO_PACKAGE = "qoco"
QOCO_METHOD = "QOCO, own matrices"
CLARABEL_METHOD = "Clarabel, own matrices"
_STATUSES = {
    "QOCO_SOLVED": SolveStatus.SOLVED,
    "QOCO_SOLVED_INACCURATE": SolveStatus.LIMIT_REACHED,
    "QOCO_MAX_ITER": SolveStatus.LIMIT_REACHED,
}
_WITHOUT_FLIGHT = {
    SolveStatus.INFEASIBLE: PlanStatus.INFEASIBLE,
    SolveStatus.LIMIT_REACHED: PlanStatus.LIMIT_REACHED,
}


def qoco_present() -> bool:
    """Whether the package is installed (optional extra `peers`)."""
    return importlib.util.find_spec(QOCO_PACKAGE) is not None


class QocoSolver:
    """A QOCO solver of fixed sparsity: minimise q'x subject to A x = b, h - G x in the cones."""

    def __init__(self, rows: list[Rows], cost: Array, tolerance: float) -> None:
        """Assemble from rows of `guidance.convex`, linear ones before cones of second order.

        Raises:
            ImportError: the package is not installed.
        """
        from scipy.sparse import csc_matrix

        self._equal = np.concatenate([np.full(part.bound.size, part.cone == "zero") for part in rows])
        place = np.where(self._equal, np.cumsum(self._equal), np.cumsum(~self._equal)) - 1
        first = np.cumsum([0] + [part.bound.size for part in rows])
        row = np.concatenate([part.row + offset for part, offset in zip(rows, first, strict=False)])
        column = np.concatenate([part.column for part in rows])
        order = np.lexsort((row, column))
        in_equal = self._equal[row[order]]
        self._orders = order[in_equal], order[~in_equal]
        values, bound = self._numbers(rows)
        counts = int(self._equal.sum()), int((~self._equal).sum())
        matrices = []
        for chosen, data, count in zip(self._orders, values, counts, strict=True):
            pointer = np.concatenate([[0], np.cumsum(np.bincount(column[chosen], minlength=cost.size))])
            matrices.append(csc_matrix((data, place[row[chosen]], pointer), shape=(count, cost.size)))
        cones = [(kind, size) for kind, size in cones_of(rows) if kind != "zero"]
        linear = sum(size for kind, size in cones if kind == "nonnegative")
        second_order = np.array([size for kind, size in cones if kind == "second_order"])
        self._solver = importlib.import_module(QOCO_PACKAGE).QOCO()
        self._solver.setup(
            cost.size, counts[1], counts[0], None, cost, matrices[0], bound[0], matrices[1], bound[1],
            linear, second_order.size, second_order, abstol=tolerance, reltol=tolerance,
        )  # fmt: skip

    def _numbers(self, rows: list[Rows]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Stored entries and bounds, of the equalities and of the cones."""
        values = np.concatenate([part.value for part in rows])
        bound = np.concatenate([part.bound for part in rows])
        equal, conic = self._orders
        return (values[equal], values[conic]), (bound[self._equal], bound[~self._equal])

    def solve(self, rows: list[Rows], cost: Array) -> ConicAnswer:
        """Solve with new numbers; the dual solution stands in the order of the rows, as Clarabel's."""
        (equal, conic), (b, h) = self._numbers(rows)
        self._solver.update_vector_data(c=cost, b=b, h=h)
        self._solver.update_matrix_data(A=equal, G=conic)
        found: Any = self._solver.solve()
        dual = np.empty(self._equal.size)
        dual[self._equal], dual[~self._equal] = found.y, found.z
        status, primal = _STATUSES.get(found.status, SolveStatus.FAILED), np.array(found.x)
        if status is SolveStatus.SOLVED and not np.isfinite(primal).all():
            status = SolveStatus.FAILED
        return ConicAnswer(status, primal, dual, int(found.iters), found.status)


@dataclass(frozen=True, eq=False)
class QocoTask(ConvexTask):
    """A task whose cone programmes QOCO solves.

    Attributes:
        solvers: kept for each programme.
    """

    solvers: dict[ConvexTemplate, QocoSolver] = field(default_factory=dict)

    def ask(self, template: ConvexTemplate, scaled: ScaledProblem) -> ConvexSolution:
        """Have one programme solved."""
        price = self.error_price * scaled.length / scaled.kappa
        rows, cost = template.rows(scaled), template.cost(self.least_error, price)
        if template not in self.solvers:
            self.solvers[template] = QocoSolver(rows, cost, self.tolerance)
        answer = self.solvers[template].solve(rows, cost)
        if answer.status is not SolveStatus.SOLVED:
            del self.solvers[template]
        return template.read_answer(scaled, rows, answer, self.least_error, price)


def plan_by_cones(task: ConvexTask, method: str, time_of_flight: float | None) -> Plan:
    """Least propellant by the cone programmes of a task alone, whoever solves them.

    Returns:
        A plan that is OPTIMAL within the true thrust bounds, or one without a flight. INFEASIBLE is the
        solver's word, or means that the tank does not suffice; neither is proved here.
    """
    problem = task.problem
    if time_of_flight is None:
        outcome = minimise_over_time(task)
        found, solves = outcome.solution, outcome.solves
        if found is None:  # no time of flight: the solver shall say so itself
            found, solves = task.solve(first_time(problem)), solves + 1
    else:
        found, solves = task.solve(time_of_flight), 1
    solution, more = task.refine(found)
    none = Plan(PlanStatus.INFEASIBLE, problem, method, message=solution.answer.words, solves=solves + more)
    if not solution.solved:
        status = _WITHOUT_FLIGHT.get(solution.answer.status, PlanStatus.SOLVER_FAILED)
        return Plan(status, problem, method, message=none.message, solves=none.solves)
    if solution.log_mass_ratio > problem.log_mass_ratio:
        needed = -problem.state.mass * math.expm1(-solution.log_mass_ratio)
        words = f"the cheapest flight found needs {needed:.2f} kg of propellant"
        return Plan(none.status, problem, method, message=words, solves=none.solves)
    return Plan.of_flight(PlanStatus.OPTIMAL, problem, method, solution.trajectory(problem), none.solves)


def plan_clarabel(problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
    """As `plan_by_cones`, by Clarabel."""
    return plan_by_cones(ConvexTask(problem, nodes), CLARABEL_METHOD, time_of_flight)


@dataclass(frozen=True, eq=False)
class QocoPlanner:
    """As `plan_by_cones`, by QOCO.

    Attributes:
        solvers: kept from plan to plan.
    """

    solvers: dict[ConvexTemplate, QocoSolver] = field(default_factory=dict)

    def plan(self, problem: LandingProblem, nodes: int, time_of_flight: float | None = None) -> Plan:
        """Least propellant to the target.

        Raises:
            ImportError: the package is not installed.
        """
        task = QocoTask(problem, nodes, solvers=self.solvers)
        return plan_by_cones(task, QOCO_METHOD, time_of_flight)
