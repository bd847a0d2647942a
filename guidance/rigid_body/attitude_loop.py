"""The attitude loop: a commanded thrust vector becomes an attitude, a throttle and torques.

The wanted attitude has the body's z axis along the thrust, within the tilt limit, and the heading of before.
The error is one turn about one axis. The wanted rate along it is

    min(k angle, sqrt(2 a (angle - a / (2 k^2))), rate limit),    k = natural frequency / (2 damping),

with k angle up to a / k^2, and a a share of the acceleration that the torques give along that axis. Near the
goal this is quaternion PD; far from it the turn can still be stopped in time. The torque is
J 2 damping frequency (wanted rate - rate) + w x J w, its components scaled down together where one exceeds
its limit, so that the turn keeps its axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.kernel import compile_kernel
from guidance.rigid_body.body import BodyNumbers, RigidBody
from guidance.rigid_body.motion import fly_into, inertia_scale, limit_command_into
from guidance.rigid_body.quaternion import error_into, heading_angle, point_into, rotate_into
from guidance.rigid_body.state import SIZE, RigidState
from guidance.thrust_limits import limit_into
from guidance.validation import finite_number, finite_vector

_STOPPING_SHARE = 0.8  # of the torque that a stop is planned with


@dataclass(frozen=True)
class AttitudeLoop:
    """Gains of the attitude loop, the same about each axis since torques are scaled by inertia.

    Attributes:
        natural_frequency: [rad/s] of a small error.
        damping: damping ratio.
        period: [s] between two commands, which are held.

    Raises:
        ValueError: a field is not positive, or the loop is unstable at this period.
    """

    natural_frequency: float = 1.5
    damping: float = 1.0
    period: float = 0.1

    def __post_init__(self) -> None:
        """Refuse a loop that cannot work."""
        finite_number("natural_frequency", self.natural_frequency, above=0.0)
        finite_number("damping", self.damping, above=0.0)
        finite_number("period", self.period, above=0.0)
        if self.damping * self.natural_frequency * self.period >= 1.0:
            raise ValueError("damping * natural_frequency * period must be below 1 for a stable loop")
        if self.natural_frequency * self.period >= 4.0 * self.damping:
            raise ValueError("natural_frequency * period must be below 4 damping for a stable loop")

    @property
    def numbers(self) -> LoopNumbers:
        """What compiled code reads."""
        return LoopNumbers(float(self.natural_frequency), float(self.damping), float(self.period))


class LoopNumbers(NamedTuple):
    """Fields of `AttitudeLoop` for compiled code."""

    natural_frequency: float
    damping: float
    period: float


DEFAULT_LOOP = AttitudeLoop()


@compile_kernel
def turn_rate(angle: float, acceleration: float, gain: float, rate_limit: float) -> float:
    """[rad/s] rate at which to close an angle [rad], so that a deceleration [rad/s^2] can end it.

    Args:
        angle: at least 0.
        acceleration: positive.
        gain: [1/s] rate per angle, near zero.
        rate_limit: [rad/s].
    """
    linear = acceleration / (gain * gain)
    rate = gain * angle if angle <= linear else math.sqrt(2.0 * acceleration * (angle - 0.5 * linear))
    return min(rate, rate_limit)


@compile_kernel
def torque_into(state: Array, wanted: Array, body: BodyNumbers, loop: LoopNumbers, out: Array) -> None:
    """Write the torque [N m] that turns a state, shape (17,), to an attitude, shape (4,), into `out`."""
    scale = inertia_scale(state[13], body)
    error_into(state[6:10], wanted, out)
    angle = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    acceleration = math.inf
    for axis in range(3):
        if abs(out[axis]) > 1e-9 * angle:
            most = body.torque_limit[axis] / (scale * body.inertia[axis])
            acceleration = min(acceleration, most * angle / abs(out[axis]))
    to_rate = 0.0
    if angle > 0.0 and acceleration > 0.0:
        gain = 0.5 * loop.natural_frequency / loop.damping
        to_rate = turn_rate(angle, _STOPPING_SHARE * acceleration, gain, body.rate_limit) / angle
    stiffness = 2.0 * loop.damping * loop.natural_frequency
    w, x, z = state[10], state[11], state[12]
    first, second, third = scale * body.inertia[0], scale * body.inertia[1], scale * body.inertia[2]
    out[0] = first * stiffness * (to_rate * out[0] - w) + (third - second) * x * z
    out[1] = second * stiffness * (to_rate * out[1] - x) + (first - third) * z * w
    out[2] = third * stiffness * (to_rate * out[2] - z) + (second - first) * w * x
    excess = 1.0
    for axis in range(3):
        if body.torque_limit[axis] > 0.0:
            excess = max(excess, abs(out[axis]) / body.torque_limit[axis])
    for axis in range(3):
        out[axis] = out[axis] / excess if body.torque_limit[axis] > 0.0 else 0.0


@compile_kernel
def command_into(
    state: Array, wanted: Array, body: BodyNumbers, loop: LoopNumbers, thrust: Array, torque: Array
) -> None:
    """Turn a thrust wanted in the site frame into commands in the body frame.

    Args:
        state: shape (17,).
        wanted: [N] shape (3,), site frame. Zero asks for an upright body, and least thrust.
        body: the vehicle.
        loop: the gains.
        thrust: [N] shape (3,), written: along the body's z axis, as much as `wanted` has along it now.
        torque: [N m] shape (3,), written.
    """
    drive_into(state, (wanted, wanted), body, loop, (thrust, torque))


@compile_kernel
def drive_into(
    state: Array,
    wanted: tuple[Array, Array],
    body: BodyNumbers,
    loop: LoopNumbers,
    commands: tuple[Array, Array],
) -> None:
    """As `command_into`, where the body may point elsewhere than along its thrust: it turns ahead of it.

    Args:
        state: shape (17,).
        wanted: [N] shape (3,) each, site frame: the thrust, and a vector to point along, of any size.
        body: the vehicle.
        loop: the gains.
        commands: shape (3,) each, written: thrust [N] and torque [N m].
    """
    thrust, torque = commands
    admissible, aim = wanted[0].copy(), wanted[1].copy()
    limit_into(admissible, body.min_thrust, body.max_thrust, body.tilt_limit)
    limit_into(aim, body.min_thrust, body.max_thrust, body.tilt_limit)
    direction = np.zeros(3)
    direction[2] = 1.0
    if aim[0] != 0.0 or aim[1] != 0.0 or aim[2] != 0.0:
        direction[:] = aim
    attitude = np.empty(4)
    point_into(direction, heading_angle(state[6:10]), attitude)
    torque_into(state, attitude, body, loop, torque)
    direction[0], direction[1], direction[2] = 0.0, 0.0, 1.0
    axis = np.empty(3)
    rotate_into(state[6:10], direction, axis)
    along = admissible[0] * axis[0] + admissible[1] * axis[1] + admissible[2] * axis[2]
    thrust[0], thrust[1] = 0.0, 0.0
    thrust[2] = min(max(along, body.min_thrust), body.max_thrust)
    limit_command_into(thrust, torque, body)


@compile_kernel
def hold_into(
    state: Array, wanted: Array, duration: float, body: BodyNumbers, loop: LoopNumbers, out: Array
) -> None:
    """Fly a held thrust vector under the attitude loop, in place.

    Args:
        state: shape (17,).
        wanted: [N] shape (3,), site frame.
        duration: [s] positive: out's K periods, none longer than the loop's.
        body: the vehicle.
        loop: the gains.
        out: shape (K, 6), written: commanded thrust [N] and torque [N m] of each period, body frame.
    """
    thrust = np.empty((2, 3))
    torque = np.empty((2, 3))
    period = duration / out.shape[0]
    for k in range(out.shape[0]):
        command_into(state, wanted, body, loop, thrust[0], torque[0])
        thrust[1] = thrust[0]
        torque[1] = torque[0]
        out[k, :3] = thrust[0]
        out[k, 3:] = torque[0]
        fly_into(state, thrust, torque, period, body)


def periods_in(duration: float, loop: AttitudeLoop) -> int:
    """How many equal periods of at most the loop's a duration [s] is cut into."""
    return max(1, math.ceil(duration / loop.period - 1e-9))


def hold_thrust(
    state: RigidState,
    thrust: ArrayLike,
    duration: float,
    body: RigidBody,
    loop: AttitudeLoop = DEFAULT_LOOP,
    gravity: ArrayLike = MOON_GRAVITY,
) -> RigidState:
    """Fly a commanded thrust vector for a while: the body turns towards it and throttles.

    Args:
        state: where the flight starts.
        thrust: [N] shape (3,), site frame; brought within the vehicle's thrust and tilt limits.
        duration: [s] positive.
        body: the vehicle.
        loop: the gains.
        gravity: [m/s^2] shape (3,), site frame.

    Returns:
        The state after `duration`. Its mass may be below the dry mass: the tank is the caller's business.

    Raises:
        ValueError: an argument is not finite or of the wrong shape, or full thrust would burn all mass.
    """
    wanted = finite_vector("thrust", thrust, 3)
    time = finite_number("duration", duration, above=0.0)
    if body.lander.max_mass_flow * time >= state.mass:
        raise ValueError(f"duration {time:g} s may burn more than the whole mass {state.mass:g} kg")
    numbers = state.as_array()
    assert numbers.size == SIZE
    commands = np.empty((periods_in(time, loop), 6))
    hold_into(numbers, wanted, time, body.numbers(gravity), loop.numbers, commands)
    return RigidState.of_array(numbers)
