"""Extremals of a given time of flight, from that of the best one: its time is held, and no longer free."""

from __future__ import annotations

import math

from guidance.flight_time.extremal import Extremal, PrimerProblem, copy_extremal, new_extremal, touches
from guidance.flight_time.primer_equations import HELD, TOUCHING_HELD, solve_from
from guidance.kernel import compile_kernel

_FARTHEST = 3.0  # ratio of times of flight
_STRIDE = 0.1  # of the time of flight: change from one extremal to the next
_LATEST = 0.5  # of the time before the braking burn: end of the first burn, in a guess


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
