"""Extremals that no first guess reaches, by way of easier problems whose extremals lead to them.

With much more thrust a landing is nearly two impulses, in closed form: its extremal is followed while the
thrust falls to what there is. Where the first burn can only just stop the fall above the ground it points
straight up until it touches it, and goes on from there by two impulses: the extremal of a start that lies
lower, next to that edge, is followed while it is lifted to where it lies.

Source: Allgower and Georg, Introduction to Numerical Continuation Methods, 2003, chapter 2.
"""

from __future__ import annotations

import math

from guidance.flight_time.extremal import Extremal, PrimerProblem, copy_extremal, new_extremal
from guidance.flight_time.first_guess import guess_impulses, guess_touch
from guidance.flight_time.linear_system import dot
from guidance.flight_time.primer_equations import FREE, LEAST_PULL, MOST_PULL, TOUCHING, solve_from
from guidance.kernel import compile_kernel

_STRONGEST = 16.0  # thrust at which two impulses are a good guess, over what there is
_NARROWEST = 0.01  # share of a start's height above the edge at which straight up is a good guess
_FIRST_STEP = 0.35  # of the logarithm of thrust or height
_LONGER = 1.5  # ratio of a step to the one before, where that was good
_SHORTER = 0.4  # the same where it was not
_SHORTEST = 0.01  # step
_MOST_STEPS = 40  # of Newton's method for the edge
_EMPTY = 0.5  # of the start mass: no burn is longer


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
