"""The time of flight that a planner is asked for first, where none is known."""

from __future__ import annotations

import math

import numpy as np

from guidance.descent.problem import LandingProblem
from guidance.flight_time.time_window import guess_time, time_window


def first_time(problem: LandingProblem) -> float:
    """[s] coast, then brake; where closed-form bounds admit no time, what the way takes at half the speed.

    The latter is for asking a solver that does not know these bounds.
    """
    window = time_window(problem)
    if not window.empty and math.isfinite(window.low):
        return guess_time(problem, window)
    speed = max(float(np.linalg.norm(problem.state.velocity)), 1.0)
    return max(2.0 * float(np.linalg.norm(problem.offset)) / speed, 1.0)
