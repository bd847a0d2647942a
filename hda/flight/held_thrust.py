"""Motion under a held thrust, with its events: the target plane or the true ground, and the empty tank.

Kernels on arrays, for the vehicle's inner loop; a state is seven numbers (x y z vx vy vz m).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.dynamics import propagate_into
from guidance.kernel import compile_kernel
from hda.flight.ground_contact import Motion, fall_to_ground, hold_over_ground
from hda.flight.rigid.held_command import FLYING, TANK_EMPTY, TOUCHDOWN, fall_body, hold_command
from hda.flight.rigid.turning import Turning
from hda.safety.touchdown_stance import Footing


class VehicleLimits(NamedTuple):
    """What the kernels know of a lander.

    Attributes:
        min_thrust: [N].
        max_thrust: [N].
        exhaust_velocity: [m/s].
        dry_mass: [kg].
        pointing_limit: [rad] greatest angle of the thrust from the vertical.
    """

    min_thrust: float
    max_thrust: float
    exhaust_velocity: float
    dry_mass: float
    pointing_limit: float


class FlightConditions(NamedTuple):
    """What stays as it is between two looks.

    Attributes:
        period: [s] over which a thrust is held.
        plane: [m] height of the target plane.
        gravity: [m/s^2] shape (3,), pointing down.
        vehicle: limits of the lander.
        thrust_error: relative error of the applied thrust.
        navigation_error: estimated minus true position [m] and velocity [m/s], shape (6,); a filter changes
            it in place from period to period.
        footing: the lander over the true ground; None: the flight ends on the plane. What is None compiles to
            nothing.
        turning: the rigid body that flies, whose state goes on from period to period; None: a point mass.
    """

    period: float
    plane: float
    gravity: Array
    vehicle: VehicleLimits
    thrust_error: float
    navigation_error: Array
    footing: Footing | None = None
    turning: Turning | None = None


@compile_kernel
def _fall_time(height: float, climb: float, gravity: float) -> float:
    """Time for a free fall through `height` >= 0, starting at vertical speed `climb`; gravity > 0."""
    root = math.sqrt(climb * climb + 2.0 * gravity * height)
    # both forms are exact; each avoids cancellation on its side
    return (climb + root) / gravity if climb >= 0.0 else 2.0 * height / (root - climb)


@compile_kernel
def _lowest_instant(
    start: Array,
    thrust: Array,
    duration: float,
    gravity: Array,
    exhaust_velocity: float,
    out: Array,
) -> float:
    """When the vertical velocity, negative at the start and positive at the end, passes zero."""
    low = 0.0
    high = duration
    for _ in range(60):
        middle = 0.5 * (low + high)
        propagate_into(start, thrust, middle, gravity, exhaust_velocity, out)
        if out[5] < 0.0:
            low = middle
        else:
            high = middle
    return high


@compile_kernel
def _hold(
    start: Array,
    thrust: Array,
    duration: float,
    conditions: FlightConditions,
    footing: Footing | None,
    out: Array,
) -> tuple[float, bool]:
    """Hold a thrust for `duration`, or until the plane or the ground is met: (time flown, whether it was).

    The footing is an argument of its own: numba leaves out what follows from None in an argument only.
    """
    gravity, plane = conditions.gravity, conditions.plane
    exhaust_velocity = conditions.vehicle.exhaust_velocity
    if footing is not None:
        motion = Motion(start, thrust, gravity, exhaust_velocity)
        return hold_over_ground(motion, duration, footing, out)
    propagate_into(start, thrust, duration, gravity, exhaust_velocity, out)
    high = duration
    below = out[2] <= plane
    if not below and start[5] < 0.0 < out[5] and start[2] + start[5] * duration < plane:
        high = _lowest_instant(start, thrust, duration, gravity, exhaust_velocity, out)
        propagate_into(start, thrust, high, gravity, exhaust_velocity, out)
        below = out[2] <= plane
        if not below:
            propagate_into(start, thrust, duration, gravity, exhaust_velocity, out)
    if not below:
        return duration, False
    low = 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        propagate_into(start, thrust, middle, gravity, exhaust_velocity, out)
        if out[2] > plane:
            low = middle
        else:
            high = middle
    propagate_into(start, thrust, high, gravity, exhaust_velocity, out)
    return high, True


@compile_kernel
def fall_to_plane(
    start: Array,
    gravity: Array,
    plane: float,
    out: Array,
) -> float:
    """Fall freely to the plane; return the time it took."""
    time = _fall_time(max(0.0, start[2] - plane), start[5], -gravity[2])
    propagate_into(start, np.zeros(3), time, gravity, 1.0, out)
    return time


@compile_kernel
def _fall(start: Array, gravity: Array, plane: float, footing: Footing | None, out: Array) -> float:
    if footing is not None:
        return fall_to_ground(start, gravity, footing, out)
    return fall_to_plane(start, gravity, plane, out)


@compile_kernel
def _fall_as(start: Array, conditions: FlightConditions, turning: Turning | None, out: Array) -> float:
    """A fall of a body or a point mass; an argument of its own for the same reason as in `_hold`."""
    if turning is not None:
        limits = (conditions.plane, conditions.vehicle.dry_mass)
        return fall_body(turning, limits, conditions.footing, out)
    return _fall(start, conditions.gravity, conditions.plane, conditions.footing, out)


@compile_kernel
def fall_freely(start: Array, conditions: FlightConditions, out: Array) -> float:
    """Fall freely to the plane, or to the true ground where there is one; return the time it took."""
    return _fall_as(start, conditions, conditions.turning, out)


@compile_kernel
def hold_period(
    start: Array, commanded: Array, conditions: FlightConditions, out: Array
) -> tuple[float, int]:
    """Apply a command for one period, ended early by the ground or the tank: (time flown, status)."""
    return _hold_as(start, commanded, conditions, conditions.turning, out)


@compile_kernel
def _hold_as(
    start: Array, commanded: Array, conditions: FlightConditions, turning: Turning | None, out: Array
) -> tuple[float, int]:
    """A period of a body or a point mass."""
    vehicle = conditions.vehicle
    if turning is not None:
        limits = (conditions.period, conditions.plane, conditions.thrust_error, vehicle.dry_mass)
        return hold_command(turning, commanded, limits, conditions.footing, out)
    applied = np.empty(3)
    for axis in range(3):
        applied[axis] = commanded[axis] * (1.0 + conditions.thrust_error)
    flow = math.sqrt(applied[0] ** 2 + applied[1] ** 2 + applied[2] ** 2) / vehicle.exhaust_velocity
    burn = conditions.period
    dry = flow * conditions.period >= start[6] - vehicle.dry_mass and flow > 0.0
    if dry:
        burn = (start[6] - vehicle.dry_mass) / flow
    flown, crossed = _hold(start, applied, burn, conditions, conditions.footing, out)
    if crossed:
        return flown, TOUCHDOWN
    if dry:
        flown += fall_freely(out.copy(), conditions, out)
        return flown, TANK_EMPTY
    return flown, FLYING
