"""Looks that were misplaced: closed forms of what is left of a belief, and chance as an oracle."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import hda
from hda.flight.episode import begin_flight, observe
from hda.policies.beliefs.measured_belief import MeasuredBelief
from hda.policies.beliefs.placement_error import Placement, cell_weights, placement_variance
from hda.policies.beliefs.surroundings import infer_unseen
from hda.policies.hazard_aware import fuse_look, judge_ground
from hda.safety.criteria import SafetyCriteria
from hda.sensing.gridding import ElevationMap, PixelGrid
from hda.sensing.measured_look import MeasuredGround, assess_elevation

CRITERIA = SafetyCriteria()
DEVIATIONS = st.integers(1, 50).map(lambda steps: 0.05 * steps)


def uniform(deviation: float, side: int = 60, newest: float = 0.0) -> Placement:
    return Placement(np.full((side, side), newest + deviation**2, dtype=np.float32), newest)


def level(pixel_size: float, first: int, cells: int, count: int) -> MeasuredGround:
    """Level ground of `cells` cells along each side, `count` points in each."""
    grid = PixelGrid(first, first, pixel_size, cells, cells)
    parts = np.full(grid.shape, 40.0), np.full(grid.shape, 0.01), np.full(grid.shape, count, dtype=np.int32)
    return assess_elevation(ElevationMap(grid, *parts), CRITERIA)


def normal_cdf(value: float) -> float:
    return 0.5 * math.erfc(-value / math.sqrt(2.0))


def random_map(seed: int, side: int = 40) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(size=(side, side)).astype(np.float32)


@given(deviation=DEVIATIONS, north=st.booleans())
def test_a_straight_edge_becomes_the_normal_distribution_of_its_distance(deviation: float, north: bool):
    safe = np.zeros((60, 60), dtype=np.float32)
    safe[:, 30:] = 1.0
    found = uniform(deviation).blurred(safe.T.copy() if north else safe)
    expected = [normal_cdf((column + 0.5 - 30.0) / deviation) for column in range(60)]
    np.testing.assert_allclose((found.T if north else found)[30], expected, atol=2e-4)


def test_looks_without_error_change_nothing():
    safe = random_map(0)
    assert uniform(0.0, 40).blurred(safe) is safe
    assert uniform(0.0, 40, newest=1.7).blurred(safe) is safe


@given(deviation=DEVIATIONS, seed=st.integers(0, 1000))
def test_it_is_a_mean_and_knows_no_direction(deviation: float, seed: int):
    safe, placement = random_map(seed), uniform(deviation, 40)
    found = placement.blurred(safe)
    assert safe.min() - 1e-6 <= found.min() <= found.max() <= safe.max() + 1e-6
    assert placement.blurred(np.full((40, 40), 0.3, dtype=np.float32)) == pytest.approx(0.3, rel=1e-6)
    np.testing.assert_allclose(placement.blurred(safe.T.copy()).T, found, atol=1e-5)
    np.testing.assert_allclose(placement.blurred(safe[::-1].copy())[::-1], found, atol=1e-5)


@given(deviation=DEVIATIONS, common=st.sampled_from([0.25, 1.0, 4.0, 100.0]))
def test_an_error_that_all_looks_and_the_lander_share_does_not_count(deviation: float, common: float):
    safe = random_map(3)
    alone, shared = uniform(deviation, 40), uniform(deviation, 40, newest=common)
    assert shared.blurred(safe).tobytes() == alone.blurred(safe).tobytes()


def test_chance_agrees():
    """The ground that a misplaced look shows at a cell, drawn 40 000 times: five standard errors."""
    rng, deviation, draws = np.random.default_rng(5), 0.8, 40_000
    safe = (random_map(7) > 0.6).astype(np.float32)
    found = uniform(deviation, 40).blurred(safe)
    for row, column in ((20, 20), (11, 27), (30, 14)):
        moved = np.rint(rng.normal(0.0, deviation, (draws, 2))).astype(int)
        share = safe[row + moved[:, 0], column + moved[:, 1]].mean()
        error = 5.0 * math.sqrt(0.25 / draws)
        assert abs(share - found[row, column]) < error


def test_each_row_of_weights_is_a_distribution():
    weights = cell_weights()
    np.testing.assert_allclose(2.0 * weights.sum(axis=1) - weights[:, 0], 1.0)
    assert (np.diff(weights) <= 0.0).all()
    spread = np.sqrt(2.0 * weights @ np.arange(10.0) ** 2)
    deviations = 0.05 * np.arange(len(weights))
    np.testing.assert_allclose(spread[10:40], np.hypot(deviations, math.sqrt(1.0 / 12.0))[10:40], rtol=0.02)


def test_a_cell_that_two_looks_read_has_the_mean_variance_of_its_points():
    belief = MeasuredBelief.blank(np.array([100.0, 100.0, 50.0]), 32)
    belief = belief.fused(level(1.0, 80, 40, 1), CRITERIA, 100.0, 2.0)
    belief = belief.fused(level(1.0, 90, 20, 3), CRITERIA, 100.0, 0.4)
    inner, outer = belief.cell(np.array([100.5, 100.5, 0.0])), belief.cell(np.array([86.5, 86.5, 0.0]))
    assert belief.placement is not None
    assert inner is not None
    assert outer is not None
    assert belief.placement.newest == 0.4
    assert belief.placement.variance[inner] == pytest.approx((1 * 2.0 + 3 * 0.4) / 4)
    assert belief.placement.variance[outer] == pytest.approx(2.0)
    coarser = belief.fused(level(1.25, 64, 32, 2), CRITERIA, 100.0, 0.1)
    assert coarser.placement is not None
    assert coarser.placement.variance[inner] == belief.placement.variance[inner]  # the finer cells are kept


def test_a_newest_look_that_is_placed_worse_blurs_nothing():
    belief = MeasuredBelief.blank(np.array([100.0, 100.0, 50.0]), 32)
    belief = belief.fused(level(1.0, 80, 40, 1), CRITERIA, 100.0, 0.4)
    worse = belief.fused(level(1.0, 90, 20, 1), CRITERIA, 100.0, 2.0)
    told = infer_unseen(worse.probability(), worse.seen)
    assert judge_ground(worse).tobytes() == told.tobytes()


def test_a_greater_deviation_than_the_widest_is_taken_as_the_widest():
    safe = random_map(4)
    assert uniform(7.0, 40).blurred(safe).tobytes() == uniform(2.5, 40).blurred(safe).tobytes()


def test_a_finer_look_brings_its_own_place():
    belief = MeasuredBelief.blank(np.array([100.0, 100.0, 50.0]), 32)
    belief = belief.fused(level(1.75, 46, 24, 1), CRITERIA, 100.0, 2.0)
    belief = belief.fused(level(1.0, 90, 20, 1), CRITERIA, 100.0, 0.4)
    inner = belief.cell(np.array([100.5, 100.5, 0.0]))
    assert belief.placement is not None
    assert inner is not None
    assert belief.placement.variance[inner] == pytest.approx(0.4)


def test_a_lander_that_knows_its_state_has_the_belief_of_its_looks_alone():
    scenario = hda.sample_scenario("lidar", 6, 0)
    observation = observe(scenario, begin_flight(scenario))
    assert placement_variance(observation) == 0.0
    belief = fuse_look(observation, scenario.view, None)
    assert belief.placement is None
    told = infer_unseen(belief.probability(), belief.seen)
    assert judge_ground(belief).tobytes() == told.tobytes()


def test_a_filter_misplaces_the_first_look_and_the_second_is_told_apart():
    scenario = hda.sample_scenario("navigated", 6, 0)
    observation = observe(scenario, begin_flight(scenario))
    belief = fuse_look(observation, scenario.view, None)
    first = placement_variance(observation)
    assert 0.1 < first < 10.0
    assert belief.placement is not None
    alone = infer_unseen(belief.probability(), belief.seen)
    assert judge_ground(belief).tobytes() == alone.tobytes()  # the newest look is all there is
    assert observation.covariance is not None
    later = replace(observation, index=1, covariance=0.25 * observation.covariance)
    fused = fuse_look(later, scenario.view, belief)
    assert fused.placement is not None
    assert fused.placement.newest == pytest.approx(0.25 * first)
    assert judge_ground(fused).tobytes() != infer_unseen(fused.probability(), fused.seen).tobytes()
