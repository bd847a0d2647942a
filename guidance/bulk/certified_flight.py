"""One start answered without a solver: the extremal, its limits, and what no flight undercuts; compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.descent.plan import PlanStatus
from guidance.flight_time.extremal import Extremal, PrimerProblem, fly_extremal
from guidance.flight_time.path_limits import PathLimits, keeps_limits
from guidance.flight_time.primer_equations import solve_primer
from guidance.kernel import compile_kernel
from guidance.lander import Lander
from guidance.lower_bound.dual_case import DualCase, chord_growth
from guidance.lower_bound.neighbour_cover import bound_extremal
from guidance.lower_bound.time_cover import GRANTED, TimeCover, claimed_bound

STATUSES = tuple(PlanStatus)
"""What the numbers of a status array stand for."""
OPTIMAL = STATUSES.index(PlanStatus.OPTIMAL)
INFEASIBLE = STATUSES.index(PlanStatus.INFEASIBLE)
UNDECIDED = STATUSES.index(PlanStatus.LIMIT_REACHED)


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
        status: index into STATUSES: optimal, infeasible, or undecided.
        propellant: [kg] that the flight burns; nan without one.
        lower_bound: [kg] no flight burns less; inf where there is none, nan where nothing is known.
    """

    status: int
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


def vehicle_of(
    lander: Lander, gravity: Array, glide_slope_limit: float | None, speed_limit: float | None
) -> Vehicle:
    """The numbers of a lander and its limits."""
    angle = math.pi if lander.pointing_limit is None else lander.pointing_limit
    limits = PathLimits(
        -math.inf if lander.pointing_limit is None else math.cos(angle),
        math.inf if speed_limit is None else speed_limit,
        math.inf if glide_slope_limit is None else glide_slope_limit,
    )
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
        if 0.0 < outside <= 1e-6 * max(1.0, math.sqrt(offset @ offset)):
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
def bound_start(
    problem: PrimerProblem, unit: float, vehicle: Vehicle, x: Extremal, most: float, target: float
) -> Bound:
    """Bound what flights that spend at most `most` [m/s] spend, as well as `target` [m/s] asks."""
    exhaust = vehicle.exhaust_velocity
    cosine = max(vehicle.limits.least_cosine, -1.0)
    case = DualCase(
        unit * problem.position,
        unit * problem.velocity,
        np.zeros(3),
        vehicle.gravity,
        unit,
        unit * chord_growth(most, exhaust),
        0.0,
        0.0,
        cosine,
        vehicle.sine,
    )
    times, cover = bound_extremal(x, problem, case, target, exhaust)
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
    unknown = Answer(UNDECIDED, math.nan, math.nan)
    nothing = Bound(0.0, np.empty(0), TimeCover(np.empty((0, 6)), np.empty(0, np.int64), 0.0, 0.0, 0.0))
    if vehicle.min_thrust > 0.0:
        return unknown, nothing
    mass, exhaust = state[6], vehicle.exhaust_velocity
    unit = vehicle.max_thrust / mass
    problem = scale_start(state, target, vehicle)
    if not solve_primer(problem, x):
        return unknown, nothing
    share = problem.mass_flow * (max(x.times[0], 0.0) + x.times[2] - x.times[1])
    if not share < 1.0:
        return unknown, nothing
    spent, tank = -exhaust * math.log1p(-share), exhaust * math.log(mass / vehicle.dry_mass)
    if spent > tank:
        enough = tank + 2.0 * GRANTED * exhaust
        bound = bound_start(problem, unit, vehicle, x, tank, enough)
        if bound.cover.level >= enough:
            return Answer(INFEASIBLE, math.nan, math.inf), bound
        return unknown, nothing
    if not keeps_limits(fly_extremal(x, problem), vehicle.limits, unit):
        return unknown, nothing
    bound = bound_start(problem, unit, vehicle, x, spent, spent)
    least = claimed_bound(bound.cover.level, spent, exhaust)
    return Answer(OPTIMAL, mass * share, mass * -math.expm1(-least / exhaust)), bound
