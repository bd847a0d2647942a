"""Units in which the programme of a rigid body's descent is well scaled, and its problem in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.rigid_descent.flight import RigidFlight
from guidance.rigid_descent.problem import RigidLandingProblem


class ScaledBody(NamedTuple):
    """The motion's numbers in the units of `RigidUnits`.

    Attributes:
        gravity: shape (3,).
        turn: shape (3,), acceleration of turn by a torque of one at the mass `mass`.
        arm: shape (3,), acceleration of turn by a thrust of one across the body at that mass.
        couple: shape (3,), (J2 - J3)/J1 and its like.
        mass: that the inertia belongs to.
        exponent: of the inertia.
        flow: mass flow of a thrust of one.
    """

    gravity: Array
    turn: Array
    arm: Array
    couple: Array
    mass: float
    exponent: float
    flow: float


@dataclass(frozen=True)
class RigidUnits:
    """What one is.

    Attributes:
        length: [m] distance to the target, or speed squared over acceleration if that is longer.
        acceleration: [m/s^2] full thrust on the start mass.
        mass: [kg] start mass.
        torque: [N m] greatest limit about an axis; 1 without reaction control.
    """

    length: float
    acceleration: float
    mass: float
    torque: float

    @classmethod
    def of(cls, problem: RigidLandingProblem) -> RigidUnits:
        """Units in which start, thrust and torque are of size one."""
        mass = problem.state.mass
        acceleration = problem.body.lander.max_thrust / mass
        speed = max(math.hypot(*problem.state.velocity), math.hypot(*problem.target_velocity))
        distance = math.dist(problem.state.position, problem.target)
        length = max(distance, speed**2 / acceleration, 1e-3)
        return cls(length, acceleration, mass, max(problem.body.torque_limit) or 1.0)

    @property
    def time(self) -> float:
        """[s] time of one."""
        return math.sqrt(self.length / self.acceleration)

    @property
    def speed(self) -> float:
        """[m/s] speed of one."""
        return math.sqrt(self.length * self.acceleration)

    @property
    def force(self) -> float:
        """[N] thrust of one."""
        return self.mass * self.acceleration

    @property
    def state(self) -> Array:
        """Shape (14,): unit of each number of a state."""
        return np.repeat([self.length, self.speed, 1.0, 1.0 / self.time, self.mass], [3, 3, 4, 3, 1])

    @property
    def control(self) -> Array:
        """Shape (6,): unit of thrust and torque."""
        return np.repeat([self.force, self.torque], 3)

    def body(self, problem: RigidLandingProblem) -> ScaledBody:
        """The motion in these units."""
        body = problem.body
        inertia = np.array(body.inertia)
        per_moment = self.time**2 / inertia
        arm = body.engine_arm * self.force * per_moment
        first, second, third = body.inertia
        couple = [(second - third) / first, (third - first) / second, (first - second) / third]
        return ScaledBody(
            problem.gravity / self.acceleration,
            self.torque * per_moment,
            arm,
            np.array(couple),
            body.inertia_mass / self.mass,
            body.inertia_exponent,
            self.speed / body.lander.exhaust_velocity,
        )


@dataclass(frozen=True, eq=False)
class Iterate:
    """A flight in the units of the programme, with the target at the origin.

    Attributes:
        states: shape (N, 14): position, velocity, attitude, rates, mass.
        controls: shape (N, 6): thrust and torque, body frame.
        duration: time of flight.
    """

    states: Array
    controls: Array
    duration: float

    @property
    def intervals(self) -> Array:
        """Shape (N - 1,): their durations, all equal."""
        count = len(self.states) - 1
        return np.full(count, self.duration / count)

    def flight(self, problem: RigidLandingProblem, units: RigidUnits) -> RigidFlight:
        """In SI and the site frame."""
        states, controls = self.states * units.state, self.controls * units.control
        attitude = states[:, 6:10] / np.linalg.norm(states[:, 6:10], axis=1)[:, None]
        return RigidFlight(
            np.linspace(0.0, self.duration * units.time, len(states)),
            states[:, :3] + problem.target,
            states[:, 3:6],
            attitude,
            states[:, 10:13],
            states[:, 13],
            controls[:, :3],
            controls[:, 3:],
        )

    @classmethod
    def of_flight(cls, flight: RigidFlight, problem: RigidLandingProblem, units: RigidUnits) -> Iterate:
        """A flight with equal intervals, in these units."""
        states = flight.states
        states[:, :3] -= problem.target
        controls = np.column_stack([flight.thrust, flight.torque])
        return cls(states / units.state, controls / units.control, float(flight.time[-1]) / units.time)
