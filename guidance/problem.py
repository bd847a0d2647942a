"""The landing problem that every planner solves: one validated value."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.lander import Lander
from guidance.state import State
from guidance.validation import finite_number, finite_vector

LARGEST_NUMBER = 1e9
"""No distance, speed or mass of a powered descent is larger; far beyond it, their powers overflow."""


@dataclass(frozen=True, eq=False)
class LandingProblem:
    """From `state` to rest on `target` with the least propellant, never below the target's altitude.

    Attributes:
        state: where the flight starts; its mass includes the propellant.
        target: [m] shape (3,), site frame.
        lander: the vehicle; its pointing limit is measured from the z axis.
        gravity: [m/s^2] shape (3,), constant.
        glide_slope_limit: [rad] greatest angle, seen from the landing point, between the vehicle and the z
            axis, in (0, pi/2]; None for none.
        speed_limit: [m/s] greatest speed; None for none.

    Raises:
        ValueError: an argument is out of range or not finite, the start lies below the target's altitude,
            its mass does not exceed the dry mass, or a number is beyond 1e9.
    """

    state: State
    target: NDArray[np.float64]
    lander: Lander
    gravity: NDArray[np.float64]
    glide_slope_limit: float | None = None
    speed_limit: float | None = None

    def __post_init__(self) -> None:
        """Refuse what no solver should see."""
        for name in ("target", "gravity"):
            vector = finite_vector(name, getattr(self, name), 3)
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
        if not isinstance(self.lander, Lander):
            raise ValueError(f"lander must be a Lander, got {self.lander!r}")
        numbers = (("state", self.state.as_array()), ("target", self.target), ("gravity", self.gravity))
        for name, vector in numbers:
            if np.abs(vector).max() > LARGEST_NUMBER:
                raise ValueError(f"{name}: no number may exceed {LARGEST_NUMBER:g}, got {vector.tolist()}")
        if self.state.mass <= self.lander.dry_mass:
            raise ValueError(
                f"state: mass {self.state.mass:g} kg must exceed the dry mass {self.lander.dry_mass:g} kg"
            )
        if self.state.position[2] < self.target[2]:
            raise ValueError(
                f"state: start altitude {self.state.position[2]:g} m lies below the target's, "
                f"{self.target[2]:g} m"
            )
        if self.glide_slope_limit is not None:
            finite_number("glide_slope_limit", self.glide_slope_limit, above=0.0, at_most=math.pi / 2)
        if self.speed_limit is not None:
            finite_number("speed_limit", self.speed_limit, above=0.0)

    @property
    def has_glide_slope(self) -> bool:
        """Whether the glide slope limit says more than the altitude floor does."""
        return self.glide_slope_limit is not None and self.glide_slope_limit < math.pi / 2 - 1e-6

    @property
    def offset(self) -> NDArray[np.float64]:
        """[m] shape (3,): the start as seen from the target."""
        return self.state.position - self.target

    @property
    def log_mass_ratio(self) -> float:
        """Natural logarithm of start mass over dry mass: all the propellant there is."""
        return math.log(self.state.mass / self.lander.dry_mass)
