"""The filter inside the vehicle's inner loop: what it steers by is the estimate of the same instant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel
from hda.navigation.control_period import navigate_period, range_down
from hda.navigation.layout import (
    POSITION,
    SITE,
    VELOCITY,
    AidingNumbers,
    FilterMemory,
    FilterNumbers,
    GyroNumbers,
    InertialNumbers,
    TrueErrors,
    Turn,
)


class GyroSensing(NamedTuple):
    """A gyroscope at work over one interval.

    Attributes:
        draws: shape (n + 1, 6), standard normal: of the interval's control periods, and of the fall after.
        numbers: the gyroscope.
    """

    draws: Array
    numbers: GyroNumbers


class Sensing(NamedTuple):
    """A filter at work over one interval; see `FilterMemory`, `TrueErrors` and `FilterNumbers`.

    Attributes:
        memory: changed in place.
        errors: the sensors' true errors; the accelerometer's bias is changed in place, with a gyroscope also
            the gyroscope's and the tilt. The body that turns holds the same array of the tilt
            (`hda.flight.rigid.turning`): it drifts there, and is corrected here.
        normal: shape (n, 16), draws of the interval's control periods.
        uniform: shape (n, 3).
        numbers: sensors and filter.
        elevation: [m] shape (rows, columns), the true ground at 1 m a cell.
        top: [m] no ground is higher.
        site: [m] shape (3,), the landing site in the frame that the vehicle steers in.
        instant: number of the control instant at which the interval begins.
        gyro: of a rigid body; None: the attitude errs by one constant tilt.
    """

    memory: FilterMemory
    errors: TrueErrors
    normal: Array
    uniform: Array
    numbers: FilterNumbers
    elevation: NDArray[np.float32]
    top: float
    site: Array
    instant: int
    gyro: GyroSensing | None = None


_PlainAiding = tuple[float, int, float, float, float, float, float]
_PlainNumbers = tuple[
    tuple[float, float, float],
    _PlainAiding,
    _PlainAiding,
    _PlainAiding,
    Array,
    float,
    float,
    float,
    Array,
    int,
]
PlainSensing = tuple[
    tuple[Array, Array, Index],
    tuple[Array, float, Array, Array, Array],
    Array,
    Array,
    _PlainNumbers,
    NDArray[np.float32],
    float,
    Array,
    int,
    tuple[Array, tuple[float, float, float]] | None,
]
"""`Sensing` without names: numba takes plain tuples from Python several times as fast."""


@compile_kernel
def _name_gyro(plain: tuple[Array, tuple[float, float, float]] | None) -> GyroSensing | None:
    if plain is None:
        return None
    return GyroSensing(plain[0], GyroNumbers(*plain[1]))


@compile_kernel
def name_sensing(plain: PlainSensing | None) -> Sensing | None:
    """Give a plain tuple its names."""
    if plain is None:
        return None
    memory, errors, normal, uniform, numbers, elevation, top, site, instant, gyro = plain
    inertial, altimeter, velocimeter, terrain, beams, steepness, relief, length, gates, patience = numbers
    named = FilterNumbers(
        InertialNumbers(*inertial),
        AidingNumbers(*altimeter),
        AidingNumbers(*velocimeter),
        AidingNumbers(*terrain),
        beams,
        steepness,
        relief,
        length,
        gates,
        patience,
    )
    return Sensing(
        FilterMemory(*memory),
        TrueErrors(*errors),
        normal,
        uniform,
        named,
        elevation,
        top,
        site,
        instant,
        _name_gyro(gyro),
    )


def plain_sensing(sensing: Sensing) -> PlainSensing:
    """Take the names away."""
    numbers = sensing.numbers
    plain = tuple(tuple(part) if isinstance(part, tuple) else part for part in numbers)
    gyro = None if sensing.gyro is None else (sensing.gyro.draws, tuple(sensing.gyro.numbers))
    return (tuple(sensing.memory), tuple(sensing.errors), *sensing[2:4], plain, *sensing[5:9], gyro)  # pyright: ignore[reportReturnType]


class FlownPeriod(NamedTuple):
    """One control period as it was really flown.

    Attributes:
        before: true state (x y z vx vy vz m) before it, shape (7,).
        after: true state after it.
        time: [s] that it took.
        number: of the period in its interval.
        turn: how a body with a gyroscope turned in it; None: there is none.
    """

    before: Array
    after: Array
    time: float
    number: int
    turn: Turn | None


@compile_kernel
def sense(
    sensing: Sensing | None,
    flown: FlownPeriod,
    gravity: Array,
    estimation_error: Array,
) -> None:
    """Take the filter over one flown control period, if there is a filter.

    What the vehicle steers by is its estimated place from the estimated site, set down in the frame in which
    the site stands where the policy put it.

    Args:
        sensing: the filter; changed in place. None: the error of the estimate stays as it is, and numba
            compiles nothing of the filter.
        flown: the period.
        gravity: [m/s^2] shape (3,).
        estimation_error: shape (6,), estimated minus true position [m] and velocity [m/s]; written in place.
    """
    if sensing is None:
        return
    before, after, time, period, turn = flown
    height = range_down(sensing.elevation, after[:3], sensing.errors.tilt, sensing.top)
    truth = (before, after, time, height, sensing.instant + period + 1, turn)
    draws = (sensing.normal[period], sensing.uniform[period])
    squares = np.empty(3)
    navigate_period(sensing.memory, truth, gravity, sensing.errors, draws, sensing.numbers, squares)
    mean = sensing.memory.mean
    for axis in range(3):
        place = mean[POSITION + axis] - mean[SITE + axis] + sensing.site[axis]
        estimation_error[axis] = place - after[axis]
        estimation_error[3 + axis] = mean[VELOCITY + axis] - after[3 + axis]
