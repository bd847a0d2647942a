"""First guesses of the extremal, from which Newton's method starts: in closed form, all in seconds.

Lengths and speeds are divided by full thrust over start mass, as in `PrimerProblem`.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.extremal import Extremal, PrimerProblem
from guidance.flight_time.linear_system import dot
from guidance.kernel import compile_kernel

_LATEST_FIRST_BURN = 0.5  # of the time before the braking burn, of a suicide burn's guess
_LATEST_IMPULSE = 0.9  # the same of two impulses
_UNIT = 1e-6  # by which the square of a unit vector may differ from one
_LEAST_HEIGHT = 1e-3  # of the start, above the ground, at a touch
_KINK = 10.0  # jump of the primer's slope at a touch, in primers over the time until then
_TIMES = 40  # of flight, tried for two impulses
_SHORTEST = 0.01  # of the longest time tried


@compile_kernel
def _make_unit(vector: Array) -> None:
    length = math.sqrt(dot(vector, vector))
    for axis in range(3):
        vector[axis] /= length


@compile_kernel
def guess_suicide_burn(problem: PrimerProblem, first_burn: bool, x: Extremal) -> bool:
    """A suicide burn along the vertical, and two sideways impulses, at the start and in it.

    Args:
        problem: in seconds.
        first_burn: whether there is the impulse at the start; without it the primer comes from below.
        x: the guess.

    Returns:
        Whether there is one: next to the target's plane a primer may be too long for floating point.
    """
    r, v, gravity, _ = problem
    g = math.sqrt(dot(gravity, gravity))
    up, across, kick, speed = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    q1, q2 = x.primer[0], x.primer[1]
    for axis in range(3):
        up[axis] = -gravity[axis] / g
    height, climb = dot(r, up), dot(v, up)
    coast = (2.0 * (1.0 - g) * height - climb * climb) / 2.0
    ignition_speed = math.sqrt(max(climb * climb + 2.0 * g * coast, 1e-6 * g * abs(height)))
    t2 = max((ignition_speed + climb) / g, 1e-2 * ignition_speed / g)
    final = t2 + ignition_speed / (1.0 - g)
    mean_time, braking_speed = 0.5 * (t2 + final), ignition_speed + g * (final - t2)
    for axis in range(3):
        across[axis] = (r[axis] - height * up[axis]) / mean_time
        kick[axis] = -across[axis] - (v[axis] - climb * up[axis])
        speed[axis] = v[axis] + kick[axis]
        q2[axis] = across[axis] + braking_speed * up[axis]
    size = math.sqrt(dot(kick, kick))
    _make_unit(q2)
    t1 = min(t2 - 2.0 * ignition_speed / g, -1e-3 * t2)
    if first_burn and size > 1e-9 * ignition_speed:
        t1 = size if size < 0.8 * t2 else _LATEST_FIRST_BURN * t2
        sine, cosine = 1.0, 0.0
        for _ in range(5):  # the Hamiltonian at t1
            gap = dot(speed, up) - g * (t2 - t1)
            if gap == 0.0:
                break
            cosine = (dot(q2, speed) - sine * dot(kick, speed) / size) / gap
            cosine = min(max(cosine, -0.95), 0.95)
            sine = math.sqrt(1.0 - cosine * cosine)
        for axis in range(3):
            q1[axis] = sine * kick[axis] / size + cosine * up[axis]
    else:
        for axis in range(3):
            q1[axis] = 0.1 * kick[axis] / ignition_speed - up[axis]
        _make_unit(q1)
    x.times[0], x.times[1], x.times[2] = t1, t2, final
    return abs(dot(q1, q1) - 1.0) < _UNIT and abs(dot(q2, q2) - 1.0) < _UNIT


@compile_kernel
def _set_impulses(problem: PrimerProblem, time: float, first: Array, last: Array) -> float:
    """Write the velocity changes of a ballistic flight that begins and ends with one; their cost.

    The gravity loss of a burn as long as its velocity change is counted, as in `guidance.two_impulse`.
    """
    r, v, g, _ = problem
    first_square, last_square = 0.0, 0.0
    for axis in range(3):
        there = -r[axis] / time - 0.5 * g[axis] * time
        first[axis], last[axis] = there - v[axis], -there - g[axis] * time
        first_square += first[axis] * first[axis]
        last_square += last[axis] * last[axis]
    brake = math.sqrt(last_square)
    return math.sqrt(first_square) + brake + 0.5 * (math.sqrt(dot(g, g)) * brake + first_square / time)


@compile_kernel
def guess_impulses(problem: PrimerProblem, x: Extremal) -> bool:
    """The cheapest of many ballistic flights between two impulses, each spread over a burn about it.

    It serves flights that run along the ground rather than down to it: near the plane, fast or far away.

    Returns:
        Whether there is one.
    """
    r, v, g, _ = problem
    pull = math.sqrt(dot(g, g))
    longest = 2.0 * (math.sqrt(dot(v, v)) / pull + math.sqrt(2.0 * math.sqrt(dot(r, r)) / pull))
    if not longest > 0.0:
        return False
    first, last = np.empty(3), np.empty(3)
    least, best = math.inf, longest
    for k in range(_TIMES):
        time = longest * _SHORTEST ** (k / (_TIMES - 1))
        cost = _set_impulses(problem, time, first, last)
        if cost < least:
            least, best = cost, time
    _set_impulses(problem, best, first, last)
    kick, brake = math.sqrt(dot(first, first)), math.sqrt(dot(last, last))
    if not (kick > 0.0 and brake > 0.0):
        return False
    for axis in range(3):
        x.primer[0, axis], x.primer[1, axis] = first[axis] / kick, last[axis] / brake
    final = best + 0.5 * (kick + brake)
    braking = final - brake
    x.times[0], x.times[1], x.times[2] = min(kick, _LATEST_IMPULSE * braking), braking, final
    return True


@compile_kernel
def guess_touch(problem: PrimerProblem, x: Extremal) -> bool:
    """Stop the fall at the ground by thrust straight up, and go on from there by two impulses.

    Returns:
        Whether there is one: the start must sink.
    """
    r, v, g, flow = problem
    if not v[2] < 0.0 or not g[2] > -1.0:
        return False
    stop = -v[2] / (1.0 + g[2])
    place, speed = r + v * stop, v.copy()
    place[2], speed[2] = _LEAST_HEIGHT * r[2], 0.0
    if not guess_impulses(PrimerProblem(place, speed, g, flow), x):
        return False
    for k in range(3):
        x.times[k] += stop
    x.touch[0], x.touch[1], x.touch[2] = stop, _KINK / stop, 0.0
    return True
