"""A plan's thrust flown through the true motion, in SI; nothing here is shared with a solver."""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory
from guidance.kernel import compile_kernel

BETWEEN = 4
"""Runge-Kutta steps per interval, in which the thrust is smooth; each is a sample of the path."""


@compile_kernel
def length_of(x: float, y: float, z: float) -> float:
    """Of a vector."""
    return math.sqrt(x * x + y * y + z * z)


@compile_kernel
def distance_between(first: Array, second: Array) -> float:
    """Between two points, shape (3,) each."""
    return length_of(first[0] - second[0], first[1] - second[1], first[2] - second[2])


@compile_kernel
def _turning(
    place: tuple[float, float, float], velocity: tuple[float, float, float], spin: Array
) -> tuple[float, float, float]:
    """Coriolis and centrifugal acceleration with the sign turned, spin x (2 v + spin x r)."""
    x, y, z = place
    east = 2.0 * velocity[0] + spin[1] * z - spin[2] * y
    north = 2.0 * velocity[1] + spin[2] * x - spin[0] * z
    up = 2.0 * velocity[2] + spin[0] * y - spin[1] * x
    return spin[1] * up - spin[2] * north, spin[2] * east - spin[0] * up, spin[0] * north - spin[1] * east


@compile_kernel
def fly_states(
    start: tuple[Array, Array, float],
    time: Array,
    thrust: Array,
    field: tuple[Array, Array],
    exhaust_velocity: float,
) -> Array:
    """Flown states, shape ((N - 1) * BETWEEN + 1, 7), by the classical Runge-Kutta method.

    Args:
        start: position [m], velocity [m/s] and mass [kg].
        time: [s] shape (N,).
        thrust: [N] shape (N - 1, 2 * BETWEEN + 1, 3).
        field: gravity [m/s^2] and angular velocity of the frame [rad/s], shape (3,) each.
        exhaust_velocity: [m/s].
    """
    gravity, spin = field
    turns = spin[0] != 0.0 or spin[1] != 0.0 or spin[2] != 0.0
    out = np.empty(((time.size - 1) * BETWEEN + 1, 7))
    out[0, :3], out[0, 3:6], out[0, 6] = start
    for k in range(time.size - 1):
        dt = (time[k + 1] - time[k]) / BETWEEN
        for part in range(BETWEEN):  # in scalars: arrays would take three times as long
            row = k * BETWEEN + part
            x0, y0, z0 = out[row, 0], out[row, 1], out[row, 2]
            east0, north0, up0 = out[row, 3], out[row, 4], out[row, 5]
            x, y, z, east, north, up, mass = x0, y0, z0, east0, north0, up0, out[row, 6]
            dx, dy, dz, deast, dnorth, dup, burnt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for stage in range(4):
                sample = 2 * part + (stage + 1) // 2
                fx, fy, fz = thrust[k, sample, 0], thrust[k, sample, 1], thrust[k, sample, 2]
                to_east, to_north = fx / mass + gravity[0], fy / mass + gravity[1]
                to_up = fz / mass + gravity[2]
                if turns:
                    turning = _turning((x, y, z), (east, north, up), spin)
                    to_east, to_north, to_up = to_east - turning[0], to_north - turning[1], to_up - turning[2]
                flow = length_of(fx, fy, fz) / exhaust_velocity
                ahead = dt if stage == 2 else 0.5 * dt
                weight = 2.0 if stage in (1, 2) else 1.0
                dx, dy, dz = dx + weight * east, dy + weight * north, dz + weight * up
                deast, dnorth = deast + weight * to_east, dnorth + weight * to_north
                dup, burnt = dup + weight * to_up, burnt + weight * flow
                x, y, z = x0 + ahead * east, y0 + ahead * north, z0 + ahead * up
                east, north, up = east0 + ahead * to_east, north0 + ahead * to_north, up0 + ahead * to_up
                mass = out[row, 6] - ahead * flow
            sixth = dt / 6.0
            out[row + 1, 0], out[row + 1, 1], out[row + 1, 2] = (
                x0 + sixth * dx,
                y0 + sixth * dy,
                z0 + sixth * dz,
            )
            out[row + 1, 3], out[row + 1, 4] = east0 + sixth * deast, north0 + sixth * dnorth
            out[row + 1, 5], out[row + 1, 6] = up0 + sixth * dup, out[row, 6] - sixth * burnt
    return out


def fly_trajectory(trajectory: Trajectory, problem: LandingProblem) -> Array:
    """Flown states, shape (4 (N - 1) + 1, 7): at the nodes and three times between each two.

    Position [m], velocity [m/s], mass [kg]. The integration errs by less than a millimetre.
    """
    state, field = problem.state, (problem.gravity, problem.angular_velocity)
    start = state.position, state.velocity, state.mass
    thrust = trajectory.sample_thrust(2 * BETWEEN)
    return fly_states(start, trajectory.time, thrust, field, trajectory.exhaust_velocity)
