"""Extremals of given times of flight: neighbours of the best one.

With the time of flight T given, the Hamiltonian is free: the first six equations F of `primer_equations`, in
the unknowns y = (q1, q2, t1, t2), have a root for each T near the best one. Along these roots

    dF/dy y' + dF/dT = 0,    and next to them    dF/dy (y - y0) = -F(y0, T),

whose matrices are columns of the Jacobian that Newton's method takes: one Jacobian corrects an extremal that
was carried over from another time, and carries it on. A touch of the ground adds its two equations to F and
its two unknowns to y.

Where a flight starts with a coast, another T needs a first burn: against q2 to land earlier, along q2 to land
later. While it is short the last burn hardly changes, and with it q2 and what of the primer's slope is normal
to q2; the part along q2 is such that the primer at the start has the length one. There are two such primers,
one for each side: a first guess, good where the last burn is short. Source: Bryson and Ho, Applied Optimal
Control, 1975, chapter 6.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.extremal import (
    Extremal,
    PrimerProblem,
    copy_extremal,
    in_unit,
    new_extremal,
    no_touch,
    touches,
)
from guidance.flight_time.linear_system import solve_linear
from guidance.flight_time.primer_equations import (
    ANGLES,
    FREE,
    TOUCHING,
    move_extremal,
    residuals,
    set_jacobian,
)
from guidance.kernel import compile_kernel

_FIXED = 6  # equations, and unknowns, of a given time of flight; the place of the Hamiltonian, and of T
_MOST_TURN = 0.5  # [rad], and of the time of flight: a longer correction leads nowhere


class Neighbours(NamedTuple):
    """Extremals near one of them, to first order; all in seconds.

    Attributes:
        extremal: nearly one, of its time of flight.
        frame: tangent frames of q1 and q2, shape (4, 3).
        correction: step to the extremal of that time, shape (7,): four angles [rad], t1, t2 and T [s]; shape
            (9,) with a touch of the ground: s [s] and c [1/s] as well.
        rate: change of the step per second of flight, of the same shape.
    """

    extremal: Extremal
    frame: Array
    correction: Array
    rate: Array


@compile_kernel
def _solve_fixed(jacobian: Array, right: Array, unit: float, step: Array) -> None:
    """Write the step, in seconds, that takes all equations but the Hamiltonian's to -right, T held.

    It is zero where they are singular.
    """
    size = step.size - 1
    matrix, vector = np.empty((size, size)), np.empty(size)
    for i in range(size):
        row = i if i < _FIXED else i + 1
        vector[i] = -right[row]
        for k in range(size):
            matrix[i, k] = jacobian[row, k if k < _FIXED else k + 1]
    step[:] = 0.0
    if solve_linear(matrix, vector) and bool(np.isfinite(vector).all()):
        for k in range(_FIXED):
            step[k] = vector[k] if k < ANGLES else vector[k] * unit
        if step.size == TOUCHING:
            step[FREE], step[FREE + 1] = vector[_FIXED] * unit, vector[_FIXED + 1] / unit


@compile_kernel
def _is_near(step: Array, unit: float) -> bool:
    """Whether a step [rad, s] is short enough to lead anywhere, beside a time of flight [s]."""
    for k in range(step.size if step.size == FREE else FREE + 1):
        if not abs(step[k]) < (_MOST_TURN if k < ANGLES else _MOST_TURN * unit):
            return False
    return True


@compile_kernel
def find_neighbours(extremal: Extremal, problem: PrimerProblem) -> Neighbours:
    """Neighbours of an extremal, or of nearly one, of a problem; both in seconds as in `solve_primer`.

    Those of a flight that touches the ground touch it too.
    """
    unit, size = extremal.times[2], TOUCHING if touches(extremal) else FREE
    scaled = in_unit(problem, unit)
    touch = no_touch()
    if size == TOUCHING:
        touch[0], touch[1] = extremal.touch[0] / unit, extremal.touch[1] * unit
        touch[2] = extremal.touch[2] / (unit * unit)
    x = Extremal(extremal.primer, extremal.times / unit, touch)
    here, frame, jacobian = np.empty(size), np.empty((4, 3)), np.empty((size, size))
    residuals(x, scaled, here)
    set_jacobian(x, scaled, here, frame, new_extremal(), jacobian)
    correction, rate = np.empty(size), np.empty(size)
    _solve_fixed(jacobian, here, unit, correction)
    if not _is_near(correction, unit):
        correction[:] = 0.0
    _solve_fixed(jacobian, jacobian[:, _FIXED], 1.0, rate)
    for k in range(ANGLES):
        rate[k] /= unit
    if size == TOUCHING:
        rate[FREE + 1] /= unit * unit
    rate[_FIXED] = 1.0
    kept = new_extremal()
    copy_extremal(extremal, kept)
    return Neighbours(kept, frame, correction, rate)


@compile_kernel
def set_neighbour(known: Neighbours, time: float, out: Extremal) -> None:
    """Write the extremal of a time of flight [s]."""
    step, delay = np.empty(known.rate.size), time - known.extremal.times[2]
    for k in range(step.size):
        step[k] = known.correction[k] + known.rate[k] * delay
    move_extremal(known.extremal, known.frame, step, out)


@compile_kernel
def _begin_first_burn(x: Extremal, along: float) -> None:
    """Let an extremal begin to burn at the start, with the sign of `along` q2; in place, where it can."""
    t1, t2 = x.times[0], x.times[1]
    start, part, square = np.empty(3), 0.0, 0.0
    for axis in range(3):
        slope = (x.primer[1, axis] - x.primer[0, axis]) / (t2 - t1)
        start[axis] = x.primer[1, axis] - slope * t2
        part += start[axis] * x.primer[1, axis]
    for axis in range(3):
        start[axis] -= part * x.primer[1, axis]
        square += start[axis] * start[axis]
    if not square < 1.0:
        return
    for axis in range(3):
        x.primer[0, axis] = start[axis] + math.copysign(math.sqrt(1.0 - square), along) * x.primer[1, axis]
    x.times[0] = 0.0


@compile_kernel
def neighbours_at(known: Neighbours, problem: PrimerProblem, time: float) -> Neighbours:
    """Neighbours of the extremal of another time of flight [s], from known ones."""
    near, there = known.extremal.times[2], new_extremal()
    set_neighbour(known, time, there)
    coasts = known.extremal.times[0] < 0.0 or there.times[0] < 0.0
    if time != near and coasts and not touches(there):
        first = new_extremal()
        set_neighbour(known, near, first)
        _begin_first_burn(first, time - near)
        set_neighbour(find_neighbours(first, problem), time, there)
    return find_neighbours(there, problem)
