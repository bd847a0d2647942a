"""Motion under a held thrust, with its events: the target plane and the empty tank.

Kernels on arrays, for the vehicle's inner loop; a state is seven numbers (x y z vx vy vz m).
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.dynamics import propagate_into
from guidance.kernel import compile_kernel

FLYING, TOUCHDOWN, TANK_EMPTY = 0, 1, 2
"""Where a period leaves the vehicle: `hda.flight.vehicle.FlightStatus` as plain numbers."""

VehicleNumbers = tuple[float, float, float, float, float]
"""Least thrust [N], greatest thrust [N], exhaust velocity [m/s], dry mass [kg], pointing limit [rad]."""


@compile_kernel
def _fall_time(height: float, climb: float, pull: float) -> float:
    """Time for a free fall through `height` >= 0, starting at vertical speed `climb`; pull > 0."""
    root = math.sqrt(climb * climb + 2.0 * pull * height)
    # both forms are exact; each avoids cancellation on its side
    return (climb + root) / pull if climb >= 0.0 else 2.0 * height / (root - climb)


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
    gravity: Array,
    exhaust_velocity: float,
    plane: float,
    out: Array,
) -> tuple[float, bool]:
    """Hold a thrust for `duration`, or until the plane is crossed: (time flown, whether it was crossed)."""
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
def hold_period(
    start: Array,
    commanded: Array,
    thrust_error: float,
    duration: float,
    gravity: Array,
    vehicle: VehicleNumbers,
    plane: float,
    out: Array,
) -> tuple[float, int]:
    """Apply a command for one period, ended early by the ground or the tank: (time flown, status)."""
    applied = commanded * (1.0 + thrust_error)
    flow = math.sqrt(applied[0] ** 2 + applied[1] ** 2 + applied[2] ** 2) / vehicle[2]
    burn = duration
    dry = flow * duration >= start[6] - vehicle[3] and flow > 0.0
    if dry:
        burn = (start[6] - vehicle[3]) / flow
    flown, crossed = _hold(start, applied, burn, gravity, vehicle[2], plane, out)
    if crossed:
        return flown, TOUCHDOWN
    if dry:
        flown += fall_to_plane(out.copy(), gravity, plane, out)
        return flown, TANK_EMPTY
    return flown, FLYING
