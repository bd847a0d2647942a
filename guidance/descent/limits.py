"""What a descent has to keep on its way, beside the vehicle's own bounds: one validated value."""

from __future__ import annotations

import math
from dataclasses import dataclass

from guidance.validation import finite_number


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on a descent's path, each None where there is none.

    Attributes:
        glide_slope: [rad] greatest angle, seen from the landing point, between the vehicle and the z axis, in
            (0, pi/2].
        speed: [m/s] greatest speed.

    Raises:
        ValueError: a limit is not finite, or out of range.
    """

    glide_slope: float | None = None
    speed: float | None = None

    def __post_init__(self) -> None:
        """Refuse limits that nothing can keep."""
        if self.glide_slope is not None:
            finite_number("limits.glide_slope", self.glide_slope, above=0.0, at_most=math.pi / 2)
        if self.speed is not None:
            finite_number("limits.speed", self.speed, above=0.0)


NO_LIMITS = Limits()
