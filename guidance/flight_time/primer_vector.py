"""Least-propellant flight by the indirect method: Lawden's primer vector (see `primer_equations`).

It gives the time of flight; the convex problem's dual solution then says whether another time is better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import LEGS, Extremal, PrimerPath, PrimerProblem, fly_extremal
from guidance.flight_time.fixed_time import solve_primer_at
from guidance.flight_time.primer_equations import solve_primer


@dataclass(frozen=True, eq=False)
class PrimerFlight:
    """A flight that meets the necessary conditions of least propellant.

    Attributes:
        first_burn: [s] end of the burn at the start; zero where there is none.
        braking: [s] start of the last burn.
        time: [s] time of flight.
        burn_rate: [1/s] share of the start mass burnt per second at full thrust.
        primer: direction of the primer at two times, rows of shape (2, 3); it is affine in time.
        primer_times: [s] these times; the first may lie before the start.
    """

    first_burn: float
    braking: float
    time: float
    burn_rate: float
    primer: Array
    primer_times: tuple[float, float]

    def log_mass(self, nodes: int) -> Array:
        """ln(m / m_start) at N equal steps, shape (N,)."""
        times = np.linspace(0.0, self.time, nodes)
        burning = np.minimum(times, self.first_burn) + np.maximum(times - self.braking, 0.0)
        return np.log1p(-self.burn_rate * burning)

    @property
    def log_mass_ratio(self) -> float:
        """ln(start mass / final mass)."""
        return -math.log1p(-self.burn_rate * (self.first_burn + self.time - self.braking))

    @property
    def extremal(self) -> Extremal:
        """The flight as the kernels read it, in seconds."""
        return Extremal(self.primer, np.array([self.primer_times[0], self.braking, self.time]))

    def direction_at(self, time: float) -> Array:
        """Unit vector of the primer, along which the thrust points; shape (3,)."""
        begin, end = self.primer_times
        p = self.primer[0] + (self.primer[1] - self.primer[0]) * ((time - begin) / (end - begin))
        return p / np.linalg.norm(p)


def find_primer_flight(problem: LandingProblem, time: float | None = None) -> PrimerFlight | None:
    """Flight of least propellant by the indirect method, in about 0.1 ms.

    Args:
        problem: the landing problem.
        time: [s] of flight; None for the best one.

    Returns:
        The flight; None where none was found, where the engine cannot stop or cannot lift the vehicle, where
        the flight does not end at rest, where the frame turns, where the thrust may not jump, where gravity
        vanishes, where no coast is left between the burns, or where the flight breaks a limit of the
        problem: the method knows none.
    """
    lander, mass = problem.lander, problem.state.mass
    if lander.min_thrust > 0.0 or problem.target_velocity.any() or problem.rotates:
        return None
    if problem.limits.thrust_rate is not None:
        return None
    unit = lander.max_thrust / mass
    scaled = PrimerProblem(
        problem.offset / unit,
        problem.state.velocity / unit,
        problem.gravity / unit,
        lander.max_mass_flow / mass,
    )
    x = Extremal(np.empty((2, 3)), np.empty(3))
    if not solve_primer(scaled, x) or (time is not None and not solve_primer_at(time, scaled, x)):
        return None
    t1, t2, final = (float(time) for time in x.times)
    flight = PrimerFlight(max(t1, 0.0), t2, final, scaled.mass_flow, x.primer, (t1, t2))
    if flight.log_mass_ratio > problem.log_mass_ratio:
        return None
    return flight if _keeps_limits(problem, fly_extremal(x, scaled), unit) else None


def _keeps_limits(problem: LandingProblem, path: PrimerPath, unit: float) -> bool:
    """Whether a flown path, in units of the acceleration `unit` and seconds, keeps every limit."""
    position = unit * path.position[:-1]
    height = position[:, 2]
    if height.min() < -1e-6 * np.abs(position).max():
        return False
    limit, speed, glide = problem.lander.pointing_limit, problem.speed_limit, problem.glide_slope_limit
    if limit is not None:
        burning = np.r_[0 : LEGS + 1, 2 * LEGS : 3 * LEGS + 1]
        if path.direction[burning, 2].min() < math.cos(limit):
            return False
    if speed is not None and (path.velocity**2).sum(axis=1).max() > (speed / unit) ** 2:
        return False
    final = problem.limits.final_thrust_direction
    if final is not None and final.excess(path.direction[-1]) > 0.0:
        return False
    sight = problem.limits.line_of_sight
    if sight is not None and sight.outside(position).max() > 0.0:
        return False
    across = np.hypot(position[:, 0], position[:, 1])
    return glide is None or bool((across * math.cos(glide) <= height * math.sin(glide)).all())
