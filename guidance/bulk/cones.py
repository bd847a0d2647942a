"""Limits of a descent that are cones, checked on a flown extremal; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.limits import Cone, Limits
from guidance.flight_time.extremal import Extremal, PrimerProblem, fly_extremal
from guidance.kernel import compile_kernel


class Cones(NamedTuple):
    """Cones as numbers: axis, cosine and sine of the angle, shape (5,); nan where there is none.

    Attributes:
        asked: whether there is any.
        final: of the thrust's direction at the end.
        sight: of the places seen from the target.
    """

    asked: bool
    final: Array
    sight: Array


def cones_of(limits: Limits) -> Cones:
    """The cones of some limits."""
    final, sight = limits.final_thrust_direction, limits.line_of_sight
    return Cones(final is not None or sight is not None, _numbers(final), _numbers(sight))


def _numbers(cone: Cone | None) -> Array:
    if cone is None:
        return np.full(5, math.nan)
    return np.array([*cone.axis, math.cos(cone.angle), math.sin(cone.angle)])


@compile_kernel
def keeps_cones(x: Extremal, problem: PrimerProblem, cones: Cones) -> bool:
    """Whether a flight keeps them, at the places of `fly_extremal`; both in seconds."""
    if not cones.asked:
        return True
    path, last = fly_extremal(x, problem), 0.0
    end = path.position.shape[0] - 1
    for axis in range(3):
        last += path.direction[end, axis] * cones.final[axis]
    if last < cones.final[3]:
        return False
    for k in range(end):
        along, square = 0.0, 0.0
        for axis in range(3):
            along += path.position[k, axis] * cones.sight[axis]
        for axis in range(3):
            square += (path.position[k, axis] - along * cones.sight[axis]) ** 2
        if cones.sight[3] * math.sqrt(square) > cones.sight[4] * along:
            return False
    return True
