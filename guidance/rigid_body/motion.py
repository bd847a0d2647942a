"""True motion of a rigid body with one engine in constant gravity.

    r' = v,                     v' = R(q) F / m + g,           q' = q (0, w)/2,
    J w' = M - w x J w,         M = torque + arm x F,          m' = -|F| / (g_ref Isp),
    F' = (F_commanded - F) / lag

Thrust F, torque and rates w stand in the body frame. Commands change linearly over an interval. The lag has a
closed form for these; the rest goes by the classic Runge-Kutta method of fourth order, with the quaternion
brought back to unit length after each step.

Over 5 s of the default body, from its limit of rate and within its torque, the error against DOP853 is below
1e-4 m, 1e-4 m/s and 1e-6 rad (`tests/guidance/rigid_body/test_motion.py`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.kernel import compile_kernel
from guidance.rigid_body.body import BodyNumbers, RigidBody
from guidance.rigid_body.state import SIZE, RigidState
from guidance.validation import finite_number, finite_vector

LONGEST_STEP = 0.05
"""[s] of the integrator."""
_STEPS_OF_LAG = 4.0  # steps that a time constant is divided into at least


@compile_kernel
def inertia_scale(mass: float, body: BodyNumbers) -> float:
    """Inertia at a mass [kg] over that at `inertia_mass`."""
    ratio = mass / body.inertia_mass
    if body.inertia_exponent == 1.0:
        return ratio
    return ratio**body.inertia_exponent


@compile_kernel
def turning_acceleration(mass: float, body: BodyNumbers) -> float:
    """[rad/s^2] that the jets give about the slower of the two axes that lean a body of a mass [kg]."""
    first, second = body.torque_limit[0] / body.inertia[0], body.torque_limit[1] / body.inertia[1]
    return min(first, second) / inertia_scale(mass, body)


@compile_kernel
def rate_into(y: Array, thrust: Array, torque: Array, body: BodyNumbers, out: Array) -> None:
    """Write the rates of change of position, velocity, attitude, rates and mass, y[:14], into `out`."""
    mass, scalar, first, second, third = y[13], y[6], y[7], y[8], y[9]
    ahead, aside, up = thrust[0], thrust[1], thrust[2]
    # the body's thrust seen from the site frame, as `quaternion.rotate_into` has it
    along = 2.0 * (first * ahead + second * aside + third * up)
    size = scalar * scalar - first * first - second * second - third * third
    twice = 2.0 * scalar
    out[0], out[1], out[2] = y[3], y[4], y[5]
    out[3] = (size * ahead + along * first + twice * (second * up - third * aside)) / mass + body.gravity[0]
    out[4] = (size * aside + along * second + twice * (third * ahead - first * up)) / mass + body.gravity[1]
    out[5] = (size * up + along * third + twice * (first * aside - second * ahead)) / mass + body.gravity[2]
    w, x, z = y[10], y[11], y[12]
    out[6] = 0.5 * (-first * w - second * x - third * z)
    out[7] = 0.5 * (scalar * w + second * z - third * x)
    out[8] = 0.5 * (scalar * x + third * w - first * z)
    out[9] = 0.5 * (scalar * z + first * x - second * w)
    scale = inertia_scale(mass, body)
    about_x, about_y, about_z = body.inertia[0], body.inertia[1], body.inertia[2]
    out[10] = ((torque[0] + body.engine_arm * aside) / scale + (about_y - about_z) * x * z) / about_x
    out[11] = ((torque[1] - body.engine_arm * ahead) / scale + (about_z - about_x) * z * w) / about_y
    out[12] = (torque[2] / scale + (about_x - about_y) * w * x) / about_z
    out[13] = -math.sqrt(ahead * ahead + aside * aside + up * up) / body.exhaust_velocity


@compile_kernel
def _engine_into(state: Array, command: Array, duration: float, share: float, lag: float, out: Array) -> None:
    """Write the thrust at a share of an interval whose linear command acts on an engine with a lag."""
    decay = math.exp(-share * duration / lag) if lag > 0.0 else 0.0
    for axis in range(3):
        behind = lag / duration * (command[1, axis] - command[0, axis])
        settled = (1.0 - share) * command[0, axis] + share * command[1, axis] - behind
        out[axis] = settled + (state[14 + axis] - command[0, axis] + behind) * decay


@compile_kernel
def fly_into(state: Array, thrust: Array, torque: Array, duration: float, body: BodyNumbers) -> None:
    """Fly commands that change linearly over a while, in place.

    Args:
        state: shape (17,), as `guidance.rigid_body.state.SIZE` says.
        thrust: [N] shape (2, 3), body frame: commanded at the start and at the end.
        torque: [N m] shape (2, 3), body frame: likewise.
        duration: [s] positive.
        body: the vehicle; its limits are not read here.
    """
    longest = LONGEST_STEP
    if body.engine_lag > 0.0:
        longest = min(longest, body.engine_lag / _STEPS_OF_LAG)
    steps = max(1, math.ceil(duration / longest - 1e-9))
    step = duration / steps
    work = np.empty((6, 14))
    y, middle, slopes = work[0], work[1], work[2:]
    forces = np.empty((3, 3))
    torques = np.empty((3, 3))
    for j in range(14):
        y[j] = state[j]
    for axis in range(3):
        forces[2, axis] = state[14 + axis] if body.engine_lag > 0.0 else thrust[0, axis]
        torques[2, axis] = torque[0, axis]
    for k in range(steps):
        for axis in range(3):
            forces[0, axis] = forces[2, axis]
            torques[0, axis] = torques[2, axis]
        for part in range(1, 3):
            share = (k + 0.5 * part) / steps
            _engine_into(state, thrust, duration, share, body.engine_lag, forces[part])
            for axis in range(3):
                torques[part, axis] = (1.0 - share) * torque[0, axis] + share * torque[1, axis]
        rate_into(y, forces[0], torques[0], body, slopes[0])
        for j in range(14):
            middle[j] = y[j] + 0.5 * step * slopes[0, j]
        rate_into(middle, forces[1], torques[1], body, slopes[1])
        for j in range(14):
            middle[j] = y[j] + 0.5 * step * slopes[1, j]
        rate_into(middle, forces[1], torques[1], body, slopes[2])
        for j in range(14):
            middle[j] = y[j] + step * slopes[2, j]
        rate_into(middle, forces[2], torques[2], body, slopes[3])
        for j in range(14):
            y[j] += step / 6.0 * (slopes[0, j] + 2.0 * (slopes[1, j] + slopes[2, j]) + slopes[3, j])
        length = math.sqrt(y[6] ** 2 + y[7] ** 2 + y[8] ** 2 + y[9] ** 2)
        for j in range(6, 10):
            y[j] /= length
    for j in range(14):
        state[j] = y[j]
    for axis in range(3):
        state[14 + axis] = forces[2, axis]


@compile_kernel
def fly_intervals(start: Array, thrust: Array, torque: Array, durations: Array, body: BodyNumbers) -> Array:
    """Fly K intervals of linear commands, thrust and torque of shape (K, 2, 3); states, shape (K + 1, 17)."""
    path = np.empty((durations.size + 1, start.size))
    path[0] = start
    for k in range(durations.size):
        path[k + 1] = path[k]
        fly_into(path[k + 1], thrust[k], torque[k], durations[k], body)
    return path


@compile_kernel
def limit_command_into(thrust: Array, torque: Array, body: BodyNumbers) -> None:
    """Replace commands by what the vehicle can do, in place.

    A thrust of zero stops the engine. Any other is turned into the gimbal's cone about the body's z axis, and
    its size brought between least and greatest thrust. Torques are cut off at their limits, each by itself.

    Args:
        thrust: [N] shape (3,), body frame.
        torque: [N m] shape (3,), body frame.
        body: the vehicle.
    """
    for axis in range(3):
        torque[axis] = min(max(torque[axis], -body.torque_limit[axis]), body.torque_limit[axis])
    size = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2)
    if size == 0.0:
        return
    across = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2)
    angle = min(math.atan2(across, thrust[2]), body.gimbal_limit)
    size = min(max(size, body.min_thrust), body.max_thrust)
    aside = size * math.sin(angle) / across if across > 0.0 else 0.0
    thrust[0] *= aside
    thrust[1] *= aside
    thrust[2] = size * math.cos(angle)


def fly_commands(
    state: RigidState,
    thrust: ArrayLike,
    torque: ArrayLike,
    duration: float,
    body: RigidBody,
    gravity: ArrayLike = MOON_GRAVITY,
) -> RigidState:
    """Fly held commands for a while, within the vehicle's limits of thrust, gimbal and torque.

    Args:
        state: where the flight starts.
        thrust: [N] commanded thrust: a number along the body's z axis, or shape (3,) in the body frame.
        torque: [N m] commanded couple of the reaction control, shape (3,), body frame.
        duration: [s] positive.
        body: the vehicle.
        gravity: [m/s^2] shape (3,), site frame.

    Returns:
        The state after `duration`. Its mass may be below the dry mass: the tank is the caller's business.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, or all mass may be burnt.
    """
    along = np.array([0.0, 0.0, 1.0])
    force = finite_vector("thrust", np.asarray(thrust) * along if np.ndim(thrust) == 0 else thrust, 3)
    couple = finite_vector("torque", torque, 3)
    time = finite_number("duration", duration, above=0.0)
    numbers = body.numbers(gravity)
    limit_command_into(force, couple, numbers)
    greatest = max(float(np.linalg.norm(force)), float(np.linalg.norm(state.thrust)))
    if greatest / body.lander.exhaust_velocity * time >= state.mass:
        raise ValueError(f"duration {time:g} s burns more than the whole mass {state.mass:g} kg")
    out = state.as_array()
    assert out.size == SIZE
    fly_into(out, np.array([force, force]), np.array([couple, couple]), time, numbers)
    return RigidState.of_array(out)
