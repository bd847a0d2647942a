"""A planned descent of a rigid body: what every method returns."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

from guidance.arrays import Array
from guidance.descent.certificate import Certificate
from guidance.descent.plan import Plan, PlanStatus
from guidance.rigid_descent.flight import RigidFlight, no_flight
from guidance.rigid_descent.problem import RigidLandingProblem
from guidance.rigid_descent.residuals import RigidResiduals, fly_rigid_residuals


@dataclass(frozen=True, eq=False)
class RigidPlan:
    """A descent, in SI.

    Attributes:
        status: how planning ended. OPTIMAL is a local optimum on its mesh: nothing is proved of others.
        problem: what was asked.
        method: which solver planned.
        flight: the flight on N nodes; empty where the status has none.
        message: the ending in words.
        point_mass: plan of the point mass that may turn at once, where one was made.
        solves: conic (or nonlinear) programmes solved on the way.
    """

    status: PlanStatus
    problem: RigidLandingProblem
    method: str
    flight: RigidFlight = field(default_factory=no_flight)
    message: str = ""
    point_mass: Plan | None = None
    solves: int = 0

    @property
    def time(self) -> Array:
        """[s] shape (N,), from 0 to `time_of_flight`."""
        return self.flight.time

    @property
    def position(self) -> Array:
        """[m] shape (N, 3)."""
        return self.flight.position

    @property
    def velocity(self) -> Array:
        """[m/s] shape (N, 3)."""
        return self.flight.velocity

    @property
    def attitude(self) -> Array:
        """Unit quaternions, scalar first, shape (N, 4): body to site frame."""
        return self.flight.attitude

    @property
    def rates(self) -> Array:
        """[rad/s] shape (N, 3), body frame."""
        return self.flight.rates

    @property
    def mass(self) -> Array:
        """[kg] shape (N,)."""
        return self.flight.mass

    @property
    def thrust(self) -> Array:
        """[N] shape (N, 3), body frame."""
        return self.flight.thrust

    @property
    def torque(self) -> Array:
        """[N m] shape (N, 3), body frame."""
        return self.flight.torque

    @property
    def nodes(self) -> int:
        """N; zero without a flight."""
        return self.flight.nodes

    @property
    def time_of_flight(self) -> float:
        """[s] duration; nan without a flight."""
        return float(self.time[-1]) if self.nodes else float("nan")

    @property
    def propellant(self) -> float:
        """[kg] propellant that the plan burns; nan without a flight."""
        return float(self.mass[0] - self.mass[-1]) if self.nodes else float("nan")

    @property
    def certificate(self) -> Certificate | None:
        """What is proved of the point mass, and so of the body: that none flies, or what none undercuts."""
        return None if self.point_mass is None else self.point_mass.certificate

    @property
    def relaxation_gap(self) -> float:
        """[kg] what the plan burns above the proved bound of the point mass; nan where there is none.

        It holds the price of turning, of the engine's lag and of the mesh.
        """
        certificate = self.certificate
        if self.status is not PlanStatus.OPTIMAL or certificate is None:
            return float("nan")
        return self.propellant - certificate.lower_bound

    @cached_property
    def residuals(self) -> RigidResiduals:
        """What the plan misses when it is flown through the true motion; computed on first use.

        Raises:
            ValueError: the plan holds no flight.
        """
        if self.nodes == 0:
            raise ValueError(f"a plan with status '{self.status.value}' cannot be flown")
        return fly_rigid_residuals(self.flight, self.problem)

    def checked(self) -> RigidPlan:
        """This plan where, flown, it keeps its limits; else LIMIT_REACHED without a flight."""
        if self.keeps_limits:
            return self
        name, excess = max(self.residuals.excess(self.problem).items(), key=lambda item: item[1])
        words = (
            f"flown, the plan leaves its limits: {name} {excess:.1f} times what is allowed; try more nodes"
        )
        return replace(self, status=PlanStatus.LIMIT_REACHED, flight=no_flight(), message=words)

    @cached_property
    def keeps_limits(self) -> bool:
        """Whether there is a flight and, flown open loop, it lands upright on its target in every limit."""
        return self.nodes > 0 and self.residuals.keeps_limits(self.problem)
