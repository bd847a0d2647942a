"""The limits on the path and on the thrust's direction that a flown extremal breaks."""

from __future__ import annotations

import math
from typing import NamedTuple

from guidance.flight_time.extremal import LEGS, Extremal, PrimerPath, PrimerProblem, fly_extremal
from guidance.kernel import compile_kernel

KEPT, POINTING, ALTITUDE, SPEED, GLIDE_SLOPE, FINAL_DIRECTION, LINE_OF_SIGHT, PROPELLANT = range(8)
"""What a flight breaks; `broken_limit` knows the first five."""
_BELOW = 1e-6  # of the largest coordinate: rounding, at the target's altitude


class PathLimits(NamedTuple):
    """Limits as numbers; infinite where there is none.

    Attributes:
        least_cosine: of the angle between thrust and z axis, while the engine burns.
        speed: [m/s] greatest.
        glide_slope: [rad] greatest angle between the vehicle, seen from the target, and the z axis.
    """

    least_cosine: float
    speed: float
    glide_slope: float


def path_limits(
    pointing: float | None = None, speed: float | None = None, glide_slope: float | None = None
) -> PathLimits:
    """Limits [rad, m/s, rad] as numbers; None for none."""
    return PathLimits(
        -math.inf if pointing is None else math.cos(pointing),
        math.inf if speed is None else float(speed),
        math.inf if glide_slope is None else float(glide_slope),
    )


@compile_kernel
def broken_limit(path: PrimerPath, limits: PathLimits, unit: float) -> int:
    """The first limit that a path breaks at its nodes: POINTING, ALTITUDE, SPEED, GLIDE_SLOPE; else KEPT.

    Args:
        path: in seconds, origin at the target.
        limits: in SI.
        unit: [m/s^2] acceleration by which the path's lengths and speeds were divided.
    """
    last = path.position.shape[0] - 1
    largest, lowest, fastest = 0.0, math.inf, 0.0
    for k in range(last + 1):
        square = 0.0
        for axis in range(3):
            square += path.velocity[k, axis] ** 2
            if k < last:
                largest = max(largest, abs(unit * path.position[k, axis]))
        fastest = max(fastest, square)
        if k < last:
            lowest = min(lowest, unit * path.position[k, 2])
        burning = k <= LEGS or k >= 2 * LEGS
        if burning and path.direction[k, 2] < limits.least_cosine:
            return POINTING
    if lowest < -_BELOW * largest:
        return ALTITUDE
    if fastest > (limits.speed / unit) ** 2:
        return SPEED
    if limits.glide_slope == math.inf:
        return KEPT
    cosine, sine = math.cos(limits.glide_slope), math.sin(limits.glide_slope)
    for k in range(last):
        x, y, z = unit * path.position[k, 0], unit * path.position[k, 1], unit * path.position[k, 2]
        if math.hypot(x, y) * cosine > z * sine:
            return GLIDE_SLOPE
    return KEPT


@compile_kernel
def burnt_share(x: Extremal, mass_flow: float) -> float:
    """Share of the start mass that a flight burns."""
    return mass_flow * (max(x.times[0], 0.0) + x.times[2] - x.times[1])


@compile_kernel
def judge_extremal(
    x: Extremal, problem: PrimerProblem, limits: PathLimits, unit: float, log_mass_ratio: float
) -> int:
    """The first limit that an extremal breaks: PROPELLANT, or one of `broken_limit`; else KEPT.

    Args:
        x: in seconds.
        problem: its problem, in seconds.
        limits: in SI.
        unit: [m/s^2] full thrust over start mass.
        log_mass_ratio: ln(start mass / dry mass).
    """
    if -math.log1p(-burnt_share(x, problem.mass_flow)) > log_mass_ratio:
        return PROPELLANT
    return broken_limit(fly_extremal(x, problem), limits, unit)
