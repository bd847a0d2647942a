"""The times of flight at which a bound is swept: from none to where gravity alone spends the propellant."""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.linear_system import dot
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_case import DualCase

_UNIFORM = 2.5  # times the first time: so far the cells are as wide as before it
_NEAR = np.array([0.02, 0.05, 0.1, 0.2, 0.35, 0.6])  # of a cell: there the least propellant may have a kink
_STRETCH = 1.03  # ratio of times beyond
_LONGEST = 1e4  # times the first: the last one of the grid where gravity is too weak to end it


@compile_kernel
def longest_time(case: DualCase, target: float, time: float) -> float:
    """[s] the time beyond which gravity alone spends `target` [m/s], or far beyond `time` [s]."""
    pull = math.sqrt(dot(case.gravity, case.gravity))
    longest = _LONGEST * time
    if pull > 0.0:
        enough = (target + dot(case.gravity, case.arrival - case.velocity) / pull) / pull
        longest = max(min(longest, enough), time)
    return longest


@compile_kernel
def time_grid(case: DualCase, target: float, time: float, cells: int) -> Array:
    """Times of flight from 0 to the longest that is of interest, rising.

    Args:
        case: the relaxed problem.
        target: [m/s] velocity change beyond which no flight is of interest.
        time: [s] a likely time of flight; next to it the grid is finer.
        cells: as many up to that time.
    """
    longest = longest_time(case, target, time)
    step, last = time / cells, min(_UNIFORM * time, longest)
    even = math.ceil(last / step)
    count = math.ceil(math.log(longest / last) / math.log(_STRETCH)) if longest > last else 0
    times = np.empty(even + 2 * _NEAR.size + 1 + count)
    for k in range(even):
        times[k] = step * k
    size = even
    for k in range(_NEAR.size):
        for sign in (-1.0, 1.0):
            mark = time + sign * step * _NEAR[k]
            if mark < last:
                times[size] = mark
                size += 1
    times[size] = last
    ratio = (longest / last) ** (1.0 / max(count, 1))
    for k in range(count):
        times[size + 1 + k] = longest if k == count - 1 else last * ratio ** (k + 1)
    size += 1 + count
    rising = np.sort(times[:size])
    kept = 0
    for k in range(size):
        if k == size - 1 or rising[k + 1] - rising[k] > 1e-6 * step:
            rising[kept] = rising[k]
            kept += 1
    return rising[:kept].copy()
