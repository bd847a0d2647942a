"""The vehicle as a rigid body: the point mass's engine and tank, and what turns it.

Body frame: origin at the mass centre, axes principal, z along the thrust of the engine at rest (up when the
vehicle stands).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.lander import PAPER_LANDER, Lander
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True)
class RigidBody:
    """A lander that must turn to thrust elsewhere.

    The defaults are a lander of 1200 kg with the proportions of the Apollo lunar module (accelerations by one
    jet in the source of Luminary 099, scaled by mass^(5/3)), its engine's lag (THROTLAG there) and its limit
    of commanded rate, and a pure couple of 66 N m about each axis.

    Attributes:
        lander: engine, tank and least thrust; its `pointing_limit` is not read, `tilt_limit` takes its place.
        inertia: [kg m^2] principal moments about x, y, z at `inertia_mass`.
        inertia_mass: [kg] mass that `inertia` belongs to.
        inertia_exponent: inertia = `inertia` (mass / `inertia_mass`)^exponent: 1 keeps the radii of gyration,
            0 the inertia. What is burnt carries its own angular momentum away, so that the change of inertia
            gives no torque; jet damping is left out.
        torque_limit: [N m] greatest couple of the reaction control about each axis; its propellant is not
            counted.
        rate_limit: [rad/s] greatest rate of turn that guidance and the attitude loop ask for.
        tilt_limit: [rad] greatest angle of the body's z axis from the vertical that they ask for, in (0, pi].
        engine_lag: [s] time constant of the thrust, and of the gimbal, after their commands; 0 for none.
        gimbal_limit: [rad] greatest angle of the thrust from the body's z axis; 0 fixes the engine.
        engine_arm: [m] distance of the engine's gimbal below the mass centre.

    Raises:
        ValueError: a field is not finite, out of range, or the moments belong to no body.
    """

    lander: Lander = PAPER_LANDER
    inertia: tuple[float, float, float] = (880.0, 880.0, 1040.0)
    inertia_mass: float = 1200.0
    inertia_exponent: float = 1.0
    torque_limit: tuple[float, float, float] = (66.0, 66.0, 66.0)
    rate_limit: float = field(default=math.radians(10.0), kw_only=True)
    tilt_limit: float = field(default=math.radians(45.0), kw_only=True)
    engine_lag: float = field(default=0.2, kw_only=True)
    gimbal_limit: float = field(default=0.0, kw_only=True)
    engine_arm: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Refuse a body that cannot exist."""
        if not isinstance(self.lander, Lander):
            raise ValueError(f"lander must be a Lander, got {self.lander!r}")
        moments = finite_vector("inertia", self.inertia, 3)
        if moments.min() <= 0.0 or 2.0 * moments.max() > moments.sum() * (1.0 + 1e-9):
            raise ValueError(
                f"inertia must be positive, none greater than the others' sum: {moments.tolist()}"
            )
        torque = finite_vector("torque_limit", self.torque_limit, 3)
        if torque.min() < 0.0:
            raise ValueError(f"torque_limit must be at least 0, got {torque.tolist()}")
        finite_number("inertia_mass", self.inertia_mass, above=0.0)
        finite_number("inertia_exponent", self.inertia_exponent, at_least=0.0, at_most=2.0)
        finite_number("rate_limit", self.rate_limit, above=0.0)
        finite_number("tilt_limit", self.tilt_limit, above=0.0, at_most=math.pi)
        finite_number("engine_lag", self.engine_lag, at_least=0.0)
        finite_number("gimbal_limit", self.gimbal_limit, at_least=0.0, at_most=math.radians(80.0))
        finite_number("engine_arm", self.engine_arm, at_least=0.0)

    def inertia_at(self, mass: float) -> Array:
        """[kg m^2] shape (3,): principal moments at a mass [kg]."""
        return np.array(self.inertia) * (mass / self.inertia_mass) ** self.inertia_exponent

    def numbers(self, gravity: ArrayLike = MOON_GRAVITY) -> BodyNumbers:
        """What compiled code reads, with gravity [m/s^2], shape (3,)."""
        return BodyNumbers(
            np.array(self.inertia, dtype=np.float64),
            np.array(self.torque_limit, dtype=np.float64),
            finite_vector("gravity", gravity, 3),
            float(self.inertia_mass),
            float(self.inertia_exponent),
            float(self.lander.exhaust_velocity),
            float(self.lander.min_thrust),
            float(self.lander.max_thrust),
            float(self.engine_lag),
            float(self.gimbal_limit),
            float(self.engine_arm),
            float(self.rate_limit),
            float(self.tilt_limit),
        )


class BodyNumbers(NamedTuple):
    """Fields of `RigidBody` and its lander for compiled code, units as there; gravity [m/s^2]."""

    inertia: Array
    torque_limit: Array
    gravity: Array
    inertia_mass: float
    inertia_exponent: float
    exhaust_velocity: float
    min_thrust: float
    max_thrust: float
    engine_lag: float
    gimbal_limit: float
    engine_arm: float
    rate_limit: float
    tilt_limit: float


DEFAULT_BODY = RigidBody()
"""The paper's lander with a body; it starts at 1200 kg."""
