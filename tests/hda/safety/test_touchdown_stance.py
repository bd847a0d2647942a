"""Where the upright lander first touches ground: closed forms, a literal loop, and what must always hold."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hda.safety.criteria import DEFAULT_CRITERIA
from hda.safety.touchdown_stance import (
    Footing,
    Stance,
    contact_height,
    ground_at,
    highest_around,
    make_footing,
    pad_height,
    set_down,
)
from tests.oracles import set_down as oracle

PLANE = 50.0
STANCE = Stance.of(DEFAULT_CRITERIA)
INSIDE = st.floats(8.0, 22.0)
BEARINGS = st.floats(-math.pi, math.pi)


def footing(elevation: np.ndarray, bearing: float = 0.0) -> Footing:
    ground = elevation.astype(np.float32)
    ground.flags.writeable = False
    return make_footing(ground, Stance.of(DEFAULT_CRITERIA, bearing), PLANE)


def incline(east: float, north: float, side: int = 30) -> np.ndarray:
    row, column = np.mgrid[0:side, 0:side]
    return 20.0 + east * (column + 0.5) + north * (row + 0.5)


def rough(seed: int, size: float = 1.0, side: int = 30) -> np.ndarray:
    return 20.0 + size * np.random.default_rng(seed).standard_normal((side, side))


def test_the_lander_of_the_default_criteria_has_its_pads_inside_the_circle_of_ten_metres():
    assert (STANCE.pad_distance, STANCE.pad_radius, STANCE.clearance) == (4.5, 0.5, 0.3)
    assert STANCE.edge_distance == pytest.approx(3.18, abs=0.002)
    np.testing.assert_allclose(STANCE.pads, [[4.5, 0.0], [0.0, 4.5], [-4.5, 0.0], [0.0, -4.5]], atol=1e-12)


@pytest.mark.parametrize("name", ["pad_distance", "pad_radius", "clearance", "bearing"])
def test_a_stance_that_cannot_be_is_refused_by_name(name):
    numbers = {"pad_distance": 4.5, "pad_radius": 0.5, "clearance": 0.3, "bearing": 0.0, name: math.nan}
    with pytest.raises(ValueError, match=name):
        Stance(**numbers)


@given(x=INSIDE, y=INSIDE, bearing=BEARINGS)
def test_on_flat_ground_it_touches_at_the_ground(x, y, bearing):
    assert contact_height(footing(np.full((30, 30), 20.0), bearing), x, y) == 20.0


@given(x=INSIDE, y=INSIDE, bearing=BEARINGS, slope=st.floats(0.0, 0.3), uphill=BEARINGS)
def test_on_an_incline_the_highest_pad_touches_by_its_upper_rim(x, y, bearing, slope, uphill):
    east, north = slope * math.cos(uphill), slope * math.sin(uphill)
    upright = footing(incline(east, north), bearing)
    middles = [20.0 + east * (x + px) + north * (y + py) for px, py in upright.pads.tolist()]
    found = contact_height(upright, x, y)
    rim = 0.5 * slope
    # of 16 points of the rim one lies within 11.25 degrees of the way uphill
    assert max(middles) + rim * math.cos(math.pi / 16) - 1e-5 <= found <= max(middles) + rim + 1e-5


def test_a_rock_under_one_pad_lifts_it_and_one_between_the_pads_less_the_clearance():
    for (row, column), height, expected in (
        ((15, 19), 1.0, 21.0),  # the middle of the eastern pad
        ((15, 15), 1.0, 20.7),  # the axis
        ((15, 15), 0.2, 20.0),  # too low for the belly
        ((18, 18), 1.0, 20.0),  # beside the square of the pads
    ):
        ground = np.full((30, 30), 20.0)
        ground[row, column] += height
        assert contact_height(footing(ground), 15.0, 15.5) == pytest.approx(expected, abs=1e-5)


def test_over_a_step_the_upper_pads_touch():
    ground = np.full((30, 30), 20.0)
    ground[:, 18:] = 23.0
    assert contact_height(footing(ground), 15.0, 15.0) == 23.0
    assert contact_height(footing(ground), 12.0, 15.0) == 20.0
    # from the post at 17.5 m to that at 18.5 m the step is a ramp; the pad's rim is 5 m east of the axis
    assert contact_height(footing(ground), 13.0, 15.0) == pytest.approx(20.0 + 3.0 * 0.5, abs=1e-5)


@given(x=INSIDE, y=INSIDE, bearing=BEARINGS, seed=st.integers(0, 20))
def test_rough_ground_is_met_where_a_literal_loop_says(x, y, bearing, seed):
    ground = footing(rough(seed), bearing)
    expected = oracle.contact_height(ground.elevation, x, y, 4.5, 0.5, 0.3, bearing)
    assert contact_height(ground, x, y) == pytest.approx(expected, abs=1e-5)


@given(x=st.floats(1.0, 29.0), y=st.floats(1.0, 29.0), seed=st.integers(0, 20))
def test_points_and_pads_of_rough_ground_are_scipys(x, y, seed):
    ground = rough(seed).astype(np.float32)
    assert ground_at(ground, x, y) == pytest.approx(float(oracle.surface(ground)((y, x))), abs=1e-5)
    found, known = pad_height(ground, x, y, 0.5)
    assert known
    assert found == pytest.approx(oracle.pad_height(ground, x, y, 0.5), abs=1e-5)


@given(x=INSIDE, y=INSIDE, seed=st.integers(0, 20), raised=st.floats(0.0, 3.0))
def test_raising_ground_never_lowers_the_contact(x, y, seed, raised):
    low = rough(seed)
    high = low + raised * np.random.default_rng(seed + 1).random(low.shape)
    assert contact_height(footing(high), x, y) >= contact_height(footing(low), x, y)


@given(x=INSIDE, y=INSIDE, reach=st.floats(0.0, 6.0), seed=st.integers(0, 20), east=st.floats(-1.0, 1.0))
def test_no_contact_around_is_higher_than_the_bound(x, y, reach, seed, east):
    ground = footing(rough(seed))
    there = contact_height(ground, x + east * reach, y - east * reach)
    assert there <= highest_around(ground, x, y, reach)


def test_unknown_ground_is_left_out_and_where_there_is_no_other_the_plane_stands_for_it():
    ground = np.full((30, 30), 20.0)
    ground[14:17, 18:21] = np.nan
    assert contact_height(footing(ground), 15.0, 15.5) == 20.0
    assert not pad_height(footing(ground).elevation, 19.5, 15.5, 0.5)[1]
    nowhere = footing(np.full((30, 30), np.nan))
    assert contact_height(nowhere, 15.0, 15.0) == PLANE
    assert contact_height(footing(np.full((30, 30), 20.0)), -40.0, 15.0) == PLANE
    assert highest_around(footing(np.full((30, 30), 20.0)), -40.0, 15.0, 1.0) >= PLANE
    assert math.isnan(ground_at(footing(ground).elevation, 0.2, 15.0))


def test_a_site_is_set_down_on_true_ground_and_left_alone_without():
    site = np.array([15.0, 15.0, 99.0])
    np.testing.assert_array_equal(set_down(footing(np.full((30, 30), 20.0)), site), [15.0, 15.0, 20.0])
    assert set_down(None, site) is site
