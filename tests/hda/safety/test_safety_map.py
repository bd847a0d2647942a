"""Algorithm 1 against a literal version of itself, on analytic ground, and under symmetries."""

import math
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.safety.criteria import SafetyCriteria
from hda.safety.lander_footprint import make_footprint
from hda.safety.safety_map import SafetyMap, assess_safety
from tests.oracles import algorithm_1

NOISE = 0.05 / 3.0
SEEDS = st.integers(0, 2**32 - 1)


def rough_ground(seed: int, shape: tuple[int, int], relief: float) -> np.ndarray:
    """A tilted, rough surface with some blocks and pits: on both sides of every limit."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices(shape)
    tilt = rng.uniform(-0.15, 0.15, size=2)
    blocks = rng.choice([0.0, 0.35, -0.5], size=shape, p=[0.97, 0.015, 0.015])
    return tilt[0] * rows + tilt[1] * columns + relief * rng.standard_normal(shape) + blocks


def assert_same(first: SafetyMap, second: SafetyMap, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(first.slope, second.slope, rtol=0, atol=tolerance)
    np.testing.assert_allclose(first.roughness, second.roughness, rtol=0, atol=tolerance)
    np.testing.assert_allclose(first.probability, second.probability, rtol=0, atol=50 * tolerance)
    # A cell at the very limit may fall either way.
    decided = np.abs(np.nan_to_num(first.roughness, nan=9.0) - 0.3) > 10 * tolerance
    np.testing.assert_array_equal(first.deterministic[decided], second.deterministic[decided])


def transformed(safety: SafetyMap, turn) -> SafetyMap:
    return SafetyMap(
        turn(safety.deterministic), turn(safety.probability), turn(safety.slope), turn(safety.roughness)
    )


# Geometry of the raster


def test_the_default_lander_has_seven_orientations_of_41_to_57_cells():
    footprint = make_footprint(10.0, 1.0, 1.0)
    cells = [{tuple(cell) for cell in footprint.footprint_cells(k).tolist()} for k in range(7)]
    assert len(footprint.pads) == 7
    assert sorted({len(inside) for inside in cells}) == [41, 49, 57]
    assert len(set.union(*cells)) == 69
    assert len(footprint.support) == 69 + 28
    assert footprint.half_size == 5


@pytest.mark.parametrize("pixel_size", [1.0, 0.5, 0.25, 0.2, 0.1])
def test_the_lander_keeps_its_size_at_any_pixel_size(pixel_size: float):
    footprint = make_footprint(10.0, 1.0, pixel_size)
    distance = np.hypot(*footprint.pads.T) * pixel_size
    # The outer edge of the pads lies on the 10 m circle, to a cell.
    assert np.all(np.abs(distance + 0.5 - 5.0) < pixel_size)
    assert footprint.half_size == {1.0: 5, 0.5: 10, 0.25: 20, 0.2: 25, 0.1: 50}[pixel_size]
    if pixel_size == 0.1:
        assert len(footprint.pads) == 64
        assert len(footprint.footprint_cells(0)) == 45**2 + 44**2


@pytest.mark.parametrize("radius", range(1, 61))
def test_orientations_are_those_of_the_rasterised_circle(radius: int):
    footprint = make_footprint(2.0 * radius + 1.0, 0.1, 1.0)
    ours = {
        frozenset((east, north) for north, east in footprint.pad_centres(k).tolist())
        for k in range(len(footprint.pads))
    }
    assert ours == {frozenset(pads) for pads in algorithm_1.orientations(radius)}
    assert len(ours) == len(footprint.pads)


# The literal Algorithm 1


LANDERS = {
    "10 m lander, 1 m pads, 1 m cells": (1.0, algorithm_1.Limits()),
    "6 m lander, 1.2 m pads, 0.5 m cells": (
        0.5,
        algorithm_1.Limits(6.0, 1.2, math.radians(12.0), 0.25, 0.02),
    ),
    "3 m lander, 0.6 m pads, 0.3 m cells": (0.3, algorithm_1.Limits(3.0, 0.6, math.radians(15.0), 0.2, 0.05)),
    "5 m lander, 0.5 m pads, 0.25 m cells": (0.25, algorithm_1.Limits(5.0, 0.5)),
}


@pytest.mark.parametrize("lander", LANDERS)
@given(seed=SEEDS, relief=st.sampled_from([0.0, 0.02, 0.1, 0.5]))
@settings(max_examples=12)
def test_equals_the_literal_algorithm(lander: str, seed: int, relief: float):
    pixel_size, limits = LANDERS[lander]
    span = make_footprint(limits.footprint_diameter, limits.pad_diameter, pixel_size).span
    dem = pixel_size * rough_ground(seed, (span + 3, span + 4), relief)
    dem[np.random.default_rng(seed).random(dem.shape) < 0.001] = np.nan
    expected = algorithm_1.assess(dem, pixel_size, limits)
    actual = assess_safety(dem, pixel_size, **limits._asdict())
    np.testing.assert_allclose(actual.slope, expected.slope, rtol=0, atol=1e-9)
    np.testing.assert_allclose(actual.roughness, expected.roughness, rtol=0, atol=1e-9)
    np.testing.assert_allclose(actual.probability, expected.probability, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(actual.deterministic, expected.deterministic)


def test_the_ground_of_that_comparison_is_neither_all_safe_nor_all_unsafe():
    share = [assess_safety(rough_ground(seed, (60, 60), 0.05)).probability[5:-5, 5:-5] for seed in range(20)]
    probability = np.concatenate(share)
    assert 0.05 < np.mean(probability > 0.99) < 0.95
    assert np.mean((probability > 0.01) & (probability < 0.99)) > 0.005


# Analytic ground


@given(
    angle=st.floats(0.0, 30.0).filter(lambda a: abs(a - 10.0) > 1e-6),
    azimuth=st.floats(0.0, 2.0 * math.pi),
    pixel_size=st.sampled_from([1.0, 0.5]),
)
def test_on_a_plane_the_slope_is_that_of_the_plane(angle: float, azimuth: float, pixel_size: float):
    rows, columns = np.indices((24, 25)) * pixel_size
    dem = math.tan(math.radians(angle)) * (math.cos(azimuth) * columns + math.sin(azimuth) * rows) + 7.0
    reach = make_footprint(10.0, 1.0, pixel_size).half_size
    # A pad of one cell touches the plane itself; a wider one is lifted, equally for all four.
    safety = assess_safety(dem, pixel_size, pad_diameter=0.9 * pixel_size)
    inner = (slice(reach, -reach), slice(reach, -reach))
    np.testing.assert_allclose(safety.slope[inner], math.radians(angle), rtol=0, atol=1e-9)
    np.testing.assert_allclose(safety.roughness[inner], 0.0, rtol=0, atol=1e-9)
    assert np.all(safety.deterministic[inner] == (angle < 10.0))
    spread = NOISE * math.cos(math.radians(angle))
    expected = 0.5 * (1.0 + math.erf(0.3 / (spread * math.sqrt(2.0)))) if angle < 10.0 else 0.0
    np.testing.assert_allclose(safety.probability[inner], expected, rtol=0, atol=1e-9)


def test_a_rock_is_a_hazard_wherever_it_may_lie_between_the_pads():
    dem = np.zeros((41, 41))
    dem[20, 20] = 0.5
    safety = assess_safety(dem)
    unsafe = ~safety.deterministic[5:-5, 5:-5]
    assert unsafe.sum() == 69  # under a pad it only tilts the lander, by 4 degrees
    assert safety.roughness[20, 20] == 0.5
    assert safety.slope[20, 20] == 0.0
    assert safety.slope[20, 15] == pytest.approx(math.atan(0.5 / (5.0 * math.sqrt(2.0))))


@pytest.mark.parametrize("height", [0.26, 0.29, 0.31, 0.34])
def test_the_probability_of_a_rock_follows_the_normal_error(height: float):
    dem = np.zeros((21, 21))
    dem[10, 10] = height
    z_score = (0.3 - height) / NOISE
    expected = 0.5 * (1.0 + math.erf(z_score / math.sqrt(2.0)))
    assert assess_safety(dem).probability[10, 10] == pytest.approx(expected, abs=1e-12)
    assert assess_safety(dem, range_noise=0.0).probability[10, 10] == (1.0 if height <= 0.3 else 0.0)


def test_a_pit_is_a_hazard_only_under_a_pad():
    dem = np.zeros((41, 41))
    dem[20, 20] = -5.0
    safety = assess_safety(dem)
    assert (~safety.deterministic[5:-5, 5:-5]).sum() == 28
    assert safety.slope[20, 20] == 0.0
    assert safety.roughness[20, 20] == 0.0
    assert safety.slope[20, 15] == pytest.approx(math.atan(1.0))


def test_a_pad_wider_than_a_pit_bridges_it():
    dem = np.zeros((41, 41))
    dem[20, 20] = -5.0
    safety = assess_safety(dem, pad_diameter=2.0)
    assert safety.deterministic[5:-5, 5:-5].all()
    assert np.all(safety.slope[5:-5, 5:-5] == 0.0)


@pytest.mark.parametrize("height", [5.0, -5.0])
def test_a_step_is_a_hazard_within_the_landers_reach(height: float):
    dem = np.zeros((30, 60))
    dem[:, 30:] = height
    safety = assess_safety(dem)
    np.testing.assert_array_equal(
        np.flatnonzero(~safety.deterministic[5:-5, 5:-5].all(axis=0)) + 5, np.arange(25, 35)
    )
    np.testing.assert_array_equal(np.flatnonzero(~safety.deterministic[15, 5:-5]) + 5, np.arange(25, 35))
    assert np.all(safety.slope[5:-5, 5:25] == 0.0)


# Holes and the border


def test_a_hole_makes_97_sites_unknown_and_leaves_the_others():
    dem = rough_ground(1, (60, 60), 0.05)
    whole = assess_safety(dem)
    dem[30, 31] = np.nan
    holed = assess_safety(dem)
    unknown = np.isnan(holed.slope[5:-5, 5:-5])
    assert unknown.sum() == 97
    np.testing.assert_array_equal(np.isnan(holed.slope), np.isnan(holed.roughness))
    assert not holed.deterministic[np.isnan(holed.slope)].any()
    assert not holed.probability[np.isnan(holed.slope)].any()
    known = ~np.isnan(holed.slope)
    for name in ("deterministic", "probability", "slope", "roughness"):
        np.testing.assert_array_equal(getattr(holed, name)[known], getattr(whole, name)[known])


def test_a_map_of_holes_is_unsafe():
    safety = assess_safety(np.full((30, 30), np.nan))
    assert not safety.deterministic.any()
    assert not safety.probability.any()
    assert np.isnan(safety.slope).all()


@pytest.mark.parametrize(("pixel_size", "border"), [(1.0, 5), (0.5, 10)])
def test_the_border_where_the_lander_does_not_fit_is_unsafe(pixel_size: float, border: int):
    safety = assess_safety(np.zeros((40, 50)), pixel_size)
    inner = (slice(border, -border), slice(border, -border))
    assert safety.deterministic[inner].all()
    outer = np.ones((40, 50), dtype=bool)
    outer[inner] = False
    assert not safety.deterministic[outer].any()
    assert not safety.probability[outer].any()
    assert np.isnan(safety.slope[outer]).all()
    assert np.isnan(safety.roughness[outer]).all()


def test_a_map_that_just_holds_the_lander_has_one_site():
    assert assess_safety(np.zeros((11, 11))).deterministic.sum() == 1


# Symmetries and order


@given(seed=SEEDS, height=st.floats(-1000.0, 1000.0))
@settings(max_examples=20)
def test_a_shift_of_the_datum_changes_nothing(seed: int, height: float):
    dem = rough_ground(seed, (30, 33), 0.05)
    assert_same(assess_safety(dem + height), assess_safety(dem))


@pytest.mark.parametrize("turn", [np.rot90, np.flipud, np.fliplr, np.transpose])
@given(seed=SEEDS)
@settings(max_examples=10)
def test_turning_or_mirroring_the_ground_turns_or_mirrors_the_map(turn, seed: int):
    dem = rough_ground(seed, (30, 37), 0.05)
    assert_same(assess_safety(turn(dem)), transformed(assess_safety(dem), turn))


@given(seed=SEEDS)
@settings(max_examples=10)
def test_looser_limits_never_make_ground_less_safe(seed: int):
    dem = rough_ground(seed, (40, 40), 0.05)
    strict = assess_safety(dem, max_slope=math.radians(7.0), max_roughness=0.2)
    loose = assess_safety(dem, max_slope=math.radians(9.0), max_roughness=0.25)
    assert np.all(loose.deterministic >= strict.deterministic)
    assert np.all(loose.probability >= strict.probability)


@given(seed=SEEDS)
@settings(max_examples=10)
def test_safe_ground_is_where_the_probability_exceeds_a_half(seed: int):
    safety = assess_safety(rough_ground(seed, (60, 60), 0.05))
    np.testing.assert_array_equal(safety.deterministic, safety.probability > 0.5)


def test_without_noise_the_probability_is_the_deterministic_map():
    safety = assess_safety(rough_ground(2, (60, 60), 0.05), range_noise=0.0)
    np.testing.assert_array_equal(safety.probability, safety.deterministic.astype(float))
    assert 0 < safety.deterministic.sum() < 2500


def test_the_map_does_not_depend_on_threads_or_on_where_a_block_of_columns_ends():
    dem = rough_ground(3, (40, 700), 0.05)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = assess_safety(dem)
        numba.set_num_threads(threads)
        together = assess_safety(dem)
    finally:
        numba.set_num_threads(threads)
    part = assess_safety(dem[:, 100:600])
    for name in ("deterministic", "probability", "slope", "roughness"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(together, name))
        np.testing.assert_array_equal(getattr(alone, name)[:, 105:595], getattr(part, name)[:, 5:-5])


@pytest.mark.parametrize("dtype", [np.float32, np.int64])
def test_takes_any_kind_of_number_and_leaves_the_input_alone(dtype: type):
    dem = np.round(rough_ground(4, (30, 30), 0.5)).astype(dtype)
    before = dem.copy()
    safety = assess_safety(dem)
    np.testing.assert_array_equal(dem, before)
    assert safety.probability.dtype == np.float64
    assert safety.deterministic.dtype == np.bool_
    assert_same(safety, assess_safety(dem.astype(float).tolist()))


# Bad input


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dem": np.zeros(30)}, "dem must be two-dimensional"),
        ({"dem": np.zeros((3, 30, 30))}, "dem must be two-dimensional"),
        ({"dem": np.zeros((10, 30))}, "dem must have at least 11 x 11 cells"),
        ({"dem": np.full((30, 30), np.inf)}, "dem must be finite"),
        ({"dem": [["high", "low"]]}, "dem must be an array of numbers"),
        ({"pixel_size": 0.0}, "pixel_size must be greater than 0"),
        ({"pixel_size": math.nan}, "pixel_size must be finite"),
        ({"pixel_size": 12.0}, "footprint_diameter 10 m is too small"),
        ({"footprint_diameter": -1.0}, "footprint_diameter must be greater than 0"),
        ({"pad_diameter": 0.0}, "pad_diameter must be greater than 0"),
        ({"pad_diameter": 12.0}, "footprint_diameter 10 m is too small"),
        ({"max_slope": 10.0}, "max_slope must be at most"),
        ({"max_roughness": -0.1}, "max_roughness must be at least 0"),
        ({"range_noise": -0.1}, "range_noise must be at least 0"),
    ],
)
def test_bad_input_is_named(arguments: dict[str, Any], message: str):
    with pytest.raises(ValueError, match=message):
        assess_safety(**{"dem": np.zeros((30, 30)), **arguments})


def test_criteria_are_checked_too():
    with pytest.raises(ValueError, match="max_slope"):
        SafetyCriteria(max_slope=10.0)
