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
from guidance.flight_time.continuation import solve_from_impulses, solve_touching_from_edge
from guidance.flight_time.extremal import (
    Extremal,
    PrimerProblem,
    blank_extremal,
    fly_extremal,
    set_direction,
)
from guidance.flight_time.fixed_time import solve_primer_at
from guidance.flight_time.full_burn import solve_full_burn
from guidance.flight_time.ground_contact import find_ground_contact
from guidance.flight_time.path_limits import (
    ALTITUDE,
    FINAL_DIRECTION,
    KEPT,
    LINE_OF_SIGHT,
    PathLimits,
    burnt_share,
    judge_extremal,
    path_limits,
)
from guidance.flight_time.primer_equations import solve_from, solve_primer, solve_touching
from guidance.kernel import compile_kernel

_NOT_FOUND = -1
_Vehicle = tuple[PathLimits, float, float]
"""Limits, full thrust over start mass [m/s^2], and ln(start mass / dry mass)."""


@dataclass(frozen=True, eq=False)
class PrimerFlight:
    """A flight that meets the necessary conditions of least propellant.

    Attributes:
        extremal: its arcs and its primer, in seconds, as the kernels read it.
        scaled: the problem that it solves, in seconds.
        broken: the first limit of the problem that it breaks, as of `path_limits`; KEPT for none.
    """

    extremal: Extremal
    scaled: PrimerProblem
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
        return self.scaled.mass_flow * burning

    def log_mass(self, nodes: int) -> Array:
        """ln(m / m_start) at N equal steps, shape (N,)."""
        return np.log1p(-self.burnt_at(np.linspace(0.0, self.time, nodes)))

    @property
    def log_mass_ratio(self) -> float:
        """ln(start mass / final mass)."""
        return -math.log1p(-burnt_share(self.extremal, self.scaled.mass_flow))

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

    Where it would cut through the target's altitude in its first burn, the one that touches it there; where a
    coast would only cost, the one that burns all the way.

    Args:
        problem: the landing problem.
        time: [s] of flight; None for the best one.

    Returns:
        The flight; None where none was found, where the engine cannot stop or cannot lift the vehicle, where
        the flight does not end at rest, where the frame turns, where the thrust may not jump, where gravity
        vanishes, or where the flight breaks a limit of the problem: the method knows none but a touch of the
        ground. A flight without a coast it knows for the best time alone.
    """
    flight = find_extremal_flight(problem, time)
    return None if flight is None or flight.broken else flight


def find_extremal_flight(
    problem: LandingProblem, time: float | None = None, thorough: bool = True
) -> PrimerFlight | None:
    """The same, and a flight too that breaks a limit of the problem or overdraws the tank: it says which.

    Args:
        problem: the landing problem.
        time: [s] of flight; None for the best one.
        thorough: whether easier problems may lead there (`continuation`), and a touch at a given time.
    """
    lander = problem.lander
    if lander.min_thrust > 0.0 or not problem.ends_at_rest or problem.rotates:
        return None
    if problem.limits.thrust_rate is not None:
        return None
    scaled, x, vehicle = scale_landing(problem), blank_extremal(), _vehicle(problem)
    held = math.nan if time is None else time
    flight = _read(problem, scaled, x, _seek(scaled, vehicle, held, x))
    if flight is not None and flight.broken != ALTITUDE:
        return flight
    if (time is not None and not thorough) or find_ground_contact(problem) is not None:
        return flight
    seeks = (_seek_full_burn, _seek_from_impulses) if thorough else (_seek_full_burn,)
    for seek in () if flight is not None else seeks:
        x = blank_extremal()
        flight = _read(problem, scaled, x, seek(scaled, vehicle, held, x))
        if flight is not None:
            break
    if flight is not None and flight.broken != ALTITUDE:
        return flight
    for seek in (_seek_touching, _seek_from_edge) if thorough else (_seek_touching,):
        x = blank_extremal()
        touching = _read(problem, scaled, x, seek(scaled, vehicle, held, x))
        if touching is not None and touching.broken != ALTITUDE:
            return touching
    return flight


def fly_to(problem: LandingProblem, x: Extremal, size: int) -> PrimerFlight | None:
    """Flight along the extremal of a problem next to one that is known; None where there is none.

    Args:
        problem: the landing problem.
        x: an extremal of a problem that is nearly the same, in seconds; changed in place.
        size: FREE, or TOUCHING where it touches the ground.
    """
    scaled = scale_landing(problem)
    return _read(problem, scaled, x, _seek_near(scaled, _vehicle(problem), size, x))


def _vehicle(problem: LandingProblem) -> _Vehicle:
    lander, limits = problem.lander, problem.limits
    asked = path_limits(lander.pointing_limit, limits.speed, limits.glide_slope)
    return asked, lander.max_thrust / problem.state.mass, problem.log_mass_ratio


@compile_kernel
def _seek(problem: PrimerProblem, vehicle: _Vehicle, time: float, x: Extremal) -> int:
    """Find the extremal of a time of flight [s], nan for the best one; what it breaks, or _NOT_FOUND."""
    if solve_primer(problem, x) and (math.isnan(time) or solve_primer_at(time, problem, x)):
        return judge_extremal(x, problem, *vehicle)
    return _NOT_FOUND


@compile_kernel
def _seek_full_burn(problem: PrimerProblem, vehicle: _Vehicle, time: float, x: Extremal) -> int:
    """The same for the flight that burns all the way; of the best time alone."""
    if math.isnan(time) and solve_full_burn(problem, x):
        return judge_extremal(x, problem, *vehicle)
    return _NOT_FOUND


@compile_kernel
def _seek_from_impulses(problem: PrimerProblem, vehicle: _Vehicle, time: float, x: Extremal) -> int:
    """The same for an extremal that only problems with more thrust lead to."""
    if solve_from_impulses(problem, x) and (math.isnan(time) or solve_primer_at(time, problem, x)):
        return judge_extremal(x, problem, *vehicle)
    return _NOT_FOUND


@compile_kernel
def _seek_touching(problem: PrimerProblem, vehicle: _Vehicle, time: float, x: Extremal) -> int:
    """The same for the extremal that touches the ground, which bends its primer upward."""
    found = solve_touching(problem, x) and (math.isnan(time) or solve_primer_at(time, problem, x))
    return judge_extremal(x, problem, *vehicle) if found and x.touch[1] > 0.0 else _NOT_FOUND


@compile_kernel
def _seek_from_edge(problem: PrimerProblem, vehicle: _Vehicle, time: float, x: Extremal) -> int:
    """The same for one that touches the ground and that only lower starts lead to."""
    found = solve_touching_from_edge(problem, x) and (math.isnan(time) or solve_primer_at(time, problem, x))
    return judge_extremal(x, problem, *vehicle) if found and x.touch[1] > 0.0 else _NOT_FOUND


@compile_kernel
def _seek_near(problem: PrimerProblem, vehicle: _Vehicle, size: int, x: Extremal) -> int:
    """The same for the extremal next to a given one, with FREE or TOUCHING equations."""
    return judge_extremal(x, problem, *vehicle) if solve_from(x, problem, size) else _NOT_FOUND


def _read(problem: LandingProblem, scaled: PrimerProblem, x: Extremal, broken: int) -> PrimerFlight | None:
    """A flight that was sought, looked at for the limits that compiled code does not know."""
    if broken == _NOT_FOUND:
        return None
    final, sight = problem.limits.final_thrust_direction, problem.limits.line_of_sight
    if broken == KEPT and (final is not None or sight is not None):
        path, unit = fly_extremal(x, scaled), problem.lander.max_thrust / problem.state.mass
        if final is not None and final.excess(path.direction[-1]) > 0.0:
            broken = FINAL_DIRECTION
        elif sight is not None and sight.outside(unit * path.position[:-1]).max() > 0.0:
            broken = LINE_OF_SIGHT
    return PrimerFlight(x, scaled, broken)
