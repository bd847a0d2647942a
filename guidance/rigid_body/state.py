"""What a rigid vehicle is at one instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from guidance.arrays import Array
from guidance.state import State
from guidance.validation import finite_number, finite_vector

SIZE = 17
"""Numbers of a state: position 0:3, velocity 3:6, attitude 6:10, rates 10:13, mass 13, thrust 14:17."""
_UNIT = 1e-6  # by how much the length of a quaternion may differ from one


def _upright() -> Array:
    return np.array([1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class RigidState:
    """Motion, attitude, mass and engine of a rigid body; arrays are copied and read-only.

    Attributes:
        position: [m] shape (3,), of the mass centre, site frame.
        velocity: [m/s] shape (3,), site frame.
        mass: [kg] greater than zero.
        attitude: unit quaternion, scalar first, shape (4,): turns body vectors into the site frame. Upright,
            heading zero, unless given.
        rates: [rad/s] shape (3,), body frame. At rest unless given.
        thrust: [N] shape (3,), body frame: what the engine gives at this instant. None unless given.

    Raises:
        ValueError: a field is not finite or of the wrong shape, the attitude is not of unit length, or the
            mass is not positive.
    """

    position: Array
    velocity: Array
    mass: float
    attitude: Array = field(default_factory=_upright)
    rates: Array = field(default_factory=lambda: np.zeros(3))
    thrust: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Copy the arrays and freeze them."""
        for name, size in (("position", 3), ("velocity", 3), ("attitude", 4), ("rates", 3), ("thrust", 3)):
            vector = finite_vector(name, getattr(self, name), size)
            if name == "attitude":
                length = float(np.linalg.norm(vector))
                if abs(length - 1.0) > _UNIT:
                    raise ValueError(f"attitude must be a unit quaternion, its length is {length:g}")
                vector /= length
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
        object.__setattr__(self, "mass", finite_number("mass", self.mass, above=0.0))

    @classmethod
    def parse(cls, value: RigidState | State | Sequence[float] | Array) -> RigidState:
        """Accept a RigidState, or what `State.parse` does, which stands upright, at rest, its engine off.

        Raises:
            ValueError: it is neither.
        """
        if isinstance(value, RigidState):
            return value
        point = State.parse(value)
        return cls(point.position, point.velocity, point.mass)

    @classmethod
    def of_array(cls, numbers: Array) -> RigidState:
        """The state of seventeen numbers in the order of `SIZE`."""
        return cls(
            numbers[:3], numbers[3:6], float(numbers[13]), numbers[6:10], numbers[10:13], numbers[14:17]
        )

    def as_array(self) -> Array:
        """Seventeen numbers in the order of `SIZE`, a new array."""
        parts = [self.position, self.velocity, self.attitude, self.rates, [self.mass], self.thrust]
        return np.concatenate(parts)

    @property
    def point(self) -> State:
        """Position, velocity and mass alone."""
        return State(self.position, self.velocity, self.mass)
