"""By how much thrusts leave the directions that a landing problem allows them."""

from __future__ import annotations

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem


def pointing_excess(thrust: Array, limit: float | None, max_thrust: float) -> float:
    """[rad] by how much thrusts, shape (N, 3) in any unit, lean beyond a limit; next to none has no lean."""
    if limit is None:
        return 0.0
    size = np.linalg.norm(thrust, axis=1)
    burning = size > _least_burning(size, max_thrust)
    if not burning.any():
        return 0.0
    angle = np.arctan2(np.linalg.norm(thrust[burning, :2], axis=1), thrust[burning, 2])
    return max(0.0, float(angle.max()) - limit)


def final_thrust_excess(thrust: Array, problem: LandingProblem, max_thrust: float | None = None) -> float:
    """[rad] by how much the last of thrusts, shape (N, 3), leaves its cone; none has no direction.

    Args:
        thrust: in any unit.
        problem: what is asked.
        max_thrust: greatest thrust in that unit; that of the lander in newtons unless given.
    """
    cone = problem.limits.final_thrust_direction
    if cone is None:
        return 0.0
    size, most = np.linalg.norm(thrust, axis=1), max_thrust or problem.lander.max_thrust
    return 0.0 if size[-1] <= _least_burning(size, most) else cone.excess(thrust[-1])


def _least_burning(size: Array, max_thrust: float) -> float:
    """What a solver leaves of no thrust, among thrusts of some sizes."""
    return 1e-3 * max(float(size.max()), 1e-3 * max_thrust)
