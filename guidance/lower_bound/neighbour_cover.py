"""A bound for every time of flight from an extremal and its neighbours, without a search for the primers.

Any affine primer bounds the velocity change of every time of flight; that of the extremal of a time does so
tightly near it. The best extremal's primer bounds the best time, those of its neighbours (to first order:
their errors cost tightness, never truth) the times beside it; far out two impulses do, and constant primers.
Where the best flight touches the ground its neighbours do, and their primers have its kink.
"""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array, Index
from guidance.flight_time.extremal import Extremal, PrimerProblem, new_extremal, touches
from guidance.flight_time.linear_system import dot
from guidance.flight_time.neighbouring_extremals import (
    Neighbours,
    find_neighbours,
    neighbours_at,
    set_neighbour,
)
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_ascent import two_impulse_primer
from guidance.lower_bound.dual_case import DualCase
from guidance.lower_bound.dual_function import THETA, linear_part
from guidance.lower_bound.path_limit import PRIMER_SIZE, shift_kink, widen_primer
from guidance.lower_bound.time_cover import (
    CoverAim,
    TimeCover,
    along_change,
    join_cover,
    last_primer,
    nearest_open_cell,
)
from guidance.lower_bound.time_grid import time_grid

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_BEYOND = 1.2  # times the distance from the best time to an open cell: there the next primer is taken
_GROWTH = 4.0  # of that distance from one primer to the next, at most
_TRIES = 2  # at a cell's own time, each from the neighbours of the one before
_BEFORE = 1.0 - 1e-9  # of the best time: a node of the grid lies at it, up to rounding
_EARLIEST = 0.1  # of the best time
_STRIDE = 0.06  # of the best time, from one primer with a kink to the next: the touch moves fast
_LONGER = 2.0  # primers where no flight is so short: there the bound has no maximum
_FAILURES = 2  # of a stride, beside the tries: it is halved each time
_LOOSER = 5.0  # tolerance beside a touch, where each primer is good for a short span of times
_IMPULSES = 1.02  # times the level: where two impulses spend so much, their primer is enough
_CELLS = 70  # of the grid of times, up to the best time
NEIGHBOUR_TOLERANCE = 2e-6
"""Of the exhaust velocity, 2.4 g of 1200 kg: how far below what is aimed at a cover may lie."""
MOST_PRIMERS = 24
"""Of a cover by neighbours, the constant ones included."""
MOST_KINKED = 200
"""The same beside a flight that touches the ground."""


@compile_kernel
def primer_of(x: Extremal, case: DualCase) -> Array:
    """Primer (a, b), shape (6,), of an extremal, of the length that lights the engine where it brakes.

    The switching function of the dual bound, s = |p| - 1 + r int s with the growth r = f kappa, vanishes
    theta seconds before the landing where, for a primer of unit length there, the scale is

        1 / (e^{-r theta} + r int_0^theta e^{-r tau} |p(tau)| dtau).
    """
    burn, primer = x.times[2] - x.times[1], np.empty(6)
    for axis in range(3):
        slope = (x.primer[0, axis] - x.primer[1, axis]) / (x.times[1] - x.times[0])
        primer[axis], primer[3 + axis] = x.primer[1, axis] - slope * burn, slope
    rate = case.thrust.full_growth
    total = 0.0
    for k in range(_POINTS.size):
        tau, square = 0.5 * burn * (1.0 + _POINTS[k]), 0.0
        for axis in range(3):
            p = primer[axis] + primer[3 + axis] * tau
            square += p * p
        total += _WEIGHTS[k] * math.exp(-rate * tau) * math.sqrt(square)
    scale = 1.0 / (math.exp(-rate * burn) + 0.5 * rate * burn * total)
    for number in range(6):
        primer[number] *= scale
    return primer


@compile_kernel
def kinked_primer_of(x: Extremal, case: DualCase) -> Array:
    """The same with ten numbers: at a touch of the ground the altitude is the limit that it uses."""
    primer = primer_of(x, case)
    out = widen_primer(primer)
    if touches(x):
        slope = (x.primer[0] - x.primer[1]) / (x.times[1] - x.times[0])
        scale = math.sqrt(dot(primer[3:], primer[3:]) / dot(slope, slope))
        out[THETA - 1], out[THETA] = scale * max(x.touch[1], 0.0), x.times[2] - x.touch[0]
    return out


@compile_kernel
def _lead(x: Extremal, case: DualCase) -> Array:
    """The primer of an extremal: of ten numbers where it touches the ground, else (a, b)."""
    return kinked_primer_of(x, case) if touches(x) else primer_of(x, case)


@compile_kernel
def _in_order(x: Extremal) -> bool:
    """Whether an extremal's times are, with that of a touch."""
    return x.times[0] < x.times[1] < x.times[2] and x.touch[0] < x.times[0]


@compile_kernel
def _join_constant(
    primer: Array, number: int, times: Array, case: DualCase, envelope: Array, owner: Index
) -> None:
    """Let a constant primer no longer than one bound the cells that it bounds best, with no least thrust.

    It lights no engine: its bound is the linear part, a straight line over the times.
    """
    before = linear_part(primer, times[0], case)
    for k in range(envelope.size):
        after = linear_part(primer, times[k + 1], case)
        lowest = min(before, after)
        if lowest > envelope[k]:
            envelope[k], owner[k] = lowest, number
        before = after


@compile_kernel
def _join_constants(times: Array, case: DualCase, primers: Array, envelope: Array, owner: Index) -> float:
    """Begin a cover with its constant primers; [m/s] what the first bounds at all times beyond the grid."""
    last, change = last_primer(case, times[-1]), along_change(case)
    primers[0], primers[1] = widen_primer(last), widen_primer(change)
    _join_constant(last, 0, times, case, envelope, owner)
    _join_constant(change, 1, times, case, envelope, owner)
    return linear_part(last, times[-1], case)


@compile_kernel
def _next_time(mark: float, beside: Neighbours, best_time: float, stride: float, farthest: Array) -> float:
    """[s] the time whose primer is taken for a cell at `mark`: further out it may cover the cell and more.

    Args:
        mark: [s].
        beside: the last one on this side of the best time.
        best_time: [s].
        stride: [s] from that one, at most.
        farthest: [s] of all on this side, from the best time, shape (1,); changed in place.
    """
    time, away, known = mark, mark - best_time, beside.extremal.times[2]
    if farthest[0] == np.inf or farthest[0] < _BEYOND * abs(away):
        farthest[0] = min(_BEYOND * abs(away), _GROWTH * farthest[0])
        time = max(best_time + math.copysign(farthest[0], away), _EARLIEST * best_time)
    return known + math.copysign(stride, time - known) if abs(time - known) > stride else time


@compile_kernel
def _lengthen(last: Neighbours, time: float, case: DualCase) -> Array:
    """A primer for a time of flight [s] too short for any: that of the last flight found, made longer.

    Its kink lies as long after the start.
    """
    x, known = new_extremal(), last.extremal.times[2]
    set_neighbour(last, known, x)
    primer = shift_kink(_lead(x, case), time - known, time)
    primer[:THETA] *= _LONGER
    return primer


@compile_kernel
def cover_by_neighbours(
    best: Neighbours, problem: PrimerProblem, times: Array, case: DualCase, aim: CoverAim
) -> TimeCover:
    """Bound every time of the grid by the primers of neighbouring extremals.

    Args:
        best: the extremal of the best time.
        problem: its problem, in seconds.
        times: [s] shape (n + 1,), rising from 0.
        case: the relaxed problem.
        aim: what level is enough; the floor does not matter here.

    Returns:
        The cover; its level is less than the aim's where the neighbours give no better one.
    """
    cells, best_time = times.size - 1, best.extremal.times[2]
    touching = touches(best.extremal)
    most = MOST_KINKED if touching else MOST_PRIMERS
    primers, owner = np.empty((most + 1, PRIMER_SIZE)), np.zeros(cells, np.int64)
    envelope = np.full(cells, -np.inf)
    beyond = _join_constants(times, case, primers, envelope, owner)
    x, left, right = new_extremal(), best, best
    set_neighbour(best, best_time, x)
    primer, level = _lead(x, case), aim.target - aim.tolerance
    best_value, farthest = aim.target, np.full(2, np.inf)
    stride = np.full(2, _STRIDE * best_time if touching else np.inf)
    tried, tries, most_tries = -1, 0, _TRIES + _FAILURES if touching else _TRIES
    count = 2
    while count < most:
        primers[count] = widen_primer(primer)
        join_cover(primer, count, times, case, envelope, owner)
        if count == 2:
            best_value = float(envelope[int(np.searchsorted(times, _BEFORE * best_time)) - 1])
            level = min(level, best_value - aim.tolerance)
        count += 1
        cell = nearest_open_cell(envelope, times, level, best_time)
        tries = tries + 1 if cell == tried else 0
        if cell >= 0 and tries == most_tries:  # its own primer does not bound it: no other one will
            level, tries = float(envelope[cell]), 0
            cell = nearest_open_cell(envelope, times, level, best_time)
        if cell < 0:
            break
        mark = 0.5 * (times[cell] + times[cell + 1])
        primer, tried = two_impulse_primer(mark, case), cell
        if linear_part(primer, mark, case) > _IMPULSES * level:
            continue
        side = 0 if mark < best_time else 1
        beside = left if side == 0 else right
        time = _next_time(mark, beside, best_time, stride[side], farthest[side : side + 1])
        there = neighbours_at(beside, problem, time)
        set_neighbour(there, time, x)
        if _in_order(x):
            primer, tried = _lead(x, case), cell if time == mark else -1
            if side == 0:
                left = there
            else:
                right = there
        elif touching:
            primers[count] = _lengthen(beside, mark, case)
            join_cover(primers[count], count, times, case, envelope, owner)
            primer, count = _LONGER * _LONGER * primer, count + 1
            stride[side] *= 0.5
        else:
            tried = cell if time == mark else -1
    lowest = min(float(np.min(envelope)), beyond)
    return TimeCover(primers[:count].copy(), owner, lowest, best_time, best_value)


@compile_kernel
def bound_by_neighbours(
    x: Extremal, problem: PrimerProblem, case: DualCase, target: float, exhaust: float
) -> tuple[Array, TimeCover]:
    """Bound the velocity change of every time of flight, from the extremal of the best time.

    Args:
        x: the extremal, in seconds.
        problem: its problem, in seconds.
        case: the relaxed problem.
        target: [m/s] the level that is enough.
        exhaust: [m/s] exhaust velocity.

    Returns:
        [s] The grid of times, and the cover of its cells.
    """
    aim = CoverAim(target, (_LOOSER if touches(x) else 1.0) * NEIGHBOUR_TOLERANCE * exhaust, -np.inf)
    times = time_grid(case, target * (1.0 + 1e-12), x.times[2], _CELLS)
    return times, cover_by_neighbours(find_neighbours(x, problem), problem, times, case, aim)
