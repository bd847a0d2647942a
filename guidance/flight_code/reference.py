"""What the flight code must answer: the same question put to the kernels of Python."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from guidance.arrays import Array
from guidance.bulk.certified_flight import Finding, Vehicle, answer_start
from guidance.bulk.sampling import set_thrust
from guidance.descent.problem import LARGEST_NUMBER, lies_below
from guidance.flight_time.extremal import new_extremal
from guidance.flight_time.path_limits import PathLimits


class Refusal(IntEnum):
    """Why the flight code refuses its input; numbers go on from those of `Finding`."""

    NOT_FINITE = 12
    """An input is NaN or infinite."""
    TOO_LARGE = 13
    """A number is beyond 1e9."""
    BAD_VEHICLE = 14
    """Thrust, dry mass, exhaust velocity or a limit is out of range."""
    NO_PROPELLANT = 15
    """The mass does not exceed the dry mass."""
    BELOW_TARGET = 16
    """The start lies below the target's altitude."""
    NO_TIME = 17
    """There is no flight to ask for a thrust, or the time is not one."""


CodeStatus = Finding | Refusal
"""What `descent_status` of the header enumerates."""


class Question(NamedTuple):
    """Input of `descent_solve`, in SI; a limit that is inf is none.

    Attributes:
        max_thrust: [N].
        min_thrust: [N].
        dry_mass: [kg].
        exhaust_velocity: [m/s].
        gravity: [m/s^2] three numbers.
        pointing_limit: [rad].
        speed_limit: [m/s].
        glide_slope_limit: [rad].
        state: (x, y, z, vx, vy, vz, mass).
        target: [m] three numbers.
    """

    max_thrust: float
    min_thrust: float
    dry_mass: float
    exhaust_velocity: float
    gravity: tuple[float, ...]
    pointing_limit: float
    speed_limit: float
    glide_slope_limit: float
    state: tuple[float, ...]
    target: tuple[float, ...]


class CodeAnswer(NamedTuple):
    """Output of `descent_solve`, and of `descent_thrust` at the start; nan where there is none.

    Attributes:
        status: of the header's enumeration.
        propellant: [kg].
        time_of_flight: [s].
        lower_bound: [kg]; inf where there is no flight.
        first_thrust: [N] shape (3,).
        touch_time: [s] of a touch of the ground; -inf for none.
    """

    status: CodeStatus
    propellant: float
    time_of_flight: float
    lower_bound: float
    first_thrust: Array
    touch_time: float = math.nan


def answer_question(question: Question) -> CodeAnswer:
    """Answer as the flight code must."""
    refusal = _refuse_vehicle(question) or _refuse_start(question)
    nothing = np.full(3, math.nan)
    if refusal is not None:
        return CodeAnswer(refusal, math.nan, math.nan, math.nan, nothing)
    x, thrust = new_extremal(), np.empty(3)
    state, target = np.array(question.state), np.array(question.target)
    answer, _ = answer_start(state, target, _vehicle(question), x)
    if answer.finding != Finding.OPTIMAL:
        return CodeAnswer(Finding(answer.finding), math.nan, math.nan, answer.lower_bound, nothing)
    set_thrust(x, 0.0, question.max_thrust, thrust)
    told = answer.propellant, float(x.times[2]), answer.lower_bound, thrust, float(x.touch[0])
    return CodeAnswer(Finding.OPTIMAL, *told)


def _vehicle(question: Question) -> Vehicle:
    angle = question.pointing_limit
    limits = PathLimits(
        -math.inf if math.isinf(angle) else math.cos(angle), question.speed_limit, question.glide_slope_limit
    )
    sine = math.sin(angle) if angle < math.pi else 0.0
    return Vehicle(*question[:4], sine, limits, np.array(question.gravity))


def _refuse_vehicle(question: Question) -> Refusal | None:
    most_thrust, least_thrust, dry_mass, exhaust, gravity, *limits = question[:8]
    engine = (most_thrust, least_thrust, dry_mass, exhaust)
    if not np.isfinite((*engine, *gravity)).all() or np.isnan(limits).any():
        return Refusal.NOT_FINITE
    if np.abs(gravity).max() > LARGEST_NUMBER:
        return Refusal.TOO_LARGE
    sizes = min(most_thrust, dry_mass, exhaust) > 0.0 and 0.0 <= least_thrust <= most_thrust
    most = (math.pi, math.inf, math.pi / 2)
    pairs = zip(limits, most, strict=True)
    known = [limit > 0.0 and (limit <= top or math.isinf(limit)) for limit, top in pairs]
    return None if sizes and all(known) else Refusal.BAD_VEHICLE


def _refuse_start(question: Question) -> Refusal | None:
    numbers = np.array((*question.state, *question.target))
    if not np.isfinite(numbers).all():
        return Refusal.NOT_FINITE
    if np.abs(numbers).max() > LARGEST_NUMBER:
        return Refusal.TOO_LARGE
    if question.state[6] <= question.dry_mass:
        return Refusal.NO_PROPELLANT
    below = lies_below(np.array(question.state[:3]), np.array(question.target))
    return Refusal.BELOW_TARGET if below else None
