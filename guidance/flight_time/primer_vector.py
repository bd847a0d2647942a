"""Least-propellant flight by the indirect method: Lawden's primer vector (see `primer_equations`).

It gives the time of flight; the convex problem's dual solution then says whether another time is better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from guidance.arrays import Array
from guidance.descent.problem import LandingProblem
from guidance.flight_time.extremal import (
    Extremal,
    PrimerProblem,
    fly_extremal,
    new_extremal,
    set_direction,
)
from guidance.flight_time.fixed_time import solve_primer_at
from guidance.flight_time.ground_contact import find_ground_contact
from guidance.flight_time.path_limits import (
    ALTITUDE,
    FINAL_DIRECTION,
    KEPT,
    LINE_OF_SIGHT,
    PROPELLANT,
    broken_limit,
    path_limits,
)
from guidance.flight_time.primer_equations import solve_primer, solve_touching


@dataclass(frozen=True, eq=False)
class PrimerFlight:
    """A flight that meets the necessary conditions of least propellant.

    Attributes:
        extremal: its arcs and its primer, in seconds, as the kernels read it.
        burn_rate: [1/s] share of the start mass burnt per second at full thrust.
        broken: the first limit of the problem that it breaks, as of `path_limits`; KEPT for none.
    """

    extremal: Extremal
    burn_rate: float
    broken: int = KEPT

    @cached_property
    def first_burn(self) -> float:
        """[s] end of the burn at the start; zero where there is none."""
        return max(float(self.extremal.times[0]), 0.0)

    @cached_property
    def braking(self) -> float:
        """[s] start of the last burn."""
        return float(self.extremal.times[1])

    @cached_property
    def time(self) -> float:
        """[s] time of flight."""
        return float(self.extremal.times[2])

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

    def direction_at(self, time: float) -> Array:
        """Unit vector of the primer, along which the thrust points; shape (3,)."""
        out = np.empty(3)
        set_direction(self.extremal, time, out)
        return out


def scale_landing(problem: LandingProblem) -> PrimerProblem:
    """A landing problem in seconds: lengths over full thrust by start mass."""
    lander, state = problem.lander, problem.state
    unit, flow = lander.max_thrust / state.mass, lander.max_mass_flow / state.mass
    return PrimerProblem(problem.offset / unit, state.velocity / unit, problem.gravity / unit, flow)


def find_primer_flight(problem: LandingProblem, time: float | None = None) -> PrimerFlight | None:
    """Flight of least propellant by the indirect method.

    Where it would cut through the target's altitude in its first burn, the one that touches it there.

    Args:
        problem: the landing problem.
        time: [s] of flight; None for the best one.

    Returns:
        The flight; None where none was found, where the engine cannot stop or cannot lift the vehicle, where
        the flight does not end at rest, where the frame turns, where the thrust may not jump, where gravity
        vanishes, where no coast is left between the burns, or where the flight breaks a limit of the
        problem: the method knows none but a touch of the ground, and that for the best time alone.
    """
    flight = find_extremal_flight(problem, time)
    return None if flight is None or flight.broken else flight


def find_extremal_flight(problem: LandingProblem, time: float | None = None) -> PrimerFlight | None:
    """The same, and a flight too that breaks a limit of the problem or overdraws the tank: it says which."""
    lander = problem.lander
    if lander.min_thrust > 0.0 or not problem.ends_at_rest or problem.rotates:
        return None
    if problem.limits.thrust_rate is not None:
        return None
    scaled, x = scale_landing(problem), new_extremal()
    flight = None
    if solve_primer(scaled, x) and (time is None or solve_primer_at(time, scaled, x)):
        flight = PrimerFlight(x, scaled.mass_flow, _broken_limit(problem, scaled, x))
        if flight.broken != ALTITUDE:
            return flight
    if time is None and find_ground_contact(problem) is None:
        x = new_extremal()
        if solve_touching(scaled, x):
            return PrimerFlight(x, scaled.mass_flow, _broken_limit(problem, scaled, x))
    return flight


def _broken_limit(problem: LandingProblem, scaled: PrimerProblem, x: Extremal) -> int:
    """The first limit that an extremal breaks, as of `path_limits`; KEPT, which is zero, if it keeps all."""
    if PrimerFlight(x, scaled.mass_flow).log_mass_ratio > problem.log_mass_ratio:
        return PROPELLANT
    limits, unit = problem.limits, problem.lander.max_thrust / problem.state.mass
    path = fly_extremal(x, scaled)
    asked = path_limits(problem.lander.pointing_limit, limits.speed, limits.glide_slope)
    broken = broken_limit(path, asked, unit)
    if broken:
        return broken
    final, sight = limits.final_thrust_direction, limits.line_of_sight
    if final is not None and final.excess(path.direction[-1]) > 0.0:
        return FINAL_DIRECTION
    outside = sight is not None and sight.outside(unit * path.position[:-1]).max() > 0.0
    return LINE_OF_SIGHT if outside else KEPT
