"""Craters: sizes against their law, shapes against Pike's numbers and the profile's own definition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import poisson

from hda.terrain.craters import (
    CraterPopulation,
    Craters,
    DepthLaw,
    crater_relief,
    draw_craters,
    draw_depth,
    pike_depth,
    pike_floor_diameter,
    pike_rim_height,
)

REACH = 3.0


def one_crater(diameter: float, depth: float, east: float, north: float) -> Craters:
    d = np.array([diameter])
    rim = np.array([depth]) * pike_rim_height(d) / pike_depth(d)
    return Craters(np.array([east]), np.array([north]), d, np.array([depth]), rim, pike_floor_diameter(d))


def pike_crater(diameter: float, east: float, north: float) -> Craters:
    return one_crater(diameter, float(pike_depth(np.array(diameter))), east, north)


def test_pikes_relations_take_and_give_metres():
    # D = 50 m = 0.05 km by hand: 0.196 * 0.05^1.010 km and so on.
    assert float(pike_depth(np.array(50.0))) == pytest.approx(9.51, abs=0.005)
    assert float(pike_rim_height(np.array(50.0))) == pytest.approx(1.73, abs=0.005)
    assert float(pike_floor_diameter(np.array(50.0))) == pytest.approx(0.16, abs=0.005)
    # At 1 km the units drop out.
    assert float(pike_depth(np.array(1000.0))) == pytest.approx(196.0)
    assert float(pike_rim_height(np.array(1000.0))) == pytest.approx(36.0)


def test_a_single_crater_has_pikes_floor_and_rim():
    relief = crater_relief(pike_crater(50.0, 150.5, 150.5), 301, 1.0, REACH)
    # Rim to floor is Pike's depth, so the floor lies a rim's height less deep below the plain.
    assert relief[150, 150] == pytest.approx(1.73 - 9.51, abs=0.01)
    assert relief[150, 175] == pytest.approx(1.73, abs=0.005)
    assert relief.max() == pytest.approx(1.73, abs=0.005)
    assert relief.min() == relief[150, 150]


@given(diameter=st.floats(20.0, 250.0), ratio=st.floats(0.05, 0.25))
def test_the_profile_is_a_bowl_with_falling_ejecta(diameter: float, ratio: float):
    radius = diameter / 2.0
    pixel_size = diameter / 80.0
    crater = one_crater(diameter, ratio * diameter, 130.5 * pixel_size, 130.5 * pixel_size)
    rim = float(crater.rim_height[0])
    profile = crater_relief(crater, 261, pixel_size, REACH)[130, 130:].astype(float)
    x = np.arange(profile.size) * pixel_size / radius  # 0, 1/40, ... 3.25
    inside, outside = x < 1.0 - 1e-9, (x > 1.0 + 1e-9) & (x < REACH)
    assert profile[0] == pytest.approx(rim - ratio * diameter, rel=1e-5)
    assert np.all(np.diff(profile[inside]) > 0)
    # A parabola from the edge of the flat floor to the rim crest.
    floor = float(crater.floor_diameter[0]) / diameter
    climb = (np.maximum(x[inside] - floor, 0.0) / (1.0 - floor)) ** 2
    np.testing.assert_allclose(profile[inside], rim - ratio * diameter * (1.0 - climb), rtol=0, atol=1e-4)
    # Above the plain by the cube law, brought to zero at the reach.
    cube = (x[outside] ** -3.0 - REACH**-3.0) / (1.0 - REACH**-3.0)
    np.testing.assert_allclose(profile[outside], rim * cube, rtol=0, atol=1e-4 * rim + 1e-6)
    assert np.all(profile[x > REACH] == 0.0)


def test_craters_add_up_wherever_their_centres_lie():
    first, second = pike_crater(60.0, 40.0, 70.0), pike_crater(90.0, -30.0, 110.0)
    both = Craters(
        *(np.concatenate([getattr(first, name), getattr(second, name)]) for name in Craters.__annotations__)
    )
    reliefs = [crater_relief(craters, 100, 1.0, REACH) for craters in (first, second, both)]
    assert reliefs[1][:, 0].max() > 0.1  # a crater outside the tile reaches into it
    np.testing.assert_allclose(reliefs[2], reliefs[0] + reliefs[1], rtol=0, atol=1e-5)


def test_rows_grow_north_and_columns_east():
    relief = crater_relief(pike_crater(20.0, 80.0, 30.0), 100, 1.0, REACH)
    row, column = np.unravel_index(np.argmin(relief), relief.shape)
    assert (row, column) in {(29, 79), (29, 80), (30, 79), (30, 80)}


def test_a_finer_grid_shows_the_same_ground():
    crater = pike_crater(40.0, 50.0, 50.0)
    coarse = crater_relief(crater, 100, 1.0, REACH)
    fine = crater_relief(crater, 300, 1.0 / 3.0, REACH)
    np.testing.assert_allclose(fine[1::3, 1::3], coarse, rtol=0, atol=1e-4)


# Size-frequency

LAWS = {
    "Trask": CraterPopulation(),
    "Trask, small craters": CraterPopulation(minimum_diameter=5.0, maximum_diameter=150.0),
    "VIPER": CraterPopulation(
        coefficient=29174e-6, exponent=1.92, minimum_diameter=5.0, maximum_diameter=80.0
    ),
}


@pytest.mark.parametrize("law", LAWS)
def test_sizes_follow_their_law(law: str):
    population = LAWS[law]
    extent, draws = 1000.0, 60
    side = extent + REACH * population.maximum_diameter
    diameters = np.concatenate(
        [draw_craters(population, extent, np.random.default_rng([7, k])).diameter for k in range(draws)]
    )
    edges = np.geomspace(population.minimum_diameter, population.maximum_diameter, 9)
    counts, _ = np.histogram(diameters, edges)
    assert counts.sum() == diameters.size
    area = draws * side**2
    # N(>D) = c D^-b, written out. 8 bins and 3 laws at 1e-6 each: false alarms 2.4e-5 in all.
    above = population.coefficient * edges**-population.exponent
    low, high = poisson.interval(1.0 - 1e-6, area * (above[:-1] - above[1:]))
    assert np.all((low <= counts) & (counts <= high))


def test_trask_numbers_per_square_kilometre():
    whole = CraterPopulation(minimum_diameter=1.0, maximum_diameter=15000.0)
    assert [round(1e6 * whole.density_above(d), 1) for d in (10.0, 50.0, 100.0)] == [794.3, 31.8, 7.9]


def test_craters_are_spread_over_the_tile_and_all_that_reaches_it():
    population = CraterPopulation(minimum_diameter=5.0, maximum_diameter=100.0)
    craters = draw_craters(population, 1000.0, np.random.default_rng(8))
    margin = REACH * 50.0
    for place in (craters.east, craters.north):
        counts, _ = np.histogram(place, np.linspace(-margin, 1000.0 + margin, 11))
        assert counts.sum() == place.size
        # 20 bins at 1e-6 each: false alarms 2e-5.
        low, high = poisson.interval(1.0 - 1e-6, place.size / 10.0)
        assert np.all((low <= counts) & (counts <= high))


# Depths


def test_uniform_depths_fill_their_range_and_no_more():
    diameter = np.linspace(20.0, 250.0, 20000)
    ratio = draw_depth(CraterPopulation(), diameter, np.random.default_rng(9)) / diameter
    assert 0.08 <= ratio.min() < 0.0801
    assert 0.1999 < ratio.max() <= 0.2
    assert ratio.mean() == pytest.approx(0.14, abs=5 * 0.12 / math.sqrt(12 * 20000))  # five sigma: 6e-7


def test_pike_depths_are_not_random():
    diameter = np.array([20.0, 50.0, 250.0])
    population = CraterPopulation(depth_law=DepthLaw.PIKE)
    np.testing.assert_array_equal(
        draw_depth(population, diameter, np.random.default_rng(1)), pike_depth(diameter)
    )


def test_stopar_depths_step_with_size_and_fade():
    fresh = {5.0: 0.10, 10.0: 0.11, 39.0: 0.11, 40.0: 0.13, 100.0: 0.15, 200.0: 0.17, 400.0: 0.21}
    population = CraterPopulation(depth_law=DepthLaw.STOPAR)
    for diameter, ratio in fresh.items():
        many = np.full(20000, diameter)
        share = draw_depth(population, many, np.random.default_rng(10)) / many / ratio
        assert 0.15 <= share.min() < 0.151
        assert 0.999 < share.max() <= 1.0 + 1e-12


def test_the_depth_law_leaves_craters_in_place():
    laws = [
        draw_craters(CraterPopulation(depth_law=law), 1000.0, np.random.default_rng(11)) for law in DepthLaw
    ]
    for other in laws[1:]:
        np.testing.assert_array_equal(laws[0].east, other.east)
        np.testing.assert_array_equal(laws[0].diameter, other.diameter)
        assert not np.array_equal(laws[0].depth, other.depth)


def test_rims_keep_pikes_share_of_the_depth():
    craters = draw_craters(CraterPopulation(), 1000.0, np.random.default_rng(12))
    share = craters.rim_height / craters.depth
    np.testing.assert_allclose(share, 0.036 / 0.196 * (craters.diameter / 1000.0) ** 0.004, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"coefficient": -1.0}, "coefficient"),
        ({"exponent": 0.0}, "exponent"),
        ({"minimum_diameter": 0.0}, "minimum_diameter"),
        ({"maximum_diameter": 10.0}, "maximum_diameter"),
        ({"depth_ratio_range": (0.2, 0.1)}, "depth_ratio_range"),
        ({"ejecta_reach": 1.0}, "ejecta_reach"),
        ({"depth_law": "pike"}, "depth_law"),
    ],
)
def test_bad_input_is_named(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        CraterPopulation(**arguments)
