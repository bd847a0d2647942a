"""What a point-mass vehicle is at one instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True, eq=False)
class State:
    """Position, velocity and mass in the site frame (x east, y north, z up).

    Attributes:
        position: [m] shape (3,), read-only.
        velocity: [m/s] shape (3,), read-only.
        mass: [kg] greater than zero.

    Raises:
        ValueError: a field is not finite, has the wrong shape, or the mass is not positive.
    """

    position: Array
    velocity: Array
    mass: float

    def __post_init__(self) -> None:
        """Copy the arrays and freeze them, so that a State never changes behind a record."""
        for name in ("position", "velocity"):
            vector = finite_vector(name, getattr(self, name), 3)
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
        object.__setattr__(self, "mass", finite_number("mass", self.mass, above=0.0))

    @classmethod
    def parse(cls, value: State | Sequence[float] | Array) -> State:
        """Accept a State or seven numbers (x, y, z, vx, vy, vz, mass); raise ValueError for anything else."""
        if isinstance(value, State):
            return value
        numbers = finite_vector("state", value, 7)
        return cls(numbers[:3], numbers[3:6], float(numbers[6]))

    def as_array(self) -> Array:
        """Seven numbers (x, y, z, vx, vy, vz, mass), a new array."""
        return np.concatenate([self.position, self.velocity, [self.mass]])
