"""The vehicle: what a guidance law must know of its engine and its tank."""

from __future__ import annotations

import math
from dataclasses import dataclass

from guidance.constants import STANDARD_GRAVITY
from guidance.validation import finite_number


@dataclass(frozen=True)
class Lander:
    """A point-mass lander with one throttled engine.

    Attributes:
        dry_mass: [kg] mass with an empty tank. The propellant on board is the state's: mass - dry_mass.
        max_thrust: [N] greatest thrust.
        specific_impulse: [s] referred to standard gravity, 9.80665 m/s^2.
        min_thrust: [N] least thrust while the engine burns.
        pointing_limit: [rad] greatest angle of the thrust from the local vertical, in (0, pi]; None for none.

    Raises:
        ValueError: a field is not finite, out of range, or min_thrust exceeds max_thrust.
    """

    dry_mass: float = 1150.0
    max_thrust: float = 12000.0
    specific_impulse: float = 325.0
    min_thrust: float = 0.0
    pointing_limit: float | None = None

    def __post_init__(self) -> None:
        """Refuse a vehicle that cannot exist."""
        finite_number("dry_mass", self.dry_mass, above=0.0)
        finite_number("max_thrust", self.max_thrust, above=0.0)
        finite_number("specific_impulse", self.specific_impulse, above=0.0)
        finite_number("min_thrust", self.min_thrust, at_least=0.0, at_most=self.max_thrust)
        if self.pointing_limit is not None:
            finite_number("pointing_limit", self.pointing_limit, above=0.0, at_most=math.pi)

    @property
    def exhaust_velocity(self) -> float:
        """[m/s] effective exhaust velocity, g_ref Isp."""
        return STANDARD_GRAVITY * self.specific_impulse

    @property
    def max_mass_flow(self) -> float:
        """[kg/s] propellant flow at full thrust."""
        return self.max_thrust / self.exhaust_velocity


PAPER_LANDER = Lander()
"""The paper's lander (its table of simulation conditions); it starts at 1200 kg."""
