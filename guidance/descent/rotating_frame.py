"""Motion in a site frame that turns with its planet: exact steps under a thrust acceleration linear in time.

    r' = v,   v' = u + g - 2 w x v - w x (w x r)

with r from a point on the axis of rotation. The equations are linear, so a step is a matrix exponential (Van
Loan, IEEE Transactions on Automatic Control 23(3), 1978).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.descent.trajectory import Trajectory


class Transition(NamedTuple):
    """A step of the state x = (r, v): x_next = state x + first u + last u_next + (first + last) g.

    Attributes:
        state: shape (6, 6).
        first: shape (6, 3), of the acceleration at the start of the step.
        last: shape (6, 3), of that at its end.
    """

    state: Array
    first: Array
    last: Array


def spin_matrix(angular_velocity: Array) -> Array:
    """The matrix S with S r = w x r, shape (3, 3), of w [rad/s], shape (3,)."""
    x, y, z = angular_velocity
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _generator(angular_velocity: Array, power: float = 1.0) -> Array:
    """Matrix of (x, u, u')' = M (x, u, u'); times the scale of w, its derivative where `power` is not one."""
    spin, out = spin_matrix(angular_velocity), np.zeros((12, 12))
    out[3:6, :3] = -power * spin @ spin
    out[3:6, 3:6] = -2.0 * spin
    return out


def _split(matrix: Array, step: float) -> Transition:
    last = matrix[:6, 9:] / step
    return Transition(matrix[:6, :6], matrix[:6, 6:9] - last, last)


def transition(angular_velocity: Array, step: float) -> Transition:
    """A step of `step` [s] in a frame that turns by `angular_velocity` [rad/s], shape (3,)."""
    from scipy.linalg import expm

    return _split(np.asarray(expm(step * _motion(angular_velocity)), dtype=np.float64), step)


def transition_and_rate(angular_velocity: Array, step: float) -> tuple[Transition, Transition]:
    """The step, and its derivative with respect to the logarithm of the angular velocity's size."""
    from scipy.linalg import expm_frechet

    moved, rate = expm_frechet(step * _motion(angular_velocity), step * _generator(angular_velocity, 2.0))
    first, second = (np.asarray(part, dtype=np.float64) for part in (moved, rate))
    return _split(first, step), _split(second, step)


def _motion(angular_velocity: Array) -> Array:
    out = _generator(angular_velocity)
    out[:3, 3:6] = out[3:6, 6:9] = out[6:9, 9:] = np.eye(3)
    return out


def rotating_states_at(trajectory: Trajectory, time: Array, problem: LandingProblem) -> tuple[Array, Array]:
    """Position [m] and velocity [m/s], shape (k, 3) each, exact; as `Trajectory.states_at`."""
    interval = float(trajectory.time[1])
    nodes = np.clip((time / interval).astype(np.int64), 0, trajectory.nodes - 2)
    out = np.empty((time.size, 6))
    for number, (k, at) in enumerate(zip(nodes, time, strict=True)):
        elapsed = float(at - k * interval)
        out[number] = np.concatenate([trajectory.position[k], trajectory.velocity[k]])
        if elapsed > 0.0:
            now, later = trajectory.acceleration[k], trajectory.acceleration[k + 1]
            then = now + (later - now) * (elapsed / interval)
            step = transition(problem.angular_velocity, elapsed)
            pushed = step.first @ (now + problem.gravity) + step.last @ (then + problem.gravity)
            out[number] = step.state @ out[number] + pushed
    return out[:, :3], out[:, 3:]
