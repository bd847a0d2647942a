"""The reachable point nearest to the target, by the indirect method.

Let s be a landing point in the target's plane, seen from the target, and J(s) the least propellant to it. J
changes with s as b.ds does, where b is the slope of the primer in the time before the landing: the costate of
the position. Of the points that a tank pays for, the nearest has

    J(s) = the content of the tank,    b along -s, horizontally,

two equations for the two numbers s. Of the points at one distance from the target, the cheapest has the
second one too. Newton's method in s solves either pair; at each s the extremal follows from the one before.
Both are conditions of the first order: that no other point is nearer, the tests compare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.flight_time.continuation import solve_touching_from_edge
from guidance.flight_time.extremal import (
    Extremal,
    PrimerProblem,
    blank_extremal,
    copy_extremal,
    new_extremal,
    touches,
)
from guidance.flight_time.path_limits import ALTITUDE, KEPT, PROPELLANT, burnt_share
from guidance.flight_time.primer_equations import FREE, TOUCHING, solve_from, solve_touching
from guidance.flight_time.primer_vector import PrimerFlight, fly_to
from guidance.kernel import compile_kernel

ERROR_SHARE, ERROR_SLACK = 1e-3, 0.05
"""Of the least landing error, and [m] beside it: how much farther from the target the cheapest flight is."""
_MOST_STEPS = 30
_MOST_HALVINGS = 6
_MOST_SHORT_STEPS = 3  # in a row, a quarter of the full step or less: it leads nowhere
_CONVERGED = 1e-9  # of the square of the time of flight: millimetres
_DIFFERENCE = 1e-5  # of the same
_LONGEST = 0.1  # of the same: step
_FULL = 1.0 - 1e-9  # of the tank: the nearest landing leaves that little of it
_MOST_FAILURES = 6  # on the way to an empty tank
_SHORT_COAST = 0.1  # of the time of flight: one so short is vanishing
_SLIVER = 1e-2  # of the time of flight: a first burn so short may have to vanish
_NONE, _NEAREST, _CHEAPEST = range(3)  # what `_seek_nearest` found


@compile_kernel
def _land_at(point: Array, problem: PrimerProblem, size: int, x: Extremal) -> bool:
    """Find the extremal to a landing point from one nearby, in place."""
    r, v, g, flow = problem
    place = r.copy()
    place[0], place[1] = r[0] - point[0], r[1] - point[1]
    return solve_from(x, PrimerProblem(place, v, g, flow), size)


@compile_kernel
def _set_misses(
    point: Array, x: Extremal, problem: PrimerProblem, goal: tuple[float, float], out: Array
) -> bool:
    """Write by which lengths the two equations are missed, shape (2,); False where they say nothing."""
    share, distance = goal
    span = x.times[1] - x.times[0]
    east, north = (x.primer[0, 0] - x.primer[1, 0]) / span, (x.primer[0, 1] - x.primer[1, 1]) / span
    slope = math.hypot(east, north)
    if not slope > 0.0:
        return False
    if math.isnan(distance):
        out[0] = (burnt_share(x, problem.mass_flow) - share) / (problem.mass_flow * slope)
    else:
        out[0] = math.hypot(point[0], point[1]) - distance
    out[1] = (east * point[1] - north * point[0]) / slope
    return True


@compile_kernel
def _newton_step(
    point: Array, x: Extremal, problem: PrimerProblem, goal: tuple[float, float], size: int, here: Array
) -> tuple[float, float]:
    """Full step towards a root of the misses, from differences; nan where there is none."""
    step, there, moved, trial = _DIFFERENCE * x.times[2] ** 2, np.empty(2), point.copy(), new_extremal()
    slopes = np.empty((2, 2))
    for k in range(2):
        moved[k] = point[k] + step
        copy_extremal(x, trial)
        if not _land_at(moved, problem, size, trial) or not _set_misses(moved, trial, problem, goal, there):
            return math.nan, math.nan
        for i in range(2):
            slopes[i, k] = (there[i] - here[i]) / step
        moved[k] = point[k]
    determinant = slopes[0, 0] * slopes[1, 1] - slopes[0, 1] * slopes[1, 0]
    if determinant == 0.0:
        return math.nan, math.nan
    east = (slopes[0, 1] * here[1] - slopes[1, 1] * here[0]) / determinant
    north = (slopes[1, 0] * here[0] - slopes[0, 0] * here[1]) / determinant
    return east, north


@compile_kernel
def solve_nearest(
    point: Array, problem: PrimerProblem, goal: tuple[float, float], size: int, x: Extremal
) -> bool:
    """Find the nearest landing point that a share of the start mass pays for, or the cheapest at a distance.

    Args:
        point: seen from the target, shape (2,), where to begin; the answer.
        problem: that of the target, in seconds; its lengths are over full thrust by start mass.
        goal: the share, and nan; or anything, and the distance.
        size: FREE, or TOUCHING where x touches the ground.
        x: the extremal to that point, in seconds; that of the answer.

    Returns:
        Whether it was found: a stationary point, at which the propellant falls away from the target. That no
        point nearby is nearer, or cheaper, is not looked at.
    """
    here, there, moved, trial = np.empty(2), np.empty(2), np.empty(2), new_extremal()
    if not _set_misses(point, x, problem, goal, here):
        return False
    short = 0
    for _ in range(_MOST_STEPS):
        unit = x.times[2] ** 2
        before = math.hypot(here[0], here[1])
        if before < _CONVERGED * unit:
            slope = x.primer[0] - x.primer[1]
            return slope[0] * point[0] + slope[1] * point[1] < 0.0
        east, north = _newton_step(point, x, problem, goal, size, here)
        if math.isnan(east):
            return False
        damping, better = min(1.0, _LONGEST * unit / max(math.hypot(east, north), 1e-300)), False
        enough = 0.3 * damping
        for _ in range(_MOST_HALVINGS):
            moved[0], moved[1] = point[0] + damping * east, point[1] + damping * north
            copy_extremal(x, trial)
            if _land_at(moved, problem, size, trial) and _set_misses(moved, trial, problem, goal, there):
                better = math.hypot(there[0], there[1]) < (1.0 - 0.1 * damping) * before
            if better:
                break
            damping *= 0.5
        short = short + 1 if damping < enough else 0
        if not better or short > _MOST_SHORT_STEPS:
            return False
        copy_extremal(trial, x)
        point[0], point[1], here[0], here[1] = moved[0], moved[1], there[0], there[1]
    return False


class _Search(NamedTuple):
    """How a landing point is sought."""

    touching: bool  # the flight touches the ground
    anew: bool  # it is still to be found, and the point is near the answer
    thorough: bool  # as of `find_nearest_landing`


@dataclass(frozen=True, eq=False)
class NearestLanding:
    """A flight to a point near the target, or what is left of the search for one.

    Attributes:
        problem: the landing there.
        flight: the flight of least propellant to it; None where none was found.
        time: [s] its time of flight; without one, that of the last extremal on the way to it.
        cheapest: whether the flight is the cheapest within the granted error; else it is the nearest, which
            leaves the tank all but empty, because that one was not found.
    """

    problem: LandingProblem
    flight: PrimerFlight | None
    time: float
    cheapest: bool = False


def find_nearest_landing(
    problem: LandingProblem, overdrawn: PrimerFlight, thorough: bool = True
) -> NearestLanding:
    """The cheapest flight to within a little more than the least landing error that the tank pays for.

    Args:
        problem: the landing problem.
        overdrawn: its extremal, which burns more than there is.
        thorough: whether fuller tanks may lead there, or the cheapest flight be given up for the nearest.

    Returns:
        The flight; or none, where none was found or the one found breaks a limit of the problem. Its
        `cheapest` says whether it is not the nearest in its place.
    """
    not_found = NearestLanding(problem, None, overdrawn.time)
    if overdrawn.broken != PROPELLANT or problem.limits.line_of_sight is not None:
        return not_found
    x, unit = blank_extremal(), problem.lander.max_thrust / problem.state.mass
    copy_extremal(overdrawn.extremal, x)
    goal = -math.expm1(-problem.log_mass_ratio), ERROR_SLACK / unit
    point, touching = np.zeros(2), thorough and bool(touches(x))
    for attempt in range(2):
        found = _seek_nearest(overdrawn.scaled, goal, _Search(touching, attempt > 0, thorough), x, point)
        not_found = replace(not_found, time=float(x.times[2]))
        if found == _NONE:
            return not_found
        target = problem.target.copy()
        target[:2] += unit * point
        there = replace(problem, target=target)
        flight = fly_to(there, x, TOUCHING if touching else FREE)
        if flight is not None and flight.broken == KEPT:
            return NearestLanding(there, flight, flight.time, found == _CHEAPEST)
        if flight is None or touching or flight.broken != ALTITUDE:
            return not_found
        touching = True
    return not_found


@compile_kernel
def _by_fuller_tanks(
    problem: PrimerProblem, share: float, begin: tuple[Extremal, Array], x: Extremal, point: Array
) -> bool:
    """Find the nearest landing point that a share of the start mass pays for, where Newton's method has not.

    If the first burn vanishes on the way, without one; else from the start by way of tanks that hold more,
    unless it is the coast that vanishes.

    Args:
        problem: that of the target, in seconds.
        share: of the start mass that is propellant.
        begin: the extremal from which it began, and its point; changed in place.
        x: the extremal at which it stopped; the answer.
        point: the same.
    """
    if 0.0 < x.times[0] < _SLIVER * x.times[2]:
        x.times[0] = -x.times[0]
        if solve_nearest(point, problem, (share, math.nan), FREE, x):
            return True
    if x.times[1] - max(x.times[0], 0.0) < _SHORT_COAST * x.times[2]:
        return False
    known, there = begin
    burnt, failures, done, step = burnt_share(known, problem.mass_flow), 0, 0.0, 0.5
    while failures < _MOST_FAILURES and done < 1.0:
        copy_extremal(known, x)
        point[:] = there
        goal = burnt + min(done + step, 1.0) * (share - burnt)
        if solve_nearest(point, problem, (goal, math.nan), FREE, x):
            done += step
            step *= 2.0
            copy_extremal(x, known)
            there[:] = point
        else:
            step *= 0.4
            failures += 1
    return done >= 1.0


@compile_kernel
def _seek_nearest(
    problem: PrimerProblem, goal: tuple[float, float], how: _Search, x: Extremal, point: Array
) -> int:
    """Find the cheapest landing within the granted error, in place.

    Args:
        problem: that of the target, in seconds.
        goal: the share of the start mass that is propellant, and the error granted beside ERROR_SHARE.
        how: it is sought.
        x: the extremal to the point; the answer.
        point: where to begin; the answer.

    Returns:
        _CHEAPEST; _NEAREST, where only the nearest was found and the search is thorough; or _NONE.
    """
    share, slack = goal
    touching, anew, thorough = how
    size = TOUCHING if touching else FREE
    if anew:
        r, v, g, flow = problem
        place = r.copy()
        place[0], place[1] = r[0] - point[0], r[1] - point[1]
        there = PrimerProblem(place, v, g, flow)
        found = solve_touching(there, x) or (thorough and solve_touching_from_edge(there, x))
        if not found or not x.touch[1] > 0.0:
            return _NONE
    known, begin, tank = new_extremal(), point.copy(), share * _FULL if thorough else share
    copy_extremal(x, known)
    found = solve_nearest(point, problem, (tank, math.nan), size, x)
    if not found and thorough and not touching:
        found = _by_fuller_tanks(problem, tank, (known, begin), x, point)
    if not found:
        return _NONE
    copy_extremal(x, known)
    begin[:] = point
    far = (1.0 + ERROR_SHARE) * math.hypot(point[0], point[1]) + slack
    if solve_nearest(point, problem, (share, far), size, x):
        return _CHEAPEST
    copy_extremal(known, x)
    point[:] = begin
    return _NEAREST if thorough else _NONE
