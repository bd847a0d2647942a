"""Units of the reference solvers: set by the ends of the flight, unlike those of the fast solver."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.descent.problem import LandingProblem


@dataclass(frozen=True)
class Units:
    """Length and acceleration of one.

    Attributes:
        length: [m] distance to the target, or speed squared over acceleration if that is longer.
        acceleration: [m/s^2] full thrust on the start mass.
    """

    length: float
    acceleration: float

    @classmethod
    def of(cls, problem: LandingProblem) -> Units:
        """Units in which start and thrust are of size one."""
        acceleration = problem.lander.max_thrust / problem.state.mass
        speed = max(float(np.linalg.norm(v)) for v in (problem.state.velocity, problem.target_velocity))
        length = max(float(np.linalg.norm(problem.offset)), speed**2 / acceleration, 1e-3)
        return cls(length, acceleration)

    @property
    def time(self) -> float:
        """[s] time of one."""
        return math.sqrt(self.length / self.acceleration)

    @property
    def speed(self) -> float:
        """[m/s] speed of one."""
        return math.sqrt(self.length * self.acceleration)
