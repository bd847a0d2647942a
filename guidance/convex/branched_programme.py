"""The conic programme of flights that share a trunk and then part, one branch to each candidate site.

State, mass and thrust of the trunk's nodes are the same variables in every branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array, Index
from guidance.convex import constraints
from guidance.convex.assembly import Assembly, nominal_numbers, once_per_thread
from guidance.convex.clarabel_solver import DEFAULT_TOLERANCE, SolveStatus
from guidance.convex.constraint_set import ConstraintSet
from guidance.convex.constraints import Rows
from guidance.convex.layout import Layout
from guidance.convex.programme import ConvexSolution
from guidance.convex.scaling import ScaledProblem


class _Move(NamedTuple):
    """Which rows and stored entries of a family a branch takes, and where its entries stand."""

    entries: Index
    rows: Index
    row: Index
    column: Index
    cone_size: int


@dataclass(frozen=True)
class Branching:
    """What decides the sparsity of the programme.

    Attributes:
        constraint_set: of each branch.
        branches: number of candidates.
        shared_nodes: nodes of the trunk.
    """

    constraint_set: ConstraintSet
    branches: int
    shared_nodes: int

    @property
    def layout(self) -> Layout:
        """Of one branch alone, trunk included."""
        return Layout(self.constraint_set.nodes)

    @cached_property
    def columns(self) -> Index:
        """Shape (branches, n): where each number of a branch's own layout stands in the decision vector."""
        size = self.layout.size
        shared = size // self.constraint_set.nodes * self.shared_nodes
        own = size - shared
        out = np.tile(np.arange(size), (self.branches, 1))
        for branch in range(1, self.branches):
            out[branch, shared:] = size + (branch - 1) * own + np.arange(own)
        return out

    @property
    def size(self) -> int:
        """Length of the decision vector."""
        return int(self.columns[-1, -1]) + 1

    def rows(self, scaled: Sequence[ScaledProblem]) -> list[Rows]:
        """Constraint rows of all branches; those of the trunk alone are stated once.

        Args:
            scaled: numbers of each branch in equal units, each with its own target as origin.
        """
        origin = scaled[0].position
        parts = []
        for branch, numbers in enumerate(scaled):
            aim = origin - numbers.position  # this target as seen from the first
            gravity = scaled[0].gravity  # at the first target, the origin of all
            shared = replace(numbers, position=origin, sight_apex=aim, gravity=gravity)
            for place, family in enumerate(self.constraint_set.families):
                part = family(self.layout, shared)
                if family is constraints.landing:
                    part = replace(part, bound=np.concatenate([aim, numbers.target_velocity]))
                moved = self._moved(part, branch, place)
                if moved is not None:
                    parts.append(moved)
        return parts

    def _moved(self, part: Rows, branch: int, place: int) -> Rows | None:
        """Rows in the columns of a branch, without the cones that bind the trunk only.

        Which these are depends on the layout alone: it is found once for each branch and place of a family.
        """
        key = branch, place
        if key not in self._moves:
            self._moves[key] = self._find_move(part, branch)
        move = self._moves[key]
        if move is None:
            return None
        value, bound = part.value[move.entries], part.bound[move.rows]
        return Rows(part.name, part.cone, move.cone_size, move.row, move.column, value, bound)

    @cached_property
    def _moves(self) -> dict[tuple[int, int], _Move | None]:
        """What `_moved` has found, by branch and place."""
        return {}

    def _find_move(self, part: Rows, branch: int) -> _Move | None:
        column = self.columns[branch][part.column]
        if branch == 0:
            every = np.arange(column.size), np.arange(part.bound.size)
            return _Move(*every, part.row, column, part.cone_size)
        width = part.cone_size if part.cone == "second_order" else 1
        kept = np.zeros(part.bound.size // width, dtype=np.bool_)
        kept[part.row[column >= self.layout.size] // width] = True
        rows = np.repeat(kept, width)
        if not rows.any():
            return None
        entries, chosen = np.flatnonzero(rows[part.row]), np.flatnonzero(rows)
        row = (np.cumsum(rows) - 1)[part.row[entries]]
        size = part.cone_size if part.cone == "second_order" else chosen.size
        return _Move(entries, chosen, row, column[entries], size)


class BranchedProgramme:
    """The assembled programme of one Branching."""

    def __init__(self, branching: Branching) -> None:
        """Assemble it from nominal numbers."""
        self.branching = branching
        nominal = [nominal_numbers(branching.constraint_set.nodes)] * branching.branches
        weights = np.full(branching.branches, 1.0 / branching.branches)
        self._assembly = Assembly(branching.rows(nominal), self._cost(weights), DEFAULT_TOLERANCE)

    def _cost(self, weights: Array) -> Array:
        cost = np.zeros(self.branching.size)
        cost[self.branching.columns[:, self.branching.layout.log_mass[-1]]] = -weights
        return cost

    def solve(self, scaled: Sequence[ScaledProblem], weights: Array) -> list[ConvexSolution] | None:
        """Least weighted propellant; each branch as a solution of its own, or None if there is none."""
        rows = self.branching.rows(scaled)
        answer = self._assembly.solve(rows, self._cost(weights))
        if answer.status is not SolveStatus.SOLVED:
            return None
        layout = self.branching.layout
        return [
            ConvexSolution(
                replace(answer, primal=answer.primal[columns]),
                layout,
                scaled[0],
                rows,
                -float(scaled[0].kappa * answer.primal[columns[layout.log_mass[-1]]]),
                np.nan,
            )
            for columns in self.branching.columns
        ]


@once_per_thread
def branched_programme(branching: Branching) -> BranchedProgramme:
    """The assembled programme of a Branching: built once per thread, then kept."""
    return BranchedProgramme(branching)
