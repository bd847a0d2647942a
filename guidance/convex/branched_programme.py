"""The conic programme of flights that share a trunk and then part, one branch to each candidate site.

State, mass and thrust of the trunk's nodes are the same variables in every branch. Where no limit on the path
needs the states, the programme is first solved without them (`guidance.convex.condensed`).
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
from guidance.convex.condensed import expand, keeps_altitude, landing_moments
from guidance.convex.constraint_set import ConstraintSet, Family
from guidance.convex.constraints import Rows
from guidance.convex.layout import CondensedLayout, Layout
from guidance.convex.programme import CONSTANT_FAMILIES, ConvexSolution
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
        condensed: whether the states are left out, and with them the altitude floor.
    """

    constraint_set: ConstraintSet
    branches: int
    shared_nodes: int
    condensed: bool = False

    @cached_property
    def layout(self) -> CondensedLayout:
        """Of one branch alone, trunk included."""
        return CondensedLayout(self.constraint_set.nodes) if self.condensed else self.whole_layout

    @cached_property
    def whole_layout(self) -> Layout:
        """The same with its states."""
        return Layout(self.constraint_set.nodes)

    @cached_property
    def families(self) -> list[Family]:
        """Constraint functions of a branch, in row order."""
        chosen = self.constraint_set
        return chosen.condensed_families if self.condensed else chosen.families

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
        origin, gravity = scaled[0].position, scaled[0].gravity  # at the first target, the origin of all
        parts = []
        for branch, numbers in enumerate(scaled):
            aim = origin - numbers.position  # this target as seen from the first
            own = replace(numbers, gravity=gravity)
            shared = replace(own, position=origin, sight_apex=aim)
            for place, family in enumerate(self.families):
                if (branch, place) in self._constant:
                    parts.append(self._constant[branch, place])
                    continue
                part = family(self.layout, own if family is landing_moments else shared)
                if family is constraints.landing:
                    part = replace(part, bound=np.concatenate([aim, numbers.target_velocity]))
                moved = self._moved(part, branch, place)
                if family in CONSTANT_FAMILIES:
                    self._constant[branch, place] = moved
                parts.append(moved)
        return [part for part in parts if part is not None]

    @cached_property
    def _constant(self) -> dict[tuple[int, int], Rows | None]:
        """Rows that are the same at every solve, by branch and place."""
        return {}

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

    def solve(self, scaled: Sequence[ScaledProblem], weights: Array) -> list[ConvexSolution]:
        """Least weighted propellant: each branch as a solution of its own, all with the same status."""
        rows, branching = self.branching.rows(scaled), self.branching
        answer = self._assembly.solve(rows, self._cost(weights))
        condensed, first, out = branching.layout, scaled[0], []
        for columns in branching.columns:
            primal, value = answer.primal[columns], np.nan
            if answer.status is SolveStatus.SOLVED:
                value = -float(first.kappa * primal[condensed.log_mass[-1]])
                if branching.condensed:
                    primal = expand(condensed, first, primal)
            branch = replace(answer, primal=primal)
            out.append(ConvexSolution(branch, branching.whole_layout, first, rows, value, np.nan))
        return out


@once_per_thread
def branched_programme(branching: Branching) -> BranchedProgramme:
    """The assembled programme of a Branching: built once per thread, then kept."""
    return BranchedProgramme(branching)


def solve_branches(
    constraint_set: ConstraintSet, shared_nodes: int, scaled: Sequence[ScaledProblem], weights: Array
) -> list[ConvexSolution] | None:
    """Least weighted propellant of branches that share some nodes.

    Args:
        constraint_set: of each branch.
        shared_nodes: nodes of the trunk.
        scaled: numbers of each branch in equal units, each with its own target as origin.
        weights: shape (branches,).

    Returns:
        Each branch as a solution of its own, seen from the first target; None where none was found.
    """
    branching = Branching(constraint_set, len(scaled), shared_nodes)
    if constraint_set.can_condense:
        found = branched_programme(replace(branching, condensed=True)).solve(scaled, weights)
        if found[0].answer.status is SolveStatus.INFEASIBLE:
            return None
        if found[0].solved and all(keeps_altitude(part.layout, part.answer.primal) for part in found):
            return found
    found = branched_programme(branching).solve(scaled, weights)
    return found if found[0].solved else None
