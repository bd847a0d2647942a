"""A rigid body under a commanded thrust vector, with its events: plane or ground, and the empty tank.

The attitude loop points and throttles anew in each of its periods, and the engine's error acts on what it
commands. The way is looked at every 0.1 m and 0.05 s, however long that period is, so that a dip below the
plane between two instants may be missed that is a few millimetres deep. The ground is touched as by the
upright lander, however it leans; how it leans is judged at the touchdown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.rigid_body.attitude_loop import drive_into
from guidance.rigid_body.motion import fly_into
from hda.flight.rigid.turning import Turning, reckon_engine
from hda.navigation.attitude import believe_into, drift
from hda.safety.touchdown_stance import Footing, contact_height, highest_around

FLYING, TOUCHDOWN, TANK_EMPTY = 0, 1, 2
"""Where a period leaves the vehicle: `hda.flight.vehicle.FlightStatus` as plain numbers."""

_STEP = 0.1  # [m] along the ground between two instants that are looked at
_INSTANT = 0.05  # [s] between them at most
_CURVING = 2.0  # [m/s^2] beside the thrust's, to be on the safe side; gravity bends the way to the other side
_HALVINGS = 50


class _Piece(NamedTuple):
    """One period of the attitude loop, or a part of it.

    Attributes:
        start: shape (17,).
        thrust: [N] shape (2, 3), body frame: as the engine is driven, with its error.
        torque: [N m] shape (2, 3), body frame.
    """

    start: Array
    thrust: Array
    torque: Array


@compile_kernel
def _reach_into(turning: Turning, piece: _Piece, time: float) -> None:
    """Write the state `time` [s] after the start of a piece into `turning.state`."""
    for number in range(piece.start.size):
        turning.state[number] = piece.start[number]
    if time > 0.0:
        fly_into(turning.state, piece.thrust, piece.torque, time, turning.body)


@compile_kernel
def _contact(state: Array, plane: float, footing: Footing | None) -> float:
    """[m] height at which the lander at its present place touches the ground or the plane."""
    if footing is not None:
        return contact_height(footing, state[0], state[1])
    return plane


@compile_kernel
def _may_touch(piece: _Piece, end: Array, time: float, plane: float, footing: Footing | None) -> bool:
    """Whether contact within a piece is possible: the way is at most a parabola's sag below its ends."""
    thrust = max(piece.start[16], piece.thrust[0, 2], end[16])  # a lag leads from the first to the second
    sag = 0.125 * time * time * (_CURVING + thrust / end[13])
    lowest = min(piece.start[2], end[2]) - sag
    if footing is not None:
        speed = max(math.hypot(piece.start[3], piece.start[4]), math.hypot(end[3], end[4]))
        return lowest <= highest_around(footing, piece.start[0], piece.start[1], speed * time + sag)
    return lowest <= plane


@compile_kernel
def _find_contact(
    turning: Turning, piece: _Piece, time: float, plane: float, footing: Footing | None
) -> float:
    """First instant [s] of a piece of `time` [s] at which the lander touches, or -1.

    `turning.state` holds the state at the end of the piece before, and that of the contact or the end after.
    """
    state = turning.state
    if not _may_touch(piece, state, time, plane, footing):
        return -1.0
    speed = max(math.hypot(piece.start[3], piece.start[4]), math.hypot(state[3], state[4]))
    looks = max(2, math.ceil(time / _INSTANT - 1e-9), math.ceil(speed * time / _STEP))
    before = 0.0
    for k in range(looks + 1):
        reached = time * k / looks
        _reach_into(turning, piece, reached)
        if state[2] <= _contact(state, plane, footing):
            for _ in range(_HALVINGS):
                middle = 0.5 * (before + reached)
                _reach_into(turning, piece, middle)
                if state[2] <= _contact(state, plane, footing):
                    reached = middle
                else:
                    before = middle
            _reach_into(turning, piece, reached)
            return reached
        before = reached
    return -1.0


@compile_kernel
def _emptying_instant(turning: Turning, piece: _Piece, time: float, dry_mass: float) -> float:
    """[s] when the mass of a piece passes the dry mass; `turning.state` is left there."""
    low, high = 0.0, time
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        _reach_into(turning, piece, middle)
        if turning.state[13] > dry_mass:
            low = middle
        else:
            high = middle
    _reach_into(turning, piece, high)
    return high


@compile_kernel
def _fly_piece(
    turning: Turning,
    wanted: Array,
    burns: bool,
    limits: tuple[float, float, float, float],
    footing: Footing | None,
) -> tuple[float, int]:
    """Fly one period of the attitude loop, or until an event: (time flown, status).

    Args:
        turning: the body.
        wanted: [N] shape (3,), site frame, as the lander believes it to be.
        burns: the engine is on; else it is cut off, and the body is held upright.
        limits: length of the piece [s], plane [m], relative error of the thrust, dry mass [kg].
        footing: the lander over the true ground; None: the plane counts.
    """
    time, plane, error, dry_mass = limits
    state = turning.state
    if state[13] <= dry_mass:
        state[14:17] = 0.0
        turning.engine[0] = 0.0
    start, thrust, torque = state.copy(), np.zeros((2, 3)), np.zeros((2, 3))
    believed = state.copy()
    believe_into(state[6:10], turning.tilt, believed[6:10])
    for axis in range(3):
        believed[10 + axis] += turning.rate_error[axis]
    drive_into(believed, (wanted, turning.aim), turning.body, turning.loop, (thrust[0], torque[0]))
    commanded = thrust[0, 2] if burns and state[13] > dry_mass else 0.0
    thrust[:, 2] = commanded * (1.0 + error)
    torque[1] = torque[0]
    piece = _Piece(start, thrust, torque)
    fly_into(state, thrust, torque, time, turning.body)
    empty = state[13] < dry_mass < start[13]
    if empty:
        time = _emptying_instant(turning, piece, time, dry_mass)
    touched = _find_contact(turning, piece, time, plane, footing)
    if touched >= 0.0:
        time = touched
    reckon_engine(turning, commanded, time, start[13] - state[13])
    drift(turning.tilt, start[6:10], state[6:10], turning.rate_error, time)
    if touched >= 0.0:
        return touched, TOUCHDOWN
    if empty:
        state[13] = dry_mass
        return time, TANK_EMPTY
    return time, FLYING


@compile_kernel
def _give(turning: Turning, out: Array) -> None:
    """Write the state as a point mass's, shape (7,)."""
    for number in range(6):
        out[number] = turning.state[number]
    out[6] = turning.state[13]


@compile_kernel
def fall_body(turning: Turning, limits: tuple[float, float], footing: Footing | None, out: Array) -> float:
    """Fall with the engine cut off, its thrust dying away, held upright by the jets; return the time it took.

    Args:
        turning: the body.
        limits: plane [m] and dry mass [kg].
        footing: the lander over the true ground; None: the plane counts.
        out: shape (7,), written: the state at the contact.
    """
    plane, dry_mass = limits
    time, nothing = 0.0, np.zeros(3)
    turning.aim[:] = 0.0
    if turning.state[2] <= _contact(turning.state, plane, footing):
        _give(turning, out)
        return time
    while True:
        step = (turning.loop.period, plane, 0.0, dry_mass)
        flown, status = _fly_piece(turning, nothing, False, step, footing)
        time += flown
        if status == TOUCHDOWN:
            _give(turning, out)
            return time


@compile_kernel
def hold_command(
    turning: Turning,
    commanded: Array,
    limits: tuple[float, float, float, float],
    footing: Footing | None,
    out: Array,
) -> tuple[float, int]:
    """Fly a commanded thrust for a control period, ended early by the ground or the tank: (time, status).

    Args:
        turning: the body.
        commanded: [N] shape (3,), site frame; the engine gives what of it lies along the body, which points
            along `turning.aim`.
        limits: control period [s], plane [m], relative error of the thrust, dry mass [kg].
        footing: the lander over the true ground; None: the plane counts.
        out: shape (7,), written: the state reached.
    """
    period, plane, error, dry_mass = limits
    pieces = max(1, math.ceil(period / turning.loop.period - 1e-9))
    step = (period / pieces, plane, error, dry_mass)
    turning.engine[1:] = 0.0
    time = 0.0
    for _ in range(pieces):
        flown, status = _fly_piece(turning, commanded, True, step, footing)
        time += flown
        if status == TANK_EMPTY:
            return time + fall_body(turning, (plane, dry_mass), footing, out), TANK_EMPTY
        if status == TOUCHDOWN:
            _give(turning, out)
            return time, TOUCHDOWN
    _give(turning, out)
    return period, FLYING
