"""Flight over true ground: when a pad or the belly of the upright lander first touches it.

Kernels for the vehicle's inner loop. While the path stays above all ground around it nothing is looked at in
detail; lower down the lander is set over the ground every 0.1 m and 0.1 s of its way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.dynamics import propagate_into
from guidance.kernel import compile_kernel
from hda.safety.touchdown_stance import Footing, contact_height, highest_around

_STEP = 0.1  # [m] along the ground, and [s], between two instants that are looked at
_HALVINGS = 50
_FALL = 0.5  # [s] of a free fall that are searched at a time


class Motion(NamedTuple):
    """A held thrust.

    Attributes:
        start: shape (7,), the state that it begins from.
        thrust: [N] shape (3,).
        gravity: [m/s^2] shape (3,), pointing down.
        exhaust_velocity: [m/s].
    """

    start: Array
    thrust: Array
    gravity: Array
    exhaust_velocity: float


@compile_kernel
def _reach_into(motion: Motion, time: float, out: Array) -> None:
    propagate_into(motion.start, motion.thrust, time, motion.gravity, motion.exhaust_velocity, out)


@compile_kernel
def find_contact(motion: Motion, begin: float, end: float, footing: Footing, out: Array) -> float:
    """First instant [s] from `begin` to `end` at which the lander touches the ground, or -1.

    `out` then holds the state there, else that at `end`.
    """
    _reach_into(motion, begin, out)
    x, y, z, sink = out[0], out[1], out[2], max(-out[5], 0.0)
    speed = math.hypot(out[3], out[4])
    _reach_into(motion, end, out)
    speed = max(speed, math.hypot(out[3], out[4]))  # velocity goes along a straight line: no more between
    lowest = min(z - sink * (end - begin), out[2])
    if lowest > highest_around(footing, x, y, speed * (end - begin)):
        return -1.0
    steps = math.ceil(max(speed, 1.0) * (end - begin) / _STEP) + 1
    before = begin
    for k in range(steps + 1):
        time = end if k == steps else begin + (end - begin) * k / steps
        _reach_into(motion, time, out)
        if out[2] <= contact_height(footing, out[0], out[1]):
            for _ in range(_HALVINGS):
                middle = 0.5 * (before + time)
                _reach_into(motion, middle, out)
                if out[2] <= contact_height(footing, out[0], out[1]):
                    time = middle
                else:
                    before = middle
            _reach_into(motion, time, out)
            return time
        before = time
    return -1.0


@compile_kernel
def _turning_instant(motion: Motion, end: float, out: Array) -> float:
    """[s] when the vertical velocity, negative at first and positive at `end`, passes zero."""
    low, high = 0.0, end
    for _ in range(60):
        middle = 0.5 * (low + high)
        _reach_into(motion, middle, out)
        if out[5] < 0.0:
            low = middle
        else:
            high = middle
    return high


@compile_kernel
def hold_over_ground(motion: Motion, duration: float, footing: Footing, out: Array) -> tuple[float, bool]:
    """Hold a thrust for `duration`, or until the ground is touched: (time flown, whether it was)."""
    _reach_into(motion, duration, out)
    begin = 0.0
    if motion.start[5] < 0.0 < out[5]:
        turn = _turning_instant(motion, duration, out)
        touched = find_contact(motion, 0.0, turn, footing, out)
        if touched >= 0.0:
            return touched, True
        begin = turn
    touched = find_contact(motion, begin, duration, footing, out)
    return (touched, True) if touched >= 0.0 else (duration, False)


@compile_kernel
def fall_to_ground(start: Array, gravity: Array, footing: Footing, out: Array) -> float:
    """Fall freely until the ground is touched; return the time it took."""
    motion = Motion(start.copy(), np.zeros(3), gravity, 1.0)
    begin = 0.0
    while True:
        touched = find_contact(motion, begin, begin + _FALL, footing, out)
        if touched >= 0.0:
            return touched
        begin += _FALL
