"""The belief over the map: against brute-force Bayes, and what its definition promises."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import State
from hda.belief_statistics import level_shares
from hda.ground.library import Ground, load_tile
from hda.policies.beliefs.belief import LEVEL_SHARES, LEVELS, SafetyBelief
from hda.sensing.lidar import Lidar, look
from hda.task.observation import Observation
from hda.task.presets import PRESETS
from tests.oracles.map_belief import Look, Sensor, probability_safe, readings_of_cell

PLANE = 50.0


def observe(lidar, position, target, probability, rng, index=0) -> Observation:
    noise = rng.standard_normal((lidar.pixels, lidar.pixels), dtype=np.float32)
    seen = look(lidar, position, target, probability, noise)
    state = State(position, np.array([0.0, 0.0, -20.0]), 1190.0)
    return Observation(index, 5.0 * index, state, target, seen, lidar.width(position, target), 30.0)


def small_world(seed: int, noise: float):
    """Three noisy looks of 9 x 9 pixels at a map of 24 x 24 cells, one partly beyond the off-nadir limit."""
    rng = np.random.default_rng(seed)
    probability = rng.choice(LEVELS, size=(24, 24)).astype(np.float32)
    lidar = Lidar(pixels=9, noise=noise, field_of_view=math.radians(8.0))
    looks = []
    for k, height in enumerate((120.0, 80.0, 30.0)):
        target = np.array([*rng.uniform(8.0, 16.0, 2), PLANE])
        position = target + np.array([*rng.uniform(-0.36, 0.36, 2) * height, height])
        looks.append(observe(lidar, position, target, probability, rng, k))
    return lidar, probability, looks


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), noise=st.sampled_from([0.5, 1.5, 4.0]))
def test_fusion_is_bayes_rule_cell_by_cell(seed, noise):
    lidar, _, looks = small_world(seed, noise)
    belief = SafetyBelief.blank(np.array([12.0, 12.0]), 12)
    for observation in looks:
        belief = belief.fused(observation, lidar)
    sensor = Sensor(lidar.noise, lidar.noise_range, lidar.off_nadir_limit)
    slow = [Look(o.state.position, o.target, o.width, o.safety_map) for o in looks]
    posterior = belief.probability()
    counts = np.zeros((24, 24), dtype=int)
    counts[belief.readings.place] = belief.readings.count
    np.testing.assert_array_equal(belief.seen, counts > 0)
    for row in range(24):
        for column in range(24):
            readings = readings_of_cell((row, column), slow, sensor)
            assert counts[row, column] == len(readings)
            expected = probability_safe(readings, LEVELS, LEVEL_SHARES)
            assert posterior[row, column] == pytest.approx(expected, abs=2e-5)


def test_the_order_of_looks_does_not_matter_and_the_old_belief_is_left_alone():
    lidar, _, looks = small_world(3, 1.5)
    blank = SafetyBelief.blank(np.array([12.0, 12.0]), 12)
    forward = backward = blank
    for k in range(3):
        before, said = forward, forward.probability()
        forward = forward.fused(looks[k], lidar)
        backward = backward.fused(looks[2 - k], lidar)
        np.testing.assert_array_equal(before.probability(), said)
    np.testing.assert_allclose(forward.probability(), backward.probability(), atol=1e-5)
    assert not blank.seen.any()
    assert blank.readings.log_likelihood.size == 0


def test_a_posterior_is_right_as_often_as_it_says():
    """Maps with all levels equally likely: of cells with p safe by the likelihood, a share p is."""
    rng = np.random.default_rng(5)
    lidar = Lidar(noise=2.0)
    shares = np.full(LEVELS.size, 1.0 / LEVELS.size)  # every level often enough to test
    believed, truth = [], []
    for _ in range(6):
        probability = rng.choice(LEVELS, size=(60, 60), p=shares).astype(np.float32)
        target = np.array([30.0, 30.0, PLANE])
        observation = observe(lidar, target + np.array([0.0, 0.0, 200.0]), target, probability, rng)
        belief = SafetyBelief.blank(target, 30).fused(observation, lidar)
        likelihood = belief.readings.log_likelihood[belief.readings.count > 0]
        weight = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
        believed.append(weight[:, 4:].sum(axis=1) / weight.sum(axis=1))
        truth.append((probability > 0.5)[belief.seen])
    p, safe = np.concatenate(believed), np.concatenate(truth)
    for low in np.arange(0.0, 1.0, 0.2):
        inside = (p >= low) & (p <= low + 0.2)
        error = 4.0 * math.sqrt(0.25 / inside.sum())
        assert inside.sum() > 50
        assert abs(p[inside].mean() - safe[inside].mean()) < error


def test_unseen_cells_keep_the_prior_and_cells_too_far_from_the_vertical_are_unseen():
    lidar = Lidar()
    rng = np.random.default_rng(0)
    probability = np.ones((400, 400), dtype=np.float32)
    target = np.array([200.0, 200.0, PLANE])
    position = target + np.array([300.0, 0.0, 900.0])  # 18 deg off the vertical: the far side is beyond 20
    observation = observe(lidar, position, target, probability, rng)
    belief = SafetyBelief.blank(target, 150).fused(observation, lidar)
    prior = LEVEL_SHARES[4:].sum() / LEVEL_SHARES.sum()
    np.testing.assert_allclose(belief.probability()[~belief.seen], prior, rtol=1e-5)
    rows, columns = np.nonzero(belief.seen)
    x, y = belief.corner[0] + columns + 0.5, belief.corner[1] + rows + 0.5
    angle = np.degrees(np.arctan2(np.hypot(x - position[0], y - position[1]), 900.0))
    assert angle.max() < 20.1
    assert (belief.probability()[belief.seen] > 0.99).mean() > 0.999
    assert (observation.safety_map == 0.0).sum() > 100


def test_outside_the_map_is_unsafe():
    lidar = Lidar()
    target = np.array([10.0, 100.0, PLANE])
    probability = np.ones((200, 200), dtype=np.float32)
    observation = observe(
        lidar, target + np.array([0.0, 0.0, 600.0]), target, probability, np.random.default_rng(1)
    )
    belief = SafetyBelief.blank(target, 80).fused(observation, lidar)
    outside = belief.seen & (belief.corner[0] + np.arange(160) < 0)[None, :]
    assert outside.sum() > 100
    assert belief.probability()[outside].max() < 1e-3


def test_a_noiseless_sensor_is_believed():
    lidar = Lidar(noise=0.0)
    rng = np.random.default_rng(2)
    probability = rng.choice([0.0, 1.0], size=(100, 100)).astype(np.float32)
    target = np.array([50.0, 50.0, PLANE])
    observation = observe(lidar, target + np.array([0.0, 0.0, 150.0]), target, probability, rng)
    belief = SafetyBelief.blank(target, 50).fused(observation, lidar)
    np.testing.assert_allclose(belief.probability()[belief.seen], probability[belief.seen], atol=1e-6)


def test_sites_and_cells_are_each_others_inverse():
    belief = SafetyBelief.blank(np.array([310.7, 402.2]), 40)
    site = belief.site(7, 21, PLANE)
    assert belief.cell(site) == (7, 21)
    assert belief.cell(np.array([0.0, 0.0, PLANE])) is None
    assert site[2] == PLANE


def test_level_shares_are_those_of_the_training_tiles():
    measured = []
    for ground in dict.fromkeys(Ground(preset.terrain, preset.criteria) for preset in PRESETS.values()):
        tile = load_tile(ground, 41, "train")  # not among those counted
        measured.append(level_shares(tile.probability[10:-10, 10:-10]))
    mean = np.mean(measured, axis=0)
    assert LEVEL_SHARES.sum() == pytest.approx(1.0, abs=2e-3)
    assert np.abs(mean - LEVEL_SHARES).max() < 0.05  # tiles differ
    assert mean[[0, -1]].sum() > 0.98  # nearly all ground is one or the other
