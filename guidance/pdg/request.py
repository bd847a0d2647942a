"""What `solve_pdg` asks of a planner: one value, which the planners are handed in turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from guidance.descent.certificate import Certificate
from guidance.descent.plan import Plan
from guidance.descent.problem import LandingProblem
from guidance.flight_time.nearest_landing import NearestLanding, find_nearest_landing
from guidance.flight_time.primer_vector import PrimerFlight, find_extremal_flight
from guidance.state import State

if TYPE_CHECKING:
    from guidance.convex.programme import ConvexSolution


@dataclass(frozen=True, eq=False)
class Request:
    """What `solve_pdg` asks of a planner.

    Attributes:
        problem: the landing problem.
        nodes: N.
        time_of_flight: [s] or None to search for the best.
        method: 'auto', 'indirect', 'convex', 'casadi' or 'cvxpy'.
        guess: an earlier plan of nearly the same flight, or None.
        provisional: whether the plan will be replaced before it is flown to its end, as in closed loop: it is
            taken as it is found, on its mesh and near the best time.
        landing_error_weight: [kg/m] price of a landing error; None lands at the target.
    """

    problem: LandingProblem
    nodes: int
    time_of_flight: float | None
    method: str
    guess: Plan | None = None
    provisional: bool = False
    landing_error_weight: float | None = None

    @cached_property
    def extremal(self) -> PrimerFlight | None:
        """What the indirect method finds, whether or not it breaks a limit."""
        if self.landing_error_weight is not None:
            return None
        return find_extremal_flight(self.problem, self.time_of_flight, not self.provisional)

    @property
    def flight(self) -> PrimerFlight | None:
        """The same, where it keeps every limit."""
        return None if self.extremal is None or self.extremal.broken else self.extremal

    @cached_property
    def nearest(self) -> NearestLanding | None:
        """What the indirect method finds near a target that is out of reach; None where it is not asked."""
        if self.method != "auto" or self.time_of_flight is not None or self.extremal is None:
            return None
        return find_nearest_landing(self.problem, self.extremal, not self.provisional)

    @cached_property
    def refusal_by_cones(self) -> Certificate | ConvexSolution | None:
        """Proof that there is no flight, with cones at the times of flight that bounds leave open.

        Or a solution that refutes it, or None where neither was found.
        """
        from guidance.planning.convex_task import ConvexTask
        from guidance.planning.infeasibility import prove_free_time

        likely = None if self.extremal is None else self.extremal.time
        return prove_free_time(ConvexTask(self.problem, self.nodes), likely)

    @property
    def bounds_first(self) -> bool:
        """Whether the dual bound is asked before any search."""
        asked = self.time_of_flight is None and self.method in ("auto", "convex")
        return asked and self.landing_error_weight is None and not self.problem.rotates

    def finer(self, nodes: int, found: Plan) -> Request:
        """The same on more nodes, from the plan found so far."""
        return replace(self, nodes=nodes, guess=found)


def remaining_time(guess: Plan, state: State) -> float | None:
    """[s] what is left of an earlier plan at its node nearest to `state`; None if nothing is."""
    if guess.nodes == 0:
        return None
    duration = guess.time_of_flight
    gap = np.linalg.norm(guess.position - state.position, axis=1) + 0.1 * duration * np.linalg.norm(
        guess.velocity - state.velocity, axis=1
    )
    remaining = duration - float(guess.time[int(gap.argmin())])
    return remaining if remaining > 0.0 else None
