"""What a lander demands of its ground: the limits of Algorithm 1 and the size of the vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from guidance.validation import finite_number


@dataclass(frozen=True)
class SafetyCriteria:
    """The lander's size, the ground that it stands, and the error of the elevation.

    Attributes:
        footprint_diameter: [m] circle around the outer edges of the four pads (ALHAT: 10 m).
        pad_diameter: [m] diameter of a pad.
        max_slope: [rad] greatest safe angle of the lander's plane from horizontal (ALHAT: 10 deg).
        max_roughness: [m] greatest safe height of the ground above the lander's plane (ALHAT: 0.30 m).
        range_noise: [m] one standard deviation of the elevation (ALHAT: 5 cm at three).

    Raises:
        ValueError: a field is out of range.
    """

    footprint_diameter: float = 10.0
    pad_diameter: float = 1.0
    max_slope: float = math.radians(10.0)
    max_roughness: float = 0.30
    range_noise: float = 0.05 / 3.0

    def __post_init__(self) -> None:
        """Refuse criteria that mean nothing."""
        finite_number("footprint_diameter", self.footprint_diameter, above=0.0)
        finite_number("pad_diameter", self.pad_diameter, above=0.0)
        finite_number("max_slope", self.max_slope, at_least=0.0, at_most=math.pi / 2.0)
        finite_number("max_roughness", self.max_roughness, at_least=0.0)
        finite_number("range_noise", self.range_noise, at_least=0.0)


DEFAULT_CRITERIA = SafetyCriteria()
