"""A rigid body under way between two looks: its state, what it believes of it, and how its engine answers.

The attitude that the loop steers by errs by one small turn, the tilt of the inertial unit. With a gyroscope
it drifts and the filter corrects it (`hda.navigation.attitude`), and the rates err too. Without one the tilt
stays, and rates are known; where there is no filter both are known.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.attitude_loop import LoopNumbers
from guidance.rigid_body.body import BodyNumbers
from guidance.rigid_body.state import SIZE, RigidState
from guidance.validation import finite_vector
from hda.navigation.attitude import believe_into, err_rates_into
from hda.navigation.layout import Turn
from hda.navigation.steering import GyroSensing, Sensing


class Turning(NamedTuple):
    """A rigid body for the kernels, which change its arrays in place.

    Attributes:
        state: shape (17,), as `guidance.rigid_body.state.SIZE` says.
        tilt: [rad] shape (3,), true minus believed attitude, a small rotation about the site's axes.
        body: the vehicle.
        loop: gains of the attitude loop.
        path: shape (m + 1, 17), the state at each control instant.
        engine: shape (3,): thrust [N] that the lander reckons with by its commands and the engine's lag, and
            over the newest period the impulse [N s] that it reckons with and the one that it feels. At the
            start of an interval the reckoned thrust is the true one, with the engine's error in it; that is
            forgotten within some lags.
        aim: [N] shape (3,), site frame, along which the body points in the present period; its size is of no
            account.
        lead: [s] by which it points ahead of a plan.
        rate_error: [rad/s] shape (3,), believed minus true rates in the present control period, body frame.
    """

    state: Array
    tilt: Array
    body: BodyNumbers
    loop: LoopNumbers
    path: Array
    engine: Array
    aim: Array
    lead: float
    rate_error: Array


PlainTurning = tuple[
    Array,
    Array,
    tuple[Array, Array, Array, float, float, float, float, float, float, float, float, float, float],
    tuple[float, float, float],
    Array,
    Array,
    Array,
    float,
    Array,
]
"""`Turning` without names: numba takes plain tuples from Python several times as fast."""


def begin_turning(
    state: RigidState, body: BodyNumbers, loop: LoopNumbers, tilt: Array, lead: float, nodes: int
) -> PlainTurning:
    """A body made ready for an interval of at most `nodes` nodes.

    Args:
        state: where it starts.
        body: the vehicle.
        loop: the gains.
        tilt: [rad] shape (3,), true minus believed attitude. It is held, not copied: with a filter it is the
            array of `Sensing.errors`, where a gyroscope's drift and the filter's corrections change it.
        lead: [s] by which it points ahead of a plan.
        nodes: of the path.
    """
    engine = np.array([float(np.linalg.norm(state.thrust)), 0.0, 0.0])
    path = np.empty((nodes, SIZE))
    path[0] = state.as_array()
    state_now, aim, rate_error = path[0].copy(), np.zeros(3), np.zeros(3)
    return state_now, tilt, tuple(body), tuple(loop), path, engine, aim, lead, rate_error  # pyright: ignore[reportReturnType]


@compile_kernel
def name_turning(plain: PlainTurning | None) -> Turning | None:
    """Give a plain tuple its names."""
    if plain is None:
        return None
    state, tilt, body, loop, path, engine, aim, lead, rate_error = plain
    return Turning(state, tilt, BodyNumbers(*body), LoopNumbers(*loop), path, engine, aim, lead, rate_error)


@compile_kernel
def keep_state(turning: Turning | None, node: int) -> None:
    """Write the present state into the path, if there is a body."""
    if turning is None:
        return
    for number in range(turning.state.size):
        turning.path[node, number] = turning.state[number]


@compile_kernel
def read_gyro(turning: Turning | None, sensing: Sensing | None, number: int, period: float) -> None:
    """Draw by how much a body misjudges its rates in control period `number` of [s] `period`.

    Args:
        turning: its `rate_error` is written; None: a point mass.
        sensing: the filter; without one, or without a gyroscope, the rates are known.
        number: of the period in its interval.
        period: [s].
    """
    if turning is None:
        return
    if sensing is None:
        return
    _read_gyro(turning, sensing, sensing.gyro, number, period)


@compile_kernel
def _read_gyro(
    turning: Turning, sensing: Sensing, gyro: GyroSensing | None, number: int, period: float
) -> None:
    """The gyroscope is an argument of its own: numba leaves out what follows from None in these alone."""
    if gyro is None:
        return
    draws, out = gyro.draws[number], turning.rate_error
    err_rates_into(sensing.memory, sensing.errors, draws, period, gyro.numbers, out)


@compile_kernel
def turn_of(turning: Turning | None, sensing: Sensing | None, number: int) -> Turn | None:
    """How a body turned in control period `number`, for its filter; None where no gyroscope tells."""
    if turning is None:
        return None
    if sensing is None:
        return None
    return _turn_of(turning, sensing.gyro, number)


@compile_kernel
def _turn_of(turning: Turning, gyro: GyroSensing | None, number: int) -> Turn | None:
    if gyro is None:
        return None
    before, after = turning.path[number, 6:10], turning.path[number + 1, 6:10]
    return Turn(before, after, gyro.draws[number], gyro.numbers)


def believed_attitude(attitude: ArrayLike, tilt: ArrayLike) -> Array:
    """The attitude that a lander believes to have.

    Args:
        attitude: the true unit quaternion, scalar first, shape (4,).
        tilt: [rad] shape (3,), true minus believed attitude, a small rotation about the site's axes.

    Returns:
        Unit quaternion, shape (4,).

    Raises:
        ValueError: an argument is not finite or of the wrong shape.
    """
    out = np.empty(4)
    believe_into(finite_vector("attitude", attitude, 4), finite_vector("tilt", tilt, 3), out)
    return out


@compile_kernel
def reckon_engine(turning: Turning, commanded: float, time: float, burnt: float) -> None:
    """Take the engine's model over a while of a held command, and add up what was felt.

    Args:
        turning: its `engine` is changed.
        commanded: [N] before the engine's error.
        time: [s].
        burnt: [kg] in that time; the impulse is felt by the accelerometers as it is told by the flow.
    """
    lag, before = turning.body.engine_lag, turning.engine[0]
    decay = math.exp(-time / lag) if lag > 0.0 else 0.0
    turning.engine[0] = commanded + (before - commanded) * decay
    turning.engine[1] += commanded * time + (before - commanded) * lag * (1.0 - decay)
    turning.engine[2] += burnt * turning.body.exhaust_velocity


@compile_kernel
def feel_engine(turning: Turning | None, known: float, told: float, least: float) -> float:
    """The engine's error ratio after a control period.

    A body's engine lags and points elsewhere than it is asked to, so that the change of velocity tells the
    error only beside what lag and attitude leave of the command.

    Args:
        turning: the body; None for a point mass.
        known: the ratio known before.
        told: what the change of velocity tells of a point mass.
        least: [N s] impulse of the period under which a body's engine tells nothing.
    """
    if turning is None:
        return told
    if turning.engine[1] < least:
        return known
    return turning.engine[2] / turning.engine[1] - 1.0
