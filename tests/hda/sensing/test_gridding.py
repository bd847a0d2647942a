"""Points to cells, against a literal loop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.sensing.gridding import PIXEL_SIZES, Gridding, PixelGrid, grid_points, lay_grid

SEEDS = st.integers(0, 2**32 - 1)


@given(
    seed=SEEDS,
    pixel_size=st.sampled_from(PIXEL_SIZES),
    percentile=st.sampled_from([None, 0.0, 37.0, 90.0, 100.0]),
)
@settings(max_examples=40)
def test_each_cell_is_the_statistics_of_its_own_points(seed, pixel_size, percentile):
    rng = np.random.default_rng(seed)
    points = rng.uniform([-30.0, 10.0, 0.0], [5.0, 40.0, 9.0], (rng.integers(1, 400), 3))
    deviation = rng.uniform(0.01, 0.1, len(points))
    grid = PixelGrid(int(12 / pixel_size), int(-20 / pixel_size), pixel_size, 9, 7)
    measured = grid_points(points, deviation, grid, percentile)
    for row in range(grid.rows):
        for column in range(grid.columns):
            west, south = (grid.first_column + column) * pixel_size, (grid.first_row + row) * pixel_size
            own = (
                (points[:, 0] >= west)
                & (points[:, 0] < west + pixel_size)
                & (points[:, 1] >= south)
                & (points[:, 1] < south + pixel_size)
            )
            heights = points[own, 2]
            assert measured.count[row, column] == heights.size
            if heights.size == 0:
                assert math.isnan(measured.height[row, column])
                assert math.isnan(measured.spread[row, column])
                continue
            height = heights.mean() if percentile is None else np.percentile(heights, percentile)
            between = heights.var(ddof=1) if heights.size > 1 else 0.0
            assert measured.height[row, column] == pytest.approx(height, abs=1e-12)
            spread = math.sqrt((deviation[own] ** 2).mean() + between)
            assert measured.spread[row, column] == pytest.approx(spread, abs=1e-9)


@given(seed=SEEDS, pixel_size=st.sampled_from(PIXEL_SIZES))
def test_a_grid_holds_every_point_and_no_empty_border(seed, pixel_size):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-50.0, 50.0, (rng.integers(1, 30), 3))
    grid = lay_grid(points, pixel_size, most=1000)
    measured = grid_points(points, np.full(len(points), 0.01), grid)
    assert measured.count.sum() == len(points)
    for edge in (measured.count[0], measured.count[-1], measured.count[:, 0], measured.count[:, -1]):
        assert edge.any()


def test_a_stray_point_does_not_stretch_the_grid():
    points = np.array([[0.5, 0.5, 0.0], [10_000.5, 3.5, 0.0]])
    grid = lay_grid(points, 1.0, most=50)
    assert grid.shape == (4, 50)
    assert lay_grid(np.empty((0, 3)), 1.0, most=50).shape == (0, 0)


def test_cells_of_one_size_lie_in_the_same_place_at_each_look():
    first = lay_grid(np.array([[0.2, 0.2, 0.0], [9.9, 9.9, 0.0]]), 1.25, 50)
    second = lay_grid(np.array([[3.9, -7.7, 0.0], [15.0, 2.0, 0.0]]), 1.25, 50)
    for grid in (first, second):
        assert grid.corner == (1.25 * grid.first_column, 1.25 * grid.first_row)


def test_rows_and_columns_are_found_from_places():
    grid = PixelGrid(first_row=-2, first_column=4, pixel_size=2.5, rows=3, columns=3)
    assert grid.corner == (10.0, -5.0)
    np.testing.assert_array_equal(grid.columns_of(np.array([9.99, 10.0, 12.6, 17.6])), [-1, 0, 1, 3])
    np.testing.assert_array_equal(grid.rows_of(np.array([-5.1, -5.0, 0.0])), [-1, 0, 2])


def test_cells_are_wide_enough_for_the_rays_and_never_finer_than_the_true_map():
    gridding = Gridding(rays_per_pixel=1.1)
    assert [gridding.pixel_size(s) for s in (0.1, 1.0, 1.2, 4.0, 99.0)] == [1.0, 1.25, 1.75, 5.0, 8.0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"rays_per_pixel": 0.0}, "rays_per_pixel"), ({"percentile": 101.0}, "percentile")],
)
def test_a_gridding_that_gives_no_map_is_refused(changes, message: str):
    with pytest.raises(ValueError, match=message):
        Gridding(**changes)
