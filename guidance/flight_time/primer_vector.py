"""Least-propellant flight by the indirect method: Lawden's primer vector (see `primer_equations`).

It gives the time of flight; the convex problem's dual solution then says whether another time is better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import Extremal, PrimerPath, PrimerProblem, fly_extremal, new_extremal
from guidance.flight_time.fixed_time import solve_primer_at
from guidance.flight_time.path_limits import broken_limit, path_limits
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

    def burnt_at(self, times: Array) -> Array:
        """Share of the start mass that is burnt at times [s] of the flight, shape (k,)."""
        burning = np.minimum(times, self.first_burn) + np.maximum(times - self.braking, 0.0)
        return self.burn_rate * burning

    def log_mass(self, nodes: int) -> Array:
        """ln(m / m_start) at N equal steps, shape (N,)."""
        return np.log1p(-self.burnt_at(np.linspace(0.0, self.time, nodes)))

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


def scale_landing(problem: LandingProblem) -> PrimerProblem:
    """A landing problem in seconds: lengths over full thrust by start mass."""
    lander, state = problem.lander, problem.state
    unit, flow = lander.max_thrust / state.mass, lander.max_mass_flow / state.mass
    return PrimerProblem(problem.offset / unit, state.velocity / unit, problem.gravity / unit, flow)


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
    if lander.min_thrust > 0.0 or not problem.ends_at_rest or problem.rotates:
        return None
    if problem.limits.thrust_rate is not None:
        return None
    scaled, x = scale_landing(problem), new_extremal()
    if not solve_primer(scaled, x) or (time is not None and not solve_primer_at(time, scaled, x)):
        return None
    t1, t2, final = x.times.tolist()
    flight = PrimerFlight(max(t1, 0.0), t2, final, scaled.mass_flow, x.primer, (t1, t2))
    if flight.log_mass_ratio > problem.log_mass_ratio:
        return None
    return flight if _keeps_limits(problem, fly_extremal(x, scaled), lander.max_thrust / mass) else None


def _keeps_limits(problem: LandingProblem, path: PrimerPath, unit: float) -> bool:
    """Whether a flown path, in units of the acceleration `unit` and seconds, keeps every limit."""
    limits = problem.limits
    if broken_limit(path, path_limits(problem.lander.pointing_limit, limits.speed, limits.glide_slope), unit):
        return False
    final, sight = limits.final_thrust_direction, limits.line_of_sight
    if final is not None and final.excess(path.direction[-1]) > 0.0:
        return False
    return sight is None or not sight.outside(unit * path.position[:-1]).max() > 0.0
