"""Where each number of the filter stands, and what its kernels know of the sensors.

Estimated are thirteen numbers: position, velocity, bias of the accelerometer, height of the ground under the
beam, landing site. Seven more are considered: their variance counts, but nothing is learnt of them, as too
little of them can be observed. They are the bias of the altimeter, one of each beam of the velocimeter, and
the tilt, the small angle by which the attitude errs.

A body with a gyroscope turns, and its filter estimates the tilt and the bias of the gyroscope too. Both stand
behind the considered biases, so that nothing else moves: mean and covariance have `TURNING_SIZE` rows, and
where the mean has a considered bias it stays 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel

POSITION, VELOCITY, ACCELEROMETER_BIAS, GROUND, SITE = 0, 3, 6, 9, 10
"""First index of what is estimated, all in the site frame: [m], [m/s], [m/s^2], [m], [m]."""
ESTIMATED = 13
"""How many numbers are estimated."""
ALTIMETER_BIAS, BEAM_BIAS, TILT = 13, 14, 17
"""First index of what is considered: [m], [m/s] for each beam, [rad] about each axis."""
SIZE = 20
"""Rows of the covariance."""
GYRO_BIAS = 20
"""First index of the bias of a gyroscope [rad/s], body frame."""
TURNING_SIZE = 23
"""Rows of mean and covariance of a body with a gyroscope."""

ALTIMETER, VELOCIMETER, TERRAIN_FIX, SITE_FIX = range(4)
"""The aiding sensors, in the order in which one instant's readings are taken."""
SENSORS = 4
"""How many."""

IMU_VELOCITY, IMU_POSITION, BIAS_STEP, ALTIMETER_NOISE, BEAM_NOISE, FIX_NOISE = 0, 3, 6, 9, 10, 13
"""First column of each noise in a row of `ReadingDraws.normal`."""
NORMAL_COLUMNS = 16
"""Standard normal draws of one control period."""
UNIFORM_COLUMNS = 3
"""Uniform draws of one control period: whether altimeter, velocimeter and terrain fix fall out."""
RATE_NOISE, GYRO_STEP, GYRO_COLUMNS = 0, 3, 6
"""Standard normal draws of a gyroscope in one control period: its noise, and the step of its bias."""


class InertialNumbers(NamedTuple):
    """The inertial unit; see `InertialUnit`.

    Attributes:
        noise_density: [m^2/s^3] of the white noise of the specific force.
        bias: [m/s^2] one sigma, stationary.
        correlation_time: [s] of the bias.
    """

    noise_density: float
    bias: float
    correlation_time: float


class GyroNumbers(NamedTuple):
    """A gyroscope; see `Gyroscope`.

    Attributes:
        noise_density: [rad^2/s] of the white noise of the rates.
        bias: [rad/s] one sigma, stationary.
        correlation_time: [s] of the bias.
    """

    noise_density: float
    bias: float
    correlation_time: float


class Turn(NamedTuple):
    """How a body turned in one control period.

    Attributes:
        before: true attitude before it, unit quaternion, shape (4,).
        after: true attitude after it.
        draws: shape (6,), standard normal.
        numbers: the gyroscope.
    """

    before: Array
    after: Array
    draws: Array
    numbers: GyroNumbers


class AidingNumbers(NamedTuple):
    """One sensor that is read at control instants.

    Attributes:
        noise: one sigma of a reading, [m] or [m/s].
        every: it is read at every so many control instants; 0: it is not there.
        floor: [m] height above the ground under which it does not read.
        ceiling: [m] height above which it does not read.
        dropout: probability that a reading falls out.
        plume_height: [m] height above the ground under which the engine's plume adds to the noise.
        plume_noise: one sigma of what the plume adds, in the unit of `noise`.
    """

    noise: float
    every: int
    floor: float
    ceiling: float
    dropout: float
    plume_height: float
    plume_noise: float


class FilterNumbers(NamedTuple):
    """All that the kernels know of the sensors and the filter.

    Attributes:
        inertial: the inertial unit.
        altimeter: [m].
        velocimeter: [m/s].
        terrain: [m].
        beams: shape (3, 3), unit vectors of the velocimeter's beams, pointing down along the body.
        steepness: cosine of the greatest angle between the vertical and a beam of a turning body.
        relief: [m] standard deviation of the ground's height.
        relief_length: [m] correlation length of the ground's height.
        gates: shape (4,), greatest squared innovation of each sensor, in units of its covariance.
        patience: after so many rejections in a row the covariance is inflated.
    """

    inertial: InertialNumbers
    altimeter: AidingNumbers
    velocimeter: AidingNumbers
    terrain: AidingNumbers
    beams: Array
    steepness: float
    relief: float
    relief_length: float
    gates: Array
    patience: int


class FilterMemory(NamedTuple):
    """What the filter remembers; the kernels change it in place.

    Attributes:
        mean: shape (13,), the estimate; with a gyroscope (23,).
        covariance: shape (20, 20), of the errors of the estimate and of what is considered; with a
            gyroscope (23, 23).
        rejections: shape (4,), readings of each sensor that were rejected in a row.
    """

    mean: Array
    covariance: Array
    rejections: Index


class TrueErrors(NamedTuple):
    """The sensors' true errors; the kernels change the first in place, with a gyroscope the last two also.

    Attributes:
        accelerometer_bias: [m/s^2] shape (3,).
        altimeter_bias: [m].
        beam_bias: [m/s] shape (3,).
        tilt: [rad] shape (3,), true minus believed attitude, a small rotation about the site's axes.
        gyro_bias: [rad/s] shape (3,), body frame.
    """

    accelerometer_bias: Array
    altimeter_bias: float
    beam_bias: Array
    tilt: Array
    gyro_bias: Array


@compile_kernel
def cross_matrix(vector: Array) -> Array:
    """The matrix [a x] with [a x] b = a x b; shape (3, 3)."""
    x, y, z = vector[0], vector[1], vector[2]
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
