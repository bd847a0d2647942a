"""ALHAT's choice of a site: the score against plain sums, what it must prefer, and its one scan."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hda
from guidance import State
from guidance.two_impulse import divert_cost
from hda.policies.rivals.alhat import AlhatSite, AlhatWeights, hazard_distance
from hda.policies.rivals.map_smoothing import smooth_map
from hda.task.observation import Observation

VIEW = hda.sample_scenario("paper", 0, 0).view
TARGET = np.array([500.0, 400.0, 50.0])
PIXELS = 16
SEEDS = st.integers(0, 2**32 - 1)


def look(safety: np.ndarray, height: float = 600.0, width: float = 32.0, mass: float = 1190.0) -> Observation:
    state = State(TARGET + np.array([0.0, 0.0, height]), np.array([0.0, 0.0, -25.0]), mass)
    return Observation(0, 0.0, state, TARGET, safety.astype(np.float32), width, 40.0)


def chosen(safety: np.ndarray, weights: AlhatWeights) -> tuple[int, int] | None:
    observation, selection = look(safety), AlhatSite(weights)
    site, memory = selection.select(observation, selection.begin(VIEW))
    assert memory.selected
    return observation.pixel(site)


@given(SEEDS)
def test_the_distance_is_to_the_nearest_hazard_or_the_edge(seed):
    hazard = np.random.default_rng(seed).random((7, 9)) < 0.2
    framed = np.pad(hazard, 1, constant_values=True)
    marked = np.argwhere(framed) - 1
    for row in range(7):
        for column in range(9):
            nearest = np.hypot(marked[:, 0] - row, marked[:, 1] - column).min()
            assert hazard_distance(hazard)[row, column] == pytest.approx(nearest)


@given(SEEDS, st.floats(0.2, 3.0))
def test_smoothing_is_the_gaussian_mean_of_what_is_seen(seed, dispersion):
    safety = np.random.default_rng(seed).random((24, 30))
    smooth = smooth_map(safety, dispersion)
    reach = math.ceil(3.0 * dispersion)
    share = [
        0.5 * (math.erf((k + 0.5) / (dispersion * 2**0.5)) - math.erf((k - 0.5) / (dispersion * 2**0.5)))
        for k in range(-reach, reach + 1)
    ]
    weight = np.outer(share, share) / sum(share) ** 2
    row, column = 12, 15
    part = safety[row - reach : row + reach + 1, column - reach : column + reach + 1]
    assert smooth[row, column] == pytest.approx((weight * part).sum())
    assert (smooth <= safety.max() + 1e-12).all()


@settings(max_examples=20)
@given(SEEDS)
def test_the_score_is_the_sum_that_the_docstring_states(seed):
    rng = np.random.default_rng(seed)
    weights = AlhatWeights(
        dispersion=0.0,
        clearance=rng.uniform(2.0, 20.0),
        distance=rng.uniform(0, 3),
        propellant=rng.uniform(0, 3),
    )
    safety = rng.choice([0.0, 0.4, 0.6, 1.0], size=(PIXELS, PIXELS), p=[0.2, 0.1, 0.1, 0.6])
    observation = look(safety)
    score = AlhatSite(weights).score(observation, VIEW)
    place = TARGET[:2, None] + observation.pixel_offset
    cost = divert_cost(observation.state, place[0], place[1], 50.0, VIEW.lander, VIEW.gravity)
    for row, column in rng.integers(0, PIXELS, (6, 2)):
        room = min(2.0 * hazard_distance(safety < 0.5)[row, column], weights.clearance)
        expected = observation.safety_map[row, column] + weights.distance * room / weights.clearance
        expected -= weights.propellant * (cost[row, column] - cost.min()) / (1190.0 - VIEW.lander.dry_mass)
        assert score[row, column] == pytest.approx(expected, rel=1e-6)


def test_of_two_clear_places_the_roomier_is_chosen_and_without_that_weight_the_cheaper():
    safety = np.zeros((PIXELS, PIXELS))
    safety[6:9, 6:9] = 1.0  # near, 2 m of room at its middle
    safety[9:16, 9:16] = 1.0  # further, up to 8 m
    roomy = chosen(safety, AlhatWeights(dispersion=0.0))
    assert roomy is not None
    assert min(roomy) >= 11
    cheap = chosen(safety, AlhatWeights(dispersion=0.0, distance=0.0, propellant=10.0))
    assert cheap in {(7, 7), (7, 8), (8, 7), (8, 8)}


def test_a_speck_that_the_dispersion_would_miss_is_left_for_an_even_field():
    safety = np.full((PIXELS, PIXELS), 0.8)
    safety[3, 3] = 1.0
    safety[2, 2:5] = safety[4, 2:5] = 0.0
    weights = AlhatWeights(dispersion=3.0, distance=0.0, propellant=0.0)
    assert chosen(safety, weights) != (3, 3)
    assert chosen(safety, replace(weights, dispersion=0.0)) == (3, 3)


def test_one_scan_from_within_range_decides():
    selection = AlhatSite()
    safety = np.zeros((PIXELS, PIXELS))
    safety[12:15, 12:15] = 1.0
    memory = selection.begin(VIEW)
    for waiting in (look(safety, height=1001.0), look(np.zeros((PIXELS, PIXELS)))):
        site, memory = selection.select(waiting, memory)
        np.testing.assert_array_equal(site, TARGET)
        assert not memory.selected
    site, memory = selection.select(look(safety, height=999.0), memory)
    assert look(safety).pixel(site) == (13, 13)
    other, memory = selection.select(look(safety[::-1]), memory)
    np.testing.assert_array_equal(other, TARGET)


@pytest.mark.parametrize("name", ["scan_range", "dispersion", "distance", "propellant"])
def test_weights_that_mean_nothing_are_refused(name):
    with pytest.raises(ValueError, match=name):
        AlhatWeights(**{name: -1.0})


def test_a_share_and_a_clearance_that_mean_nothing_are_refused():
    for share in (-0.1, 1.1):
        with pytest.raises(ValueError, match="hazard_probability"):
            AlhatWeights(hazard_probability=share)
    with pytest.raises(ValueError, match="clearance"):
        AlhatWeights(clearance=0.0)
