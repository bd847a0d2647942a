"""One measurement against the textbook's dense matrices, least squares, and closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.navigation import Velocimeter
from hda.navigation.layout import ESTIMATED, GROUND, POSITION, SIZE, VELOCITY, FilterMemory
from hda.navigation.schmidt_update import take_in, update

SEEDS = st.integers(0, 2**32 - 1)
OPEN = 1e300


def random_memory(rng: np.random.Generator, considered: float = 1.0) -> FilterMemory:
    spread = rng.standard_normal((SIZE, SIZE))
    spread[ESTIMATED:] *= considered
    return FilterMemory(rng.standard_normal(ESTIMATED), spread @ spread.T, np.zeros(4, dtype=np.int64))


def random_measurement(rng: np.random.Generator, rows: int):
    return rng.standard_normal((rows, SIZE)), rng.standard_normal(rows), rng.uniform(0.1, 2.0, rows)


@settings(max_examples=40)
@given(seed=SEEDS, rows=st.integers(1, 3))
def test_it_is_the_optimal_gain_on_what_is_estimated_and_none_on_the_rest(seed: int, rows: int):
    rng = np.random.default_rng(seed)
    memory = random_memory(rng)
    design, innovation, noise = random_measurement(rng, rows)
    mean, before = memory.mean.copy(), memory.covariance.copy()
    predicted = design @ before @ design.T + np.diag(noise)
    gain = before @ design.T @ np.linalg.inv(predicted)
    gain[ESTIMATED:] = 0.0
    left = np.eye(SIZE) - gain @ design
    after = left @ before @ left.T + gain @ np.diag(noise) @ gain.T
    square = update(memory, design, innovation, noise, OPEN)
    assert square == pytest.approx(innovation @ np.linalg.solve(predicted, innovation))
    np.testing.assert_allclose(memory.mean, mean + gain[:ESTIMATED] @ innovation, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(memory.covariance, after, rtol=1e-8, atol=1e-8)
    np.testing.assert_array_equal(memory.covariance, memory.covariance.T)
    np.testing.assert_allclose(memory.covariance[ESTIMATED:, ESTIMATED:], before[ESTIMATED:, ESTIMATED:])
    assert np.linalg.eigvalsh(memory.covariance).min() > -1e-9 * np.linalg.eigvalsh(before).max()


@settings(max_examples=25)
@given(seed=SEEDS)
def test_where_nothing_is_considered_it_is_weighted_least_squares(seed: int):
    """Five measurements one after the other, and all at once by their normal equations."""
    rng = np.random.default_rng(seed)
    memory = random_memory(rng, considered=0.0)
    prior = memory.covariance[:ESTIMATED, :ESTIMATED].copy()
    start = memory.mean.copy()
    information, right = np.linalg.inv(prior), np.linalg.solve(prior, start)
    for rows in (1, 3, 2, 3, 1):
        design, value, noise = random_measurement(rng, rows)
        seen = design[:, :ESTIMATED]
        update(memory, design, value - seen @ memory.mean, noise, OPEN)
        information += seen.T @ np.diag(1.0 / noise) @ seen
        right += seen.T @ (value / noise)
    scale = np.linalg.cond(prior) * 1e-13
    covariance = np.linalg.inv(information)
    np.testing.assert_allclose(memory.covariance[:ESTIMATED, :ESTIMATED], covariance, rtol=1e-6, atol=scale)
    np.testing.assert_allclose(memory.mean, covariance @ right, rtol=1e-6, atol=1e-5 + scale)


def test_no_number_of_readings_sees_below_their_common_bias():
    """n readings of noise s with a common bias of deviation b: the variance is b^2 + s^2/n."""
    noise, bias, readings = 0.5, 0.3, 400
    memory = FilterMemory(np.zeros(ESTIMATED), np.zeros((SIZE, SIZE)), np.zeros(4, dtype=np.int64))
    memory.covariance[GROUND, GROUND] = 1e8
    memory.covariance[ESTIMATED, ESTIMATED] = bias**2
    design = np.zeros((1, SIZE))
    design[0, GROUND], design[0, ESTIMATED] = -1.0, 1.0
    for _ in range(readings):
        update(memory, design, np.zeros(1), np.full(1, noise**2), OPEN)
    assert memory.covariance[GROUND, GROUND] == pytest.approx(bias**2 + noise**2 / readings, rel=1e-3)


@given(angle=st.floats(5.0, 60.0), noise=st.floats(1e-3, 1.0))
def test_three_beams_know_the_velocity_as_their_geometry_says(angle: float, noise: float):
    """Horizontal sqrt(2/3) s / sin t, vertical s / (sqrt 3 cos t), whatever the azimuth."""
    memory = FilterMemory(np.zeros(ESTIMATED), np.zeros((SIZE, SIZE)), np.zeros(4, dtype=np.int64))
    for axis in range(3):
        memory.covariance[VELOCITY + axis, VELOCITY + axis] = 1e6
    design = np.zeros((3, SIZE))
    design[:, VELOCITY : VELOCITY + 3] = -Velocimeter(beam_angle=math.radians(angle)).beams
    update(memory, design, np.zeros(3), np.full(3, noise**2), OPEN)
    horizontal = math.sqrt(2.0 / 3.0) * noise / math.sin(math.radians(angle))
    vertical = noise / (math.sqrt(3.0) * math.cos(math.radians(angle)))
    block = memory.covariance[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3]
    expected = np.diag([horizontal**2, horizontal**2, vertical**2])
    np.testing.assert_allclose(block, expected, rtol=1e-3, atol=1e-6 * noise**2)


@given(seed=SEEDS)
def test_the_gate_changes_nothing_when_it_rejects(seed: int):
    rng = np.random.default_rng(seed)
    memory = random_memory(rng)
    design, innovation, noise = random_measurement(rng, 3)
    before = memory.mean.tobytes(), memory.covariance.tobytes()
    square = update(memory, design, innovation, noise, 0.0)
    assert square > 0.0
    assert (memory.mean.tobytes(), memory.covariance.tobytes()) == before


@pytest.mark.parametrize("patience", [1, 3, 5])
def test_after_its_patience_it_doubts_itself_and_takes_the_reading(patience: int):
    memory = FilterMemory(np.zeros(ESTIMATED), 0.01 * np.eye(SIZE), np.zeros(4, dtype=np.int64))
    design = np.zeros((3, SIZE))
    design[:, POSITION : POSITION + 3] = np.eye(3)
    far = np.array([50.0, -20.0, 10.0])
    gating = (16.27, patience, 2, POSITION, POSITION + 3)
    for k in range(1, patience):
        assert take_in(memory, design, far - memory.mean[:3], np.full(3, 0.01), gating) > 16.27
        assert memory.rejections[2] == k
        np.testing.assert_array_equal(memory.mean, 0.0)
    take_in(memory, design, far - memory.mean[:3], np.full(3, 0.01), gating)
    assert memory.rejections[2] == 0
    np.testing.assert_allclose(memory.mean[:3], far, atol=0.01)
    np.testing.assert_array_equal(memory.mean[3:], 0.0)


@given(angle=st.floats(1.0, 89.0), gate=st.sampled_from([2.4, 16.27]), azimuth=st.floats(-3.1, 3.1))
def test_beams_at_any_angle_are_believed_again(angle: float, gate: float, azimuth: float):
    """Close beams hardly see a horizontal velocity: the doubt grows until what they read passes."""
    memory = FilterMemory(np.zeros(ESTIMATED), 1e-4 * np.eye(SIZE), np.zeros(4, dtype=np.int64))
    design = np.zeros((3, SIZE))
    design[:, VELOCITY : VELOCITY + 3] = -Velocimeter(beam_angle=math.radians(angle)).beams
    truth = np.array([20.0 * math.cos(azimuth), 20.0 * math.sin(azimuth), -3.0])
    innovation = design[:, VELOCITY : VELOCITY + 3] @ truth
    gating = (gate, 1, 1, VELOCITY, VELOCITY + 3)
    assert take_in(memory, design, innovation, np.full(3, 1e-6), gating) > gate
    assert memory.rejections[1] == 0
    np.testing.assert_allclose(memory.mean[VELOCITY : VELOCITY + 3], truth, atol=0.5)


def test_one_reading_that_is_far_off_does_no_harm():
    memory = FilterMemory(np.zeros(ESTIMATED), 0.01 * np.eye(SIZE), np.zeros(4, dtype=np.int64))
    design = np.zeros((1, SIZE))
    design[0, POSITION] = 1.0
    gating = (10.83, 3, 0, POSITION, POSITION + 1)
    for _ in range(5):  # two wrong, one right, again and again: never three in a row
        for reading in (50.0, 50.0, 0.0):
            take_in(memory, design, reading - memory.mean[:1], np.full(1, 0.01), gating)
    assert abs(memory.mean[POSITION]) < 1e-12
