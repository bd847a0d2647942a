"""What a descent has to keep on its way, beside the vehicle's own bounds: one validated value."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.validation import finite_number, finite_vector


@dataclass(frozen=True)
class Cone:
    """The directions within an angle of an axis.

    Attributes:
        angle: [rad] in (0, pi].
        axis: direction, of any length but zero; kept as a unit vector. Up unless given.

    Raises:
        ValueError: the angle is out of range, or the axis is no direction.
    """

    angle: float
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        """Make the axis a unit vector."""
        finite_number("angle", self.angle, above=0.0, at_most=math.pi)
        axis = finite_vector("axis", self.axis, 3)
        length = float(np.linalg.norm(axis))
        if not 0.0 < length < math.inf:
            raise ValueError(f"axis must be a direction, got {axis.tolist()}")
        east, north, up = (float(number) for number in axis / length)
        object.__setattr__(self, "axis", (east, north, up))

    @property
    def direction(self) -> Array:
        """The axis, shape (3,)."""
        return np.array(self.axis)

    @property
    def across(self) -> Array:
        """Two unit vectors normal to the axis and to each other, shape (2, 3)."""
        axis = self.direction
        first = np.eye(3)[int(np.abs(axis).argmin())]
        first = np.cross(np.cross(axis, first), axis)
        first = first / np.linalg.norm(first)
        return np.array([first, np.cross(axis, first)], dtype=np.float64)

    def outside(self, points: Array) -> Array:
        """[m] how far points seen from the apex, shape (..., 3), lie outside; at most zero inside.

        That is their distance from the surface of a cone no wider than a right angle; behind it, less.
        """
        across = np.linalg.norm(points @ self.across.T, axis=-1)
        return math.cos(self.angle) * across - math.sin(self.angle) * (points @ self.direction)

    def on_surface(self, point: Array) -> Array:
        """[m] shape (3,): the place on the surface nearest to a point outside it, not on the axis."""
        aside = point - (point @ self.direction) * self.direction
        normal = math.cos(self.angle) * aside / np.linalg.norm(aside) - math.sin(self.angle) * self.direction
        return point - float(self.outside(point)) * normal

    def excess(self, vector: Array) -> float:
        """[rad] by how much a vector, shape (3,) and not zero, leaves the cone; 0 inside."""
        across = float(np.linalg.norm(np.cross(self.direction, vector)))
        return max(0.0, math.atan2(across, float(self.direction @ vector)) - self.angle)


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on a descent's path, each None where there is none.

    Attributes:
        glide_slope: [rad] greatest angle, seen from the landing point, between the vehicle and the z axis, in
            (0, pi/2].
        speed: [m/s] greatest speed.
        final_thrust_direction: directions that the thrust may have at the end, which is the last node: a
            touchdown upright. Over the last interval the thrust turns into the cone, the faster the finer
            the mesh. A thrust of nothing has no direction.
        line_of_sight: where the vehicle may be, as seen from the target; the angle is at most pi/2. With a
            free landing point the cone still stands on the target, and holds the landing point too.
        thrust_rate: [N/s] greatest change of the thrust vector per second, in size and direction together,
            from the first node to the last. The engine may start at any thrust, and is cut off at the end.

    Raises:
        ValueError: a limit is not finite, out of range, or not of its type.
    """

    glide_slope: float | None = None
    speed: float | None = None
    final_thrust_direction: Cone | None = None
    line_of_sight: Cone | None = None
    thrust_rate: float | None = None

    def __post_init__(self) -> None:
        """Refuse limits that nothing can keep."""
        if self.glide_slope is not None:
            finite_number("limits.glide_slope", self.glide_slope, above=0.0, at_most=math.pi / 2)
        if self.speed is not None:
            finite_number("limits.speed", self.speed, above=0.0)
        if self.thrust_rate is not None:
            finite_number("limits.thrust_rate", self.thrust_rate, above=0.0)
        self._demand_cone("final_thrust_direction")
        self._demand_cone("line_of_sight")
        if self.line_of_sight is not None:
            finite_number("limits.line_of_sight.angle", self.line_of_sight.angle, at_most=math.pi / 2)

    def _demand_cone(self, name: str) -> None:
        value = getattr(self, name)
        if value is not None and not isinstance(value, Cone):
            raise ValueError(f"limits.{name} must be a Cone, got {value!r}")


NO_LIMITS = Limits()
