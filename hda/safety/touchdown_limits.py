"""How hard a lander may touch down: published limits of speed, slope, and a rigid body's attitude."""

from __future__ import annotations

import math
from dataclasses import dataclass

from guidance.validation import finite_number


@dataclass(frozen=True)
class TouchdownLimits:
    """Greatest speeds, slope and lean of a touchdown that the gear takes; each limit itself is kept.

    Attributes:
        vertical_speed: [m/s] square to the plane that the lander comes to stand on.
        horizontal_speed: [m/s] along that plane.
        slope: [rad] angle of that plane from horizontal.
        tilt: [rad] angle of a rigid body's axis from the vertical at the contact (6 deg, as designed for the
            Apollo lunar module).
        turn_rate: [rad/s] its rate of turn there (2 deg/s, likewise).

    Raises:
        ValueError: a field is not positive and finite, or slope or tilt is not below 90 degrees.
    """

    vertical_speed: float
    horizontal_speed: float
    slope: float
    tilt: float = math.radians(6.0)
    turn_rate: float = math.radians(2.0)

    def __post_init__(self) -> None:
        """Refuse limits that mean nothing."""
        finite_number("vertical_speed", self.vertical_speed, above=0.0)
        finite_number("horizontal_speed", self.horizontal_speed, above=0.0)
        finite_number("slope", self.slope, above=0.0, at_most=math.radians(89.0))
        finite_number("tilt", self.tilt, above=0.0, at_most=math.radians(89.0))
        finite_number("turn_rate", self.turn_rate, above=0.0)


DESIGN_LIMITS = TouchdownLimits(vertical_speed=2.0, horizontal_speed=0.5, slope=math.radians(12.0))
"""What Chandrayaan-3 was designed for (2, 0.5 m/s, 12 deg; a slide of ISRO in the Hindustan Times)."""

TESTED_LIMITS = TouchdownLimits(vertical_speed=3.0, horizontal_speed=1.0, slope=math.radians(12.0))
"""What Chandrayaan-3 was tested to (3, 1 m/s, 12 deg; the same source). No test of lean or turn is known."""
