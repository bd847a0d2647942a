"""What chance does to a navigation: errors that last an episode, and draws for each reading."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from guidance.arrays import Array
from hda.navigation.layout import GYRO_COLUMNS, NORMAL_COLUMNS, UNIFORM_COLUMNS, TrueErrors
from hda.navigation.system import NavigationSystem


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """What chance does once an episode; its arrays are frozen, as all policies of an episode share them.

    Attributes:
        accelerometer_bias: [m/s^2] shape (3,), at present; it wanders slowly.
        altimeter_bias: [m].
        beam_bias: [m/s] shape (3,), of each beam of the velocimeter.
        tilt: [rad] shape (3,), true minus believed attitude, a small rotation about the site's axes; with a
            gyroscope that at present.
        position: [m] shape (3,), initial estimate minus truth.
        velocity: [m/s] shape (3,), initial estimate minus truth.
        gyro_bias: [rad/s] shape (3,), at present, body frame; it wanders slowly.
    """

    accelerometer_bias: Array
    altimeter_bias: float
    beam_bias: Array
    tilt: Array
    position: Array
    velocity: Array
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        lasting = self.beam_bias, self.position, self.velocity
        for array in (self.accelerometer_bias, self.tilt, self.gyro_bias, *lasting):
            array.flags.writeable = False

    def true_errors(self) -> TrueErrors:
        """For the kernels, which let biases and attitude wander: arrays of their own."""
        return TrueErrors(
            self.accelerometer_bias.copy(),
            self.altimeter_bias,
            self.beam_bias.copy(),
            self.tilt.copy(),
            self.gyro_bias.copy(),
        )

    def moved_on(self, errors: TrueErrors) -> SensorErrors:
        """The same with what wandered as the kernels left it."""
        return replace(
            self,
            accelerometer_bias=errors.accelerometer_bias,
            tilt=errors.tilt,
            gyro_bias=errors.gyro_bias,
        )


def draw_sensor_errors(system: NavigationSystem, rng: np.random.Generator) -> SensorErrors:
    """Draw an episode's errors: sixteen normal numbers, in one order whatever the sensors are.

    A gyroscope takes three more.
    """
    draw = rng.standard_normal(16)
    spread = np.array([system.horizontal_error, system.horizontal_error, system.vertical_error])
    altimeter, velocimeter, gyroscope = system.altimeter, system.velocimeter, system.gyroscope
    return SensorErrors(
        accelerometer_bias=system.inertial.bias * draw[:3],
        altimeter_bias=0.0 if altimeter is None else altimeter.bias * float(draw[3]),
        beam_bias=np.zeros(3) if velocimeter is None else velocimeter.bias * draw[4:7],
        tilt=system.inertial.tilt * draw[7:10],
        position=spread * draw[10:13],
        velocity=system.velocity_error * draw[13:16],
        gyro_bias=np.zeros(3) if gyroscope is None else gyroscope.bias * rng.standard_normal(3),
    )


@dataclass(frozen=True, eq=False)
class ReadingDraws:
    """What chance does to the readings of n control periods.

    Attributes:
        normal: shape (n, 16), standard normal; columns as in `hda.navigation.layout`.
        uniform: shape (n, 3), in [0, 1): whether altimeter, velocimeter and terrain fix fall out.
        gyro: shape (n + 1, 6), standard normal, of a gyroscope, which is read in a fall after the last period
            too; None without one.
    """

    normal: Array
    uniform: Array
    gyro: Array | None = None


def draw_readings(rng: np.random.Generator, periods: int, gyroscope: bool = False) -> ReadingDraws:
    """Draw all of it, in one order whatever the sensors are; a gyroscope's come last."""
    return ReadingDraws(
        rng.standard_normal((periods, NORMAL_COLUMNS)),
        rng.random((periods, UNIFORM_COLUMNS)),
        rng.standard_normal((periods + 1, GYRO_COLUMNS)) if gyroscope else None,
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
