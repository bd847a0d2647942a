"""A bound for every time of flight: a few affine primers that together cover all of them.

Each primer bounds the velocity change of every duration, tightly near the one that it is best for. Where the
best bound of those found so far is too low, the best primer of that time joins them. A constant primer, from
|w - v_0 - g T| <= J, covers all times beyond the last of the grid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array, Index
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_ascent import Ascent, affine_basis, ascend, dual_value, two_impulse_primer
from guidance.lower_bound.dual_case import DualCase
from guidance.lower_bound.dual_function import AFFINE, THETA, linear_part, sweep_bound
from guidance.lower_bound.path_limit import (
    PRIMER_SIZE,
    ascend_with_kink,
    has_kink,
    keep_path,
    shift_kink,
    widen_primer,
)

_FIRST_STRIDE = 5e-3  # of the time of flight
_NUDGE = 0.03  # towards the primer of two impulses: one that is best at another time may lie on a kink of D
_FIRST_SCALE = 1.1  # of the primer of two impulses: longer than one, its thrust burns somewhere
_FINE = 240  # cells of the grid of one time of flight
_HAIR = 1e-9  # of one time of flight: the cell whose bound is that of this time
_STRETCH = 1.7  # of the distance from the best time
_NEARER = 1.0 - 1e-9  # than another cell: what lies further inside is rounding
MOST_PRIMERS = 160
"""A cover that needs more is given up as it stands."""
GRANTED = 1e-7
"""Of the exhaust velocity, 0.1 g of 1200 kg: what the checker of a bound may lose on a grid of its own."""


class CoverAim(NamedTuple):
    """What a cover is made for.

    Attributes:
        target: [m/s] the level that is enough.
        tolerance: [m/s] how far below the best bound of the best time the level may lie.
        floor: [m/s] give up where a time has no better bound than this.
    """

    target: float
    tolerance: float
    floor: float


class TimeCover(NamedTuple):
    """What a set of primers proves.

    Attributes:
        primers: shape (k, 6) or (k, 10), b and c in 1/s. The first is constant, for all times beyond the
            grid.
        owner: index of the primer that bounds a cell of the grid of times, shape (n,).
        level: [m/s] the least bound over all cells and beyond.
        best_time: [s] a time of flight whose best bound is the least that was met.
        best_value: [m/s] that bound.
    """

    primers: Array
    owner: Index
    level: float
    best_time: float
    best_value: float


@compile_kernel
def claimed_bound(level: float, most: float, exhaust: float) -> float:
    """[m/s] what is claimed of a level of which flights that spend at most `most` are spoken; at least 0."""
    return max(min(level - GRANTED * exhaust, most), 0.0)


@compile_kernel
def against_gravity(case: DualCase) -> Array:
    """Primer (a, b), shape (6,), of unit length against gravity; zero where there is no gravity."""
    primer = np.zeros(6)
    primer[:3] = -case.gravity / max(math.sqrt(case.gravity @ case.gravity), 1e-300)
    return primer


@compile_kernel
def along_change(case: DualCase) -> Array:
    """Primer (a, b), shape (6,), of unit length along the change of velocity; zero where there is none."""
    primer = np.zeros(6)
    change = case.arrival - case.velocity
    primer[:3] = change / max(math.sqrt(change @ change), 1e-300)
    return primer


@compile_kernel
def last_primer(case: DualCase, time: float) -> Array:
    """The constant primer whose bound does not fall with the time of flight and is greatest at `time` [s]."""
    first, second = against_gravity(case), along_change(case)
    falls = second[:3] @ case.gravity > 0.0
    if falls or linear_part(first, time, case) >= linear_part(second, time, case):
        return first
    return second


@compile_kernel
def bound_at(primer: Array, time: float, case: DualCase) -> float:
    """[m/s] D of a primer at one time of flight [s], on a grid on which a thrust that turns fast is seen."""
    marks, lowest = np.empty(_FINE + 2), np.empty(_FINE + 1)
    for k in range(_FINE):
        marks[k] = time * k / _FINE
    marks[_FINE], marks[_FINE + 1] = time * (1.0 - _HAIR), time
    sweep_cells(primer, marks, case, lowest)
    return float(lowest[_FINE])


@compile_kernel
def _follow_kink(start: Array, time: float, case: DualCase, aim: CoverAim) -> Ascent:
    """The best primer with the limit of `start`, or that itself, whichever the finer grid says."""
    found = ascend_with_kink(start, time, case, 0.1 * aim.tolerance, 2.0 * aim.target)
    before, after = bound_at(start, time, case), bound_at(found.primer, time, case)
    return Ascent(start, before, False) if before > after else Ascent(found.primer, after, found.stalled)


@compile_kernel
def best_primer(known: Array, later: float, time: float, case: DualCase, aim: CoverAim) -> Ascent:
    """The best primer of a time, of ten numbers, from one that is known or from that of two impulses.

    Where no ascent gets that far it is that of two impulses, whose bound is their velocity change. Where its
    bound is less than the aim's target, a limit on the path may raise it. The time is `later` [s] than that
    of the known one: a limit that it uses is tried first.
    """
    kinked = Ascent(widen_primer(known), -np.inf, True)
    if has_kink(known):
        kinked = _follow_kink(shift_kink(known, later, time), time, case, aim)
        if kinked.value > aim.target - aim.tolerance:
            return kinked
    gradient, basis = np.empty(6), affine_basis(time, case)
    impulses = two_impulse_primer(time, case)
    second = _FIRST_SCALE * impulses
    first = known[:AFFINE] + _NUDGE * (second - known[:AFFINE])
    if dual_value(second, time, case, gradient) > dual_value(first, time, case, gradient):
        first, second = second, first
    found = ascend(first, basis, time, case, 0.1 * aim.tolerance, 2.0 * aim.target)
    least = dual_value(impulses, time, case, gradient)
    if found.stalled or found.value < least:
        other = ascend(second, basis, time, case, 0.1 * aim.tolerance, 2.0 * aim.target)
        if other.value > found.value:
            found = other
    if found.value < least:
        found = Ascent(impulses, least, True)
    if found.value > aim.target - aim.tolerance:
        return Ascent(widen_primer(found.primer), found.value, found.stalled)
    kept = keep_path(found, time, case, 0.1 * aim.tolerance, 2.0 * aim.target)
    return kinked if kinked.value > kept.value else kept


@compile_kernel
def _next_stride(found: Ascent, time: float, stride: float, case: DualCase, tolerance: float) -> float:
    """[s] step downhill to a time with a lower best bound; zero where the bound is as good as level there."""
    gradient = np.empty(THETA)
    half = 1e-4 * time
    rise = dual_value(found.primer, time + half, case, gradient)
    slope = (rise - dual_value(found.primer, time - half, case, gradient)) / (2.0 * half)
    if abs(slope) * _FIRST_STRIDE * time < tolerance:
        return 0.0
    size = _FIRST_STRIDE * time if stride == 0.0 else (2.0 if stride * slope < 0.0 else 0.3) * abs(stride)
    return -math.copysign(size, slope)


@compile_kernel
def _beyond(time: float, best_time: float, again: bool, times: Array) -> float:
    """[s] the time whose primer is tried for a cell at `time`: further out it covers the cell and more."""
    if again:
        return time
    return min(max(best_time + _STRETCH * (time - best_time), 0.5 * time), 0.5 * (time + times[-1]))


@compile_kernel
def nearest_open_cell(envelope: Array, times: Array, level: float, best_time: float) -> int:
    """The cell nearest to the best time whose bound lies below the level; -1 where there is none.

    Of two that are as near, up to rounding, it is the earlier one.
    """
    nearest, least = -1, np.inf
    for k in range(envelope.size):
        away = abs(0.5 * (times[k] + times[k + 1]) - best_time)
        if envelope[k] < level and away < _NEARER * least:
            nearest, least = k, away
    return nearest


@compile_kernel
def join_cover(
    primer: Array, number: int, times: Array, case: DualCase, envelope: Array, owner: Index
) -> None:
    """Let a primer bound the cells that it bounds best."""
    lowest = np.empty(envelope.size)
    sweep_cells(primer, times, case, lowest)
    for k in range(envelope.size):
        if lowest[k] > envelope[k]:
            envelope[k], owner[k] = lowest[k], number


@compile_kernel
def sweep_cells(primer: Array, times: Array, case: DualCase, lowest: Array) -> None:
    """As `sweep_bound`, with the kink of the primer anywhere."""
    cell = -1
    if primer.size > AFFINE and primer[THETA] < times[-1]:
        cell = int(np.searchsorted(times, primer[THETA])) - 1
    if cell < 0 or primer[THETA] == times[cell + 1]:
        sweep_bound(primer, times, case, lowest)
        return
    marks = np.empty(times.size + 1)
    marks[: cell + 1], marks[cell + 1], marks[cell + 2 :] = (
        times[: cell + 1],
        primer[THETA],
        times[cell + 1 :],
    )
    parts = np.empty(lowest.size + 1)
    sweep_bound(primer, marks, case, parts)
    lowest[:cell], lowest[cell + 1 :] = parts[:cell], parts[cell + 2 :]
    lowest[cell] = min(parts[cell], parts[cell + 1])


@compile_kernel
def cover_times(times: Array, case: DualCase, start: Array, near: float, aim: CoverAim) -> TimeCover:
    """Find primers whose bounds lie above a level at every time of the grid.

    The level is the aim's target or, where the best bound of a time is less, its tolerance below the least of
    those best bounds.

    Args:
        times: [s] shape (n + 1,), rising from 0.
        case: the relaxed problem.
        start: primer for the time `near`, shape (6,) or (10,).
        near: [s] the time of flight to begin with.
        aim: what level is enough.
    """
    cells = times.size - 1
    primers, owner = np.empty((MOST_PRIMERS, PRIMER_SIZE)), np.zeros(cells, np.int64)
    made_for = np.full(MOST_PRIMERS, near)
    envelope = np.full(cells, -np.inf)
    primers[0] = widen_primer(last_primer(case, times[-1]))
    primers[1] = widen_primer(along_change(case))
    for count in range(2):
        join_cover(primers[count], count, times, case, envelope, owner)
    level, best_time, best_value = aim.target, near, np.inf
    time, count, cell, again, stride = near, 2, -1, False, 0.0
    known, known_time = widen_primer(start), near
    while count < MOST_PRIMERS:
        found = best_primer(known, time - known_time, time, case, aim)
        better = found.value < best_value - aim.tolerance
        if found.value < best_value:
            best_value, best_time = found.value, time
            level = min(aim.target, best_value - aim.tolerance)
        primers[count], made_for[count] = found.primer, time
        join_cover(found.primer, count, times, case, envelope, owner)
        count += 1
        if best_value < aim.floor:
            break
        if better:
            stride = _next_stride(found, time, stride, case, aim.tolerance)
            if stride != 0.0 and times[1] < time + stride < times[-1]:
                time, known, known_time = time + stride, found.primer, time
                continue
        if again:  # the best primer of this cell is among them: more cannot be had of it
            level = min(level, envelope[cell])
        cell_before, cell = cell, nearest_open_cell(envelope, times, level, best_time)
        if cell < 0:
            break
        again = cell == cell_before
        time = _beyond(0.5 * (times[cell] + times[cell + 1]), best_time, again, times)
        known, known_time = primers[owner[cell]], float(made_for[owner[cell]])
    lowest_bound = min(float(np.min(envelope)), linear_part(primers[0], times[-1], case))
    return TimeCover(primers[:count].copy(), owner, lowest_bound, best_time, best_value)
