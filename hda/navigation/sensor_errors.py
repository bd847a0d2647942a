"""What chance does to a navigation: errors that last an episode, and draws for each reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from hda.navigation.layout import NORMAL_COLUMNS, UNIFORM_COLUMNS, TrueErrors
from hda.navigation.system import NavigationSystem


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """What chance does once an episode; its arrays are frozen, as all policies of an episode share them.

    Attributes:
        accelerometer_bias: [m/s^2] shape (3,), at present; it wanders slowly.
        altimeter_bias: [m].
        beam_bias: [m/s] shape (3,), of each beam of the velocimeter.
        tilt: [rad] shape (3,), true minus believed attitude, a small rotation about the site's axes.
        position: [m] shape (3,), initial estimate minus truth.
        velocity: [m/s] shape (3,), initial estimate minus truth.
    """

    accelerometer_bias: Array
    altimeter_bias: float
    beam_bias: Array
    tilt: Array
    position: Array
    velocity: Array

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.accelerometer_bias, self.beam_bias, self.tilt, self.position, self.velocity):
            array.flags.writeable = False

    def true_errors(self) -> TrueErrors:
        """For the kernels, which let the accelerometers' bias wander: arrays of their own."""
        return TrueErrors(
            self.accelerometer_bias.copy(), self.altimeter_bias, self.beam_bias.copy(), self.tilt.copy()
        )


def draw_sensor_errors(system: NavigationSystem, rng: np.random.Generator) -> SensorErrors:
    """Draw an episode's errors: sixteen normal numbers, in one order whatever the sensors are."""
    draw = rng.standard_normal(16)
    spread = np.array([system.horizontal_error, system.horizontal_error, system.vertical_error])
    altimeter, velocimeter = system.altimeter, system.velocimeter
    return SensorErrors(
        accelerometer_bias=system.inertial.bias * draw[:3],
        altimeter_bias=0.0 if altimeter is None else altimeter.bias * float(draw[3]),
        beam_bias=np.zeros(3) if velocimeter is None else velocimeter.bias * draw[4:7],
        tilt=system.inertial.tilt * draw[7:10],
        position=spread * draw[10:13],
        velocity=system.velocity_error * draw[13:16],
    )


@dataclass(frozen=True, eq=False)
class ReadingDraws:
    """What chance does to the readings of n control periods.

    Attributes:
        normal: shape (n, 16), standard normal; columns as in `hda.navigation.layout`.
        uniform: shape (n, 3), in [0, 1): whether altimeter, velocimeter and terrain fix fall out.
    """

    normal: Array
    uniform: Array


def draw_readings(rng: np.random.Generator, periods: int) -> ReadingDraws:
    """Draw all of it, in one order whatever the sensors are."""
    return ReadingDraws(
        rng.standard_normal((periods, NORMAL_COLUMNS)), rng.random((periods, UNIFORM_COLUMNS))
    )


@dataclass(frozen=True, eq=False)
class FixDraws:
    """What chance does to the fix of the site in one look.

    Attributes:
        normal: shape (3,), standard normal.
        uniform: in [0, 1): whether there is none.
    """

    normal: Array
    uniform: float


def draw_fix(rng: np.random.Generator) -> FixDraws:
    """Draw it."""
    return FixDraws(rng.standard_normal(3), float(rng.random()))
