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
def _fly(start: Array, steps: Array, thrust: Array, gravity: Array, exhaust_velocity: float) -> Array:
    """Flown states, shape ((N - 1) * BETWEEN + 1, 7), by the classical Runge-Kutta method.

    Args:
        start: state, shape (7,).
        steps: [s] shape (N - 1,).
        thrust: [N] shape (N - 1, 2 * BETWEEN + 1, 3).
        gravity: [m/s^2] shape (3,).
        exhaust_velocity: [m/s].
    """
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
    return _fly(problem.state.as_array(), time[1:] - time[:-1], thrust, problem.gravity, exhaust)
