"""A lander's navigation: its sensors, what it knows at the start, and how its filter is set.

One frozen value, and the named faults that make another of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from guidance.arrays import Array
from guidance.validation import finite_number, unknown_name
from hda.navigation.layout import FilterNumbers
from hda.navigation.sensors import (
    Altimeter,
    Gyroscope,
    InertialUnit,
    SiteFixes,
    TerrainFixes,
    Velocimeter,
    aiding_numbers,
)

_LOST_BELOW = 100.0  # [m] above the ground, `altimeter-lost-low`
_NO_VELOCIMETER = Velocimeter()  # its beams stand in the kernels' numbers; they are never read


@dataclass(frozen=True)
class NavigationSystem:
    """Sensors, initial knowledge and filter.

    Attributes:
        inertial: the inertial unit; the filter flies by it between readings.
        altimeter: or None.
        velocimeter: or None.
        terrain: fixes against the map from orbit, or None.
        site: fixes of the landing site, or None; without them the site is measured once.
        gyroscope: of a rigid body: the filter estimates its attitude, and the velocimeter's beams turn with
            it. None: the attitude errs by one constant tilt.
        horizontal_error: [m] one sigma of the initial position, east and north.
        vertical_error: [m] one sigma of the initial position, up.
        velocity_error: [m/s] one sigma of the initial velocity along each axis.
        ground_error: [m] one sigma of the ground's height below before the first reading: the altimeter's
            first range ties it.
        relief: [m] standard deviation of the ground's height, and ...
        relief_length: [m] ... its correlation length: how fast the ground may change under the beam (chosen:
            above what a step of 1 to 256 m changes on the tuning tiles of `paper`,
            docs/explanation/navigation.md).
        false_rejections: share of readings that a gate rejects while all is as the filter believes.
        patience: after so many rejections in a row the filter doubts itself, not the sensor (chosen).

    Raises:
        ValueError: a field is out of range.
    """

    inertial: InertialUnit = field(default_factory=InertialUnit)
    altimeter: Altimeter | None = field(default_factory=Altimeter)
    velocimeter: Velocimeter | None = field(default_factory=Velocimeter)
    terrain: TerrainFixes | None = field(default_factory=TerrainFixes)
    site: SiteFixes | None = field(default_factory=SiteFixes)
    horizontal_error: float = 20.0
    vertical_error: float = 5.0
    velocity_error: float = 0.2
    ground_error: float = 100.0
    relief: float = 6.0
    relief_length: float = 80.0
    false_rejections: float = 1e-3
    patience: int = 3
    gyroscope: Gyroscope | None = None

    def __post_init__(self) -> None:
        """Refuse a system that cannot exist."""
        for name in ("horizontal_error", "vertical_error", "velocity_error", "ground_error", "relief"):
            finite_number(name, getattr(self, name), at_least=0.0)
        finite_number("relief_length", self.relief_length, above=0.0)
        finite_number("false_rejections", self.false_rejections, above=0.0, at_most=0.5)
        if self.patience < 1:
            raise ValueError(f"patience must be at least 1, got {self.patience}")

    @cached_property
    def gates(self) -> Array:
        """Greatest squared innovation that each sensor's gate lets through, shape (4,); read-only."""
        freedom = np.array([1.0, 3.0, 3.0, 3.0])  # ALTIMETER, VELOCIMETER, TERRAIN_FIX, SITE_FIX
        gates = np.array(chdtri(freedom, self.false_rejections))
        gates.flags.writeable = False
        return gates

    def numbers(self, period: float) -> FilterNumbers:
        """The system for the kernels of a vehicle that steers each `period` [s].

        Raises:
            ValueError: a sensor's interval is not a whole number of periods.
        """
        return FilterNumbers(
            inertial=self.inertial.numbers,
            altimeter=aiding_numbers(self.altimeter, period),
            velocimeter=aiding_numbers(self.velocimeter, period),
            terrain=aiding_numbers(self.terrain, period),
            beams=(self.velocimeter or _NO_VELOCIMETER).beams,
            steepness=math.cos((self.velocimeter or _NO_VELOCIMETER).slant_limit),
            relief=self.relief,
            relief_length=self.relief_length,
            gates=self.gates,
            patience=self.patience,
        )


def _raise_floor(system: NavigationSystem) -> NavigationSystem:
    altimeter = system.altimeter
    if altimeter is None or altimeter.ceiling < _LOST_BELOW:
        return replace(system, altimeter=None)
    return replace(system, altimeter=replace(altimeter, floor=max(_LOST_BELOW, altimeter.floor)))


def _drop_looks(system: NavigationSystem) -> NavigationSystem:
    if system.site is None:
        return system
    return replace(system, site=replace(system.site, dropout=1.0 / 3.0))


def _add_plume(system: NavigationSystem) -> NavigationSystem:
    altimeter, velocimeter = system.altimeter, system.velocimeter
    if altimeter is not None:
        altimeter = replace(altimeter, plume_height=50.0, plume_noise=1.0)
    if velocimeter is not None:
        velocimeter = replace(velocimeter, plume_height=50.0, plume_noise=0.5)
    return replace(system, altimeter=altimeter, velocimeter=velocimeter)


NAVIGATION_FAULTS: dict[str, Callable[[NavigationSystem], NavigationSystem]] = {
    "altimeter-lost-low": _raise_floor,
    "velocimeter-lost": lambda system: replace(system, velocimeter=None),
    "no-terrain-fix": lambda system: replace(system, terrain=None),
    "site-fix-missing": _drop_looks,
    "plume-noise": _add_plume,
}
"""Faults by name: the altimeter lost below 100 m; no velocimeter; no fix against the map from orbit; one look
in three without a fix of the site; the plume adds 1 m and 0.5 m/s (chosen) below 50 m."""


def add_fault(system: NavigationSystem, name: str) -> NavigationSystem:
    """The same system with a named fault of `NAVIGATION_FAULTS`.

    Raises:
        ValueError: there is no such fault; the nearest valid names are given.
    """
    if name not in NAVIGATION_FAULTS:
        raise ValueError(unknown_name("navigation fault", name, NAVIGATION_FAULTS))
    return NAVIGATION_FAULTS[name](system)
