"""Bands, units and transforms of GeoTIFFs: what is taken, and advice that fits the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from hda.ground.elevation_file import ElevationFileError, open_elevation
from hda.ground.own_terrain import cut_tile, open_own_terrain
from tests.ground_files import MOON, write_geotiff

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

HEIGHTS = np.random.default_rng(0).normal(size=(100, 100)).astype(np.float32)
LOCAL = 'LOCAL_CS["site",UNIT["{}",{}]]'


def refusal(path: Path, **options: Any) -> str:
    with pytest.raises(ElevationFileError) as caught, open_elevation(path, **options):
        pass
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def write_bands(path: Path, *bands: np.ndarray, **options: Any) -> Path:
    place = Affine(10, 0, 5000, 0, -10, 9000)
    shape = {"height": 100, "width": 100, "count": len(bands), "dtype": "float32"}
    with rasterio.open(path, "w", driver="GTiff", crs=MOON, transform=place, **shape) as stream:
        for number, band in enumerate(bands, 1):
            stream.write(band[::-1], number)
        for name, values in options.items():
            setattr(stream, name, values)
    return path


@pytest.mark.parametrize("rotation", [1e-13, -3e-10])
def test_rotation_that_is_rounding_is_accepted(tmp_path: Path, rotation: float) -> None:
    place = Affine(1, rotation, 5000, rotation, -1, 9000)
    with open_elevation(write_geotiff(tmp_path / "s.tif", HEIGHTS, transform=place)) as source:
        np.testing.assert_array_equal(source.read(0, 100, 0, 100), HEIGHTS)


@pytest.mark.parametrize("rotation", [1e-6, -0.1])
def test_rotation_that_is_not_is_refused_with_a_command(tmp_path: Path, rotation: float) -> None:
    place = Affine(2, rotation, 5000, rotation, -2, 9000)
    message = refusal(write_geotiff(tmp_path / "s.tif", HEIGHTS, transform=place))
    assert "is rotated or mirrored" in message
    assert "-tr 2 2 -r cubic -dstnodata nan s.tif s-metres.tif" in message


def test_of_several_bands_one_must_be_chosen(tmp_path: Path) -> None:
    path = write_bands(tmp_path / "s.tif", HEIGHTS, HEIGHTS + 7.0, descriptions=("elevation", "spread"))
    message = refusal(path)
    assert "holds 2 bands (1: elevation, 2: spread)" in message
    assert "--band 1 takes the first (band=1 in Python)" in message
    for band, shift in ((1, 0.0), (2, 7.0)):
        terrain = open_own_terrain(path, band=band)
        assert terrain.identity().get("band", 1) == band
        assert np.nanmean(cut_tile(terrain, 0)) == pytest.approx(float(HEIGHTS.mean()) + shift, abs=0.05)


@pytest.mark.parametrize("band", [0, 3, -1, True, 1.5, "1"])
def test_a_band_that_is_not_there_is_refused(tmp_path: Path, band: Any) -> None:
    path = write_bands(tmp_path / "s.tif", HEIGHTS, HEIGHTS)
    assert "band must be 1 to 2" in refusal(path, band=band)


def test_a_band_of_an_array_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "s.npy", HEIGHTS)
    with pytest.raises(ValueError, match="band is for GeoTIFF files"):
        open_own_terrain(tmp_path / "s.npy", 10.0, band=2)
    assert open_own_terrain(tmp_path / "s.npy", 10.0, band=1) == open_own_terrain(tmp_path / "s.npy", 10.0)


def test_an_alpha_band_says_what_is_unknown(tmp_path: Path) -> None:
    alpha = np.full_like(HEIGHTS, 255.0)
    alpha[:, :5] = 0.0
    colors = (ColorInterp.gray, ColorInterp.alpha)
    path = write_bands(tmp_path / "s.tif", np.where(alpha == 0.0, 0.0, HEIGHTS), alpha, colorinterp=colors)
    assert "2: alpha" in refusal(path)
    tile = cut_tile(open_own_terrain(path, band=1), 0)
    assert np.isnan(tile[:, :50]).all()
    assert np.isfinite(tile[:, 80:]).all()


@pytest.mark.parametrize("unit", ["unknown", "Unknown", "none", "[m]", "metres", "m"])
def test_a_unit_that_says_nothing_counts_as_metres(tmp_path: Path, unit: str) -> None:
    with open_elevation(write_geotiff(tmp_path / "s.tif", HEIGHTS, unit=unit)) as source:
        np.testing.assert_array_equal(source.read(0, 100, 0, 100), HEIGHTS)


@pytest.mark.parametrize("unit", ["ft", "foot", "US survey foot", "km", "cm"])
def test_another_unit_is_refused(tmp_path: Path, unit: str) -> None:
    message = refusal(write_geotiff(tmp_path / "s.tif", HEIGHTS, unit=unit))
    assert f"heights must be in metres, got '{unit}'" in message
    assert "gdal_edit.py -units m s.tif" in message


def test_heights_over_a_vertical_system_in_feet_are_refused(tmp_path: Path) -> None:
    crs = CRS.from_user_input("EPSG:32633+6360")
    place = Affine(1, 0, 500e3, 0, -1, 5e6)
    assert "US survey foot" in refusal(write_geotiff(tmp_path / "s.tif", HEIGHTS, crs=crs, transform=place))


@pytest.mark.parametrize(
    ("options", "wanted"),
    [
        (
            {"crs": CRS.from_wkt(LOCAL.format("foot", 0.3048))},
            "must be metres of a projected system, got 'foot'",
        ),
        ({"crs": CRS.from_wkt(LOCAL.format("kilometre", 1000))}, "must be metres"),
        (
            {
                "crs": CRS.from_wkt(LOCAL.format("metre", 1)),
                "transform": Affine(1, 0.2, 0, 0.2, -1, 0),
            },
            "is rotated or mirrored",
        ),
        (
            {"crs": CRS.from_wkt(LOCAL.format("metre", 1)), "transform": Affine(1, 0, 0, 0, -2, 0)},
            "make them square",
        ),
        ({"crs": CRS.from_epsg(4978), "transform": Affine(2, 0, 9, 0, -2, 9)}, "must be metres"),
    ],
)
def test_no_command_where_it_could_not_work(tmp_path: Path, options: dict[str, Any], wanted: str) -> None:
    message = refusal(write_geotiff(tmp_path / "s.tif", HEIGHTS, **options))
    assert wanted in message
    assert "gdalwarp" not in message
    assert "save its heights as .npy" in message


def test_the_advice_for_an_array_names_no_tool_for_geotiffs(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(1000, 1000))
    heights[:3] = -12345.0
    np.save(tmp_path / "s.npy", heights)
    with pytest.raises(ElevationFileError) as caught:
        open_own_terrain(tmp_path / "s.npy")
    np.save(tmp_path / "holes.npy", np.full((1000, 1000), np.nan))
    with pytest.raises(ValueError, match="unknown ground") as holes:
        open_own_terrain(tmp_path / "holes.npy")
    for message, name in ((str(caught.value), "s.npy"), (str(holes.value), "holes.npy")):
        assert "gdal" not in message
        assert name in message
    assert "tile 0" in str(caught.value)


def test_whole_numbers_become_decimal_ones_on_the_way_and_keep_what_was_declared(tmp_path: Path) -> None:
    stored = (HEIGHTS * 10).astype(np.int16)
    degrees = CRS.from_proj4("+proj=longlat +R=1737400 +no_defs")
    place = Affine(1e-4, 0, 30, 0, -1e-4, 60)
    message = refusal(write_geotiff(tmp_path / "s.tif", stored, crs=degrees, transform=place), nodata=-7)
    assert "+lat_0=59.9950 +lon_0=30.0050 +R=1737400 +units=m" in message
    assert "-tr 1.5 1.5 -r cubic -ot Float32 -srcnodata -7 -dstnodata nan" in message  # 3 m by 1.5 m there
