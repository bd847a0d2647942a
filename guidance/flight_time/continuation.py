"""Extremals that no first guess reaches, by way of easier problems whose extremals lead to them.

With much more thrust a landing is nearly two impulses, in closed form: its extremal is followed while the
thrust falls to what there is. Where the first burn can only just stop the fall above the ground it points
straight up until it touches it, and goes on from there by two impulses: the extremal of a start that lies
lower, next to that edge, is followed while it is lifted to where it lies. That of a given time of flight is
followed from the best time, which is then held and no longer free.

Source: Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapter 2.
"""

from __future__ import annotations

import math

from guidance.flight_time.extremal import (
    LEGS,
    Extremal,
    PrimerProblem,
    copy_extremal,
    fly_extremal,
    new_extremal,
    touches,
)
from guidance.flight_time.first_guess import guess_impulses, guess_touch
from guidance.flight_time.linear_system import dot
from guidance.flight_time.primer_equations import (
    FREE,
    HELD,
    LEAST_PULL,
    MOST_PULL,
    TOUCHING,
    TOUCHING_HELD,
    solve_from,
)
from guidance.kernel import compile_kernel

_STRONGEST = 16.0  # thrust at which two impulses are a good guess, over what there is
_NARROWEST = 0.01  # share of a start's height above the edge at which straight up is a good guess
_FIRST_STEP = 0.35  # of the logarithm of thrust or height
_LONGER = 1.5  # ratio of a step to the one before, where that was good
_SHORTER = 0.4  # the same where it was not
_SHORTEST = 0.01  # step
_MOST_STEPS = 40  # of Newton's method for the edge
_EMPTY = 0.5  # of the start mass: no burn is longer
_FARTHEST = 3.0  # ratio of times of flight, from the best one
_STRIDE = 0.1  # of the time of flight: change from one extremal to the next
_LATEST = 0.5  # of the time before the last burn: end of a first burn that begins to burn


@compile_kernel
def _with_thrust(problem: PrimerProblem, ratio: float) -> PrimerProblem:
    """A problem with that many times its thrust and its mass flow."""
    r, v, g, flow = problem
    return PrimerProblem(r / ratio, v / ratio, g / ratio, flow * ratio)


@compile_kernel
def _lengthen_burns(x: Extremal, ratio: float, out: Extremal) -> None:
    """Write an extremal whose burns last longer, about the same middle of the flight."""
    copy_extremal(x, out)
    first, last = max(x.times[0], 0.0), x.times[2] - x.times[1]
    if first > 0.0:
        out.times[0] = ratio * first
    out.times[1] += 0.5 * (ratio - 1.0) * (first - last)
    out.times[2] = out.times[1] + ratio * last


@compile_kernel
def solve_from_impulses(problem: PrimerProblem, x: Extremal) -> bool:
    """Find an extremal from two impulses, by way of problems with more thrust.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        x: the answer, in seconds.

    Returns:
        Whether it was found; it is not where the coast between its burns vanishes on the way.
    """
    left, step, trial = math.log(_STRONGEST), _FIRST_STEP, new_extremal()
    pull = problem.gravity
    if not LEAST_PULL < dot(pull, pull) < MOST_PULL or not dot(problem.position, pull) < 0.0:
        return False
    stronger = _with_thrust(problem, _STRONGEST)
    if not (guess_impulses(stronger, x) and solve_from(x, stronger, FREE)):
        return False
    while left > 0.0 and step > _SHORTEST:
        after, found = max(left - step, 0.0), False
        weaker = _with_thrust(problem, math.exp(after))
        for longer in (math.exp(left - after), 1.0):
            if not found:
                _lengthen_burns(x, longer, trial)
                found = solve_from(trial, weaker, FREE)
        if found:
            copy_extremal(trial, x)
            left, step = after, _LONGER * step
        else:
            step *= _SHORTER
    return left == 0.0


@compile_kernel
def _stopping_height(problem: PrimerProblem) -> float:
    """The height, in the problem's lengths, in which full thrust straight up just stops the fall.

    It is infinite where nothing falls, or the engine does not lift the vehicle.
    """
    gravity, rate, flow = problem.gravity[2], problem.velocity[2], problem.mass_flow
    if not rate < 0.0 or not gravity > -1.0:
        return math.inf
    time = -rate / (1.0 + gravity)  # of a mass that does not fall: from above, and the velocity is convex
    if not flow * time < _EMPTY:
        return math.inf
    for _ in range(_MOST_STEPS):
        left = 1.0 - flow * time
        step = (rate + gravity * time - math.log(left) / flow) / (gravity + 1.0 / left)
        time -= step
        if not abs(step) > 1e-14 * time:
            break
    lifted = (time + (1.0 / flow - time) * math.log1p(-flow * time)) / flow
    return -(rate + 0.5 * gravity * time) * time - lifted


@compile_kernel
def _lower(problem: PrimerProblem, edge: float, share: float) -> PrimerProblem:
    """A problem that starts at a share of its height above a height."""
    place = problem.position.copy()
    place[2] = edge + share * (place[2] - edge)
    return PrimerProblem(place, problem.velocity, problem.gravity, problem.mass_flow)


@compile_kernel
def solve_touching_from_edge(problem: PrimerProblem, x: Extremal) -> bool:
    """Find an extremal that touches the target's altitude in its first burn, from starts that lie lower.

    Args:
        problem: in seconds, as `PrimerProblem` says; it sinks.
        x: the answer, in seconds.

    Returns:
        Whether it was found, as of `solve_touching`.
    """
    edge, trial, share, pull = _stopping_height(problem), new_extremal(), 1.0, problem.gravity
    if not LEAST_PULL < dot(pull, pull) < MOST_PULL or not problem.position[2] > edge:
        return False
    while True:
        share *= 0.5
        lower = _lower(problem, edge, share)
        if guess_touch(lower, x) and solve_from(x, lower, TOUCHING):
            break
        if share < _NARROWEST:
            return False
    left, step = -math.log(share), 2.0 * _FIRST_STEP
    while left > 0.0 and step > _SHORTEST:
        after = max(left - step, 0.0)
        copy_extremal(x, trial)
        if solve_from(trial, _lower(problem, edge, math.exp(-after)), TOUCHING):
            copy_extremal(trial, x)
            left, step = after, _LONGER * step
        else:
            step *= _SHORTER
    return left == 0.0


@compile_kernel
def _set_lowest(problem: PrimerProblem, x: Extremal) -> bool:
    """Write the touch of the altitude that the first burn of an extremal comes down to; whether it does."""
    path = fly_extremal(x, problem)
    for k in range(LEGS):
        before, after = path.velocity[k, 2], path.velocity[k + 1, 2]
        if before < 0.0 <= after:
            share, part = before / (before - after), x.times[0] / LEGS
            x.touch[0], x.touch[1] = (k + share) * part, 0.0
            x.touch[2] = path.position[k, 2] + 0.5 * share * part * before
            return x.touch[2] < 0.0
    return False


@compile_kernel
def raise_touch(problem: PrimerProblem, size: int, x: Extremal) -> bool:
    """Find an extremal that touches the target's altitude in its first burn, from one that cuts through it.

    It touches the lowest altitude that it comes down to, which is raised to the target's.

    Args:
        problem: in seconds, as `PrimerProblem` says.
        size: TOUCHING or TOUCHING_HELD.
        x: the extremal that cuts through the ground, in seconds; the answer.

    Returns:
        Whether it was found, as of `solve_touching`.
    """
    if not x.times[0] > 0.0 or not _set_lowest(problem, x):
        return False
    depth, left, step, trial = x.touch[2], 1.0, 0.5, new_extremal()
    while left > 0.0 and step > _SHORTEST:
        after = max(left - step, 0.0)
        copy_extremal(x, trial)
        trial.touch[2] = depth * after
        if solve_from(trial, problem, size):
            copy_extremal(trial, x)
            left, step = after, _LONGER * step
        else:
            step *= _SHORTER
    return left == 0.0


@compile_kernel
def _light_first_burn(x: Extremal, longer: float) -> None:
    """Give an extremal that begins with a coast the short first burn that another time of flight asks for.

    A coast and a burn that point along q2 end at rest at one time alone. Turning p at the start about its
    part normal to q2 to unit length, on the side of q2 for a longer flight and on the other for a shorter
    one, leaves the last burn nearly as it is. The burn's length follows from a fall to the same ignition.

    Args:
        x: the extremal, in seconds; changed in place.
        longer: [s] by how much the flight shall last longer.
    """
    t1, t2, final = x.times[0], x.times[1], x.times[2]
    share, along, across = t1 / (t1 - t2), 0.0, 0.0
    for axis in range(3):
        x.primer[0, axis] += (x.primer[1, axis] - x.primer[0, axis]) * share
        along += x.primer[0, axis] * x.primer[1, axis]
    for axis in range(3):
        x.primer[0, axis] -= along * x.primer[1, axis]
        across += x.primer[0, axis] * x.primer[0, axis]
    turned = math.copysign(math.sqrt(max(1.0 - across, 1e-4)), longer)
    size = math.sqrt(across + turned * turned)
    for axis in range(3):
        x.primer[0, axis] = (x.primer[0, axis] + turned * x.primer[1, axis]) / size
    x.times[0] = min(abs(longer) * (final - t2) / t2, _LATEST * t2)


@compile_kernel
def _solve_near(time: float, problem: PrimerProblem, x: Extremal) -> bool:
    """Find the extremal of one time of flight from that of another near it, in place."""
    change = time - x.times[2]
    if change == 0.0:
        return True
    if touches(x):
        x.times[1] *= time / x.times[2]
        x.times[2] = time
        return solve_from(x, problem, TOUCHING_HELD)
    start = new_extremal()
    copy_extremal(x, start)
    for attempt in range(2):
        if attempt == 1 or x.times[0] <= 0.0:
            copy_extremal(start, x)
            _light_first_burn(x, change)
        x.times[1] *= time / x.times[2]
        x.times[2] = time
        if solve_from(x, problem, HELD):
            return True
    return False


@compile_kernel
def solve_primer_at(time: float, problem: PrimerProblem, x: Extremal) -> bool:
    """Find the extremal of one time of flight from that of another, in steps.

    Args:
        time: [s] of flight.
        problem: in seconds, as `PrimerProblem` says.
        x: an extremal of the problem in seconds; the answer. Where there is none it is spoilt.

    Returns:
        Whether it was found; never where one time is more than three times the other.
    """
    start = x.times[2]
    if not start / _FARTHEST < time < start * _FARTHEST:
        return False
    steps = 1 + int(abs(time - start) / (_STRIDE * start))
    for k in range(steps):
        if not _solve_near(start + (time - start) * (k + 1) / steps, problem, x):
            return False
    x.times[2] = time  # to the last bit
    return True
