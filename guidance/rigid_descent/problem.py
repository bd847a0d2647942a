"""The landing problem of a rigid body: one validated value."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.descent.limits import Limits
from guidance.descent.problem import LandingProblem
from guidance.rigid_body.body import RigidBody
from guidance.rigid_body.quaternion import tilt_angle
from guidance.rigid_body.state import RigidState
from guidance.validation import finite_number, finite_vector

OBJECTIVES = ("propellant", "time")
_ROUNDING = 1e-6  # what it may add to a limit of the start: of rate, of thrust, and [rad] of its direction


@dataclass(frozen=True, eq=False)
class RigidLandingProblem:
    """From `state` to an upright stand at `target` with the least propellant, never below its altitude.

    It ends with the body's z axis up, any heading, and without rates. Altitude, glide slope and the limit of
    rate hold on the whole flight, the limit of tilt from the second node on and `first_tilt_limit` before.

    Attributes:
        state: where the flight starts; its mass includes the propellant. An engine without lag gives what is
            commanded, whatever thrust stands here.
        target: [m] shape (3,), site frame.
        body: the vehicle and its limits.
        gravity: [m/s^2] shape (3,), site frame.
        target_velocity: [m/s] shape (3,), at the target; rest unless given.
        glide_slope: [rad] greatest angle, seen from the target, between the vehicle and the z axis, in
            (0, pi/2]; None for none.
        free_attitude: whether the attitude at the start is free, as in Szmuk and Acikmese 2018.
        objective: 'propellant', or 'time' for the shortest flight.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape; the start is faster than
            the limit of rate, or leans too far; its thrust, where the engine has a lag, lies above max_thrust
            or outside the gimbal's cone.
    """

    state: RigidState
    target: Array
    body: RigidBody
    gravity: Array = field(default_factory=lambda: np.array(MOON_GRAVITY))
    target_velocity: Array = field(default_factory=lambda: np.zeros(3))
    glide_slope: float | None = None
    free_attitude: bool = False
    objective: str = "propellant"

    def __post_init__(self) -> None:
        """Refuse what no solver should see."""
        if not isinstance(self.state, RigidState):
            raise ValueError(f"state must be a RigidState, got {self.state!r}")
        if not isinstance(self.body, RigidBody):
            raise ValueError(f"body must be a RigidBody, got {self.body!r}")
        for name in ("target", "gravity", "target_velocity"):
            vector = finite_vector(name, getattr(self, name), 3)
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
        if self.glide_slope is not None:
            finite_number("glide_slope", self.glide_slope, above=0.0, at_most=math.pi / 2)
        if self.objective not in OBJECTIVES:
            raise ValueError(f"objective must be one of {', '.join(OBJECTIVES)}, got {self.objective!r}")
        if not self.free_attitude and tilt_angle(self.state.attitude) >= 0.5 * math.pi + self.tilt_limit:
            raise ValueError("state: the body leans too far from its tilt limit to be turned back")
        rate = math.hypot(*self.state.rates)
        if rate > self.body.rate_limit * (1.0 + _ROUNDING):
            raise ValueError(
                f"state: rates of {rate:g} rad/s exceed the body's limit, {self.body.rate_limit:g}"
            )
        if not self.free_thrust:
            self._demand_thrust()
        _ = self.point_mass  # its checks of mass, altitude and sizes

    def _demand_thrust(self) -> None:
        """Refuse a start whose engine gives what it never could."""
        thrust, most = self.state.thrust, self.body.lander.max_thrust
        size = math.hypot(*thrust)
        if size > most * (1.0 + _ROUNDING):
            raise ValueError(f"state: thrust of {size:g} N exceeds max_thrust, {most:g} N")
        lean = math.atan2(math.hypot(thrust[0], thrust[1]), thrust[2])
        if size > _ROUNDING * most and lean > self.body.gimbal_limit + _ROUNDING:
            raise ValueError(f"state: thrust lies {lean:g} rad from the body's z axis, beyond gimbal_limit")

    @property
    def tilt_limit(self) -> float:
        """[rad] of the body."""
        return self.body.tilt_limit

    @property
    def first_tilt_limit(self) -> float:
        """[rad] of the tilt before the second node: that of the start, and what braking its rates takes.

        That is w^2 / (2 M / J) for the rate w across the z axis, by the weaker torque M about the greater
        moment J. At least `tilt_limit`; pi where the attitude at the start is free.
        """
        if self.free_attitude:
            return math.pi
        body, rate = self.body, math.hypot(self.state.rates[0], self.state.rates[1])
        swing = 0.0
        if rate > 0.0:
            torque = min(body.torque_limit[:2])
            moment = float(body.inertia_at(self.state.mass)[:2].max())
            swing = 0.5 * rate**2 * moment / torque if torque > 0.0 else math.pi
        return min(math.pi, max(body.tilt_limit, tilt_angle(self.state.attitude) + swing))

    @property
    def point_mass(self) -> LandingProblem:
        """The relaxation: a point mass that turns at once, its thrust anywhere that the body could point it.

        Every flight of the body is one of this point mass, so that no flight of the body burns less. Only
        commands are held above min_thrust: an engine with a lag may give less, so the point mass may give
        none. Without a lag the thrust is linear between commands that a gimbal may lean to opposite sides.
        """
        body = self.body
        pointing = self.first_tilt_limit + body.gimbal_limit
        least = body.lander.min_thrust * math.cos(body.gimbal_limit) if self.free_thrust else 0.0
        lander = replace(
            body.lander, min_thrust=least, pointing_limit=pointing if pointing < math.pi else None
        )
        return LandingProblem(
            self.state.point,
            self.target,
            lander,
            self.gravity,
            Limits(glide_slope=self.glide_slope),
            self.target_velocity,
        )

    @property
    def free_thrust(self) -> bool:
        """Whether the engine may start at any thrust: it has no lag that keeps the thrust of the start."""
        return self.body.engine_lag == 0.0
