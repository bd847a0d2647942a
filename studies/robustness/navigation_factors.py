"""Factors of a lander that navigates: each sensor of `hda.navigation`, and what is known at the start.

The filter is told each number, so it stays honest: what a level costs is what such a sensor cannot give.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from guidance.constants import STANDARD_GRAVITY
from hda.navigation.system import NavigationSystem
from hda.task.presets import Preset
from studies.robustness.factor import Factor

Sensor = Literal["inertial", "gyroscope", "altimeter", "velocimeter", "terrain", "site"]
"""A sensor's field in `NavigationSystem`."""

_MICRO_G = 1e-6 * STANDARD_GRAVITY


def _navigation(preset: Preset) -> NavigationSystem:
    if preset.navigation is None:
        raise ValueError(f"preset {preset.name!r} has no navigation filter: fly the factor on `navigated`")
    return preset.navigation


def _measured(preset: Preset, sensor: Sensor, field: str) -> float:
    part = getattr(_navigation(preset), sensor)
    if part is None:
        raise ValueError(f"preset {preset.name!r} has no navigation sensor {sensor!r} to vary")
    return getattr(part, field)


def _sensor_factor(
    place: tuple[Sensor, str], name: str, label: str, levels: tuple[float, ...], unit: float = 1.0
) -> Factor:
    """A factor that is one field of a sensor; `unit` of the label in SI units."""
    sensor, field = place

    def vary(preset: Preset, value: float) -> Preset:
        system = _navigation(preset)
        changed = replace(getattr(system, sensor), **{field: unit * value})
        return replace(preset, navigation=replace(system, **{sensor: changed}))

    return Factor(
        name,
        label,
        lambda preset: _measured(preset, sensor, field) / unit,
        levels,
        vary,
        lambda preset: preset.navigation is not None and getattr(preset.navigation, sensor) is not None,
    )


def _start_factor(field: str, name: str, label: str, levels: tuple[float, ...]) -> Factor:
    """A factor that is one deviation of the state at the start."""
    return Factor(
        name,
        label,
        lambda preset: getattr(_navigation(preset), field),
        levels,
        lambda preset, value: replace(preset, navigation=replace(_navigation(preset), **{field: value})),
        lambda preset: preset.navigation is not None,
    )


NAVIGATION_FACTORS: tuple[Factor, ...] = (
    _sensor_factor(
        ("inertial", "bias"),
        "accelerometer-bias",
        "bias of the accelerometer (1 sigma) [micro-g]",
        (10_000.0, 3000.0, 1000.0, 0.0),
        _MICRO_G,
    ),
    _sensor_factor(
        ("inertial", "tilt"),
        "attitude-error",
        "error of the attitude about each axis (1 sigma) [mrad]",
        (10.0, 3.0, 0.0, 30.0),
        1e-3,
    ),
    _sensor_factor(
        ("gyroscope", "noise"),
        "gyroscope-noise",
        "angle random walk of the gyroscope (1 sigma) [deg/sqrt(h)]",
        (7.0, 0.7, 0.0),
        math.radians(1.0) / 60.0,
    ),
    _sensor_factor(
        ("gyroscope", "bias"),
        "gyroscope-bias",
        "bias of the gyroscope about each axis (1 sigma) [deg/h]",
        (1000.0, 100.0, 10.0, 0.0),
        math.radians(1.0) / 3600.0,
    ),
    _sensor_factor(
        ("altimeter", "noise"), "altimeter-noise", "noise of the altimeter (1 sigma) [m]", (10.0, 1.0, 0.01)
    ),
    _sensor_factor(
        ("altimeter", "bias"), "altimeter-bias", "bias of the altimeter (1 sigma) [m]", (10.0, 1.0, 0.0)
    ),
    _sensor_factor(
        ("velocimeter", "noise"),
        "velocimeter-noise",
        "noise of the velocimeter along a beam (1 sigma) [m/s]",
        (1.0, 0.2, 0.05),
    ),
    _sensor_factor(
        ("velocimeter", "bias"),
        "velocimeter-bias",
        "bias of each beam of the velocimeter (1 sigma) [m/s]",
        (0.5, 0.1, 0.02, 0.0),
    ),
    _sensor_factor(
        ("velocimeter", "floor"),
        "velocimeter-floor",
        "height under which the velocimeter is silent [m]",
        (500.0, 200.0, 100.0, 1.0),
    ),
    _sensor_factor(
        ("terrain", "noise"),
        "terrain-fix-noise",
        "noise of a fix against the map, per axis (1 sigma) [m]",
        (200.0, 50.0, 2.0),
    ),
    _sensor_factor(
        ("site", "noise_per_range"),
        "site-fix-noise",
        "noise of a fix of the site over its range, per axis (1 sigma) [m/km]",
        (10.0, 3.0, 0.2),
        1e-3,
    ),
    _sensor_factor(
        ("site", "floor"),
        "site-fix-floor",
        "range under which no site is fixed [m]",
        (800.0, 500.0, 100.0),
    ),
    _sensor_factor(
        ("site", "dropout"), "site-fix-dropout", "share of the looks without a fix", (0.9, 0.6, 0.3)
    ),
    _start_factor(
        "horizontal_error",
        "start-position-error",
        "error of the initial position, east and north (1 sigma) [m]",
        (200.0, 50.0, 0.0),
    ),
    _start_factor(
        "vertical_error", "start-height-error", "error of the initial height (1 sigma) [m]", (50.0, 20.0, 0.0)
    ),
    _start_factor(
        "velocity_error",
        "start-velocity-error",
        "error of the initial velocity along each axis (1 sigma) [m/s]",
        (5.0, 1.0, 0.0),
    ),
)
"""Every sensor of `hda.navigation.sensors`, and the start; only a body has the gyroscope."""
