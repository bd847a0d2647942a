"""What the filter knows at one instant, and how it begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array, Index
from guidance.state import State
from guidance.validation import finite_vector
from hda.navigation.layout import (
    ACCELEROMETER_BIAS,
    ALTIMETER_BIAS,
    BEAM_BIAS,
    ESTIMATED,
    GROUND,
    GYRO_BIAS,
    POSITION,
    SENSORS,
    SITE,
    SIZE,
    TILT,
    TURNING_SIZE,
    VELOCITY,
    FilterMemory,
)
from hda.navigation.sensor_errors import SensorErrors
from hda.navigation.system import NavigationSystem


@dataclass(frozen=True, eq=False)
class NavigationState:
    """What the filter knows at one control instant, and the true errors that it does not know.

    Attributes:
        estimate: shape (13,): position [m], velocity [m/s], accelerometer bias [m/s^2], height of the ground
            under the beam [m], landing site [m]; site frame. With a gyroscope (23,): then seven zeros, of
            what is not estimated or stands in the attitude, and its bias [rad/s], body frame.
        covariance: shape (20, 20), of the errors of these and of the considered: altimeter bias [m], three
            beam biases [m/s], tilt [rad]. With a gyroscope (23, 23): the tilt is estimated too, and its bias.
        rejections: shape (4,), readings in a row that the gate rejected: altimeter, velocimeter, terrain fix,
            site fix.
        errors: the sensors' true errors; for the simulator alone.
        instant: number of control instants since the start.
    """

    estimate: Array
    covariance: Array
    rejections: Index
    errors: SensorErrors
    instant: int = 0

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.estimate, self.covariance, self.rejections):
            array.flags.writeable = False

    def memory(self) -> FilterMemory:
        """Copies for the kernels, which change them."""
        return FilterMemory(self.estimate.copy(), self.covariance.copy(), self.rejections.copy())

    @property
    def position(self) -> Array:
        """[m] shape (3,), estimated."""
        return self.estimate[POSITION : POSITION + 3]

    @property
    def velocity(self) -> Array:
        """[m/s] shape (3,), estimated."""
        return self.estimate[VELOCITY : VELOCITY + 3]

    @property
    def accelerometer_bias(self) -> Array:
        """[m/s^2] shape (3,), estimated."""
        return self.estimate[ACCELEROMETER_BIAS : ACCELEROMETER_BIAS + 3]

    @property
    def ground_height(self) -> float:
        """[m] estimated height of the ground under the beam."""
        return float(self.estimate[GROUND])

    @property
    def site(self) -> Array:
        """[m] shape (3,), estimated place of the landing site."""
        return self.estimate[SITE : SITE + 3]

    @property
    def relative_covariance(self) -> Array:
        """Shape (6, 6), of position less site [m] and of velocity [m/s]: what a landing on the site needs."""
        pick = np.zeros((6, len(self.covariance)))
        pick[:, POSITION : VELOCITY + 3] = np.eye(6)
        pick[:3, SITE : SITE + 3] = -np.eye(3)
        return pick @ self.covariance @ pick.T

    @property
    def attitude_covariance(self) -> Array:
        """[rad^2] shape (3, 3), of the small angle about the site's axes by which the attitude errs."""
        return self.covariance[TILT : TILT + 3, TILT : TILT + 3]


def begin_navigation(
    system: NavigationSystem, state: State, target: ArrayLike, errors: SensorErrors
) -> NavigationState:
    """The filter at the start of an episode, before any reading.

    Args:
        system: sensors and filter.
        state: the true state.
        target: [m] shape (3,), first target on the map from orbit: the site until a look finds one, and the
            first guess of the ground's height.
        errors: the episode's errors.

    Raises:
        ValueError: the target is not three finite numbers.
    """
    site = finite_vector("target", target, 3)
    gyroscope = system.gyroscope
    estimate = np.zeros(ESTIMATED if gyroscope is None else TURNING_SIZE)
    estimate[POSITION : POSITION + 3] = state.position + errors.position
    estimate[VELOCITY : VELOCITY + 3] = state.velocity + errors.velocity
    estimate[GROUND] = site[2]
    estimate[SITE : SITE + 3] = site
    sigma = np.zeros(SIZE if gyroscope is None else TURNING_SIZE)
    sigma[POSITION : POSITION + 2] = system.horizontal_error
    sigma[POSITION + 2] = system.vertical_error
    sigma[VELOCITY : VELOCITY + 3] = system.velocity_error
    sigma[ACCELEROMETER_BIAS : ACCELEROMETER_BIAS + 3] = system.inertial.bias
    sigma[GROUND] = system.ground_error
    sigma[ALTIMETER_BIAS] = 0.0 if system.altimeter is None else system.altimeter.bias
    sigma[BEAM_BIAS : BEAM_BIAS + 3] = 0.0 if system.velocimeter is None else system.velocimeter.bias
    sigma[TILT : TILT + 3] = system.inertial.tilt
    sigma[GYRO_BIAS:] = 0.0 if gyroscope is None else gyroscope.bias
    return NavigationState(estimate, np.diag(sigma**2), np.zeros(SENSORS, dtype=np.int64), errors)


def check_begun(system: NavigationSystem, navigation: NavigationState) -> None:
    """Refuse a filter of another size than the system's: the kernels would reach beyond its arrays.

    Raises:
        ValueError: the filter was begun without the system's gyroscope or with one that it lacks, or its
            arrays have shapes that no system gives.
    """
    turning = system.gyroscope is not None
    rows, size = (TURNING_SIZE, TURNING_SIZE) if turning else (ESTIMATED, SIZE)
    arrays = navigation.estimate, navigation.covariance, navigation.rejections
    expected, found = ((rows,), (size, size), (SENSORS,)), tuple(array.shape for array in arrays)
    if found != expected:
        kind = "with" if turning else "without"
        raise ValueError(
            f"navigation must be of a system {kind} a gyroscope, as system is: estimate, covariance and"
            f" rejections of shapes {expected}, got {found}"
        )
