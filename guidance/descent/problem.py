"""The landing problem that every planner solves: one validated value."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from guidance.arrays import Array
from guidance.descent.limits import NO_LIMITS, Limits
from guidance.lander import Lander
from guidance.state import State
from guidance.validation import finite_vector

LARGEST_NUMBER = 1e9
"""No distance, speed or mass of a powered descent is larger; far beyond it, their powers overflow."""
ROUNDING = 1e-6
"""What rounding may take from a limit: of the distance to the target or 1 m, of the speed or 1 m/s."""


_VECTORS = ("target", "gravity", "target_velocity", "angular_velocity")


def lies_below(start: Array, target: Array) -> bool:
    """Whether a start [m] lies below a target's altitude by more than rounding; both of shape (3,)."""
    depth = float(target[2] - start[2])
    return depth > 0.0 and depth > ROUNDING * max(1.0, math.dist(start, target))


@dataclass(frozen=True, eq=False)
class LandingProblem:
    """From `state` to `target` with the least propellant, never below the target's altitude.

    A start that breaks the altitude, the glide slope, the line of sight or the speed limit by no more than
    `ROUNDING` keeps it.

    Attributes:
        state: where the flight starts; its mass includes the propellant.
        target: [m] shape (3,), site frame.
        lander: the vehicle; its pointing limit is measured from the z axis.
        gravity: [m/s^2] shape (3,), constant in the site frame.
        limits: what the path has to keep.
        target_velocity: [m/s] shape (3,), at the target; rest unless given.
        angular_velocity: [rad/s] shape (3,), of the site frame, about an axis through its origin: Coriolis
            and centrifugal acceleration act beside gravity, which is the pull at the origin. Zero unless
            given.

    Raises:
        ValueError: an argument is out of range or not finite, the start lies below the target's altitude by
            more than rounding, its mass does not exceed the dry mass, or a number is beyond 1e9.
    """

    state: State
    target: Array
    lander: Lander
    gravity: Array
    limits: Limits = NO_LIMITS
    target_velocity: Array = field(default_factory=lambda: np.zeros(3))
    angular_velocity: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Refuse what no solver should see."""
        state = [*self.state.position.tolist(), *self.state.velocity.tolist(), self.state.mass]
        numbers = {"state": state}
        for name in _VECTORS:
            vector = finite_vector(name, getattr(self, name), 3)
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
            numbers[name] = vector.tolist()
        if not isinstance(self.lander, Lander):
            raise ValueError(f"lander must be a Lander, got {self.lander!r}")
        if not isinstance(self.limits, Limits):
            raise ValueError(f"limits must be a Limits, got {self.limits!r}")
        for name, values in numbers.items():
            if max(map(abs, values)) > LARGEST_NUMBER:
                raise ValueError(f"{name}: no number may exceed {LARGEST_NUMBER:g}, got {values}")
        if self.state.mass <= self.lander.dry_mass:
            raise ValueError(
                f"state: mass {self.state.mass:g} kg must exceed the dry mass {self.lander.dry_mass:g} kg"
            )
        if lies_below(self.state.position, self.target):
            raise ValueError(
                f"state: start altitude {self.state.position[2]:g} m lies below the target's, "
                f"{self.target[2]:g} m"
            )

    @property
    def glide_slope_limit(self) -> float | None:
        """[rad] that of the limits."""
        return self.limits.glide_slope

    @property
    def speed_limit(self) -> float | None:
        """[m/s] that of the limits."""
        return self.limits.speed

    @property
    def has_glide_slope(self) -> bool:
        """Whether the glide slope limit says more than the altitude floor does."""
        return self.glide_slope_limit is not None and self.glide_slope_limit < math.pi / 2 - 1e-6

    @cached_property
    def offset(self) -> Array:
        """[m] shape (3,), read-only: the start as seen from the target.

        One that breaks the altitude, the glide slope or the line of sight by no more than rounding is moved
        to keep it.
        """
        offset = self.state.position - self.target
        if offset[2] < 0.0:
            offset[2] = 0.0
        outside = self.outside_glide_slope(offset)
        rounding = ROUNDING * max(1.0, math.hypot(*offset.tolist()))
        if 0.0 < outside <= rounding:
            across, angle = math.hypot(offset[0], offset[1]), self.glide_slope_limit or 0.0
            offset[:2] *= 1.0 - outside * math.cos(angle) / across
            offset[2] += outside * math.sin(angle)
        sight = self.limits.line_of_sight
        if sight is not None and 0.0 < sight.outside(offset) <= rounding:
            offset = sight.on_surface(offset)
        offset.flags.writeable = False
        return offset

    def outside_glide_slope(self, vector: Array) -> float:
        """How far a vector from the landing point, shape (3,), lies outside the glide slope; inside: <= 0."""
        if self.glide_slope_limit is None or not self.has_glide_slope:
            return 0.0
        angle, across = self.glide_slope_limit, math.hypot(vector[0], vector[1])
        return math.cos(angle) * across - math.sin(angle) * float(vector[2])

    @property
    def rotates(self) -> bool:
        """Whether the site frame turns."""
        return any(self.angular_velocity.tolist())

    @property
    def ends_at_rest(self) -> bool:
        """Whether the vehicle stops at the target."""
        return not any(self.target_velocity.tolist())

    @property
    def pull_at_target(self) -> Array:
        """[m/s^2] shape (3,): gravity and the centrifugal acceleration at the target."""
        spin = self.angular_velocity
        return self.gravity - np.cross(spin, np.cross(spin, self.target)) if self.rotates else self.gravity

    @property
    def arrived(self) -> bool:
        """Whether the start is the target, with its velocity, to rounding: no flight is needed."""
        near = math.hypot(*self.offset.tolist()) <= ROUNDING
        return near and math.dist(self.state.velocity, self.target_velocity) <= self.speed_rounding

    @property
    def speed_rounding(self) -> float:
        """[m/s] a speed that counts as none beside those of the start and of the target."""
        return ROUNDING * max(1.0, self._end_speed)

    @property
    def _end_speed(self) -> float:
        return max(float(np.linalg.norm(self.state.velocity)), float(np.linalg.norm(self.target_velocity)))

    @property
    def speed_bound(self) -> float | None:
        """[m/s] the speed limit, eased where the start or the end exceeds it by no more than rounding."""
        limit, speed = self.speed_limit, self._end_speed
        if limit is None or not limit < speed <= limit * (1.0 + ROUNDING):
            return limit
        return speed

    @property
    def log_mass_ratio(self) -> float:
        """Natural logarithm of start mass over dry mass: all the propellant there is."""
        return math.log(self.state.mass / self.lander.dry_mass)
