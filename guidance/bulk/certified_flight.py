"""One start answered without a solver: the extremal, its limits, and what no flight undercuts; compiled."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.limits import NO_LIMITS, Limits
from guidance.descent.problem import ROUNDING
from guidance.flight_time.extremal import Extremal, PrimerProblem, copy_extremal, new_extremal, no_touch
from guidance.flight_time.full_burn import solve_full_burn
from guidance.flight_time.linear_system import dot
from guidance.flight_time.path_limits import (
    ALTITUDE,
    KEPT,
    POINTING,
    PROPELLANT,
    PathLimits,
    burnt_share,
    judge_extremal,
    path_limits,
)
from guidance.flight_time.primer_equations import LEAST_PULL, MOST_PULL, solve_primer, solve_touching
from guidance.kernel import compile_kernel
from guidance.lander import Lander
from guidance.lower_bound.dual_case import DualCase, ThrustBounds, chord_growth
from guidance.lower_bound.neighbour_cover import bound_by_neighbours
from guidance.lower_bound.time_cover import GRANTED, TimeCover, claimed_bound


class Finding(IntEnum):
    """What the compiled code says of a start."""

    OPTIMAL = 0
    """A flight of least propellant, and a bound."""
    INFEASIBLE = 1
    """Proved: the tank pays for no flight."""
    NO_FLIGHT = 2
    """The iteration found no flight."""
    TANK_TOO_SMALL = 3
    """The flight found burns more than the tank holds; that all do is not proved."""
    LEAST_THRUST = 4
    """The engine cannot stop."""
    NO_GRAVITY = 5
    """Gravity is too weak beside the thrust."""
    WEAK_ENGINE = 6
    """Full thrust does not lift the vehicle."""
    NOT_ABOVE = 7
    """The start does not lie above the target, against gravity."""
    LEANS = 8
    """The flight of least propellant breaks the pointing limit."""
    BELOW_GROUND = 9
    """It goes below the target's altitude."""
    TOO_FAST = 10
    """It breaks the speed limit."""
    OFF_GLIDE_SLOPE = 11
    """It breaks the glide slope limit."""


_OPTIMAL, _INFEASIBLE, _NO_FLIGHT, _TANK_TOO_SMALL = (int(finding) for finding in tuple(Finding)[:4])
_LEAST_THRUST, _NO_GRAVITY, _WEAK_ENGINE, _NOT_ABOVE = (int(finding) for finding in tuple(Finding)[4:8])
_NOTHING = -1  # found
_LEANS = int(Finding.LEANS)  # the other limits follow in the order of `path_limits`


class Vehicle(NamedTuple):
    """A lander and the world it flies in, as the kernels read them.

    Attributes:
        max_thrust: [N].
        min_thrust: [N].
        dry_mass: [kg].
        exhaust_velocity: [m/s].
        sine: of the pointing limit; 0 where there is none.
        limits: on the path and the pointing.
        gravity: [m/s^2] shape (3,).
    """

    max_thrust: float
    min_thrust: float
    dry_mass: float
    exhaust_velocity: float
    sine: float
    limits: PathLimits
    gravity: Array


class Answer(NamedTuple):
    """What is known of one start.

    Attributes:
        finding: a `Finding`, as a number.
        propellant: [kg] that the flight burns; nan without one.
        lower_bound: [kg] no flight burns less; inf where there is none, nan where nothing is known.
    """

    finding: int
    propellant: float
    lower_bound: float


class Bound(NamedTuple):
    """The proof of an answer.

    Attributes:
        spent_at_most: [m/s] it speaks of flights that spend no more.
        times: [s] grid of times of flight, rising.
        cover: the primers that bound them.
    """

    spent_at_most: float
    times: Array
    cover: TimeCover


def vehicle_of(lander: Lander, gravity: Array, asked: Limits = NO_LIMITS) -> Vehicle:
    """The numbers of a lander and of the limits that they are: glide slope, speed and pointing."""
    angle = math.pi if lander.pointing_limit is None else lander.pointing_limit
    limits = path_limits(lander.pointing_limit, asked.speed, asked.glide_slope)
    sine = math.sin(angle) if angle < math.pi else 0.0
    engine = lander.max_thrust, lander.min_thrust, lander.dry_mass, lander.exhaust_velocity
    return Vehicle(*engine, sine, limits, gravity.copy())


@compile_kernel
def offset_from(state: Array, target: Array, limits: PathLimits) -> Array:
    """[m] shape (3,): the start seen from the target, moved onto a limit that rounding makes it break."""
    offset = state[:3] - target
    offset[2] = max(offset[2], 0.0)
    if limits.glide_slope < math.pi / 2 - 1e-6:
        cosine, sine = math.cos(limits.glide_slope), math.sin(limits.glide_slope)
        across = math.hypot(offset[0], offset[1])
        outside = cosine * across - sine * offset[2]
        if 0.0 < outside <= ROUNDING * max(1.0, math.sqrt(dot(offset, offset))):
            offset[:2] *= 1.0 - outside * cosine / across
            offset[2] += outside * sine
    return offset


@compile_kernel
def scale_start(state: Array, target: Array, vehicle: Vehicle) -> PrimerProblem:
    """The problem in seconds: lengths over full thrust by start mass."""
    unit = vehicle.max_thrust / state[6]
    return PrimerProblem(
        offset_from(state, target, vehicle.limits) / unit,
        state[3:6] / unit,
        vehicle.gravity / unit,
        vehicle.max_thrust / vehicle.exhaust_velocity / state[6],
    )


@compile_kernel
def domain_of(problem: PrimerProblem, min_thrust: float) -> int:
    """Why the indirect method does not know a problem, as a `Finding`; OPTIMAL where it does."""
    pull = dot(problem.gravity, problem.gravity)
    if min_thrust > 0.0:
        return _LEAST_THRUST
    if not pull > LEAST_PULL:
        return _NO_GRAVITY
    if not pull < MOST_PULL:
        return _WEAK_ENGINE
    return _OPTIMAL if dot(problem.position, problem.gravity) < 0.0 else _NOT_ABOVE


@compile_kernel
def seek_extremal(
    problem: PrimerProblem, limits: PathLimits, unit: float, log_mass_ratio: float, x: Extremal
) -> int:
    """Find the extremal of the best time: with a coast, without, or touching; the limit that it breaks.

    Args:
        problem: in seconds.
        limits: in SI.
        unit: [m/s^2] full thrust over start mass.
        log_mass_ratio: ln(start mass / dry mass).
        x: the answer, in seconds.

    Returns:
        As `judge_extremal`; _NOTHING where none was found.
    """
    broken, other = _NOTHING, new_extremal()
    x.touch[:] = no_touch()
    if solve_primer(problem, x):
        broken = judge_extremal(x, problem, limits, unit, log_mass_ratio)
    elif solve_full_burn(problem, other):
        copy_extremal(other, x)
        broken = judge_extremal(x, problem, limits, unit, log_mass_ratio)
    if broken in (_NOTHING, ALTITUDE) and solve_touching(problem, other) and other.touch[1] > 0.0:
        copy_extremal(other, x)
        broken = judge_extremal(x, problem, limits, unit, log_mass_ratio)
    return broken


@compile_kernel
def bound_start(
    problem: PrimerProblem, vehicle: Vehicle, x: Extremal, unit: float, most: float, target: float
) -> Bound:
    """Bound the velocity change of the flights of a problem.

    Args:
        problem: in seconds.
        vehicle: lander, gravity and limits.
        x: the extremal, in seconds.
        unit: [m/s^2] full thrust over start mass.
        most: [m/s] the bound speaks of flights that spend no more.
        target: [m/s] the level that is enough.
    """
    exhaust = vehicle.exhaust_velocity
    case = DualCase(
        unit * problem.position,
        unit * problem.velocity,
        np.zeros(3),
        vehicle.gravity,
        ThrustBounds(
            unit,
            unit * chord_growth(most, exhaust),
            0.0,
            0.0,
            max(vehicle.limits.least_cosine, -1.0),
            vehicle.sine,
        ),
        0.0,
        0.0,  # no limit on the path: only the touch of the flight itself, as its primer has it, is used
        False,
    )
    times, cover = bound_by_neighbours(x, problem, case, target, exhaust)
    return Bound(most, times, cover)


@compile_kernel
def answer_start(state: Array, target: Array, vehicle: Vehicle, x: Extremal) -> tuple[Answer, Bound]:
    """Answer one start.

    Args:
        state: (x, y, z, vx, vy, vz, mass), shape (7,).
        target: [m] shape (3,).
        vehicle: lander, gravity and limits.
        x: the extremal, where one was found; in seconds.

    Returns:
        The answer, and its proof; without a flight to prove anything of, an empty one.
    """
    nothing = Bound(0.0, np.empty(0), TimeCover(np.empty((0, 6)), np.empty(0, np.int64), 0.0, 0.0, 0.0))
    mass, exhaust, unit = state[6], vehicle.exhaust_velocity, vehicle.max_thrust / state[6]
    problem = scale_start(state, target, vehicle)
    outside = domain_of(problem, vehicle.min_thrust)
    if outside != _OPTIMAL:
        return Answer(outside, math.nan, math.nan), nothing
    tank = exhaust * math.log(mass / vehicle.dry_mass)
    broken = seek_extremal(problem, vehicle.limits, unit, tank / exhaust, x)
    if broken == _NOTHING:
        return Answer(_NO_FLIGHT, math.nan, math.nan), nothing
    if broken == PROPELLANT:
        enough = tank + 2.0 * GRANTED * exhaust
        bound = bound_start(problem, vehicle, x, unit, tank, enough)
        if bound.cover.level >= enough:
            return Answer(_INFEASIBLE, math.nan, math.inf), bound
        return Answer(_TANK_TOO_SMALL, math.nan, math.nan), nothing
    if broken != KEPT:
        return Answer(_LEANS + broken - POINTING, math.nan, math.nan), nothing
    share = burnt_share(x, problem.mass_flow)
    spent = -exhaust * math.log1p(-share)
    bound = bound_start(problem, vehicle, x, unit, spent, spent)
    least = claimed_bound(bound.cover.level, spent, exhaust)
    return Answer(_OPTIMAL, mass * share, mass * -math.expm1(-least / exhaust)), bound
