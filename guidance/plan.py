"""A planned descent: what every method returns, and its thrust as a function of time."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.problem import LandingProblem

if TYPE_CHECKING:
    from guidance.certificate import Certificate
    from guidance.residuals import Residuals

Array = NDArray[np.float64]


class PlanStatus(Enum):
    """How planning ended."""

    OPTIMAL = "optimal"
    """Least propellant to the target."""
    NEAREST = "nearest"
    """The target is out of reach: least propellant to the reachable point nearest to it."""
    INFEASIBLE = "infeasible"
    """No flight exists within the scope that the certificate states."""
    SOLVER_FAILED = "solver failed"
    """The solver broke down; nothing is known."""
    LIMIT_REACHED = "limit reached"
    """Iterations ran out before feasibility was decided or accuracy reached; nothing is known."""

    @property
    def has_flight(self) -> bool:
        """Whether the plan holds a trajectory."""
        return self in (PlanStatus.OPTIMAL, PlanStatus.NEAREST)


def _none() -> Array:
    return np.empty(0)


def _no_vectors() -> Array:
    return np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class Plan:
    """A descent on N nodes (N - 1 intervals), in SI and the site frame.

    Between nodes the thrust *acceleration* is linear in time (first-order hold). Arrays are read-only, and
    empty where the status has no flight.

    Attributes:
        status: how planning ended.
        problem: what was asked.
        method: which solver planned.
        time: [s] shape (N,), from 0 to `time_of_flight`.
        position: [m] shape (N, 3).
        velocity: [m/s] shape (N, 3).
        mass: [kg] shape (N,).
        thrust: [N] shape (N, 3).
        landing_error: [m] distance from landing point to target; nan without a flight.
        message: the ending in words.
        certificate: why no flight exists, where the status is INFEASIBLE (or NEAREST, if proved).
        solves: conic (or nonlinear) programmes solved on the way, coarse ones and refinements included;
            those of proofs are not.
    """

    status: PlanStatus
    problem: LandingProblem
    method: str
    time: Array = field(default_factory=_none)
    position: Array = field(default_factory=_no_vectors)
    velocity: Array = field(default_factory=_no_vectors)
    mass: Array = field(default_factory=_none)
    thrust: Array = field(default_factory=_no_vectors)
    landing_error: float = float("nan")
    message: str = ""
    certificate: Certificate | None = None
    solves: int = 0

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("time", "position", "velocity", "mass", "thrust"):
            getattr(self, name).flags.writeable = False

    @classmethod
    def of_flight(
        cls,
        status: PlanStatus,
        problem: LandingProblem,
        method: str,
        flight: dict[str, Array],
        solves: int = 0,
    ) -> Plan:
        """A plan with a flight: `flight` holds time, position, velocity, mass and thrust by name."""
        miss = float(np.linalg.norm(flight["position"][-1, :2] - problem.target[:2]))
        return cls(
            status,
            problem,
            method,
            flight["time"],
            flight["position"],
            flight["velocity"],
            flight["mass"],
            flight["thrust"],
            miss,
            message=status.value,
            solves=solves,
        )

    @property
    def time_of_flight(self) -> float:
        """[s] duration; nan without a flight."""
        return float(self.time[-1]) if self.time.size else float("nan")

    @property
    def propellant(self) -> float:
        """[kg] propellant that the plan burns; nan without a flight."""
        return float(self.mass[0] - self.mass[-1]) if self.mass.size else float("nan")

    @property
    def nodes(self) -> int:
        """N; zero without a flight."""
        return int(self.time.size)

    def thrust_at(self, time: ArrayLike) -> Array:
        """Planned thrust; before the start that of the start, after the end none (engine cut-off).

        Args:
            time: [s] since the plan's start; a number, or shape (k,).

        Returns:
            [N] shape (3,), or (k, 3).

        Raises:
            ValueError: the plan holds no flight.
        """
        if self.nodes == 0:
            raise ValueError(f"a plan with status '{self.status.value}' has no thrust")
        t = np.asarray(time, dtype=np.float64)
        step = self.time[1]
        at = np.clip(t / step, 0.0, self.nodes - 1.0)
        k = np.minimum(at.astype(np.int64), self.nodes - 2)
        share = at - k
        mass = self._mass_between(k, share)
        weight = share[..., None]
        thrust = mass[..., None] * (
            (1.0 - weight) * self._acceleration[k] + weight * self._acceleration[k + 1]
        )
        after = t > self.time[-1] * (1.0 + 1e-12)
        return np.where(after[..., None], 0.0, thrust)

    @cached_property
    def _acceleration(self) -> Array:
        return self.thrust / self.mass[:, None]

    @cached_property
    def _flow(self) -> Array:
        """[1/s] share of the mass burnt per second at each node."""
        return np.linalg.norm(self._acceleration, axis=1) / self.problem.lander.exhaust_velocity

    def _mass_between(self, k: NDArray[np.int64], share: Array) -> Array:
        """Mass in interval k: its logarithm is quadratic where the magnitude of acceleration is linear."""
        bend = 0.5 * self.time[1] * (self._flow[k + 1] - self._flow[k]) * share * (1.0 - share)
        return self.mass[k] * (self.mass[k + 1] / self.mass[k]) ** share * np.exp(bend)

    @cached_property
    def residuals(self) -> Residuals:
        """What the plan misses when it is flown through the true motion; computed on first use."""
        from guidance.residuals import fly_residuals

        return fly_residuals(self)

    @property
    def keeps_limits(self) -> bool:
        """Whether there is a flight and, flown, it lands where it says and keeps every limit.

        The tolerance is `guidance.residuals.FLIGHT_TOLERANCE`.
        """
        return self.nodes > 0 and self.residuals.keeps_limits(self.problem)
