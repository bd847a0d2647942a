"""A user's own ground: files into tiles, the house frame, and one clear line for what cannot be flown."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rasterio.crs import CRS
from rasterio.transform import Affine

from hda.ground import library as dtm_library
from hda.ground.elevation_file import ElevationFileError, open_elevation
from hda.ground.library import Ground, check_split, load_tile, prepare_tiles, tile_numbers
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain, cut_tile, open_own_terrain
from hda.ground.resampling import axis_weights, resample
from hda.safety.criteria import SafetyCriteria
from hda.task.own_ground import place_preset
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from hda.terrain.generator import generate_terrain, terrain_rng
from hda.terrain.settings import PAPER_TERRAIN
from tests.ground_files import MOON, write_geotiff

# rasterio 1.4 multiplies affine 3 transforms the old way, inside itself.
pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

DEGREES = CRS.from_proj4("+proj=longlat +R=1737400 +no_defs")


def plane(rows: int, columns: int, side: float) -> np.ndarray:
    north, east = (np.arange(rows) + 0.5) * side, (np.arange(columns) + 0.5) * side
    return 7.0 + 0.05 * north[:, None] - 0.02 * east[None, :]


# ---- resampling ----


@given(
    side=st.one_of(st.sampled_from([0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0]), st.floats(0.1, 10.0)),
    first=st.integers(0, 40),
    cells=st.integers(1, 60),
)
@settings(max_examples=60)
def test_a_plane_stays_the_same_plane(side: float, first: int, cells: int) -> None:
    pixels = max(4, int(np.ceil((first + cells) / side)))
    weights = axis_weights(first, cells, side, pixels)
    heights = plane(pixels, pixels, side)[weights.first : weights.last, weights.first : weights.last]
    centres = slice(first, first + cells)
    expected = plane(first + cells, first + cells, 1.0)[centres, centres]
    inside = (np.arange(cells) + first + 1) <= pixels * side  # the last pixel may end within a cell
    found = resample(heights, weights, weights)
    cut_through = side < 1.0 and abs(1.0 / side - round(1.0 / side)) > 1e-9
    atol = (0.05 + 0.02) * side / 2.0 if cut_through else 1e-9
    np.testing.assert_allclose(found[inside][:, inside], expected[inside][:, inside], atol=atol)


def test_averages_are_those_of_blocks() -> None:
    heights = np.random.default_rng(0).normal(size=(40, 40))
    weights = axis_weights(2, 6, 0.25, 40)
    blocks = heights.reshape(10, 4, 10, 4).mean(axis=(1, 3))
    found = resample(heights[weights.first : weights.last, weights.first : weights.last], weights, weights)
    np.testing.assert_allclose(found, blocks[2:8, 2:8], atol=1e-12)


def test_finer_ground_is_gdal_cubic_convolution() -> None:
    """Independent code: GDAL resamples the same pixels; away from the edge it must agree."""
    from rasterio.enums import Resampling
    from rasterio.warp import reproject

    heights = np.random.default_rng(1).normal(size=(30, 30))
    gdal = np.zeros((120, 120))
    reproject(
        heights,
        gdal,
        src_transform=Affine(4, 0, 0, 0, -4, 120),
        dst_transform=Affine(1, 0, 0, 0, -1, 120),
        src_crs=MOON,
        dst_crs=MOON,
        resampling=Resampling.cubic,
    )
    weights = axis_weights(0, 120, 4.0, 30)
    np.testing.assert_allclose(
        resample(heights, weights, weights)[12:-12, 12:-12], gdal[12:-12, 12:-12], atol=1e-5
    )


def test_a_cell_that_needs_an_unknown_pixel_is_unknown() -> None:
    heights = np.zeros((40, 40))
    heights[20, 10] = np.nan
    for side, north, east in ((0.5, [10], [5]), (1.0, [20], [10])):
        cells = int(40 * side)
        weights = axis_weights(0, cells, side, 40)
        assert [place.tolist() for place in np.nonzero(np.isnan(resample(heights, weights, weights)))] == [
            north,
            east,
        ]
    weights = axis_weights(0, 80, 2.0, 40)
    unknown = np.isnan(resample(heights, weights, weights))
    rows, columns = np.nonzero(unknown)
    assert unknown[40:42, 20:22].all()  # its own cells
    assert rows.min() >= 37
    assert rows.max() <= 44
    assert columns.min() >= 17
    assert columns.max() <= 24


# ---- files ----


def test_a_geotiff_is_read_south_first(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(30, 50)).astype(np.float32)
    with open_elevation(write_geotiff(tmp_path / "site.tif", heights)) as source:
        assert source.shape == (30, 50)
        assert source.pixel_size == (1.0, 1.0)
        np.testing.assert_array_equal(source.read(0, 30, 0, 50), heights)
        np.testing.assert_array_equal(source.read(3, 9, 10, 40), heights[3:9, 10:40])


def test_a_south_up_geotiff_is_not_flipped(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(30, 50)).astype(np.float32)
    path = write_geotiff(tmp_path / "site.tif", heights[::-1], transform=Affine(1, 0, 500, 0, 1, 700))
    with open_elevation(path) as source:
        np.testing.assert_array_equal(source.read(2, 30, 0, 50), heights[2:])


def test_no_data_scale_and_offset_of_a_geotiff(tmp_path: Path) -> None:
    stored = np.arange(600, dtype=np.int16).reshape(20, 30)
    stored[4, 5] = -32768
    path = write_geotiff(tmp_path / "site.tiff", stored, nodata=-32768, scale=(0.5, 100.0))
    with open_elevation(path) as source:
        heights = source.read(0, 20, 0, 30)
    assert np.isnan(heights[4, 5])
    assert np.isnan(heights).sum() == 1
    assert heights[2, 3] == stored[2, 3] * 0.5 + 100.0


def test_infinite_heights_are_unknown(tmp_path: Path) -> None:
    heights = np.zeros((12, 12))
    heights[3, 4], heights[5, 6] = np.inf, -np.inf
    np.save(tmp_path / "site.npy", heights)
    with open_elevation(tmp_path / "site.npy") as source:
        assert np.isnan(source.read(0, 12, 0, 12)).sum() == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"crs": DEGREES, "transform": Affine(1e-5, 0, 30, 0, -1e-5, -85)}, "in degrees.*gdalwarp -t_srs"),
        ({"crs": DEGREES}, "in degrees.*do not lie in that system"),
        ({"crs": None}, "no coordinate system"),
        ({"crs": CRS.from_proj4("+proj=stere +lat_0=-85 +R=1737400 +units=km")}, "must be metres"),
        ({"transform": Affine(1, 0.5, 0, 0.5, -1, 0)}, "rotated"),
        ({"transform": Affine(-1, 0, 500, 0, -1, 700)}, "mirrored"),
        ({"transform": Affine(1, 0, 0, 0, -2, 0)}, "make them square"),
        ({"count": 2}, "one band"),
        ({"unit": "feet"}, "heights must be in metres"),
    ],
)
def test_a_geotiff_that_is_not_metres_is_refused_in_one_line(
    tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    path = write_geotiff(tmp_path / "site.tif", np.zeros((20, 20), np.float32), **options)
    with pytest.raises(ElevationFileError, match=words) as caught, open_elevation(path):
        pass
    assert "\n" not in str(caught.value)
    assert "site.tif" in str(caught.value)


def test_complex_heights_are_refused(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "site.tif", np.zeros((20, 20), np.complex64))
    with pytest.raises(ElevationFileError, match="real numbers"), open_elevation(path):
        pass


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("site.npy", np.zeros(12), "two dimensions"),
        ("site.npy", np.zeros((3, 4), bool), "bool"),
        ("site.npy", np.zeros((3, 4), complex), "complex"),
        ("site.npy", np.array([[{}]], dtype=object), "not a readable"),
        ("site.txt", np.zeros((3, 4)), "must be a GeoTIFF"),
    ],
)
def test_another_array_is_refused(tmp_path: Path, name: str, content: np.ndarray, words: str) -> None:
    np.save(tmp_path / "array.npy", content, allow_pickle=True)
    (tmp_path / "array.npy").rename(tmp_path / name)
    with pytest.raises(ElevationFileError, match=words), open_elevation(tmp_path / name):
        pass


def test_an_archive_of_arrays_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "site.npz", np.zeros((3, 3)))
    (tmp_path / "site.npz").rename(tmp_path / "site.npy")
    with pytest.raises(ElevationFileError, match="archive"), open_elevation(tmp_path / "site.npy"):
        pass


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ElevationFileError, match="no such file"):
        open_own_terrain(tmp_path / "none.tif")


def test_a_geotiff_says_its_own_pixel_size(tmp_path: Path) -> None:
    path = write_geotiff(tmp_path / "site.tif", np.zeros((20, 20), np.float32))
    with pytest.raises(ValueError, match="pixel_size"):
        open_own_terrain(path, pixel_size=2.0)


# ---- tiles ----


def test_tiles_are_counted_from_the_south_west(tmp_path: Path) -> None:
    heights = np.zeros((1100, 520))  # 2 m: 2200 m by 1040 m, two tiles and strips left over
    heights += np.arange(1100)[:, None] * 0.1
    np.save(tmp_path / "site.npy", heights)
    terrain = open_own_terrain(tmp_path / "site.npy", pixel_size=2.0)
    assert terrain.tiles == (0, 1)
    assert terrain.tile_columns == 1
    assert terrain.resampling == "cubic convolution"
    north = (np.arange(1000) + 0.5) * 0.05 - 0.05
    np.testing.assert_allclose(cut_tile(terrain, 0)[:, 500], north, atol=1e-9)
    np.testing.assert_allclose(cut_tile(terrain, 1)[:, 0], north + 50.0, atol=1e-9)


def test_a_file_at_one_metre_is_taken_as_it_is(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(1000, 2003)).astype(np.float32)
    terrain = open_own_terrain(write_geotiff(tmp_path / "site.tif", heights))
    assert terrain.tiles == (0, 1)
    assert terrain.resampling == "none"
    np.testing.assert_array_equal(cut_tile(terrain, 1), heights[:, 1000:2000])


def test_a_tile_with_much_unknown_ground_is_left_out(tmp_path: Path) -> None:
    heights = np.zeros((500, 1500), np.float32)
    heights[:100, :501] = np.nan  # a fifth of the first tile, one column of the second
    heights[:, 1000:1049] = np.nan  # 9.8 % of the third
    np.save(tmp_path / "site.npy", heights)
    terrain = open_own_terrain(tmp_path / "site.npy", pixel_size=2.0, flat_is_ground=True)
    assert terrain.tiles == (1, 2)
    assert terrain.left_out == 1
    np.save(tmp_path / "holes.npy", np.full((1000, 1000), np.nan))
    with pytest.raises(ValueError, match="unknown ground"):
        open_own_terrain(tmp_path / "holes.npy")


@pytest.mark.parametrize(
    ("shape", "side", "words"),
    [
        ((999, 1000), 1.0, "at least 1000 x 1000 m are needed"),
        ((200, 199), 5.0, "covers 995 x 1000 m"),
        ((1, 1), 0.1, "are needed"),
        ((0, 5), 1.0, "are needed"),
        ((100, 100), 20.0, "where a lander can stand"),
    ],
)
def test_a_file_that_holds_no_tile_is_refused(
    tmp_path: Path, shape: tuple[int, int], side: float, words: str
) -> None:
    np.save(tmp_path / "site.npy", np.zeros(shape))
    with pytest.raises(ValueError, match=words):
        open_own_terrain(tmp_path / "site.npy", pixel_size=side)


def test_an_undeclared_no_data_value_is_noticed(tmp_path: Path) -> None:
    heights = np.zeros((1000, 1000), np.float32)
    heights[3, 3] = -9999.0
    path = write_geotiff(tmp_path / "site.tif", heights)
    for flat_is_ground in (False, True):
        with pytest.raises(ValueError, match="no-data value that the file does not declare"):
            open_own_terrain(path, flat_is_ground=flat_is_ground)


def test_a_file_that_changes_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "site.npy"
    np.save(path, np.zeros((1000, 1000), np.float32))
    terrain = open_own_terrain(path, flat_is_ground=True)
    np.save(path, np.ones((1000, 1001), np.float32))
    with pytest.raises(ValueError, match="was changed"):
        cut_tile(terrain, 0)


# ---- flown ----


@pytest.fixture(scope="module")
def hazardous(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tile of generated ground in a file, with a hole."""
    path = tmp_path_factory.mktemp("own") / "site.npy"
    heights = generate_terrain(PAPER_TERRAIN, terrain_rng(7)) - 300.0
    heights[300:310, 300:310] = np.nan
    np.save(path, heights)
    return path


def test_a_preset_on_own_ground(hazardous: Path, cache: Path) -> None:
    preset = place_preset("paper", hazardous, workers=1)
    assert preset.name == "paper-site"
    scenario = sample_scenario(preset, 3, 5, OWN_SPLIT)
    elevation = scenario.tile.elevation
    assert np.nanmax(elevation) == 50.0
    assert np.isnan(elevation[300:310, 300:310]).all()
    assert not scenario.tile.deterministic[300:310, 300:310].any()
    assert (scenario.tile.probability[300:310, 300:310] == 0.0).all()
    assert scenario.tile.deterministic.any()
    assert scenario.nominal_target[2] == 50.0
    assert scenario.tile.hazard_share(scenario.nominal_target, 100.0) >= 0.8
    original = generate_terrain(PAPER_TERRAIN, terrain_rng(7))
    known = np.isfinite(elevation)
    np.testing.assert_allclose(elevation[known], original[known], atol=1e-4)


def test_it_is_cached_under_its_content(hazardous: Path, cache: Path, tmp_path: Path) -> None:
    preset = place_preset("paper", hazardous, workers=1)
    assert isinstance(preset.terrain, OwnTerrain)
    ground = Ground(preset.terrain, preset.criteria)
    assert (ground.folder() / "tile-00000" / "elevation.npy").exists()
    assert json.loads((ground.folder() / "parameters.json").read_text())["terrain"]["sha256"]
    copy = tmp_path / "copy.npy"
    copy.write_bytes(hazardous.read_bytes())
    again = open_own_terrain(copy)
    assert again == preset.terrain
    assert Ground(again, preset.criteria).key == ground.key
    assert again.description()["file"] == "copy.npy"
    assert "file" not in again.identity()
    heights = np.load(hazardous, allow_pickle=False)
    heights[0, 0] += 0.25
    np.save(copy, heights)
    other = open_own_terrain(copy)
    assert Ground(other, preset.criteria).key != ground.key


def test_splits_do_not_mix(hazardous: Path) -> None:
    ground = Ground(open_own_terrain(hazardous), SafetyCriteria())
    assert tile_numbers(OWN_SPLIT, ground) == (0,)
    for split in dtm_library.SPLITS:
        with pytest.raises(ValueError, match="split must be 'own'"):
            load_tile(ground, 0, split)
        with pytest.raises(ValueError, match="split must be 'own'"):
            prepare_tiles(ground, split, 1)
    with pytest.raises(ValueError, match="needs a terrain of your own"):
        sample_scenario("paper", 0, 0, OWN_SPLIT)
    with pytest.raises(ValueError, match="tile 1 does not belong"):
        check_split(1, OWN_SPLIT, ground)


def test_ground_without_enough_hazard_is_refused_after_bounded_tries(cache: Path, tmp_path: Path) -> None:
    path = tmp_path / "smooth.npy"
    np.save(path, np.zeros((100, 100), np.float32))
    with pytest.raises(ValueError, match=r"80% hazard.*10000 draws \(the most was 0\.0%\).*hazard_share"):
        place_preset("paper", path, pixel_size=10.0, flat_is_ground=True, workers=1)
    preset = place_preset("paper", path, pixel_size=10.0, flat_is_ground=True, hazard_share=0.0, workers=1)
    assert sample_scenario(preset, 0, 0, OWN_SPLIT).tile.deterministic[500, 500]
    with pytest.raises(ValueError, match="hazard_share"):
        place_preset("paper", path, pixel_size=10.0, hazard_share=1.5)


def test_training_does_not_take_it(hazardous: Path) -> None:
    from rl.environment.env import EpisodeSource

    preset = replace(PRESETS["paper"], terrain=open_own_terrain(hazardous))
    for split in ("train", "tuning"):
        with pytest.raises(ValueError, match="split must be 'own'"):
            EpisodeSource(preset, split).scenario(0, 0, {})
