"""Constraint rows made into the arrays of one Clarabel solver, built once and then given new numbers.

Sparsity and the solver's internal scaling are fixed from nominal numbers that no caller can change, and every
solve replaces all numbers: an answer has the same bits whatever was solved before.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import numpy as np

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.convex.clarabel_solver import ConicAnswer, ConicSettings, ConicSolver
from guidance.convex.constraints import Rows
from guidance.convex.scaling import ScaledProblem, scale_problem
from guidance.descent.limits import Cone, Limits
from guidance.descent.problem import LandingProblem
from guidance.lander import Lander
from guidance.state import State

Key = TypeVar("Key")
Programme = TypeVar("Programme")


class Assembly:
    """Rows of one sparsity, in Clarabel's order, and the solvers of that sparsity."""

    def __init__(self, rows: list[Rows], cost: Array, tolerance: float) -> None:
        """Fix the sparsity.

        Args:
            rows: of nominal numbers.
            cost: of nominal numbers, shape (n,).
            tolerance: of the conic solver.
        """
        from scipy.sparse import csc_matrix

        self.first = np.cumsum([0] + [part.bound.size for part in rows])
        """First row of each part, and the number of all rows."""
        row = np.concatenate([part.row + offset for part, offset in zip(rows, self.first, strict=False)])
        column = np.concatenate([part.column for part in rows])
        self._order = np.lexsort((row, column))
        pointer = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=cost.size))])
        values, bound = self._numbers(rows)
        shape = (int(self.first[-1]), cost.size)
        matrix = csc_matrix((values, row[self._order], pointer), shape=shape)
        self._nominal, self._tolerance = (matrix, bound, cost, cones_of(rows)), tolerance
        self._solvers: dict[bool, ConicSolver] = {}

    def _numbers(self, rows: list[Rows]) -> tuple[Array, Array]:
        values = np.concatenate([part.value for part in rows])
        return values[self._order], np.concatenate([part.bound for part in rows])

    def solve(self, rows: list[Rows], cost: Array, refine: bool = False) -> ConicAnswer:
        """Solve with new numbers.

        Args:
            rows: of the same sparsity.
            cost: shape (n,).
            refine: whether to refine each linear solve, as in `ConicSettings`.
        """
        if refine not in self._solvers:
            settings = ConicSettings(self._tolerance, refine)
            self._solvers[refine] = ConicSolver(*self._nominal, settings)
        return self._solvers[refine].solve(*self._numbers(rows), cost)


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
    tilted = Cone(1.0, (0.1, -0.2, 1.0))
    problem = LandingProblem(
        State(np.array([200.0, 100.0, 900.0]), np.array([-8.0, -4.0, -30.0]), 1200.0),
        np.zeros(3),
        Lander(min_thrust=1000.0, pointing_limit=1.0),
        np.array(MOON_GRAVITY),
        Limits(
            glide_slope=1.0,
            speed=100.0,
            final_thrust_direction=tilted,
            line_of_sight=tilted,
            thrust_rate=3000.0,
        ),
        target_velocity=np.array([2.0, 1.0, -5.0]),
        angular_velocity=np.array([1e-3, -2e-3, 3e-3]),
    )
    return scale_problem(problem, 30.0, nodes)


def once_per_thread(build: Callable[[Key], Programme]) -> Callable[[Key], Programme]:
    """Keep what `build` makes of each key, in each thread: a solver must not be shared while it solves."""
    local = threading.local()

    @wraps(build)
    def find(key: Key) -> Programme:
        kept: dict[Key, Programme] = local.__dict__.setdefault("kept", {})
        if key not in kept:
            kept[key] = build(key)
        return kept[key]

    return find
