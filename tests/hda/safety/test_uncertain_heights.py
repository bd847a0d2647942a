"""Algorithm 1 with an error of each height of its own: the literal loop, and the common error."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.safety.criteria import SafetyCriteria
from hda.safety.lander_footprint import make_footprint
from hda.safety.safety_map import assess_on_board, assess_safety
from tests.hda.safety.test_safety_map import LANDERS, SEEDS, rough_ground
from tests.oracles import algorithm_1


@pytest.mark.parametrize("lander", LANDERS)
@given(seed=SEEDS, relief=st.sampled_from([0.02, 0.1, 0.5]))
@settings(max_examples=8)
def test_equals_the_literal_algorithm(lander: str, seed: int, relief: float):
    pixel_size, limits = LANDERS[lander]
    span = make_footprint(limits.footprint_diameter, limits.pad_diameter, pixel_size).span
    rng = np.random.default_rng(seed)
    dem = pixel_size * rough_ground(seed, (span + 3, span + 4), relief)
    noise = rng.uniform(0.001, 0.3, dem.shape)
    hole = rng.random(dem.shape) < 0.001
    dem[hole] = noise[hole] = np.nan
    expected = algorithm_1.assess(dem, pixel_size, limits, noise)
    own: dict[str, Any] = limits._asdict() | {"range_noise": noise}
    actual = assess_safety(dem, pixel_size, **own)
    np.testing.assert_allclose(actual.slope, expected.slope, rtol=0, atol=1e-9)
    np.testing.assert_allclose(actual.roughness, expected.roughness, rtol=0, atol=1e-9)
    np.testing.assert_allclose(actual.probability, expected.probability, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(actual.deterministic, expected.deterministic)


@given(seed=SEEDS, noise=st.sampled_from([0.0, 0.01, 0.05, 0.3]))
@settings(max_examples=20)
def test_one_error_in_every_cell_is_the_common_error(seed: int, noise: float):
    dem = rough_ground(seed, (40, 300), 0.05)  # more than a block of columns
    common = assess_safety(dem, range_noise=noise)
    own = assess_safety(dem, range_noise=np.full(dem.shape, noise))
    for name in ("slope", "roughness", "deterministic"):
        np.testing.assert_array_equal(getattr(own, name), getattr(common, name))
    np.testing.assert_allclose(own.probability, common.probability, rtol=0, atol=1e-12)


def test_the_cell_that_is_least_sure_decides_though_another_is_higher():
    dem, noise = np.zeros((11, 11)), np.full((11, 11), 0.01)
    dem[6, 5], dem[4, 5] = 0.25, 0.20  # under the limit of 0.30 m by 5 deviations, and by one
    noise[4, 5] = 0.10
    probability = assess_safety(dem, range_noise=noise).probability[5, 5]
    assert probability == pytest.approx(0.5 * math.erfc(-1.0 / math.sqrt(2.0)), abs=1e-12)


def test_more_error_makes_safe_ground_less_sure_and_unsafe_ground_less_sure_too():
    dem = rough_ground(3, (60, 60), 0.05)
    sure = assess_safety(dem, range_noise=np.full(dem.shape, 0.02))
    unsure = assess_safety(dem, range_noise=np.full(dem.shape, 0.2))
    safe, steep = sure.deterministic, sure.slope > math.radians(10.0)
    assert safe.any()
    assert (unsure.probability[safe] <= sure.probability[safe] + 1e-12).all()
    assert (unsure.probability[~safe & ~steep] >= sure.probability[~safe & ~steep] - 1e-12).all()


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        (np.zeros((20, 21)), "range_noise must have the shape of dem"),
        (np.full((20, 20), -0.1), "range_noise must be finite and at least 0"),
        (np.full((20, 20), np.nan), "range_noise must be finite and at least 0"),
        ([["a"]], "range_noise must be a number or an array of numbers"),
    ],
)
def test_bad_errors_are_named(noise, message: str):
    with pytest.raises(ValueError, match=message):
        assess_safety(np.zeros((20, 20)), range_noise=noise)


@given(
    seed=st.integers(0, 2**32 - 1),
    side=st.sampled_from([1.0, 1.25, 2.5]),
    boulders=st.floats(0.0, 0.1),
    rise=st.floats(0.0, 0.35),
)
@settings(max_examples=60)
def test_on_board_runs_of_steep_sites_change_nothing(
    seed: int, side: float, boulders: float, rise: float
) -> None:
    """Steep sites in runs of all lengths, and holes: against the path of one common error, without runs."""
    rng = np.random.default_rng(seed)
    dem = rng.normal(scale=0.03, size=(30, 70)) + rise * side * np.abs(np.arange(70) - 35.0)
    dem += 1.5 * (rng.random(dem.shape) < boulders)
    dem[rng.random(dem.shape) < 0.004] = np.nan
    whole = assess_safety(dem, side, range_noise=0.02)
    probability, known = assess_on_board(dem, side, np.full(dem.shape, 0.02), SafetyCriteria())
    np.testing.assert_array_equal(known, ~np.isnan(whole.slope))
    np.testing.assert_allclose(probability, whole.probability, rtol=0, atol=1e-12)
