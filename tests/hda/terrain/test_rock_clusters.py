"""Rocks in clusters: Thomas's process, against its closed forms."""

import math

import numpy as np
import pytest

from hda.terrain.rock_clusters import RockClusters, gather_rocks
from hda.terrain.rocks import RockPopulation, Rocks, draw_rocks

SIDE = 400.0


def gathered(clusters: RockClusters, seed: int, count: int = 1200) -> Rocks:
    rng = np.random.default_rng(seed)
    rocks = Rocks(*rng.uniform(0.0, SIDE, (2, count)), *rng.random((3, count)))
    return gather_rocks(rocks, clusters, SIDE, 0.0, rng)


def pair_count(rocks: Rocks, distance: float) -> float:
    """Ripley's K [m^2]: rocks within a distance of a rock over their density; the square has no edges."""
    east, north = (np.abs(place[:, None] - place) for place in (rocks.east, rocks.north))
    near = np.hypot(np.minimum(east, SIDE - east), np.minimum(north, SIDE - north)) <= distance
    pairs = near.sum() - len(rocks)
    return pairs / len(rocks) * SIDE**2 / (len(rocks) - 1)


@pytest.mark.parametrize("distance", [8.0, 20.0, 45.0])
def test_pairs_are_as_near_as_in_thomass_process(distance: float) -> None:
    """K(r) = pi r^2 + (1 - exp(-r^2 / (4 radius^2))) spacing^2.

    Over 24 seeds the estimate scatters by the clusters' number (100 of them each: 10 % / sqrt(24) = 2 %).
    """
    clusters = RockClusters(spacing=40.0, radius=10.0)
    found = np.mean([pair_count(gathered(clusters, seed), distance) for seed in range(24)])
    closed = math.pi * distance**2 + (1.0 - math.exp(-(distance**2) / 400.0)) * 40.0**2
    assert found == pytest.approx(closed, rel=0.1)


def test_wide_clusters_are_none() -> None:
    found = np.mean([pair_count(gathered(RockClusters(5.0, 200.0), seed), 20.0) for seed in range(4)])
    assert found == pytest.approx(math.pi * 400.0, rel=0.03)


def test_number_sizes_and_density_stay() -> None:
    population = RockPopulation(0.05, minimum_diameter=0.3, maximum_diameter=2.0)
    rng = np.random.default_rng(3)
    rocks = draw_rocks(population, SIDE, rng)
    margin = 2.0
    moved = gather_rocks(rocks, RockClusters(), SIDE, margin, rng)
    for name in ("diameter", "axis_ratio", "azimuth"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(rocks, name))
    for place in (moved.east, moved.north):
        assert place.min() >= -margin
        assert place.max() < SIDE + margin
    # As many in every quarter, on average: each has 25 clusters of 100, so 40 seeds scatter by 3 %.
    west = [np.mean(gathered(RockClusters(), seed).east < SIDE / 2.0) for seed in range(40)]
    assert np.mean(west) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("field", "value"), [("spacing", 0.0), ("radius", -1.0), ("radius", math.nan)])
def test_clusters_have_a_size(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        RockClusters(**{field: value})
