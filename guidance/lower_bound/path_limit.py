"""Better bounds where the altitude or the glide slope binds: a multiplier of that limit at one time.

The relaxed flight that the best affine primer leads may cut through the ground. At the time at which it does
so most, the limit joins the dual problem: its multiplier gives the primer a kink there
(`guidance.lower_bound.dual_function`). Which time and which side of the cone is a guess; that only costs
tightness. Where the flight of the indirect method touches the ground, its own kink is the guess that leads
(`guidance.lower_bound.neighbour_cover.kinked_primer_of`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.flight_time.linear_system import dot
from guidance.kernel import compile_kernel
from guidance.lower_bound.dual_ascent import STEPS, Ascent, affine_basis, ascend, place_before, relax_thrust
from guidance.lower_bound.dual_case import DualCase
from guidance.lower_bound.dual_function import AFFINE, THETA

PRIMER_SIZE = 10
"""Numbers of a primer (a, b, c, theta)."""
_ROUNDS = 3  # each limit taken where the flight of the one before breaks it most
_LEAST_MULTIPLIER = 1e-9  # times the time of flight: less is rounding, and may be negative
_FELT = 1e-6  # of the way that full thrust over the flight makes: a limit broken by less is kept


class Breach(NamedTuple):
    """Where a relaxed flight breaks the limit on its path most.

    Attributes:
        theta: [s] before the landing.
        depth: [m] by which; zero where it keeps it.
        normal: unit vector n with n.r >= 0 within the limit, shape (3,).
    """

    theta: float
    depth: float
    normal: Array


@compile_kernel
def widen_primer(primer: Array) -> Array:
    """A primer (a, b) as one of ten numbers, without a limit on the path."""
    out = np.zeros(PRIMER_SIZE)
    out[: primer.size] = primer
    if primer.size == AFFINE:
        out[THETA] = np.inf
    return out


@compile_kernel
def find_breach(primer: Array, time: float, case: DualCase) -> Breach:
    """Where the relaxed flight of one duration [s] that a primer leads breaks the limit on its path most."""
    thrust, place, normal = relax_thrust(primer, time, case), np.empty(3), np.zeros(3)
    worst, theta = 0.0, np.inf
    for k in range(1, STEPS):
        at = time * k / STEPS
        place_before(thrust, time, at, case, place)
        across = math.sqrt(place[0] * place[0] + place[1] * place[1])
        depth = case.slope_cosine * across - case.slope_sine * place[2]
        if depth > worst:
            worst, theta = depth, at
            for axis in range(2):
                normal[axis] = -case.slope_cosine * place[axis] / max(across, 1e-300)
            normal[2] = case.slope_sine
    return Breach(theta, worst, normal)


@compile_kernel
def _kinked_basis(time: float, case: DualCase, normal: Array) -> Array:
    """The numbers (a, b T, multiplier T) of a primer with a limit on the path, shape (9, 7)."""
    out = np.zeros((9, 7))
    out[:AFFINE, :AFFINE] = affine_basis(time, case)
    for axis in range(3):
        out[AFFINE + axis, AFFINE] = normal[axis] / time
    return out


@compile_kernel
def shift_kink(known: Array, later: float, time: float) -> Array:
    """A primer for a flight of `time` [s], `later` [s] more: its limit binds as long after the start."""
    out = known.copy()
    out[THETA] = min(max(known[THETA] + later, 0.0), time)
    return out


@compile_kernel
def ascend_with_kink(start: Array, time: float, case: DualCase, tolerance: float, enough: float) -> Ascent:
    """The best primer of a time of flight [s] with the limit on the path that `start` uses; as `ascend`."""
    normal = start[AFFINE:THETA] / math.sqrt(dot(start[AFFINE:THETA], start[AFFINE:THETA]))
    found = ascend(start, _kinked_basis(time, case, normal), time, case, tolerance, enough)
    if not dot(found.primer[AFFINE:THETA], normal) > _LEAST_MULTIPLIER / time:
        found.primer[AFFINE:THETA], found.primer[THETA] = 0.0, np.inf
    return found


@compile_kernel
def has_kink(primer: Array) -> bool:
    """Whether a primer uses a limit on the path."""
    if primer.size == AFFINE:
        return False
    return primer[AFFINE] != 0.0 or primer[AFFINE + 1] != 0.0 or primer[AFFINE + 2] != 0.0


@compile_kernel
def keep_path(found: Ascent, time: float, case: DualCase, tolerance: float, enough: float) -> Ascent:
    """Raise the bound of one time of flight by the limit on the path.

    Args:
        found: where the ascent without it ended.
        time: [s] of flight.
        case: the relaxed problem.
        tolerance: [m/s] as of `ascend`.
        enough: [m/s] as of `ascend`.

    Returns:
        The best ascent, its primer of ten numbers.
    """
    best = Ascent(widen_primer(found.primer), found.value, found.stalled)
    flown = best.primer
    for _ in range(_ROUNDS):
        if best.value > enough:
            break
        breach = find_breach(flown, time, case)
        if not breach.depth > _FELT * case.thrust.full * time * time:
            break
        start = best.primer.copy()
        start[AFFINE:THETA], start[THETA] = 0.0, breach.theta
        other = ascend(start, _kinked_basis(time, case, breach.normal), time, case, tolerance, enough)
        flown = other.primer
        if not dot(flown[AFFINE:THETA], breach.normal) > _LEAST_MULTIPLIER / time:
            break
        if not other.value > best.value + tolerance:
            break
        best = other
    return best
