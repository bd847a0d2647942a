"""What is added to a model of coarse posts: its means stay, its slopes go on, its draws are keyed."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from hda.ground.detail import ADDED_CRATER, ADDED_ROCK, GroundDetail, measure_surface
from hda.ground.library import Ground, build_tile, load_tile, prepare_tiles
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain, add_detail, cut_tile, open_own_terrain
from hda.ground.post_means import lay_posts, remove_post_means
from hda.ground.resampling import axis_weights, resample
from hda.safety.criteria import SafetyCriteria
from hda.terrain.base_surface import BaseSurface, generate_base_surface, rms_slope
from hda.terrain.settings import ROCK_ABUNDANCES
from tests.ground_files import write_geotiff

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

SIDE = 5
SURFACE = BaseSurface(hurst=0.8, rms_slope=math.radians(3.0))


def post_means(heights: np.ndarray, side: int = SIDE) -> np.ndarray:
    rows, columns = (count // side for count in heights.shape)
    blocks = heights[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return blocks.mean(axis=(1, 3))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two tiles side by side, 5 m a post, as an orbiter's model has them; a hole in the first."""
    heights = generate_base_surface(SURFACE, 2000, 1.0, np.random.default_rng(4))[:1000].astype(np.float64)
    posts = post_means(heights).astype(np.float32)
    posts[20:30, 20:30] = np.nan
    return write_geotiff(tmp_path_factory.mktemp("coarse") / "coarse.tif", posts, float(SIDE))


def with_detail(path: Path, seed: int = 1, abundance: str = "medium") -> OwnTerrain:
    return open_own_terrain(path, detail=GroundDetail(seed, abundance))


def test_the_mean_over_each_post_is_kept(coarse: Path) -> None:
    """Low waves are the model's: to a centimetre, and here to rounding."""
    terrain = with_detail(coarse)
    assert terrain.detail is not None
    for number in terrain.tiles:
        plain = cut_tile(terrain, number)
        relief = add_detail(terrain, terrain.detail, number).relief
        assert relief.std() > 0.05
        before, after = post_means(plain), post_means(plain + relief)
        known = np.isfinite(before)
        np.testing.assert_allclose(after[known], before[known], atol=1e-9)
        tile = build_tile(Ground(terrain, SafetyCriteria()), number)
        shift = post_means(tile.elevation.astype(np.float64))[known] - before[known]
        assert np.ptp(shift) < 0.01
        np.testing.assert_array_equal(np.isnan(tile.elevation), np.isnan(plain))


def test_it_does_not_depend_on_order_or_workers(coarse: Path, cache: Path) -> None:
    terrain = with_detail(coarse)
    assert terrain.detail is not None
    first = [add_detail(terrain, terrain.detail, number) for number in (0, 1)]
    again = [add_detail(with_detail(coarse), terrain.detail, number) for number in (1, 0)]
    for one, other in zip(first, reversed(again), strict=True):
        np.testing.assert_array_equal(one.relief, other.relief)
        np.testing.assert_array_equal(one.kinds, other.kinds)
    assert not np.array_equal(first[0].kinds, first[1].kinds)
    ground = Ground(terrain, SafetyCriteria())
    prepare_tiles(ground, OWN_SPLIT, workers=2)
    for number, added in enumerate(first):
        kept, built = load_tile(ground, number, OWN_SPLIT), build_tile(ground, number)
        for name in ("elevation", "probability", "deterministic", "added"):
            np.testing.assert_array_equal(getattr(kept, name), getattr(built, name))
        assert kept.added is not None
        np.testing.assert_array_equal(kept.added, added.kinds)


def test_other_seeds_and_rocks_give_other_ground(coarse: Path) -> None:
    terrain = open_own_terrain(coarse)
    kinds = {
        (seed, name): add_detail(terrain, GroundDetail(seed, name), 0).kinds
        for seed, name in [(1, "sparse"), (1, "dense"), (2, "sparse")]
    }
    one, rocky, other = kinds.values()
    assert np.mean(one != other) > 0.05
    np.testing.assert_array_equal(one & ADDED_CRATER, rocky & ADDED_CRATER)  # craters stay in place
    assert np.count_nonzero(rocky & ADDED_ROCK) > 2 * np.count_nonzero(one & ADDED_ROCK)


@pytest.mark.parametrize("name", sorted(ROCK_ABUNDANCES))
def test_rocks_cover_what_their_law_says(coarse: Path, name: str) -> None:
    """A rock reaches into 1 + 2 D + pi D^2 / 4 cells of 1 m on average, if its outline is a circle (Steiner).

    Rocks in clusters lie over one another, so that fewer cells are marked than of rocks spread evenly;
    outlines that are no circles reach into a little more.
    """
    population = ROCK_ABUNDANCES[name]
    edges = np.geomspace(population.minimum_diameter, population.maximum_diameter, 400)
    number, middle = -np.diff(population.density_above(edges)), np.sqrt(edges[1:] * edges[:-1])
    even = 1.0 - math.exp(-float(number @ (1.0 + 2.0 * middle + math.pi * middle**2 / 4.0)))
    kinds = [add_detail(open_own_terrain(coarse), GroundDetail(seed, name), 1).kinds for seed in (7, 8)]
    assert 0.6 * even < np.mean(np.array(kinds) & ADDED_ROCK > 0) < 1.02 * even


def test_the_slopes_of_the_model_go_on_below_its_posts() -> None:
    """Of a self-affine surface only post means are kept; what is filled in has the variance that went.

    The RMS slope of a tile of a square kilometre scatters by about a tenth.
    """
    whole = generate_base_surface(SURFACE, 1000, 1.0, np.random.default_rng(11)).astype(np.float64)
    posts = post_means(whole)
    surface = measure_surface(posts, float(SIDE))
    assert surface.hurst == pytest.approx(SURFACE.hurst, abs=0.08)
    assert math.tan(surface.rms_slope) == pytest.approx(math.tan(SURFACE.rms_slope), rel=0.2)
    weights = axis_weights(0, 1000, float(SIDE), posts.shape[0])
    smooth = resample(posts, weights, weights)
    drawn = generate_base_surface(surface, 1000, 1.0, np.random.default_rng(12), 2.0 * SIDE)
    axis = lay_posts(0, 1000, float(SIDE), posts.shape[0])
    filled = smooth + remove_post_means(drawn.astype(np.float64), axis, axis)
    for cells in (1, 2, 4):
        wanted, lost = rms_slope(whole, cells=cells), rms_slope(smooth, cells=cells)
        assert lost < 0.85 * wanted
        assert rms_slope(filled, cells=cells) == pytest.approx(wanted, rel=0.15)
    np.testing.assert_allclose(post_means(filled), post_means(smooth), atol=1e-9)


def test_a_plane_is_no_roughness() -> None:
    north, east = np.mgrid[:200, :200] * 5.0
    rough = generate_base_surface(SURFACE, 200, 5.0, np.random.default_rng(0)).astype(np.float64)
    level, tilted = measure_surface(rough, 5.0), measure_surface(rough + 0.3 * north - 0.1 * east, 5.0)
    assert tilted.rms_slope == pytest.approx(level.rms_slope, rel=1e-6)
    assert tilted.hurst == pytest.approx(level.hurst, rel=1e-6)
    flat = measure_surface(np.zeros((200, 200)), 5.0)
    assert flat.rms_slope == 0.0


def test_the_provenance_says_what_was_added(coarse: Path) -> None:
    plain, sparse, dense = (
        open_own_terrain(coarse),
        with_detail(coarse, 1, "sparse"),
        with_detail(coarse, 1, "dense"),
    )
    assert "added" not in plain.description()
    added = json.loads(json.dumps(dense.description(), default=str))["added"]
    assert (added["seed"], added["rock_abundance"]) == (1, "dense")
    assert added["rocks"]["area_fraction"] == 0.06
    assert added["craters"]["minimum_diameter"] == 1.0
    assert added["craters"]["maximum_diameter"] == 22.5
    assert added["longest_wave"] == 10.0
    keys = {Ground(terrain, SafetyCriteria()).key for terrain in (plain, sparse, dense)}
    assert len(keys) == 3
    assert build_tile(Ground(plain, SafetyCriteria()), 0).added is None


def test_what_cannot_be_added_is_one_line(coarse: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "fine.npy", generate_base_surface(SURFACE, 1000, 1.0, np.random.default_rng(0)))
    with pytest.raises(ValueError, match="pixels of 1 m show their own hazards"):
        with_detail(tmp_path / "fine.npy")
    with pytest.raises(ValueError, match="rock abundance"):
        GroundDetail(1, "rocky")
    for seed in (-1, 1.5, True):
        with pytest.raises(ValueError, match="whole number"):
            GroundDetail(seed)  # pyright: ignore[reportArgumentType]
