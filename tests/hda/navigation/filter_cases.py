"""Systems, descents and ground for the tests of the filter; flown by guidance alone, without a simulator."""

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.dynamics import propagate
from guidance.lander import PAPER_LANDER
from guidance.state import State
from guidance.zem_zev import saturate_thrust, time_to_go, zem_zev_acceleration
from hda.navigation import (
    FlownPath,
    NavigationState,
    NavigationSystem,
    begin_navigation,
    draw_fix,
    draw_readings,
    draw_sensor_errors,
    find_site,
    navigate,
    track_site,
)

GRAVITY = np.array([0.0, 0.0, -1.62])
PERIOD = 0.5
LOOK_PERIODS = 10
TARGET = np.array([500.0, 500.0, 50.0])
ALONE = NavigationSystem(altimeter=None, velocimeter=None, terrain=None, site=None)
"""The inertial unit and nothing else."""


@dataclass(frozen=True, eq=False)
class Descent:
    """A flight to TARGET: times [s] shape (n,) and true states (n, 7) at its control instants.

    Of a body with a gyroscope also true attitudes, shape (n, 4).
    """

    time: Array
    path: Array
    attitude: Array | None = None


def fly_descent(rng: np.random.Generator) -> Descent:
    """A ZEM/ZEV descent from the paper's starts, its engine wrong by up to 5 % in each interval."""
    azimuth, distance = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(200.0, 250.0)
    outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    position = TARGET + distance * outward
    position[2] = rng.uniform(900.0, 1000.0)
    velocity = -rng.uniform(5.0, 10.0) * outward - np.array([0.0, 0.0, rng.uniform(20.0, 35.0)])
    state = State(position, velocity, 1200.0)
    remaining = time_to_go(state, TARGET)
    path, wrong, k = [state.as_array()], 0.0, 0
    while remaining > PERIOD:
        if k % LOOK_PERIODS == 0:
            wrong = rng.uniform(-0.05, 0.05)
        asked = state.mass * zem_zev_acceleration(state, TARGET, remaining)
        state = propagate(state, saturate_thrust(asked, PAPER_LANDER) * (1.0 + wrong), PERIOD, PAPER_LANDER)
        path.append(state.as_array())
        remaining -= PERIOD
        k += 1
    return Descent(PERIOD * np.arange(k + 1, dtype=np.float64), np.array(path))


def walk_ground(system: NavigationSystem, path: Array, rng: np.random.Generator) -> Array:
    """Ground under each node of a path that changes as the filter takes it to."""
    flown = np.hypot(*np.diff(path[:, :2], axis=0).T)
    variance = 2.0 * system.relief**2 * -np.expm1(-flown / system.relief_length)
    start = TARGET[2] + system.ground_error * rng.standard_normal()
    return start + np.concatenate([[0.0], np.cumsum(np.sqrt(variance) * rng.standard_normal(flown.size))])


@dataclass(frozen=True, eq=False)
class Run:
    """A filter taken along a whole descent of m legs, one from each look to the next, and n control periods.

    Attributes:
        error: shape (m, 13), estimate minus truth at the end of each leg; with a gyroscope (m, 23), zeros for
            what is considered.
        covariance: shape (m, 20, 20), there; with a gyroscope (m, 23, 23).
        squares: shape (n, 3), of altimeter, velocimeter and terrain fix.
        site_squares: shape (m - 1,), of the site's fixes at the looks after the first; NaN without one.
        final: the filter at the end.
    """

    error: Array
    covariance: Array
    squares: Array
    site_squares: Array
    final: NavigationState


def run_filter(system: NavigationSystem, descent: Descent, ground: Array, rng: np.random.Generator) -> Run:
    """Take a filter along a descent over the given ground: a look each LOOK_PERIODS, the site at TARGET."""
    time, path = descent.time, descent.path
    errors = draw_sensor_errors(system, rng)
    navigation = begin_navigation(system, State.parse(path[0]), TARGET, errors)
    error, covariance, squares, site_squares = [], [], [], []
    for first in range(0, time.size - 1, LOOK_PERIODS):
        last = min(first + LOOK_PERIODS, time.size - 1)
        if first == 0:
            navigation = find_site(system, navigation, path[0, :3], TARGET, draw_fix(rng))
        else:
            navigation, square = track_site(system, navigation, path[first, :3], TARGET, draw_fix(rng))
            site_squares.append(square)
        heights = (path[:, 2] - ground)[first + 1 : last + 1]
        attitudes = None if descent.attitude is None else descent.attitude[first : last + 1]
        leg = FlownPath(time[first : last + 1], path[first : last + 1], heights, attitudes)
        draws = draw_readings(rng, last - first, gyroscope=descent.attitude is not None)
        navigation, log = navigate(system, navigation, leg, draws)
        squares.append(log.innovation_square)
        errors = navigation.errors
        truth = np.concatenate([path[last, :6], errors.accelerometer_bias, ground[last : last + 1], TARGET])
        if system.gyroscope is not None:
            truth = np.concatenate([truth, np.zeros(4), errors.tilt, errors.gyro_bias])
        error.append(navigation.estimate - truth)
        covariance.append(navigation.covariance)
    return Run(
        np.array(error), np.array(covariance), np.concatenate(squares), np.array(site_squares), navigation
    )


def fly_many(runs: int, seed: int) -> list[Descent]:
    """Independent descents."""
    return [fly_descent(np.random.default_rng([seed, k])) for k in range(runs)]


def run_many(system: NavigationSystem, descents: list[Descent], seed: int) -> list[Run]:
    """The filter on each descent, with errors and ground of its own."""
    out = []
    for k, descent in enumerate(descents):
        rng = np.random.default_rng([seed, k])
        out.append(run_filter(system, descent, walk_ground(system, descent.path, rng), rng))
    return out
