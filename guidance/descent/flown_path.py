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
def _add_rotation(state: Array, spin: Array, out: Array) -> None:
    """Add Coriolis and centrifugal acceleration, -spin x (2 v + spin x r), to `out`."""
    x, y, z = state[0], state[1], state[2]
    east = 2.0 * state[3] + spin[1] * z - spin[2] * y
    north = 2.0 * state[4] + spin[2] * x - spin[0] * z
    up = 2.0 * state[5] + spin[0] * y - spin[1] * x
    out[0] -= spin[1] * up - spin[2] * north
    out[1] -= spin[2] * east - spin[0] * up
    out[2] -= spin[0] * north - spin[1] * east


@compile_kernel
def _fly(
    start: Array, steps: Array, thrust: Array, field: tuple[Array, Array], exhaust_velocity: float
) -> Array:
    """Flown states, shape ((N - 1) * BETWEEN + 1, 7), by the classical Runge-Kutta method.

    Args:
        start: state, shape (7,).
        steps: [s] shape (N - 1,).
        thrust: [N] shape (N - 1, 2 * BETWEEN + 1, 3).
        field: gravity [m/s^2] and angular velocity of the frame [rad/s], shape (3,) each.
        exhaust_velocity: [m/s].
    """
    gravity, spin = field
    turns = spin[0] != 0.0 or spin[1] != 0.0 or spin[2] != 0.0
    out = np.empty((steps.size * BETWEEN + 1, 7))
    rate, total, here = np.empty(7), np.empty(7), np.empty(7)
    out[0] = start
    for k in range(steps.size):
        dt = steps[k] / BETWEEN
        for part in range(BETWEEN):
            state = out[k * BETWEEN + part]
            here[:] = state
            total[:] = 0.0
            for stage in range(4):
                force = thrust[k, 2 * part + (stage + 1) // 2]
                for axis in range(3):
                    rate[axis] = here[3 + axis]
                    rate[3 + axis] = force[axis] / here[6] + gravity[axis]
                if turns:
                    _add_rotation(here, spin, rate[3:6])
                rate[6] = -length_of(force[0], force[1], force[2]) / exhaust_velocity
                ahead = dt if stage == 2 else 0.5 * dt
                weight = 2.0 if stage in (1, 2) else 1.0
                for number in range(7):
                    total[number] += weight * rate[number]
                    here[number] = state[number] + ahead * rate[number]
            for number in range(7):
                out[k * BETWEEN + part + 1, number] = state[number] + dt / 6.0 * total[number]
    return out


def fly_trajectory(trajectory: Trajectory, problem: LandingProblem) -> Array:
    """Flown states, shape (4 (N - 1) + 1, 7): at the nodes and three times between each two.

    Position [m], velocity [m/s], mass [kg]. The integration errs by less than a millimetre.
    """
    return fly_thrust(trajectory, trajectory.sample_thrust(2 * BETWEEN), problem)


def fly_thrust(trajectory: Trajectory, thrust: Array, problem: LandingProblem) -> Array:
    """The same for its thrust [N] at the ends of 2 BETWEEN parts of each interval."""
    time, exhaust = trajectory.time, trajectory.exhaust_velocity
    field = problem.gravity, problem.angular_velocity
    return _fly(problem.state.as_array(), time[1:] - time[:-1], thrust, field, exhaust)
