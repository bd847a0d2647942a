"""A planned descent: what every method returns, and what a planner raises that has none to give."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.descent.certificate import Certificate
from guidance.descent.problem import LandingProblem
from guidance.descent.residuals import Residuals, fly_residuals
from guidance.descent.rotating_frame import rotating_states_at
from guidance.descent.trajectory import Trajectory, no_trajectory


class PlanStatus(Enum):
    """How planning ended."""

    OPTIMAL = "optimal"
    """Least propellant to the target."""
    NEAREST = "nearest"
    """The target is out of reach: least propellant to the reachable point nearest to it."""
    WEIGHED = "weighed"
    """Least propellant and landing error, weighed against each other; the landing point is free."""
    INFEASIBLE = "infeasible"
    """No flight exists within the scope that the certificate states."""
    SOLVER_FAILED = "solver failed"
    """The solver broke down; nothing is known."""
    LIMIT_REACHED = "limit reached"
    """Iterations ran out before feasibility was decided or accuracy reached; nothing is known."""

    @property
    def has_flight(self) -> bool:
        """Whether the plan holds a trajectory."""
        return self in (PlanStatus.OPTIMAL, PlanStatus.NEAREST, PlanStatus.WEIGHED)


@dataclass(frozen=True, eq=False)
class Plan:
    """A descent, in SI and the site frame.

    Attributes:
        status: how planning ended.
        problem: what was asked.
        method: which solver planned.
        trajectory: the flight on N nodes; empty where the status has none.
        landing_error: [m] distance from landing point to target; nan without a flight.
        message: the ending in words.
        proof: the `certificate`, or what makes it of the plan when it is first asked for.
        solves: conic (or nonlinear) programmes solved on the way, coarse ones and refinements included;
            those of proofs are not.
    """

    status: PlanStatus
    problem: LandingProblem
    method: str
    trajectory: Trajectory = field(default_factory=no_trajectory)
    landing_error: float = float("nan")
    message: str = ""
    proof: Certificate | Callable[[Plan], Certificate | None] | None = None
    solves: int = 0

    @classmethod
    def of_flight(
        cls,
        status: PlanStatus,
        problem: LandingProblem,
        method: str,
        trajectory: Trajectory,
        solves: int = 0,
        proof: Callable[[Plan], Certificate | None] | None = None,
    ) -> Plan:
        """A plan with a flight."""
        miss = math.dist(trajectory.position[-1, :2].tolist(), problem.target[:2].tolist())
        return cls(status, problem, method, trajectory, miss, status.value, proof, solves)

    @property
    def time(self) -> Array:
        """[s] shape (N,), from 0 to `time_of_flight`."""
        return self.trajectory.time

    @property
    def position(self) -> Array:
        """[m] shape (N, 3)."""
        return self.trajectory.position

    @property
    def velocity(self) -> Array:
        """[m/s] shape (N, 3)."""
        return self.trajectory.velocity

    @property
    def mass(self) -> Array:
        """[kg] shape (N,)."""
        return self.trajectory.mass

    @property
    def thrust(self) -> Array:
        """[N] shape (N, 3)."""
        return self.trajectory.thrust

    @property
    def nodes(self) -> int:
        """N; zero without a flight."""
        return self.trajectory.nodes

    @property
    def time_of_flight(self) -> float:
        """[s] duration; nan without a flight."""
        return self.trajectory.duration

    @property
    def propellant(self) -> float:
        """[kg] propellant that the plan burns; nan without a flight."""
        return float(self.mass[0] - self.mass[-1]) if self.mass.size else float("nan")

    @cached_property
    def certificate(self) -> Certificate | None:
        """What is proved: why no flight exists, where INFEASIBLE; what no flight undercuts, where OPTIMAL.

        The latter is made in about a millisecond on first use. None for plans to the nearest point and those
        of the closed loop.
        """
        return self.proof(self) if callable(self.proof) else self.proof

    @property
    def optimality_gap(self) -> float:
        """[kg] what the plan burns above the proved lower bound; nan without a flight or a bound.

        The bound uses the altitude and the glide slope at one time of each flight, and leaves out the other
        `limits` of the problem: where these, or those for longer, bind, the gap holds a part of their price
        too. `certificate.scope` says which times of flight it covers.
        """
        if self.status is not PlanStatus.OPTIMAL or self.certificate is None:
            return float("nan")
        return self.propellant - self.certificate.lower_bound

    def thrust_at(self, time: ArrayLike) -> Array:
        """Planned thrust; before the start that of the start, after the end none (engine cut-off).

        Args:
            time: [s] since the plan's start; a number, or shape (k,).

        Returns:
            [N] shape (3,), or (k, 3).

        Raises:
            ValueError: the plan holds no flight.
        """
        self._demand_flight("has no thrust")
        return self.trajectory.thrust_at(time)

    def states_at(self, time: ArrayLike) -> tuple[Array, Array]:
        """Planned position and velocity, exact for the planned thrust.

        Args:
            time: [s] shape (k,), from 0 to the plan's end.

        Returns:
            Position [m] and velocity [m/s], shape (k, 3) each.

        Raises:
            ValueError: the plan holds no flight.
        """
        self._demand_flight("has no states")
        times = np.asarray(time, dtype=np.float64)
        if self.problem.rotates:
            return rotating_states_at(self.trajectory, times, self.problem)
        return self.trajectory.states_at(times, self.problem.gravity)

    @cached_property
    def residuals(self) -> Residuals:
        """What the plan misses when it is flown through the true motion; computed on first use.

        Raises:
            ValueError: the plan holds no flight.
        """
        self._demand_flight("cannot be flown")
        return fly_residuals(self.trajectory, self.problem)

    @cached_property
    def keeps_limits(self) -> bool:
        """Whether there is a flight and, flown, it lands where it says and keeps every limit.

        The tolerance is `guidance.descent.residuals.FLIGHT_TOLERANCE`.
        """
        return self.nodes > 0 and self.residuals.keeps_limits(self.problem)

    def _demand_flight(self, lack: str) -> None:
        if self.nodes == 0:
            raise ValueError(f"a plan with status '{self.status.value}' {lack}")


class GuidanceError(Exception):
    """A planner has no plan.

    Attributes:
        plan: the labelled result without a trajectory (its status, message and certificate).
    """

    def __init__(self, message: str, plan: Plan) -> None:
        """Keep the labelled result beside the words."""
        super().__init__(message)
        self.plan = plan


class InfeasibleError(GuidanceError):
    """No flight within the limits exists; `plan.certificate` proves it, and its `scope` says how far."""


class SolverFailedError(GuidanceError):
    """The solver stopped without an answer: nothing is said about whether a flight exists."""
