"""The two laws flown over one interval, in compiled code: ZEM/ZEV, and the feedback about a plan.

Numbers are copied one by one: a slice that takes an array compiles for seconds, most of it words of an error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.thrust_limits import limit_into
from guidance.tracking.regulator import TrackingGains
from guidance.zem_zev import ZemZevGains, zem_zev_into
from hda.flight.held_thrust import (
    FLYING,
    TOUCHDOWN,
    FlightConditions,
    VehicleLimits,
    fall_freely,
    hold_period,
)
from hda.flight.rigid.pointing import aim_ahead, aim_along, steer_across
from hda.flight.rigid.turning import PlainTurning, feel_engine, keep_state, name_turning, read_gyro, turn_of
from hda.navigation.steering import FlownPeriod, PlainSensing, Sensing, name_sensing, sense
from hda.safety.touchdown_stance import Footing

_LEAST_TELLING = 0.05  # [m/s^2] commanded acceleration under which the engine's error is not estimated


class _ZemZevNumbers(NamedTuple):
    """`ZemZevCommand` for the kernels, under the same names."""

    position_gain: float
    velocity_gain: float
    time_to_go: float
    time_to_go_rate: float


class _Reference(NamedTuple):
    """What a plan asks for at the control instants: shapes (n, 3), (n, 3), (n - 1, 3)."""

    position: Array
    velocity: Array
    acceleration: Array


class _Log(NamedTuple):
    """Where a kernel writes: shapes (m + 1,), (m + 1, 7), (m, 3)."""

    time: Array
    path: Array
    commanded: Array


_PlainFooting = tuple[NDArray[np.float32], Array, float, float, float]
"""`Footing` without names."""

_PlainConditions = tuple[
    float,
    float,
    Array,
    tuple[float, float, float, float, float],
    float,
    Array,
    _PlainFooting | None,
    PlainTurning | None,
]
"""`FlightConditions` without names."""


@compile_kernel
def _fly_zem_zev(
    start: Array,
    site: Array,
    command: _ZemZevNumbers,
    conditions: FlightConditions,
    sensing: Sensing | None,
    log: _Log,
) -> tuple[int, int, int]:
    """Fly one interval: (nodes written, status, control periods in which the pointing limit acted)."""
    time, path, commanded = log
    period, gravity, vehicle = conditions.period, conditions.gravity, conditions.vehicle
    gains = ZemZevGains(command.position_gain, command.velocity_gain)
    seen = start.copy()
    limited = 0
    periods = commanded.shape[0] - 1
    for number in range(7):
        path[0, number] = start[number]
    time[0] = 0.0
    for k in range(periods + 1):
        remaining = command.time_to_go - command.time_to_go_rate * period * k
        if remaining <= 0.5 * period:
            commanded[k] = 0.0
            read_gyro(conditions.turning, sensing, k, period)
            time[k + 1] = time[k] + fall_freely(path[k], conditions, path[k + 1])
            keep_state(conditions.turning, k + 1)
            return k + 2, TOUCHDOWN, limited
        if k == periods:
            break
        for number in range(6):
            seen[number] = path[k, number] + conditions.navigation_error[number]
        zem_zev_into(seen, site, gains, remaining, gravity, commanded[k])
        left = remaining / command.time_to_go_rate
        steer_across(conditions.turning, seen, site, gains, left, commanded[k])
        for axis in range(3):
            commanded[k, axis] *= path[k, 6]
        aim_along(conditions.turning, commanded[k], left)
        if limit_into(commanded[k], vehicle.min_thrust, vehicle.max_thrust, vehicle.pointing_limit):
            limited += 1
        read_gyro(conditions.turning, sensing, k, period)
        flown, status = hold_period(path[k], commanded[k], conditions, path[k + 1])
        keep_state(conditions.turning, k + 1)
        time[k + 1] = time[k] + flown
        if status != FLYING:
            return k + 2, status, limited
        turn = turn_of(conditions.turning, sensing, k)
        period_flown = FlownPeriod(path[k], path[k + 1], flown, k, turn)
        sense(sensing, period_flown, gravity, conditions.navigation_error)
    return periods + 1, FLYING, limited


@compile_kernel
def _fly_plan(
    start: Array,
    reference: _Reference,
    feedback: tuple[TrackingGains, TrackingGains, float],
    conditions: FlightConditions,
    sensing: Sensing | None,
    log: _Log,
) -> tuple[int, int, int]:
    """Track a reference for one interval; returns as `_fly_zem_zev`.

    The engine's error ratio is unknown at the start of the interval, and assumed (last of `feedback`); once
    a period has been flown it is known from the change of velocity, which is compared with what the command
    should have given.
    """
    time, path, commanded = log
    period, gravity, vehicle = conditions.period, conditions.gravity, conditions.vehicle
    navigation = conditions.navigation_error
    periods = commanded.shape[0] - 1
    planned = reference.acceleration.shape[0]
    across, upward, estimate = feedback
    limited = 0
    for number in range(7):
        path[0, number] = start[number]
    time[0] = 0.0
    for k in range(periods + 1):
        if k >= planned:
            commanded[k] = 0.0
            read_gyro(conditions.turning, sensing, k, period)
            time[k + 1] = time[k] + fall_freely(path[k], conditions, path[k + 1])
            keep_state(conditions.turning, k + 1)
            return k + 2, TOUCHDOWN, limited
        if k == periods:
            break
        for axis in range(3):
            gains = upward if axis == 2 else across
            miss = path[k, axis] + navigation[axis] - reference.position[k, axis]
            drift = path[k, 3 + axis] + navigation[3 + axis] - reference.velocity[k, axis]
            acceleration = reference.acceleration[k, axis]
            acceleration -= gains.position_gain * miss
            acceleration -= gains.velocity_gain * drift
            commanded[k, axis] = path[k, 6] * acceleration / (1.0 + estimate)
        aim_ahead(conditions.turning, commanded[k], reference.acceleration, k, period, estimate)
        if limit_into(commanded[k], vehicle.min_thrust, vehicle.max_thrust, vehicle.pointing_limit):
            limited += 1
        read_gyro(conditions.turning, sensing, k, period)
        flown, status = hold_period(path[k], commanded[k], conditions, path[k + 1])
        keep_state(conditions.turning, k + 1)
        time[k + 1] = time[k] + flown
        if status != FLYING:
            return k + 2, status, limited
        turn = turn_of(conditions.turning, sensing, k)
        sense(sensing, FlownPeriod(path[k], path[k + 1], flown, k, turn), gravity, navigation)
        told = _estimate_error(path[k], path[k + 1], commanded[k], period, gravity, estimate)
        least = _LEAST_TELLING * path[k, 6] * period
        estimate = feel_engine(conditions.turning, estimate, told, least)
    return periods + 1, FLYING, limited


@compile_kernel
def _estimate_error(
    before: Array,
    after: Array,
    commanded: Array,
    period: float,
    gravity: Array,
    estimate: float,
) -> float:
    """Engine's error ratio from one period's change of velocity; the old estimate where it hardly burnt."""
    square = 0.0
    along = 0.0
    for axis in range(3):
        gained = (after[3 + axis] - before[3 + axis]) / period - gravity[axis]
        square += commanded[axis] * commanded[axis]
        along += commanded[axis] * gained
    mean_mass = 0.5 * (before[6] + after[6])
    if square < (_LEAST_TELLING * mean_mass) ** 2:
        return estimate
    return along * mean_mass / square - 1.0


def plain_footing(footing: Footing) -> _PlainFooting:
    """Take the names away."""
    return footing.elevation, footing.pads, footing.pad_radius, footing.clearance, footing.plane


@compile_kernel
def _name_footing(plain: _PlainFooting | None) -> Footing | None:
    if plain is None:
        return None
    return Footing(*plain)


@compile_kernel
def _name_conditions(conditions: _PlainConditions) -> FlightConditions:
    period, plane, gravity, vehicle, thrust_error, navigation, footing, turning = conditions
    return FlightConditions(
        period,
        plane,
        gravity,
        VehicleLimits(*vehicle),
        thrust_error,
        navigation,
        _name_footing(footing),
        name_turning(turning),
    )


@compile_kernel
def enter_zem_zev(
    start: Array,
    site: Array,
    command: tuple[float, float, float, float],
    conditions: _PlainConditions,
    sensing: PlainSensing | None,
    log: tuple[Array, Array, Array],
) -> tuple[int, int, int]:
    """`_fly_zem_zev` of plain tuples: numba takes them from Python several times as fast as named ones."""
    named = _name_conditions(conditions)
    return _fly_zem_zev(start, site, _ZemZevNumbers(*command), named, name_sensing(sensing), _Log(*log))


@compile_kernel
def enter_plan(
    start: Array,
    reference: tuple[Array, Array, Array],
    feedback: tuple[tuple[float, float], tuple[float, float], float],
    conditions: _PlainConditions,
    sensing: PlainSensing | None,
    log: tuple[Array, Array, Array],
) -> tuple[int, int, int]:
    """`_fly_plan` of plain tuples."""
    named = _name_conditions(conditions)
    across, upward, assumed_error = feedback
    law = _Reference(*reference), (TrackingGains(*across), TrackingGains(*upward), assumed_error)
    return _fly_plan(start, *law, named, name_sensing(sensing), _Log(*log))
