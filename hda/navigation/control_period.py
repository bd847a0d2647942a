"""The filter over control periods, compiled: the inertial unit carries it, the other sensors correct it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.navigation.attitude import carry_attitude, drift, err_rates_into
from hda.navigation.layout import FilterMemory, FilterNumbers, GyroNumbers, TrueErrors, Turn
from hda.navigation.propagation import carry, cross, measure_force
from hda.navigation.readings import read_sensors
from hda.sensing.ray_casting import find_ground


@compile_kernel
def range_down(elevation: NDArray[np.float32], position: Array, tilt: Array, top: float) -> float:
    """[m] range to the ground along the axis that the vehicle believes to point down; NaN: none is known.

    Args:
        elevation: [m] shape (rows, columns), the true ground at 1 m a cell; row 0 is the south edge.
        position: [m] shape (3,), true.
        tilt: [rad] shape (3,), true minus believed attitude.
        top: [m] no ground is higher.
    """
    down = np.zeros(3)
    down[2] = -1.0
    down += cross(tilt, down)
    down /= math.sqrt(down[0] ** 2 + down[1] ** 2 + down[2] ** 2)
    return find_ground(elevation, position, down, top)[0]


@compile_kernel
def navigate_period(
    memory: FilterMemory,
    truth: tuple[Array, Array, float, float, int, Turn | None],
    gravity: Array,
    errors: TrueErrors,
    draws: tuple[Array, Array],
    numbers: FilterNumbers,
    squares: Array,
) -> None:
    """Take the filter over one control period.

    Args:
        memory: of the filter; changed in place.
        truth: true states (x y z vx vy vz m) before and after, the time between [s], the range down after it
            [m] (NaN: no ground), the number of the control instant after it, and how the body turned (None:
            there is no gyroscope).
        gravity: [m/s^2] shape (3,).
        errors: the sensors' true errors, changed in place; the tilt is that after the period, and the force
            is measured by it.
        draws: shapes (16,) and (3,): a row of `ReadingDraws`.
        numbers: sensors and filter.
        squares: shape (3,); the squared innovations of altimeter, velocimeter and terrain fix are written
            here, NaN where there was no reading.
    """
    before, after, time, height, instant, turn = truth
    carry_attitude(memory, errors, turn, time)
    measured = measure_force((before, after, time), gravity, errors, draws[0], numbers.inertial)
    carry(memory, measured, time, gravity, numbers)
    read_sensors(memory, (after, height, instant, turn), errors, draws, numbers, squares)


class TurningPath(NamedTuple):
    """A flown path of a body with a gyroscope, n nodes.

    Attributes:
        attitude: true unit quaternions, shape (n, 4).
        draws: shape (n - 1, 6) at least, standard normal.
        numbers: the gyroscope.
        period: [s] of a whole control period: the noise of the rates in a shorter last one is the same.
    """

    attitude: Array
    draws: Array
    numbers: GyroNumbers
    period: float


@compile_kernel
def _turn(
    memory: FilterMemory, errors: TrueErrors, path: TurningPath | None, k: int, time: float
) -> Turn | None:
    """Let the attitude drift over period k of a path, and say how the body turned in it."""
    if path is None:
        return None
    before, after, rate_error = path.attitude[k], path.attitude[k + 1], np.empty(3)
    err_rates_into(memory, errors, path.draws[k], path.period, path.numbers, rate_error)
    drift(errors.tilt, before, after, rate_error, time)
    return Turn(before, after, path.draws[k], path.numbers)


@compile_kernel
def navigate_path(
    memory: FilterMemory,
    truth: tuple[Array, Array, Array, int, TurningPath | None],
    gravity: Array,
    errors: TrueErrors,
    draws: tuple[Array, Array],
    numbers: FilterNumbers,
    log: tuple[Array, Array, Array, Array],
) -> None:
    """Take the filter along a flown path of n nodes.

    Args:
        memory: of the filter; changed in place.
        truth: times [s] shape (n,), true states (n, 7), ranges down [m] at the nodes after the first, shape
            (n - 1,), the number of the first node's control instant, and how the body turned (None: there is
            no gyroscope).
        gravity: [m/s^2] shape (3,).
        errors: the sensors' true errors; changed in place.
        draws: shapes (n - 1, 16) and (n - 1, 3).
        numbers: sensors and filter.
        log: shapes (n - 1, 13), (n - 1, 20, 20), (n - 1, 3) and (n - 1, 3): estimate, covariance, squared
            innovations and true tilt after each period are written here.
    """
    time, path, heights, instant, turning = truth
    normal, uniform = draws
    estimates, covariances, squares, tilts = log
    for k in range(time.size - 1):
        spent = time[k + 1] - time[k]
        turn = _turn(memory, errors, turning, k, spent)
        interval = (path[k], path[k + 1], spent, heights[k], instant + k + 1, turn)
        navigate_period(memory, interval, gravity, errors, (normal[k], uniform[k]), numbers, squares[k])
        estimates[k] = memory.mean
        covariances[k] = memory.covariance
        tilts[k] = errors.tilt
