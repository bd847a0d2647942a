"""An extremal of the least-propellant descent: a burn, a coast and a burn along a primer affine in time.

`guidance.flight_time.primer_equations` says which of them is the answer; this is how one is flown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_SHRINK = 0.4  # ratio of one part of a burn to the next one, towards where its primer is shortest
_MOST_LEVELS = 20
LEGS = 12
"""Parts of an arc in a flown path."""


class PrimerProblem(NamedTuple):
    """What is flown, with the origin at the target.

    `solve_primer` takes the first three divided by full thrust over start mass: seconds are the only unit.

    Attributes:
        position: at the start, shape (3,).
        velocity: at the start, shape (3,).
        gravity: shape (3,).
        mass_flow: share of the start mass that full thrust burns in a unit of time.
    """

    position: Array
    velocity: Array
    gravity: Array
    mass_flow: float


class Extremal(NamedTuple):
    """The seven unknowns: two unit vectors and three times; its arrays are changed in place.

    Where the flight touches the ground in its first burn, two more: the time s of that, and the rate c at
    which the primer's upward part falls until then beside what is affine, p_z = ... + c (s - t)_+.

    Attributes:
        primer: unit vectors q1 and q2 of the primer at the switches, shape (2, 3).
        times: end of the first burn t1, start of the last t2, end of the flight T, shape (3,).
        touch: s, c and the altitude that is touched, shape (3,); s = -inf where there is no touch.
    """

    primer: Array
    times: Array
    touch: Array


class Primer(NamedTuple):
    """A primer vector, in the site frame, and its length."""

    east: float
    north: float
    up: float
    length: float


class Burn(NamedTuple):
    """Full thrust for a while.

    Attributes:
        begin: time at which it begins.
        end: time at which it ends.
        mass: at its begin, in start masses.
    """

    begin: float
    end: float
    mass: float


class PrimerPath(NamedTuple):
    """A flown extremal at the ends of equal parts of its arcs, from the start to the landing.

    Attributes:
        position: shape (3 LEGS + 1, 3).
        velocity: shape (3 LEGS + 1, 3).
        direction: unit vectors of the primer, shape (3 LEGS + 1, 3).
    """

    position: Array
    velocity: Array
    direction: Array


@compile_kernel
def new_extremal() -> Extremal:
    """An extremal to be written, without a touch of the ground."""
    return Extremal(np.empty((2, 3)), np.empty(3), no_touch())


def blank_extremal() -> Extremal:
    """The same, without the way into compiled code and back."""
    return Extremal(np.empty((2, 3)), np.empty(3), np.array([-math.inf, 0.0, 0.0]))


@compile_kernel
def no_touch() -> Array:
    """Of the ground, as an extremal holds it."""
    return np.array([-np.inf, 0.0, 0.0])


@compile_kernel
def touches(x: Extremal) -> bool:
    """Whether the flight touches the ground in its first burn."""
    return x.touch[0] > -np.inf


@compile_kernel
def copy_extremal(x: Extremal, out: Extremal) -> None:
    """Write an extremal into another."""
    for axis in range(3):
        out.primer[0, axis], out.primer[1, axis] = x.primer[0, axis], x.primer[1, axis]
        out.times[axis], out.touch[axis] = x.times[axis], x.touch[axis]


@compile_kernel
def in_unit(problem: PrimerProblem, unit: float) -> PrimerProblem:
    """A problem in seconds with `unit` seconds as its unit of time."""
    r, v, square = np.empty(3), np.empty(3), unit * unit
    for axis in range(3):
        r[axis], v[axis] = problem.position[axis] / square, problem.velocity[axis] / unit
    return PrimerProblem(r, v, problem.gravity, problem.mass_flow * unit)


@compile_kernel
def primer_at(x: Extremal, time: float) -> Primer:
    """The primer vector at a time."""
    fraction = (time - x.times[0]) / (x.times[1] - x.times[0])
    east = x.primer[0, 0] + (x.primer[1, 0] - x.primer[0, 0]) * fraction
    north = x.primer[0, 1] + (x.primer[1, 1] - x.primer[0, 1]) * fraction
    up = x.primer[0, 2] + (x.primer[1, 2] - x.primer[0, 2]) * fraction
    if time < x.touch[0]:
        up += x.touch[1] * (x.touch[0] - time)
    return Primer(east, north, up, math.sqrt(east * east + north * north + up * up))


@compile_kernel
def set_primer(x: Extremal, time: float, p: Array) -> None:
    """Write the primer vector at a time, shape (3,)."""
    p[0], p[1], p[2], _ = primer_at(x, time)


@compile_kernel
def set_direction(x: Extremal, time: float, p: Array) -> None:
    """Write the unit vector of the primer at a time, shape (3,)."""
    primer = primer_at(x, time)
    size = max(primer.length, 1e-12)
    p[0], p[1], p[2] = primer.east / size, primer.north / size, primer.up / size


@compile_kernel
def add_burn(x: Extremal, burn: Burn, mass_flow: float, then: float, out: Array) -> None:
    """Add to out = (r, v), at the time `then`, what a burn contributes."""
    if not (touches(x) and burn.begin < x.times[0]):
        _add_smooth_burn(x, burn, mass_flow, then, out)
        return
    mark = min(max(x.touch[0], burn.begin), burn.end)
    for begin, end in ((burn.begin, mark), (mark, burn.end)):
        if end > begin:
            left = burn.mass - mass_flow * (begin - burn.begin)
            _add_turning_burn(x, Burn(begin, end, left), mass_flow, then, out)


@compile_kernel
def _add_turning_burn(x: Extremal, burn: Burn, mass_flow: float, then: float, out: Array) -> None:
    """The same next to a touch, where the primer may be short and turn fast.

    The parts of its quadrature shrink towards the time at which the primer is shortest, down to the time
    that it takes to turn there.
    """
    first, last, length = np.empty(3), np.empty(3), burn.end - burn.begin
    set_primer(x, burn.begin, first)
    set_primer(x, burn.end, last)
    along, square = 0.0, 0.0
    for axis in range(3):
        along -= first[axis] * (last[axis] - first[axis])
        square += (last[axis] - first[axis]) ** 2
    share = min(max(along / max(square, 1e-300), 0.0), 1.0)
    least = 0.0
    for axis in range(3):
        least += (first[axis] + share * (last[axis] - first[axis])) ** 2
    levels = 0
    while levels < _MOST_LEVELS and square * _SHRINK ** (2 * levels) > least:
        levels += 1
    nearest = burn.begin + share * length
    for edge in (burn.begin, burn.end):
        span, inner = edge - nearest, 0.0
        for level in range(levels, -1 if span != 0.0 else levels, -1):
            outer = _SHRINK**level
            begin, end = nearest + span * inner, nearest + span * outer
            if span < 0.0:
                begin, end = end, begin
            left = burn.mass - mass_flow * (begin - burn.begin)
            _add_smooth_burn(x, Burn(begin, end, left), mass_flow, then, out)
            inner = outer


@compile_kernel
def _add_smooth_burn(x: Extremal, burn: Burn, mass_flow: float, then: float, out: Array) -> None:
    """The same of a burn during which the primer has no kink; Gauss-Legendre quadrature."""
    half, begin, span = 0.5 * (burn.end - burn.begin), x.times[0], x.times[1] - x.times[0]
    ax, ay, az = x.primer[0, 0], x.primer[0, 1], x.primer[0, 2]
    bx, by, bz = x.primer[1, 0] - ax, x.primer[1, 1] - ay, x.primer[1, 2] - az
    if burn.begin + half < x.touch[0]:
        az += x.touch[1] * (x.touch[0] - begin)
        bz -= x.touch[1] * span
    rx, ry, rz, vx, vy, vz = out[0], out[1], out[2], out[3], out[4], out[5]
    for k in range(_POINTS.size):  # `primer_at` with what does not change taken out of the loop
        elapsed = half * (1.0 + _POINTS[k])
        fraction = (burn.begin + elapsed - begin) / span
        px, py, pz = ax + bx * fraction, ay + by * fraction, az + bz * fraction
        size = math.sqrt(px * px + py * py + pz * pz)
        impulse = half * _WEIGHTS[k] / ((burn.mass - mass_flow * elapsed) * max(size, 1e-12))
        gx, gy, gz = impulse * px, impulse * py, impulse * pz
        left = then - burn.begin - elapsed
        rx, ry, rz = rx + gx * left, ry + gy * left, rz + gz * left
        vx, vy, vz = vx + gx, vy + gy, vz + gz
    out[0], out[1], out[2], out[3], out[4], out[5] = rx, ry, rz, vx, vy, vz


@compile_kernel
def fly_extremal(x: Extremal, problem: PrimerProblem) -> PrimerPath:
    """States and primers along a flight, in the units of `solve_primer`."""
    _, _, g, flow = problem
    first = max(x.times[0], 0.0)
    ends = np.array([0.0, first, x.times[1], x.times[2]])
    points = 3 * LEGS + 1
    path = PrimerPath(np.empty((points, 3)), np.empty((points, 3)), np.empty((points, 3)))
    state, time, mass = np.empty(6), 0.0, 1.0
    for axis in range(3):
        state[axis], state[3 + axis] = problem.position[axis], problem.velocity[axis]
    for k in range(points):
        set_direction(x, time, path.direction[k])
        for axis in range(3):
            path.position[k, axis], path.velocity[k, axis] = state[axis], state[3 + axis]
        arc, part = k // LEGS, k % LEGS
        if arc == 3:
            break
        step = (ends[arc + 1] - ends[arc]) / LEGS
        then = ends[arc] + (part + 1) * step
        for axis in range(3):
            state[axis] += state[3 + axis] * step + 0.5 * step * step * g[axis]
            state[3 + axis] += step * g[axis]
        if arc != 1:
            add_burn(x, Burn(time, then, mass), flow, then, state)
            mass -= flow * (then - time)
        time = then
    return path
