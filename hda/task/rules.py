"""The rules of the task and the ranges of its starts: what a preset is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.validation import finite_number


@dataclass(frozen=True)
class Rules:
    """How an episode runs and how it is judged.

    Attributes:
        decision_interval: [s] time between looks (paper: 5 s, the processing time of ALHAT).
        control_period: [s] time over which a thrust is held; the decision interval over a whole number.
        max_decisions: an episode still in flight after so many is truncated.
        thrust_error: bound of the relative thrust error, uniform, one draw per decision interval (paper:
            0.05).
        navigation_position_error: [m] 1 sigma of the error of the estimated position along each axis, one
            draw for the episode. Looks are taken and placed relative to the lander, so a horizontal error
            moves the first target and little else; a vertical one ends the flight above or into the ground.
        navigation_velocity_error: [m/s] 1 sigma of the error of the estimated velocity along each axis, one
            draw for the episode. ZEM/ZEV turns an error b into (K_R - K_V) / K_V b at touchdown: 2 b at 6/2.
        crash_speed: [m/s] a faster touchdown is a crash.
        soft_speed: [m/s] `success` asks for a touchdown no faster, vertically and horizontally.

    Raises:
        ValueError: a field is out of range, or the control period does not divide the decision interval.
    """

    decision_interval: float = 5.0
    control_period: float = 0.5
    max_decisions: int = 20
    thrust_error: float = 0.05
    navigation_position_error: float = 0.0
    navigation_velocity_error: float = 0.0
    crash_speed: float = 5.0
    soft_speed: float = 2.0

    def __post_init__(self) -> None:
        """Check every field."""
        finite_number("decision_interval", self.decision_interval, above=0.0)
        finite_number("control_period", self.control_period, above=0.0, at_most=self.decision_interval)
        finite_number("thrust_error", self.thrust_error, at_least=0.0, at_most=0.9)
        finite_number("navigation_position_error", self.navigation_position_error, at_least=0.0)
        finite_number("navigation_velocity_error", self.navigation_velocity_error, at_least=0.0)
        finite_number("crash_speed", self.crash_speed, above=0.0)
        finite_number("soft_speed", self.soft_speed, above=0.0)
        if self.max_decisions < 1:
            raise ValueError(f"max_decisions must be at least 1, got {self.max_decisions}")
        ratio = self.decision_interval / self.control_period
        if abs(ratio - round(ratio)) > 1e-9 * ratio:
            raise ValueError(
                f"control_period must be decision_interval over a whole number, got {self.control_period:g} s"
                f" for {self.decision_interval:g} s"
            )

    @property
    def control_periods(self) -> int:
        """Control periods in one decision interval."""
        return round(self.decision_interval / self.control_period)


@dataclass(frozen=True)
class Range:
    """A uniform draw between two bounds.

    Attributes:
        low: least value.
        high: greatest value; equal to `low` for a fixed value.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Refuse an empty range."""
        finite_number("low", self.low)
        finite_number("high", self.high, at_least=self.low)

    def draw(self, rng: np.random.Generator) -> float:
        """One uniform draw."""
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class StartConditions:
    """Where and how an episode starts (paper, table of simulation conditions).

    Attributes:
        altitude: [m] above the map datum.
        distance: [m] horizontal distance to the first target.
        descent_speed: [m/s] downward.
        horizontal_speed: [m/s].
        approach_spread: [rad] the horizontal velocity points toward the target within this angle on either
            side.
        mass: [kg].
        target_area: [m] x and y of the first target lie in this range.
        hazard_radius: [m] radius around the first target within which ...
        hazard_share: ... at least this share of the ground is unsafe.

    Raises:
        ValueError: a field is out of range.
    """

    altitude: Range = Range(900.0, 1000.0)
    distance: Range = Range(200.0, 250.0)
    descent_speed: Range = Range(20.0, 35.0)
    horizontal_speed: Range = Range(5.0, 10.0)
    approach_spread: float = math.radians(30.0)
    mass: Range = Range(1200.0, 1200.0)
    target_area: Range = Range(250.0, 750.0)
    hazard_radius: float = 100.0
    hazard_share: float = 0.8

    def __post_init__(self) -> None:
        """Refuse starts that mean nothing."""
        for name in ("distance", "descent_speed", "horizontal_speed"):
            finite_number(f"{name}.low", getattr(self, name).low, at_least=0.0)
        finite_number("approach_spread", self.approach_spread, at_least=0.0, at_most=math.pi)
        finite_number("hazard_radius", self.hazard_radius, above=0.0)
        finite_number("hazard_share", self.hazard_share, at_least=0.0, at_most=1.0)
