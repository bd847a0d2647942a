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


@dataclass(frozen=True, eq=False)
class RigidLandingProblem:
    """From `state` to an upright stand at `target` with the least propellant, never below its altitude.

    It ends with the body's z axis up, any heading, and without rates. The body's limits of tilt and rate hold
    from the second node on.

    Attributes:
        state: where the flight starts; its mass includes the propellant.
        target: [m] shape (3,), site frame.
        body: the vehicle and its limits.
        gravity: [m/s^2] shape (3,), site frame.
        target_velocity: [m/s] shape (3,), at the target; rest unless given.
        glide_slope: [rad] greatest angle, seen from the target, between the vehicle and the z axis, in
            (0, pi/2]; None for none.
        free_attitude: whether the attitude at the start is free, as in Szmuk and Acikmese 2018.
        objective: 'propellant', or 'time' for the shortest flight.

    Raises:
        ValueError: an argument is out of range, not finite or of the wrong shape.
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
        _ = self.point_mass  # its checks of mass, altitude and sizes

    @property
    def tilt_limit(self) -> float:
        """[rad] of the body."""
        return self.body.tilt_limit

    @property
    def point_mass(self) -> LandingProblem:
        """The relaxation: a point mass that turns at once, its thrust anywhere that the body could point it.

        Every flight of the body is one of this point mass, so that no flight of the body burns less.
        """
        pointing = self.body.tilt_limit + self.body.gimbal_limit
        lander = replace(self.body.lander, pointing_limit=pointing if pointing < math.pi else None)
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
