"""Values that stand for unknown ground, in files that do not say so."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from scipy.ndimage import gaussian_filter, zoom

from hda.ground.elevation_file import ElevationFileError
from hda.ground.own_terrain import cut_tile, open_own_terrain
from tests.ground_files import write_geotiff

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")


def make_ground(offset: float = -2400.0, pixels: int = 500, seed: int = 0) -> np.ndarray:
    """Heights of gentle ground [m], 2 m a pixel."""
    rng = np.random.default_rng(seed)
    smooth = np.asarray(gaussian_filter(rng.normal(size=(pixels, pixels)), 25.0))
    return offset + 12.0 * smooth / smooth.std() + rng.normal(scale=0.02, size=smooth.shape)


def make_wedge(pixels: int = 500) -> np.ndarray:
    row, column = np.mgrid[:pixels, :pixels]
    return column < 0.3 * row


def refusal(path: Path, **options: Any) -> str:
    with pytest.raises(ElevationFileError) as caught:
        open_own_terrain(path, **({"pixel_size": 2.0} if path.suffix == ".npy" else {}), **options)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_wedge_of_zeros_is_refused_with_its_share_and_what_to_do(tmp_path: Path) -> None:
    heights, path = make_ground(), tmp_path / "site.npy"
    heights[make_wedge()] = 0.0
    np.save(path, heights)
    message = refusal(path)
    assert "15.1% of tile 0 is exactly 0 m" in message
    for words in ("--nodata=0", "nodata=0 in Python", "--flat-is-ground", "flat_is_ground=True"):
        assert words in message
    assert open_own_terrain(path, 2.0, flat_is_ground=True).tiles == (0,)
    with pytest.raises(ValueError, match="more than 10% of every 1000 x 1000 m is unknown"):
        open_own_terrain(path, 2.0, nodata=0)


@pytest.mark.parametrize("value", [0.0, -9999.0, -32767.0, -32768.0, 65535.0, -3.4028234663852886e38, 1e20])
@pytest.mark.parametrize("kind", ["float32", "float64"])
def test_a_tile_of_one_value_is_refused(tmp_path: Path, value: float, kind: str) -> None:
    path = tmp_path / "site.npy"
    np.save(path, np.full((500, 500), value, kind))
    assert "100% of tile 0 is exactly" in refusal(path)
    if abs(value) > 1e9:  # no height of any ground
        assert "--flat-is-ground" not in refusal(path, flat_is_ground=True)
    else:
        assert open_own_terrain(path, 2.0, flat_is_ground=True).tiles == (0,)


def test_a_tile_that_is_flat_but_for_rounding_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "site.npy"
    np.save(path, -9998.5 + np.random.default_rng(0).normal(scale=1e-3, size=(500, 500)))
    assert "tile 0 without relief" in refusal(path)
    assert open_own_terrain(path, 2.0, flat_is_ground=True).tiles == (0,)


@pytest.mark.parametrize("kind", ["int16", "uint16", "int32", "float32"])
def test_the_end_of_a_type_is_no_height(tmp_path: Path, kind: str) -> None:
    end = float(np.finfo("f4").min if kind == "float32" else np.iinfo(kind).max)
    heights = make_ground(200.0).astype(kind)
    heights[7:9, 30:33] = end
    path = write_geotiff(tmp_path / "site.tif", heights, 2.0, scale=(0.5, -3.0))
    message = refusal(path)
    assert f"is exactly {end * 0.5 - 3.0:.9g} m" in message
    value = float(message.partition("--nodata=")[2].split()[0])
    assert value == pytest.approx(end, rel=1e-8)  # as it is stored, not as a height
    terrain = open_own_terrain(path, nodata=value)
    assert terrain.nodata == (value,)
    tile = cut_tile(terrain, 0)
    assert np.isnan(tile[14:18, 60:66]).all()
    assert np.nanmax(tile) < 200.0


@pytest.mark.parametrize(
    "place",
    [
        (slice(0, 80), slice(0, 500)),  # along an edge, up to where the file is read in strips
        (slice(0, 50), slice(0, 500)),
        (slice(430, 500), slice(450, 500)),  # a corner
        (slice(250, 251), slice(0, 500)),  # one row that was lost
        (slice(0, 500), slice(100, 102)),
        (slice(200, 205), slice(300, 305)),
    ],
)
@pytest.mark.parametrize("step", [0.0, 1.0])
def test_wherever_it_lies(tmp_path: Path, place: tuple[slice, slice], step: float) -> None:
    heights = make_ground()
    heights = np.round(heights / step) * step if step else heights
    heights[place] = -2290.0
    np.save(tmp_path / "site.npy", heights)
    assert "is exactly -2290 m" in refusal(tmp_path / "site.npy")


@pytest.mark.parametrize("fill", ["lowest", "middle", "highest"])
def test_a_value_among_the_heights_is_seen_by_its_cliffs(tmp_path: Path, fill: str) -> None:
    heights = make_ground(0.0)
    level = {"lowest": heights.min(), "middle": 0.0, "highest": heights.max()}[fill]
    heights[make_wedge()] = level
    np.save(tmp_path / "site.npy", heights)
    assert f"is exactly {level:.9g} m" in refusal(tmp_path / "site.npy")


def test_a_void_that_was_resampled_with_the_ground_is_seen(tmp_path: Path) -> None:
    heights = make_ground(pixels=250)
    heights[make_wedge(250)] = 0.0
    np.save(tmp_path / "site.npy", np.asarray(zoom(heights, 2.0, order=1, grid_mode=True, mode="nearest")))
    assert "is exactly 0 m" in refusal(tmp_path / "site.npy")


def test_a_void_behind_unknown_ground_is_seen(tmp_path: Path) -> None:
    heights = make_ground()
    heights[:22] = np.nan
    heights[:20] = 0.0
    np.save(tmp_path / "site.npy", heights)
    assert "is exactly 0 m" in refusal(tmp_path / "site.npy")


def test_single_spikes_are_seen_even_on_flat_ground(tmp_path: Path) -> None:
    heights = make_ground()
    heights[100, 200] = heights[300, 400] = 0.0
    np.save(tmp_path / "site.npy", heights)
    for flat_is_ground in (False, True):
        message = refusal(tmp_path / "site.npy", flat_is_ground=flat_is_ground)
        assert "is exactly 0 m" in message
        assert "--flat-is-ground" not in message
    assert open_own_terrain(tmp_path / "site.npy", 2.0, nodata=0.0).tiles == (0,)


def test_several_values_are_named_and_declared_together(tmp_path: Path) -> None:
    heights = make_ground()
    heights[:20], heights[-15:] = 0.0, -9999.0
    np.save(tmp_path / "site.npy", heights)
    assert "is exactly 0 m (as are others: -9999 m)" in refusal(tmp_path / "site.npy")
    assert "is exactly -9999 m;" in refusal(tmp_path / "site.npy", nodata=0)
    terrain = open_own_terrain(tmp_path / "site.npy", 2.0, nodata=[0, -9999])
    assert terrain.nodata == (-9999.0, 0.0)
    assert np.isnan(cut_tile(terrain, 0)).mean() == pytest.approx(0.07, abs=0.01)


@pytest.mark.parametrize("repeat", [1, 2, 5])
def test_the_share_is_that_of_the_file(tmp_path: Path, repeat: int) -> None:
    """With pixels that are repeated, and beside unknown ground."""
    heights = make_ground(pixels=500 // repeat)
    heights[-60 // repeat :] = 0.0
    heights = np.repeat(np.repeat(heights, repeat, axis=0), repeat, axis=1)
    heights[:50] = np.nan
    np.save(tmp_path / "site.npy", heights)
    assert "12% of tile 0 is exactly 0 m" in refusal(tmp_path / "site.npy")


def test_the_tiles_are_named(tmp_path: Path) -> None:
    heights = np.hstack([make_ground(seed=seed) for seed in range(3)])
    heights[:, 520:560] = 0.0
    heights[:, 1000:1060] = 0.0
    np.save(tmp_path / "site.npy", heights)
    assert "10% of tiles 1, 2 is exactly 0 m" in refusal(tmp_path / "site.npy")


# ---- ground that must not be taken for a void ----


def quantized(heights: np.ndarray, step: float) -> np.ndarray:
    return np.round(heights / step) * step


@pytest.mark.parametrize(
    "change",
    [
        lambda heights: heights,
        lambda heights: heights.astype(np.float32),
        lambda heights: quantized(heights, 0.1),
        lambda heights: quantized(heights, 0.5),
        lambda heights: np.round(heights).astype(np.int16),
        lambda heights: np.round(heights * 0.1).astype(np.int16),  # two or three levels in all
        lambda heights: np.repeat(np.repeat(heights[::5, ::5], 5, axis=0), 5, axis=1),
        lambda heights: np.repeat(np.repeat(np.round(heights[::2, ::2]), 2, axis=0), 2, axis=1),
        lambda heights: np.maximum(heights, np.quantile(heights, 0.3)),  # a lake
        lambda heights: np.minimum(heights, np.quantile(heights, 0.7)),
    ],
)
def test_measured_ground_is_accepted(tmp_path: Path, change: Any) -> None:
    np.save(tmp_path / "site.npy", change(make_ground()))
    assert open_own_terrain(tmp_path / "site.npy", 2.0).tiles == (0,)


@pytest.mark.parametrize("step", [0.0, 0.1, 0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("preset", ["paper", "hard"])
def test_rocky_ground_in_steps_is_accepted(tmp_path: Path, preset: str, step: float) -> None:
    from tests.trust.made_ground import rough_ground

    heights = rough_ground(preset)
    np.save(tmp_path / "site.npy", quantized(heights, step) if step else heights)
    assert open_own_terrain(tmp_path / "site.npy").tiles == (0,)


def test_a_declared_no_data_value_is_no_void(tmp_path: Path) -> None:
    heights = make_ground().astype(np.float32)
    heights[:, :40] = -9999.0
    path = write_geotiff(tmp_path / "site.tif", heights, 2.0, nodata=-9999.0)
    assert np.isnan(cut_tile(open_own_terrain(path), 0)[:, :80]).all()


def test_a_mask_in_the_file_is_no_void(tmp_path: Path) -> None:
    heights = make_ground().astype(np.float32)
    heights[:, :40] = 0.0
    path = write_geotiff(tmp_path / "site.tif", heights, 2.0)
    with rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True), rasterio.open(path, "r+") as stream:
        stream.write_mask((heights != 0.0)[::-1])
    assert np.isnan(cut_tile(open_own_terrain(path), 0)[:, :80]).all()


# ---- identity ----


def test_what_changes_the_ground_changes_its_key_and_nothing_else_does(tmp_path: Path) -> None:
    heights = make_ground()
    heights[:20] = 0.0
    np.save(tmp_path / "site.npy", heights)
    flat = open_own_terrain(tmp_path / "site.npy", 2.0, flat_is_ground=True)
    unknown = open_own_terrain(tmp_path / "site.npy", 2.0, nodata=0.0)
    usual = {"sha256", "source_pixel", "tile_columns", "tiles", "left_out", "maximum_elevation", "resampling"}
    assert set(flat.identity()) == usual  # as it was before there were choices: its cached tiles stay good
    assert set(unknown.identity()) == usual | {"nodata"}
    assert flat.description()["flat_is_ground"] is True
    assert unknown.description()["flat_is_ground"] is False


@pytest.mark.parametrize("nodata", [np.nan, np.inf, "zero", [0.0, None]])
def test_a_no_data_value_is_a_number(tmp_path: Path, nodata: Any) -> None:
    np.save(tmp_path / "site.npy", make_ground())
    with pytest.raises(ValueError, match="nodata must be"):
        open_own_terrain(tmp_path / "site.npy", 2.0, nodata=nodata)
