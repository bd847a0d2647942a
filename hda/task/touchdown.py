"""Where a flight ends: on the target plane, as in the paper, or on the real ground below the pads."""

from __future__ import annotations

from dataclasses import dataclass

from guidance.validation import finite_number
from hda.safety.criteria import SafetyCriteria
from hda.safety.touchdown_limits import DESIGN_LIMITS, TouchdownLimits
from hda.safety.touchdown_stance import Stance


@dataclass(frozen=True)
class PlaneTouchdown:
    """The flight ends where it crosses the plane of the target; the cell there is safe or is not.

    All sites lie on that plane, and `Rules.soft_speed` is the limit of both speeds.
    """

    def stance(self, criteria: SafetyCriteria) -> None:
        """No pads: the lander is a point."""


@dataclass(frozen=True)
class GroundTouchdown:
    """The flight ends where a pad or the belly of the upright lander first touches the true ground.

    Sites carry a height, that of the pads' plane at contact. The lander then settles on the ground, and is
    judged as it stands there. Its size, and the clearance of its belly, are those of Algorithm 1.

    Attributes:
        limits: of speed and slope.
        bearing: [rad] of the first pad from the axis, from east toward north, the same in every episode: the
            ground knows no direction.
        centre_of_mass_height: [m] above the plane of the pads (chosen: a low, wide lander).
        moment_of_inertia: [kg m^2] about a horizontal axis (the Apollo lunar module's by its Luminary 099
            program, scaled to 1200 kg as mass^(5/3): 875).

    Raises:
        ValueError: a field is out of range.
    """

    limits: TouchdownLimits = DESIGN_LIMITS
    bearing: float = 0.0
    centre_of_mass_height: float = 1.5
    moment_of_inertia: float = 900.0

    def __post_init__(self) -> None:
        """Refuse a lander that cannot be."""
        finite_number("bearing", self.bearing)
        finite_number("centre_of_mass_height", self.centre_of_mass_height, above=0.0)
        finite_number("moment_of_inertia", self.moment_of_inertia, at_least=0.0)

    def stance(self, criteria: SafetyCriteria) -> Stance:
        """The lander of the criteria, as it is turned here."""
        return Stance.of(criteria, self.bearing)


Touchdown = PlaneTouchdown | GroundTouchdown
