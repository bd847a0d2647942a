"""The filter between readings: against closed forms, finite differences and the true motion."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance.constants import STANDARD_GRAVITY
from guidance.dynamics import propagate
from guidance.lander import PAPER_LANDER
from guidance.state import State
from hda.navigation import (
    FlownPath,
    InertialUnit,
    ReadingDraws,
    begin_navigation,
    draw_sensor_errors,
    navigate,
)
from hda.navigation.layout import ESTIMATED, GROUND, SIZE, TILT, FilterMemory
from hda.navigation.propagation import carry
from tests.hda.navigation.filter_cases import ALONE, GRAVITY, TARGET, fly_descent

SEEDS = st.integers(0, 2**32 - 1)
HOVER = State(np.array([0.0, 0.0, 500.0]), np.zeros(3), 1200.0)


def hover(duration: float, period: float = 0.5) -> FlownPath:
    """Standing still above no known ground."""
    time = period * np.arange(round(duration / period) + 1, dtype=np.float64)
    return FlownPath(time, np.tile(HOVER.as_array(), (time.size, 1)), np.full(time.size - 1, np.nan))


def no_chance(periods: int) -> ReadingDraws:
    return ReadingDraws(np.zeros((periods, 16)), np.zeros((periods, 3)))


def deviations(unit: InertialUnit, duration: float) -> np.ndarray:
    """One sigma of position and velocity, up and down left out, after hovering with a known start."""
    system = replace(ALONE, inertial=unit, horizontal_error=0.0, vertical_error=0.0, velocity_error=0.0)
    start = begin_navigation(system, HOVER, TARGET, draw_sensor_errors(system, np.random.default_rng(0)))
    flown = hover(duration)
    after, _ = navigate(system, start, flown, no_chance(flown.periods))
    return np.sqrt(np.diag(after.covariance))[[0, 3]]


SILENT = InertialUnit(noise=0.0, bias=0.0, correlation_time=1e12, tilt=0.0)


def test_a_bias_of_300_micro_g_grows_to_a_quarter_of_a_metre_a_second_in_80_s():
    bias = 300e-6 * STANDARD_GRAVITY
    found = deviations(replace(SILENT, bias=bias), 80.0)
    np.testing.assert_allclose(found, [0.5 * bias * 80.0**2, bias * 80.0], rtol=1e-6)
    np.testing.assert_allclose(found, [9.4, 0.24], rtol=0.02)


def test_white_noise_is_integrated_once_and_twice():
    density = 35e-6 * STANDARD_GRAVITY
    found = deviations(replace(SILENT, noise=density), 80.0)
    np.testing.assert_allclose(found, density * np.sqrt([80.0**3 / 3.0, 80.0]), rtol=1e-9)
    assert found[1] == pytest.approx(3e-3, rel=0.05)


def test_a_tilt_turns_the_force_that_holds_the_vehicle_up():
    found = deviations(replace(SILENT, tilt=1e-3), 80.0)
    np.testing.assert_allclose(found, 1e-3 * 1.62 * np.array([80.0**2 / 2.0, 80.0]), rtol=1e-5)


def test_a_bias_that_wanders_keeps_its_variance():
    unit = InertialUnit(noise=0.0, bias=1e-3, correlation_time=20.0, tilt=0.0)
    system = replace(ALONE, inertial=unit)
    start = begin_navigation(system, HOVER, TARGET, draw_sensor_errors(system, np.random.default_rng(0)))
    after, _ = navigate(system, start, hover(60.0), no_chance(120))
    np.testing.assert_allclose(np.diag(after.covariance)[6:9], 1e-6, rtol=1e-9)


@settings(max_examples=30)
@given(seed=SEEDS)
def test_the_covariance_is_carried_by_the_derivative_of_the_truth(seed: int):
    """Finite differences of where a start, a bias and a tilt lead, through the equations of motion alone."""
    rng = np.random.default_rng(seed)
    system = replace(ALONE, inertial=InertialUnit(noise=0.0, correlation_time=300.0, bias=0.0), relief=0.0)
    force, time = rng.uniform(-3.0, 3.0, 3), rng.uniform(0.1, 2.0)
    measured = (force * time, 0.5 * force * time**2)

    def follow(point: np.ndarray) -> np.ndarray:
        """Truth of a vehicle whose unit reads `force`: turned by the tilt, less the bias."""
        r, v, b, tilt = point[:3], point[3:6], point[6:9], point[TILT:]
        felt = force + np.cross(tilt, force) - b + GRAVITY
        out = point.copy()
        out[:3], out[3:6] = r + v * time + 0.5 * felt * time**2, v + felt * time
        out[6:9] = b * math.exp(-time / 300.0)
        return out

    point = np.concatenate([rng.standard_normal(ESTIMATED), np.zeros(SIZE - ESTIMATED)])
    step = np.eye(SIZE)
    jacobian = np.column_stack([0.5 * (follow(point + s) - follow(point - s)) for s in step])
    spread = rng.standard_normal((SIZE, SIZE))
    memory = FilterMemory(point[:ESTIMATED].copy(), spread @ spread.T, np.zeros(4, dtype=np.int64))
    carry(memory, measured, time, GRAVITY, system.numbers(time))
    np.testing.assert_allclose(memory.mean, follow(point)[:ESTIMATED], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        memory.covariance, jacobian @ spread @ spread.T @ jacobian.T, rtol=1e-9, atol=1e-9
    )


@given(distance=st.floats(0.0, 300.0))
def test_the_ground_below_may_change_with_the_path_flown(distance: float):
    system = replace(ALONE, relief=7.0, relief_length=50.0)
    memory = FilterMemory(np.zeros(ESTIMATED), np.zeros((SIZE, SIZE)), np.zeros(4, dtype=np.int64))
    memory.mean[3:6] = [0.6 * distance, 0.8 * distance, -30.0]
    carry(memory, (-GRAVITY, -0.5 * GRAVITY), 1.0, GRAVITY, system.numbers(1.0))
    expected = 2.0 * 49.0 * (1.0 - math.exp(-distance / 50.0))
    assert memory.covariance[GROUND, GROUND] == pytest.approx(expected, abs=1e-9)


def test_the_unit_feels_what_the_engine_errs():
    """A perfect unit and a known start follow a descent whose engine is 5 % wrong, to rounding."""
    descent = fly_descent(np.random.default_rng(3))
    system = replace(
        ALONE, inertial=SILENT, horizontal_error=0.0, vertical_error=0.0, velocity_error=0.0, relief=0.0
    )
    start = begin_navigation(
        system, State.parse(descent.path[0]), TARGET, draw_sensor_errors(system, np.random.default_rng(0))
    )
    periods = descent.time.size - 1
    flown = FlownPath(descent.time, descent.path, np.full(periods, np.nan))
    _, log = navigate(system, start, flown, no_chance(periods))
    np.testing.assert_allclose(log.estimate[:, :6], descent.path[1:, :6], atol=1e-9)


def test_a_held_thrust_is_integrated_exactly_whatever_the_period():
    """One period of 10 s and a hundred of a tenth end in the same estimate and covariance."""
    thrust = np.array([800.0, -300.0, 2500.0])
    system = replace(ALONE, inertial=replace(SILENT, bias=1e-3), relief=0.0)
    errors = draw_sensor_errors(system, np.random.default_rng(5))
    ends = []
    for periods in (1, 100):
        time = np.linspace(0.0, 10.0, periods + 1)
        path = np.array([propagate(HOVER, thrust, t, PAPER_LANDER).as_array() for t in time])
        start = begin_navigation(system, HOVER, TARGET, errors)
        flown = FlownPath(time, path, np.full(periods, np.nan))
        after, _ = navigate(system, start, flown, no_chance(periods))
        ends.append((after.estimate, after.covariance))
    np.testing.assert_allclose(ends[0][0], ends[1][0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(ends[0][1], ends[1][1], rtol=1e-9, atol=1e-12)
