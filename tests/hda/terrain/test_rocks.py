"""Rocks: sizes and covered area against their law, shapes against dense sampling."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import poisson

from hda.terrain.rocks import RockPopulation, Rocks, draw_rocks, rock_heights, rock_margin


def make_rocks(*rows: tuple[float, float, float, float, float]) -> Rocks:
    return Rocks(*np.array(rows, dtype=float).T)


def surface(rocks: Rocks, east: np.ndarray, north: np.ndarray) -> np.ndarray:
    """Height of the rocks at points, straight from the definition of a hemi-ellipsoid."""
    height = np.zeros(east.shape)
    for x, y, diameter, ratio, azimuth in zip(
        rocks.east, rocks.north, rocks.diameter, rocks.axis_ratio, rocks.azimuth, strict=True
    ):
        turned = ((east - x) + 1j * (north - y)) * np.exp(-1j * azimuth)
        long_axis, short_axis = diameter / 2 / math.sqrt(ratio), diameter / 2 * math.sqrt(ratio)
        level = 1.0 - (turned.real / long_axis) ** 2 - (turned.imag / short_axis) ** 2
        height = np.maximum(height, diameter / 2 * np.sqrt(np.maximum(level, 0.0)))
    return height


def sampled_maximum(rocks: Rocks, size: int, pixel_size: float, points: int) -> np.ndarray:
    """Greatest height over a grid of points in each cell, corners and edges included."""
    inner = np.linspace(0.0, 1.0, points)
    line = (np.arange(size)[:, None] + inner[None, :]).ravel() * pixel_size
    east, north = np.meshgrid(line, line)
    return surface(rocks, east, north).reshape(size, points, size, points).max(axis=(1, 3))


# The law


@pytest.mark.parametrize("area_fraction", [0.05, 0.1, 0.2])
def test_the_share_of_area_follows_its_law_in_each_size_bin(area_fraction: float):
    population = RockPopulation(area_fraction=area_fraction)
    extent, draws = 400.0, 10
    area = draws * (extent + 2.0 * rock_margin(population)) ** 2
    diameter = np.concatenate(
        [draw_rocks(population, extent, np.random.default_rng([3, k])).diameter for k in range(draws)]
    )
    edges = np.array([0.5, 0.6, 0.8, 1.0, 1.3, 1.7, 4.0])
    covered = math.pi / 4.0 * diameter**2
    q = 1.79 + 0.152 / area_fraction
    for low, high in itertools.pairwise(edges):
        inside = (diameter >= low) & (diameter < high)
        expected = area_fraction * (math.exp(-q * low) - math.exp(-q * high)) * area
        spread = math.sqrt(np.sum(covered[inside] ** 2))  # of a compound Poisson sum
        # 18 bins at five sigma: false alarms 1e-5 in all.
        assert abs(covered[inside].sum() - expected) < 5.0 * spread


def test_counts_are_poisson():
    population = RockPopulation()
    counts = np.array([len(draw_rocks(population, 100.0, np.random.default_rng([4, k]))) for k in range(400)])
    side = 100.0 + 2.0 * rock_margin(population)
    above = population.density_above(np.array([0.5, 4.0]))
    mean = (above[0] - above[1]) * side**2
    low, high = poisson.interval(1.0 - 1e-6, counts.size * mean)
    assert low <= counts.sum() <= high
    # Variance equals the mean: its estimate has a relative spread of sqrt(2 / 399). Five sigma: 6e-7.
    assert counts.var(ddof=1) == pytest.approx(mean, rel=5.0 * math.sqrt(2.0 / 399.0))


def test_numbers_per_square_metre():
    dense, sparse = RockPopulation(area_fraction=0.2), RockPopulation(area_fraction=0.05)
    np.testing.assert_allclose(dense.density_above(np.array([0.5, 1.0])), [1.3e-1, 1.2e-2], rtol=0.05)
    np.testing.assert_allclose(sparse.density_above(np.array([0.5, 1.0])), [1.36e-2, 3.7e-4], rtol=0.01)


@given(area_fraction=st.floats(0.03, 0.4), diameter=st.floats(0.3, 4.0))
def test_number_and_area_are_one_law(area_fraction: float, diameter: float):
    population = RockPopulation(area_fraction=area_fraction)
    q = population.decay

    def number(d: float) -> float:  # rocks per metre of diameter: -dF/dD over the area of one
        return q * area_fraction * math.exp(-q * d) / (math.pi * d * d / 4.0)

    expected, _ = quad(number, diameter, diameter + 40.0 / q, epsabs=0.0)
    assert population.density_above(np.array([diameter]))[0] == pytest.approx(expected, rel=1e-6)


def test_sizes_stay_between_their_limits():
    rocks = draw_rocks(RockPopulation(), 300.0, np.random.default_rng(5))
    assert 0.5 <= rocks.diameter.min() < 0.501
    assert rocks.diameter.max() <= 4.0
    assert 0.5 <= rocks.axis_ratio.min() < rocks.axis_ratio.max() <= 1.0


def test_no_rocks_when_none_are_asked_for():
    assert len(draw_rocks(RockPopulation(area_fraction=0.0), 300.0, np.random.default_rng(5))) == 0


# Shapes


@given(
    seed=st.integers(0, 2**32 - 1),
    pixel_size=st.sampled_from([1.0, 0.5, 0.25]),
    diameter=st.floats(0.5, 4.0),
)
@settings(max_examples=40)
def test_a_cell_holds_the_highest_point_of_the_rock(seed: int, pixel_size: float, diameter: float):
    rng = np.random.default_rng(seed)
    rocks = make_rocks(
        (rng.uniform(3, 5), rng.uniform(3, 5), diameter, rng.uniform(0.5, 1), rng.uniform(0, math.pi))
    )
    size, points = round(8 / pixel_size), 33
    cells = rock_heights(rocks, size, pixel_size)
    sampled = sampled_maximum(rocks, size, pixel_size, points)
    assert np.all(cells >= sampled - 1e-6)
    # Off the outline, where the flank is vertical, the samples come close: level sets are half a step apart.
    level_gap = 4.0 * pixel_size / (points - 1) / diameter
    cell_level, sampled_level = (1.0 - (h / (diameter / 2.0)) ** 2 for h in (cells, sampled))
    assert np.all(cell_level >= sampled_level - 8.0 * level_gap)
    assert cells.max() == pytest.approx(diameter / 2.0, rel=1e-6)


def test_the_outline_keeps_the_area_of_the_circle():
    for ratio in (0.5, 0.7, 1.0):
        heights = rock_heights(make_rocks((2.5, 2.5, 3.0, ratio, 0.4)), 2500, 0.002)
        assert np.count_nonzero(heights) * 0.002**2 == pytest.approx(math.pi * 1.5**2, rel=5e-3)


def test_a_small_rock_fills_its_cell():
    heights = rock_heights(make_rocks((4.9, 2.1, 0.6, 1.0, 0.0)), 8, 1.0)
    assert heights[2, 4] == pytest.approx(0.3)
    # It reaches 0.2 m into the next column: sqrt(0.3^2 - 0.1^2) high where it crosses the edge.
    assert heights[2, 5] == pytest.approx(math.sqrt(0.3**2 - 0.1**2), rel=1e-6)
    assert heights[1, 4] == pytest.approx(math.sqrt(0.3**2 - 0.1**2), rel=1e-6)
    assert np.count_nonzero(heights) == 4


def test_overlapping_rocks_take_the_highest():
    first, second = (3.0, 3.2, 2.0, 0.8, 0.3), (3.6, 3.4, 1.4, 0.6, 1.9)
    together = rock_heights(make_rocks(first, second), 8, 1.0)
    highest = np.maximum(rock_heights(make_rocks(first), 8, 1.0), rock_heights(make_rocks(second), 8, 1.0))
    np.testing.assert_array_equal(together, highest)


def test_a_rock_outside_the_tile_reaches_into_it():
    heights = rock_heights(make_rocks((-0.5, 4.5, 3.0, 1.0, 0.0), (20.0, 4.5, 3.0, 1.0, 0.0)), 8, 1.0)
    assert heights[4, 0] == pytest.approx(math.sqrt(1.5**2 - 0.5**2), rel=1e-6)
    assert not heights[:, 1:].any()


def test_rows_grow_north_and_azimuth_turns_from_east_to_north():
    along_north_east = rock_heights(make_rocks((4.0, 4.0, 4.0, 0.5, math.pi / 4.0)), 80, 0.1)
    assert along_north_east[58, 58] > 0.0
    assert along_north_east[58, 21] == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"area_fraction": 1.5}, "area_fraction"),
        ({"decay_constant": -1.0}, "decay_constant"),
        ({"decay_slope": -1.0}, "decay_slope"),
        ({"decay_constant": 0.0, "decay_slope": 0.0}, "decay_constant and decay_slope"),
        ({"minimum_diameter": 0.0}, "minimum_diameter"),
        ({"maximum_diameter": 0.4}, "maximum_diameter"),
    ],
)
def test_bad_input_is_named(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        RockPopulation(**arguments)
