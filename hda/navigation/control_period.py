"""The filter over control periods, compiled: the inertial unit carries it, the other sensors correct it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.navigation.layout import FilterMemory, FilterNumbers, TrueErrors
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
    truth: tuple[Array, Array, float, float, int],
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
            [m] (NaN: no ground), and the number of the control instant after it.
        gravity: [m/s^2] shape (3,).
        errors: the sensors' true errors; the accelerometer's bias is changed in place.
        draws: shapes (16,) and (3,): a row of `ReadingDraws`.
        numbers: sensors and filter.
        squares: shape (3,); the squared innovations of altimeter, velocimeter and terrain fix are written
            here, NaN where there was no reading.
    """
    before, after, time, height, instant = truth
    measured = measure_force((before, after, time), gravity, errors, draws[0], numbers.inertial)
    carry(memory, measured, time, gravity, numbers)
    read_sensors(memory, (after, height, instant), errors, draws, numbers, squares)


@compile_kernel
def navigate_path(
    memory: FilterMemory,
    truth: tuple[Array, Array, Array, int],
    gravity: Array,
    errors: TrueErrors,
    draws: tuple[Array, Array],
    numbers: FilterNumbers,
    log: tuple[Array, Array, Array],
) -> None:
    """Take the filter along a flown path of n nodes.

    Args:
        memory: of the filter; changed in place.
        truth: times [s] shape (n,), true states (n, 7), ranges down [m] at the nodes after the first, shape
            (n - 1,), and the number of the first node's control instant.
        gravity: [m/s^2] shape (3,).
        errors: the sensors' true errors; changed in place.
        draws: shapes (n - 1, 16) and (n - 1, 3).
        numbers: sensors and filter.
        log: shapes (n - 1, 13), (n - 1, 20, 20) and (n - 1, 3): estimate, covariance and squared innovations
            after each period are written here.
    """
    time, path, heights, instant = truth
    normal, uniform = draws
    estimates, covariances, squares = log
    for k in range(time.size - 1):
        interval = (path[k], path[k + 1], time[k + 1] - time[k], heights[k], instant + k + 1)
        navigate_period(memory, interval, gravity, errors, (normal[k], uniform[k]), numbers, squares[k])
        estimates[k] = memory.mean
        covariances[k] = memory.covariance
