"""The attitude in the filter of a body: closed forms, independent turns, and whether it errs as it says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from guidance.arrays import Array
from guidance.state import State
from hda.navigation import (
    FlownPath,
    Gyroscope,
    InertialUnit,
    NavigationLog,
    NavigationState,
    NavigationSystem,
    ReadingDraws,
    Velocimeter,
    begin_navigation,
    draw_readings,
    draw_sensor_errors,
    navigate,
)
from hda.navigation.attitude import believe_into, carry_attitude, correct_attitude, drift
from hda.navigation.layout import GYRO_BIAS, TILT, TURNING_SIZE, FilterMemory, GyroNumbers, TrueErrors, Turn
from hda.navigation.sensor_errors import SensorErrors
from tests.hda.navigation.filter_cases import ALONE, TARGET, Descent, Run, fly_many, run_many

GYROSCOPE = Gyroscope()
SYSTEM = NavigationSystem(gyroscope=GYROSCOPE)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
STEADY = 1e12  # [s] in which a bias would wander
RUNS = 200
SEEDS = st.integers(0, 2**32 - 1)


def hover(system: NavigationSystem, duration: float, attitude: Array) -> NavigationState:
    """The filter after standing still above no known ground, with a start known but for its attitude."""
    sure = replace(system, horizontal_error=0.0, vertical_error=0.0, velocity_error=0.0)
    time = 0.1 * np.arange(round(duration / 0.1) + 1, dtype=np.float64)
    state = State(np.array([0.0, 0.0, 500.0]), np.zeros(3), 1200.0)
    start = begin_navigation(sure, state, TARGET, draw_sensor_errors(sure, np.random.default_rng(0)))
    path, periods = np.tile(state.as_array(), (time.size, 1)), time.size - 1
    flown = FlownPath(time, path, np.full(periods, np.nan), np.tile(attitude, (time.size, 1)))
    after, _ = navigate(sure, start, flown, draw_readings(np.random.default_rng(1), periods, gyroscope=True))
    return after


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.4, -0.3, 1.0)])
def test_by_the_gyroscope_alone_the_error_grows_as_noise_and_bias_say(turn: tuple[float, float, float]):
    """Variance of the angle: start + density t + (bias t)^2, whatever the attitude that is held."""
    attitude = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    system = replace(ALONE, gyroscope=replace(GYROSCOPE, correlation_time=STEADY))
    found = hover(system, 80.0, attitude).attitude_covariance
    expected = 1e-6 + GYROSCOPE.noise**2 * 80.0 + (GYROSCOPE.bias * 80.0) ** 2
    np.testing.assert_allclose(found, expected * np.eye(3), rtol=1e-5, atol=1e-12)
    assert GYROSCOPE.bias * 80.0 == pytest.approx(0.39e-3, rel=0.01)
    assert GYROSCOPE.noise * math.sqrt(80.0) == pytest.approx(0.18e-3, rel=0.02)


def test_a_bias_of_the_gyroscope_turns_the_force_that_holds_the_body_up():
    """Velocity g bias t^2 / 2 and position g bias t^3 / 6 across the vertical."""
    silent = InertialUnit(noise=0.0, bias=0.0, correlation_time=STEADY, tilt=0.0)
    system = replace(ALONE, inertial=silent, gyroscope=Gyroscope(0.0, 1e-5, STEADY))
    found = np.sqrt(np.diag(hover(system, 80.0, UPRIGHT).covariance))
    expected = 1.62 * 1e-5 * np.array([80.0**3 / 6.0, 80.0**2 / 2.0])
    np.testing.assert_allclose(found[[0, 3]], expected, rtol=5e-3)  # a period of 0.1 s in 80 s
    assert (found[[2, 5]] < 0.01 * expected).all()  # but for the true bias, which has leant the body's axis


@given(seed=SEEDS)
def test_the_error_drifts_apart_as_two_turns_that_are_followed_by_themselves(seed: int):
    """True and believed attitude turned by their own rates, exactly; the tilt is what lies between them."""
    rng = np.random.default_rng(seed)
    rates, error = 0.17 * rng.standard_normal((50, 3)), 1e-4 * rng.standard_normal(3)
    start = Rotation.from_rotvec(rng.standard_normal(3))
    tilt = 1e-3 * rng.standard_normal(3)
    true, believed = start, Rotation.from_rotvec(-tilt) * start
    for rate in rates:
        before = true
        true, believed = (
            turned * Rotation.from_rotvec(0.1 * own)
            for turned, own in ((true, rate), (believed, rate + error))
        )
        drift(tilt, before.as_quat(scalar_first=True), true.as_quat(scalar_first=True), error, 0.1)
    np.testing.assert_allclose((true * believed.inv()).as_rotvec(), tilt, atol=2e-6)


def a_memory(rng: np.random.Generator) -> FilterMemory:
    spread = rng.standard_normal((TURNING_SIZE, TURNING_SIZE))
    return FilterMemory(np.zeros(TURNING_SIZE), spread @ spread.T, np.zeros(4, dtype=np.int64))


@given(seed=SEEDS, time=st.floats(0.05, 2.0))
def test_the_covariance_is_carried_as_the_error_moves(seed: int, time: float):
    rng = np.random.default_rng(seed)
    memory = a_memory(rng)
    turned = Rotation.from_rotvec(rng.standard_normal(3))
    attitude, numbers = turned.as_quat(scalar_first=True), GyroNumbers(0.3, 0.7, 5.0)
    kept = math.exp(-time / 5.0)
    step, noise = np.eye(TURNING_SIZE), np.zeros(TURNING_SIZE)
    step[TILT : TILT + 3, GYRO_BIAS:] = -time * turned.as_matrix()
    step[GYRO_BIAS:, GYRO_BIAS:] *= kept
    noise[TILT : TILT + 3], noise[GYRO_BIAS:] = 0.3 * time, 0.49 * (1.0 - kept**2)
    expected = step @ memory.covariance @ step.T + np.diag(noise)
    errors = TrueErrors(np.zeros(3), 0.0, np.zeros(3), np.zeros(3), np.ones(3))
    carry_attitude(memory, errors, Turn(attitude, attitude, np.zeros(6), numbers), time)
    np.testing.assert_allclose(memory.covariance, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(errors.gyro_bias, kept)


@given(seed=SEEDS)
def test_a_correction_turns_the_believed_attitude(seed: int):
    rng = np.random.default_rng(seed)
    memory, tilt = a_memory(rng), 1e-3 * rng.standard_normal(3)
    true, (before, after) = Rotation.from_rotvec(rng.standard_normal(3)), np.empty((2, 4))
    learnt = 1e-3 * rng.standard_normal(3)
    memory.mean[TILT : TILT + 3] = learnt
    believe_into(true.as_quat(scalar_first=True), tilt, before)
    correct_attitude(memory, tilt)
    believe_into(true.as_quat(scalar_first=True), tilt, after)
    np.testing.assert_array_equal(memory.mean[TILT : TILT + 3], 0.0)
    first, second = (Rotation.from_quat(some, scalar_first=True) for some in (before, after))
    np.testing.assert_allclose((second * first.inv()).as_rotvec(), learnt, atol=1e-5)


def read_once(lean: float, tilt: Array, height: float = 300.0) -> tuple[NavigationState, NavigationLog]:
    """One reading of a velocimeter alone, by a body that leans to the east and otherwise errs in nothing."""
    quiet = replace(ALONE, gyroscope=GYROSCOPE, velocimeter=Velocimeter(bias=0.0))
    errors = SensorErrors(np.zeros(3), 0.0, np.zeros(3), tilt, np.zeros(3), np.zeros(3))
    state = State(np.array([0.0, 0.0, 500.0]), np.array([20.0, -5.0, -30.0]), 1200.0)
    path = np.tile(state.as_array(), (2, 1))
    path[1, :3] += 0.5 * path[1, 3:6]
    attitude = Rotation.from_rotvec([0.0, lean, 0.0]).as_quat(scalar_first=True)
    flown = FlownPath(np.array([0.0, 0.5]), path, np.array([height]), np.tile(attitude, (2, 1)))
    draws = ReadingDraws(np.zeros((1, 16)), np.zeros((1, 3)), np.zeros((2, 6)))
    start = begin_navigation(quiet, state, TARGET, errors)
    return navigate(quiet, start, flown, draws)


@given(lean=st.floats(-0.6, 0.6))
def test_beams_turn_with_the_body_and_are_used_where_it_believes_them(lean: float):
    """Without errors nothing is learnt but sureness; a tilt errs as the beams that it turns."""
    after, log = read_once(lean, np.zeros(3))
    assert log.innovation_square[0, 1] < 1e-9
    assert (np.diag(after.covariance)[3:6] < 0.1**2).all()
    tilted, log = read_once(lean, np.array([2e-3, -1e-3, 0.0]))
    assert log.innovation_square[0, 1] > 0.1
    assert np.linalg.norm(tilted.errors.tilt) < np.linalg.norm([2e-3, -1e-3, 0.0])


def test_a_beam_that_is_too_slant_or_too_long_gives_no_reading():
    """Two beams cannot tell three speeds; none tells nothing."""

    def seen(after: NavigationState) -> int:
        return int((np.linalg.eigvalsh(after.covariance[3:6, 3:6]) < 0.1**2).sum())

    assert seen(read_once(math.radians(30.0), np.zeros(3))[0]) == 3
    assert seen(read_once(math.radians(-40.0), np.zeros(3))[0]) == 2  # the first at 62.5 deg
    slant, log = read_once(math.radians(-100.0), np.zeros(3))
    assert seen(slant) == 0
    assert np.isnan(log.innovation_square[0, 1])
    assert seen(read_once(math.radians(-30.0), np.zeros(3), height=2800.0)[0]) == 2  # 4.6 km along the first


def sway(descent: Descent, rng: np.random.Generator) -> Descent:
    """The same descent by a body that leans by up to some 25 degrees, to and fro in 15 to 30 s, and turns."""
    period, phase, size = rng.uniform(15.0, 30.0, 3), rng.uniform(0.0, 6.0, 3), rng.uniform(0.1, 0.3, 3)
    angles = size * np.sin(2.0 * math.pi * descent.time[:, None] / period + phase)
    return replace(descent, attitude=Rotation.from_rotvec(angles).as_quat(scalar_first=True))


@pytest.fixture(scope="module")
def swaying() -> list[Descent]:
    return [sway(d, np.random.default_rng([7, k])) for k, d in enumerate(fly_many(RUNS, seed=20))]


def check_squares(runs: list[Run], pick: list[int]) -> None:
    """Mean squares over the runs at each look, and at the end, within their 95 % band but for one look."""
    legs = min(len(run.error) for run in runs)
    low, high = chi2.ppf([0.025, 0.975], len(pick) * len(runs)) / len(runs)
    means = []
    for k in [*range(legs - 1), -1]:
        errors = np.array([run.error[k, pick] for run in runs])
        inverse = np.linalg.inv(np.array([run.covariance[k][np.ix_(pick, pick)] for run in runs]))
        means.append(float(np.einsum("ri,rij,rj->r", errors, inverse, errors).mean()))
    outside = sum(not low <= mean <= high for mean in means)
    assert outside <= 1, means
    tail = 0.5e-3 / len(means)
    low, high = chi2.ppf([tail, 1.0 - tail], len(pick) * len(runs)) / len(runs)
    assert low <= min(means) <= max(means) <= high


ANGLES, BIASES = list(range(TILT, TILT + 3)), list(range(GYRO_BIAS, GYRO_BIAS + 3))
KNOWN = [*range(13), *ANGLES, *BIASES]
"""All that is estimated."""


def test_attitude_and_all_else_err_as_the_covariance_says(swaying: list[Descent]):
    runs = run_many(SYSTEM, swaying, seed=31)
    for pick in (ANGLES, BIASES, KNOWN):
        check_squares(runs, pick)
    for run in runs[:20]:
        for covariance in run.covariance:
            scale = np.sqrt(np.diag(covariance))
            assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 0.0
    deviation = np.mean([np.sqrt(np.diag(run.covariance[-1]))[ANGLES] for run in runs], axis=0)
    alone = math.sqrt(1e-6 + GYROSCOPE.noise**2 * 60.0 + (GYROSCOPE.bias * 60.0) ** 2)
    assert (deviation < alone).all()


def test_an_attitude_that_errs_far_more_still_errs_as_it_says(swaying: list[Descent]):
    """Four times the start's error, and a gyroscope a hundred times worse: the readings must carry it."""
    loose = replace(
        SYSTEM,
        inertial=InertialUnit(tilt=4e-3),
        gyroscope=Gyroscope(100.0 * GYROSCOPE.noise, 100.0 * GYROSCOPE.bias, 100.0),
    )
    runs = run_many(loose, swaying, seed=32)
    check_squares(runs, ANGLES)
    check_squares(runs, KNOWN)
    alone = math.sqrt(16e-6 + (100.0 * GYROSCOPE.noise) ** 2 * 50.0)
    across = np.mean([np.sqrt(np.diag(run.covariance[-1]))[TILT : TILT + 2] for run in runs])
    assert across < 0.6 * alone


def stand(state: State) -> FlownPath:
    """Two periods of an upright body that does not move, 1 m above the ground."""
    time, states = 0.5 * np.arange(3, dtype=np.float64), np.tile(state.as_array(), (3, 1))
    return FlownPath(time, states, np.ones(2), np.tile(UPRIGHT, (3, 1)))


def test_a_path_without_attitudes_is_refused_where_there_is_a_gyroscope():
    state = State(np.array([0.0, 0.0, 500.0]), np.zeros(3), 1200.0)
    start = begin_navigation(SYSTEM, state, TARGET, draw_sensor_errors(SYSTEM, np.random.default_rng(0)))
    draws = draw_readings(np.random.default_rng(0), 2, gyroscope=True)
    with pytest.raises(ValueError, match="must have attitudes"):
        navigate(SYSTEM, start, replace(stand(state), attitudes=None), draws)


@pytest.mark.parametrize(("begun", "taken_on"), [(ALONE, SYSTEM), (SYSTEM, ALONE)])
def test_a_filter_of_a_system_with_other_rows_is_refused(begun: NavigationSystem, taken_on: NavigationSystem):
    state = State(np.array([0.0, 0.0, 500.0]), np.zeros(3), 1200.0)
    start = begin_navigation(begun, state, TARGET, draw_sensor_errors(begun, np.random.default_rng(0)))
    draws = draw_readings(np.random.default_rng(0), 2, gyroscope=True)
    with pytest.raises(ValueError, match=r"navigation must be of a system with(out)? a gyroscope"):
        navigate(taken_on, start, stand(state), draws)


@pytest.mark.parametrize("shape", [(1, 6), (2, 5), (12,)])
def test_draws_of_a_gyroscope_that_do_not_fit_are_refused(shape: tuple[int, ...]):
    state = State(np.array([0.0, 0.0, 500.0]), np.zeros(3), 1200.0)
    start = begin_navigation(SYSTEM, state, TARGET, draw_sensor_errors(SYSTEM, np.random.default_rng(0)))
    draws = replace(draw_readings(np.random.default_rng(0), 2), gyro=np.zeros(shape))
    with pytest.raises(ValueError, match="gyro must have shape"):
        navigate(SYSTEM, start, stand(state), draws)


@pytest.mark.parametrize("name", ["noise", "bias", "correlation_time"])
def test_a_gyroscope_that_cannot_be_is_refused(name: str):
    with pytest.raises(ValueError, match=name):
        replace(GYROSCOPE, **{name: -1.0})
