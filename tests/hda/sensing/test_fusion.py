"""Fusing scans on one lattice is as if all their points had been sorted in at once."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hda.sensing.fusion import cover_grids, fuse_elevations
from hda.sensing.gridding import PixelGrid, grid_points, lay_grid

SEEDS = st.integers(0, 2**32 - 1)


def scanned(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    corner = rng.uniform(-10.0, 10.0, 2)
    points = np.column_stack([corner + rng.uniform(0.0, 12.0, (120, 2)), rng.uniform(0.0, 3.0, 120)])
    return points, np.full(120, rng.uniform(0.01, 0.1))


@given(seed=SEEDS, pixel_size=st.sampled_from([1.0, 1.25, 2.5]), percentile=st.sampled_from([None, 100.0]))
@settings(max_examples=40)
def test_two_scans_fused_are_one_scan_of_all_their_points(seed, pixel_size, percentile):
    rng = np.random.default_rng(seed)
    (first, first_noise), (second, second_noise) = scanned(rng), scanned(rng)
    one, other = (
        grid_points(points, noise, lay_grid(points, pixel_size, 100), percentile)
        for points, noise in ((first, first_noise), (second, second_noise))
    )
    fused = fuse_elevations(one, other, percentile)
    together = np.concatenate([first, second])
    whole = grid_points(together, np.concatenate([first_noise, second_noise]), fused.grid, percentile)
    np.testing.assert_array_equal(fused.count, whole.count)
    assert fused.count.sum() == 240
    np.testing.assert_allclose(fused.height, whole.height, atol=1e-12)
    single = whole.count == 1
    np.testing.assert_allclose(fused.spread[single], whole.spread[single], atol=1e-12)


def test_fusing_means_keeps_the_variance_of_the_population():
    """Of many points a cell: the variances about one's own mean, and the difference of the means."""
    rng = np.random.default_rng(0)
    grid = PixelGrid(0, 0, 1.0, 1, 1)
    heights = rng.normal(0.0, 0.3, 4000), rng.normal(0.8, 0.3, 1000)
    one, other = (
        grid_points(np.column_stack([np.full((h.size, 2), 0.5), h]), np.full(h.size, 0.1), grid, None)
        for h in heights
    )
    fused = fuse_elevations(one, other, percentile=None)
    every = np.concatenate(heights)
    assert fused.height[0, 0] == pytest.approx(every.mean(), abs=1e-12)
    assert fused.spread[0, 0] == pytest.approx(np.sqrt(every.var(ddof=1) + 0.1**2), rel=1e-3)


@given(seed=SEEDS)
def test_the_order_of_two_scans_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    first, second = (grid_points(p, d, lay_grid(p, 1.0, 100)) for p, d in (scanned(rng), scanned(rng)))
    one, other = fuse_elevations(first, second), fuse_elevations(second, first)
    assert one.grid == other.grid
    np.testing.assert_allclose(one.height, other.height, atol=1e-12)
    np.testing.assert_allclose(one.spread, other.spread, atol=1e-12)


def test_holes_stay_holes_and_grids_of_other_cells_are_refused():
    nothing = grid_points(np.empty((0, 3)), np.empty(0), PixelGrid(0, 0, 1.0, 3, 3))
    some = grid_points(np.array([[4.5, 0.5, 7.0]]), np.array([0.1]), PixelGrid(0, 3, 1.0, 2, 2))
    fused = fuse_elevations(nothing, some)
    assert fused.grid == PixelGrid(0, 0, 1.0, 3, 5)
    assert np.isfinite(fused.height).sum() == 1
    assert fused.height[0, 4] == 7.0
    assert cover_grids(PixelGrid(9, 9, 1.0, 0, 0), some.grid) == some.grid
    with pytest.raises(ValueError, match="pixel_size"):
        cover_grids(PixelGrid(0, 0, 1.0, 3, 3), PixelGrid(0, 0, 1.25, 3, 3))
