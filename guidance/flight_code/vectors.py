"""Examples for the flight code: questions of many kinds, and the answers of Python, as a table."""

from __future__ import annotations

import math

import numpy as np

from guidance.constants import MOON_GRAVITY
from guidance.flight_code.reference import CodeAnswer, Question, answer_question
from guidance.lander import PAPER_LANDER

_GOOD = Question(
    PAPER_LANDER.max_thrust,
    PAPER_LANDER.min_thrust,
    PAPER_LANDER.dry_mass,
    PAPER_LANDER.exhaust_velocity,
    MOON_GRAVITY,
    math.inf,
    math.inf,
    math.inf,
    (200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0),
    (0.0, 0.0, 50.0),
)
_TOUCHING = (
    (-164.2, -138.1, 179.3, -2.2, -29.1, -46.7, 1199.0),
    (-11.3, 0.4, 202.6, 17.4, 25.7, -48.7, 1194.5),
    (9.4, -38.2, 103.7, 8.9, 27.0, -29.2, 1186.2),
)
_WITHOUT_COAST = (
    (-3.3, 47.1, 151.9, -3.8, -23.6, -35.9, 1200.0),
    (-141.9, -143.2, 197.2, 48.7, 26.7, -33.5, 1200.0),
    (41.5, -113.1, 92.5, -9.4, 44.8, -15.3, 1200.0),
)
_WRONG = (math.nan, math.inf, -math.inf, 1e12, -1e12, 0.0, -1.0)
_COLUMNS = (
    "max_thrust,min_thrust,dry_mass,exhaust_velocity,gravity_x,gravity_y,gravity_z,"
    "pointing_limit,speed_limit,glide_slope_limit,x,y,z,vx,vy,vz,mass,target_x,target_y,target_z,"
    "status,propellant,time_of_flight,lower_bound,thrust_x,thrust_y,thrust_z"
)


def draw_questions(count: int, rng: np.random.Generator) -> list[Question]:
    """Questions that a vehicle may ask: near and far starts, short tanks, other worlds, limits."""
    return [_draw(k, rng) for k in range(count)]


def wrong_questions() -> list[Question]:
    """A good question with each of its numbers replaced by what is none, or is far out of range."""
    out = []
    for name in Question._fields:
        value = getattr(_GOOD, name)
        for wrong in _WRONG:
            if isinstance(value, tuple):
                places = range(len(value))
                out += [_GOOD._replace(**{name: _put(value, place, wrong)}) for place in places]
            else:
                out.append(_GOOD._replace(**{name: wrong}))
    return out


def edge_questions() -> list[Question]:
    """Questions outside the method's domain, and flights that break a limit by a little, or by nothing.

    Flights that touch the ground and flights without a coast, too.
    """
    low, level = (200.0, 100.0, 50.0, 0.0, 0.0, 0.0, 1200.0), (120.0, 0.0, 50.0, 0.0, 0.0, 30.0, 1200.0)
    return [
        _GOOD._replace(min_thrust=500.0),
        _GOOD._replace(max_thrust=1900.0),
        _GOOD._replace(gravity=(0.0, 0.0, -1e-3)),
        _GOOD._replace(gravity=(0.0, 0.0, 1.62)),
        _GOOD._replace(state=low),
        _GOOD._replace(state=level),
        _GOOD._replace(state=level, gravity=(0.8, 0.0, -1.4)),
        _GOOD._replace(state=(*_GOOD.state[:6], 1170.0)),
        _GOOD._replace(dry_mass=1176.0),
        _GOOD._replace(dry_mass=1174.9),
        *(_GOOD._replace(state=state) for state in (*_TOUCHING, *_WITHOUT_COAST)),
        *(_GOOD._replace(state=state, speed_limit=50.0) for state in _TOUCHING),
        *(_GOOD._replace(pointing_limit=angle) for angle in (0.2, 0.9, 1.5, math.pi)),
        *(_GOOD._replace(speed_limit=speed) for speed in (40.0, 60.0, 80.0)),
        *(_GOOD._replace(glide_slope_limit=angle) for angle in (0.1, 0.24, 0.4, math.pi / 2)),
    ]


def write_table(questions: list[Question]) -> str:
    """Questions and answers as comma-separated values, a row each, numbers to the last digit."""
    rows = [",".join(map(repr, _numbers(question, answer_question(question)))) for question in questions]
    return "\n".join([_COLUMNS, *rows, ""])


def _numbers(question: Question, answer: CodeAnswer) -> list[float | int]:
    asked = [float(number) for field in question for number in np.atleast_1d(field)]
    told = [answer.propellant, answer.time_of_flight, answer.lower_bound, *answer.first_thrust]
    return [*asked, int(answer.status), *(float(number) for number in told)]


def _put(values: tuple[float, ...], place: int, value: float) -> tuple[float, ...]:
    return (*values[:place], value, *values[place + 1 :])


def _draw(number: int, rng: np.random.Generator) -> Question:
    pull = 1.62 if number % 3 else rng.uniform(0.5, 10.0)
    kind = number % 5
    reach, height, speed = ((250.0, 1000.0, 10.0), (500.0, 700.0, 30.0), (300.0, 300.0, 40.0))[kind % 3]
    mass = rng.uniform(1152.0, 1200.0)
    place = [*rng.uniform(-reach, reach, 2), 50.0 + rng.uniform(0.01, 1.0) * height]
    state = (*place, *rng.uniform(-speed, speed, 2), rng.uniform(-50.0, 10.0), mass)
    return _GOOD._replace(
        max_thrust=mass * pull * rng.uniform(1.5, 9.0) if number % 3 == 0 else _GOOD.max_thrust,
        dry_mass=float(rng.uniform(400.0, 1100.0)) if number % 2 else _GOOD.dry_mass,
        gravity=(*(rng.normal(0.0, 0.1, 2) if number % 7 == 0 else (0.0, 0.0)), -pull),
        pointing_limit=float(rng.uniform(0.3, math.pi)) if kind == 2 else math.inf,
        speed_limit=float(rng.uniform(30.0, 150.0)) if kind == 3 else math.inf,
        glide_slope_limit=float(rng.uniform(0.3, math.pi / 2)) if kind == 4 else math.inf,
        state=tuple(map(float, state)),
    )
