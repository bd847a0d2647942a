"""The vehicle between two looks: it flies a command at the control rate within the limits of its thrust.

At each control instant the law gives a thrust, the vehicle takes the nearest within its bounds and its
pointing limit (`guidance.thrust_limits`), applies it with this interval's relative error, and holds it for
one control period; motion under a held thrust is exact (`guidance.dynamics`). When the time to go falls to
half a control period the engine is cut off and the vehicle falls freely to the target plane. The flight ends
where the plane is crossed, whatever the engine does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.lander import Lander
from guidance.state import State
from guidance.thrust_limits import limit_into, pointing_angle
from guidance.zem_zev import zem_zev_into
from hda.flight import held_thrust
from hda.flight.held_thrust import (
    FLYING,
    TOUCHDOWN,
    FlightConditions,
    VehicleLimits,
    fall_to_plane,
    hold_period,
)
from hda.policy import Decision, ZemZevCommand


@dataclass(frozen=True)
class ControlPeriods:
    """Control periods between two looks.

    Attributes:
        period: [s] over which a thrust is held.
        count: how many.
    """

    period: float
    count: int


class _ZemZevNumbers(NamedTuple):
    """`ZemZevCommand` for the kernels, under the same names."""

    position_gain: float
    velocity_gain: float
    time_to_go: float
    time_to_go_rate: float


class _FeedbackGains(NamedTuple):
    """About a plan, on position [1/s^2] and velocity [1/s]."""

    position: float
    velocity: float


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


_PlainConditions = tuple[float, float, Array, tuple[float, float, float, float, float], float, Array]
"""`FlightConditions` without names."""


class FlightStatus(IntEnum):
    """Where an interval left the vehicle."""

    FLYING = held_thrust.FLYING
    TOUCHDOWN = held_thrust.TOUCHDOWN
    """The target plane was crossed."""
    TANK_EMPTY = held_thrust.TANK_EMPTY
    """The tank ran dry above the plane; the vehicle then fell to it."""


@dataclass(frozen=True, eq=False)
class FlightErrors:
    """What chance does to one interval.

    Attributes:
        thrust: relative error of the applied thrust.
        navigation: estimated minus true position [m] and velocity [m/s], shape (6,); the vehicle steers by
            the estimate.
    """

    thrust: float = 0.0
    navigation: Array = field(default_factory=lambda: np.zeros(6))


_LEAST_TELLING = 0.05  # [m/s^2] commanded acceleration under which the engine's error is not estimated


@dataclass(frozen=True, eq=False)
class Segment:
    """Flight between two decisions, or up to the ground. n nodes have n - 1 intervals.

    Attributes:
        time: [s] shape (n,), since the decision.
        path: shape (n, 7): position [m], velocity [m/s], mass [kg].
        commanded: [N] shape (n - 1, 3), thrust within the vehicle's limits, held over each interval.
        time_to_go: [s] what remains at the last node.
        thrust_error: relative error of the applied thrust over the whole segment.
        status: where the vehicle is at the last node.
        pointing_limited: control periods in which the pointing limit changed the thrust.
    """

    time: Array
    path: Array
    commanded: Array
    time_to_go: float
    thrust_error: float
    status: FlightStatus
    pointing_limited: int = 0

    @property
    def final_state(self) -> State:
        """State at the last node."""
        return State(self.path[-1, :3], self.path[-1, 3:6], float(self.path[-1, 6]))


@compile_kernel
def _fly_zem_zev(
    start: Array,
    site: Array,
    command: _ZemZevNumbers,
    conditions: FlightConditions,
    log: _Log,
) -> tuple[int, int, int]:
    """Fly one interval: (nodes written, status, control periods in which the pointing limit acted)."""
    time, path, commanded = log
    period, gravity, vehicle = conditions.period, conditions.gravity, conditions.vehicle
    gains = (command.position_gain, command.velocity_gain)
    seen = start.copy()
    limited = 0
    periods = commanded.shape[0] - 1
    path[0] = start
    time[0] = 0.0
    for k in range(periods + 1):
        remaining = command.time_to_go - command.time_to_go_rate * period * k
        if remaining <= 0.5 * period:
            commanded[k] = 0.0
            time[k + 1] = time[k] + fall_to_plane(path[k], gravity, conditions.plane, path[k + 1])
            return k + 2, TOUCHDOWN, limited
        if k == periods:
            break
        seen[:6] = path[k, :6] + conditions.navigation_error
        zem_zev_into(seen, site, gains, remaining, gravity, commanded[k])
        commanded[k] *= path[k, 6]
        if limit_into(commanded[k], vehicle.min_thrust, vehicle.max_thrust, vehicle.pointing_limit):
            limited += 1
        flown, status = hold_period(path[k], commanded[k], conditions, path[k + 1])
        time[k + 1] = time[k] + flown
        if status != FLYING:
            return k + 2, status, limited
    return periods + 1, FLYING, limited


@compile_kernel
def _fly_plan(
    start: Array,
    reference: _Reference,
    gains: _FeedbackGains,
    conditions: FlightConditions,
    log: _Log,
) -> tuple[int, int, int]:
    """Track a reference for one interval; returns as `_fly_zem_zev`.

    The engine's error ratio is unknown at the start of the interval; once a period has been flown it is known
    from the change of velocity, which is compared with what the command should have given.
    """
    time, path, commanded = log
    period, gravity, vehicle = conditions.period, conditions.gravity, conditions.vehicle
    navigation = conditions.navigation_error
    periods = commanded.shape[0] - 1
    planned = reference.acceleration.shape[0]
    estimate = 0.0
    limited = 0
    path[0] = start
    time[0] = 0.0
    for k in range(periods + 1):
        if k >= planned:
            commanded[k] = 0.0
            time[k + 1] = time[k] + fall_to_plane(path[k], gravity, conditions.plane, path[k + 1])
            return k + 2, TOUCHDOWN, limited
        if k == periods:
            break
        for axis in range(3):
            miss = path[k, axis] + navigation[axis] - reference.position[k, axis]
            drift = path[k, 3 + axis] + navigation[3 + axis] - reference.velocity[k, axis]
            acceleration = reference.acceleration[k, axis]
            acceleration -= gains.position * miss
            acceleration -= gains.velocity * drift
            commanded[k, axis] = path[k, 6] * acceleration / (1.0 + estimate)
        if limit_into(commanded[k], vehicle.min_thrust, vehicle.max_thrust, vehicle.pointing_limit):
            limited += 1
        flown, status = hold_period(path[k], commanded[k], conditions, path[k + 1])
        time[k + 1] = time[k] + flown
        if status != FLYING:
            return k + 2, status, limited
        estimate = _estimate_error(path[k], path[k + 1], commanded[k], period, gravity, estimate)
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


@compile_kernel
def _enter_zem_zev(
    start: Array,
    site: Array,
    command: tuple[float, float, float, float],
    conditions: _PlainConditions,
    log: tuple[Array, Array, Array],
) -> tuple[int, int, int]:
    """`_fly_zem_zev` of plain tuples: numba takes them from Python several times as fast as named ones."""
    period, plane, gravity, vehicle, thrust_error, navigation = conditions
    named = FlightConditions(period, plane, gravity, VehicleLimits(*vehicle), thrust_error, navigation)
    return _fly_zem_zev(start, site, _ZemZevNumbers(*command), named, _Log(*log))


@compile_kernel
def _enter_plan(
    start: Array,
    reference: tuple[Array, Array, Array],
    gains: tuple[float, float],
    conditions: _PlainConditions,
    log: tuple[Array, Array, Array],
) -> tuple[int, int, int]:
    """`_fly_plan` of plain tuples."""
    period, plane, gravity, vehicle, thrust_error, navigation = conditions
    named = FlightConditions(period, plane, gravity, VehicleLimits(*vehicle), thrust_error, navigation)
    return _fly_plan(start, _Reference(*reference), _FeedbackGains(*gains), named, _Log(*log))


def fly_interval(
    state: State,
    decision: Decision,
    lander: Lander,
    gravity: Array,
    interval: ControlPeriods,
    errors: FlightErrors,
) -> Segment:
    """Fly a decision until the next look or the ground.

    Args:
        state: where the interval starts, above the plane of the decision's site.
        decision: site and command.
        lander: the vehicle, which limits the thrust.
        gravity: [m/s^2] shape (3,), pointing down.
        interval: control periods to the next look.
        errors: of the applied thrust and of the estimated state over this interval.

    Returns:
        The flown segment.

    Raises:
        ValueError: a plan was sampled at another control period than the vehicle's.
    """
    periods = interval.count
    time, path, commanded = np.empty(periods + 2), np.empty((periods + 2, 7)), np.empty((periods + 1, 3))
    vehicle = (
        lander.min_thrust,
        lander.max_thrust,
        lander.exhaust_velocity,
        lander.dry_mass,
        pointing_angle(lander),
    )
    plane = float(decision.site[2])
    conditions = (interval.period, plane, gravity, vehicle, errors.thrust, errors.navigation)
    start, log, command = state.as_array(), (time, path, commanded), decision.command
    if isinstance(command, ZemZevCommand):
        rate = command.time_to_go_rate
        asked = (command.position_gain, command.velocity_gain, command.time_to_go, rate)
        nodes, status, limited = _enter_zem_zev(start, decision.site, asked, conditions, log)
        time_to_go = command.time_to_go - rate * float(time[nodes - 1])
    else:
        reference = command.reference
        _check_period(reference.control_period, interval.period)
        parts = (reference.position, reference.velocity, reference.thrust_acceleration)
        nodes, status, limited = _enter_plan(start, parts, command.gains, conditions, log)
        time_to_go = reference.duration - float(time[nodes - 1])
    return Segment(
        time=time[:nodes],
        path=path[:nodes],
        commanded=commanded[: nodes - 1],
        time_to_go=time_to_go,
        thrust_error=errors.thrust,
        status=FlightStatus(status),
        pointing_limited=limited,
    )


def _check_period(planned: float, flown: float) -> None:
    if abs(planned - flown) > 1e-9 * flown:
        raise ValueError(
            f"command: its reference has a control period of {planned:g} s, the vehicle {flown:g} s"
        )
