"""What the dual bound must know of a landing problem, and the relaxation that it bounds.

Let B(t) be the velocity change spent so far. The mass is m_0 exp(-B/c) with the exhaust velocity c, so that
the thrust acceleration obeys T_min/m_0 exp(B/c) <= |u| <= T_max/m_0 exp(B/c). A flight that spends no more
than J keeps

    l (1 + B/c) <= |u| <= f (1 + kappa B),    l = T_min/m_0,  f = T_max/m_0,  kappa = (exp(J/c) - 1)/J,

since exp lies above its tangent at 0 and below its chord over [0, J]. These bounds are linear in B, and what
is proved of every flight that keeps them holds for every real flight that spends at most J. The pointing
limit is kept, and at one time of each flight the altitude or the glide slope, whichever is the narrower; the
speed limit is left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.kernel import compile_kernel


class ThrustBounds(NamedTuple):
    """What inner loops read of a case: numbers alone, as each call with arrays would count their owners.

    Attributes:
        full: [m/s^2] f, full thrust over start mass.
        full_growth: [1/s] f kappa.
        least: [m/s^2] l, least thrust over start mass.
        least_growth: [1/s] l/c.
        cosine: of the pointing limit; -1 where there is none.
        sine: of the pointing limit; 0 where there is none.
    """

    full: float
    full_growth: float
    least: float
    least_growth: float
    cosine: float
    sine: float


class DualCase(NamedTuple):
    """The relaxed problem, in SI, as the kernels read it.

    Attributes:
        position: [m] shape (3,), the start seen from the target.
        velocity: [m/s] shape (3,), at the start.
        arrival: [m/s] shape (3,), velocity at the target.
        gravity: [m/s^2] shape (3,).
        thrust: bounds of the thrust.
        slope_cosine: of the glide slope limit; 0 where the altitude is the only limit.
        slope_sine: of the glide slope limit, 1 for the altitude; 0 to leave out both.
        anywhere: whether the landing point may lie anywhere in the target's plane: b is vertical then.
    """

    position: Array
    velocity: Array
    arrival: Array
    gravity: Array
    thrust: ThrustBounds
    slope_cosine: float
    slope_sine: float
    anywhere: bool


@compile_kernel
def chord_growth(most: float, exhaust: float) -> float:
    """[s/m] kappa: the chord of the thrust acceleration's growth over the velocity changes up to `most`."""
    return math.expm1(most / exhaust) / most if most > 0.0 else 1.0 / exhaust


def dual_case(problem: LandingProblem, most: float, anywhere: bool = False) -> DualCase:
    """The relaxation for flights of a landing problem that spend at most `most` [m/s].

    Where they may land anywhere in the target's plane a glide slope counts as the altitude alone.
    """
    lander, mass = problem.lander, problem.state.mass
    exhaust = lander.exhaust_velocity
    full, least = lander.max_thrust / mass, lander.min_thrust / mass
    limit = math.pi if lander.pointing_limit is None else lander.pointing_limit
    slope, slopes = problem.glide_slope_limit or 0.0, problem.has_glide_slope and not anywhere
    return DualCase(
        np.array(problem.offset),
        np.array(problem.state.velocity),
        np.array(problem.target_velocity),  # copies: kernels compile once for arrays that may be written
        np.array(problem.gravity),
        ThrustBounds(
            full,
            full * chord_growth(most, exhaust),
            least,
            least / exhaust,
            math.cos(limit),
            math.sin(limit) if limit < math.pi else 0.0,
        ),
        math.cos(slope) if slopes else 0.0,
        math.sin(slope) if slopes else 1.0,
        anywhere,
    )
