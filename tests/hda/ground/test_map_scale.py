"""How long a metre of a map is: closed forms, correction, and a refusal whose advice works."""

import math
import shlex
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine
from rasterio.warp import Resampling, calculate_default_transform, reproject, transform

from hda.ground.elevation_file import ElevationFileError, open_elevation
from hda.ground.own_terrain import cut_tile, open_own_terrain
from tests.ground_files import write_geotiff
from tests.oracles.mapped_plane import SLOPE_DEG, Site, measured_slope, write_plane

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

RADIUS = 1737400.0
GROUND = np.random.default_rng(0).normal(size=(100, 100)).astype(np.float32)


def moon(projection: str) -> CRS:
    return CRS.from_proj4(f"{projection} +R={RADIUS:.0f} +units=m")


def write_at(path: Path, crs: CRS, x: float, y: float, side: float = 10.0) -> Path:
    """A square kilometre around a place of a map."""
    place = Affine(side, 0, x - 50 * side, 0, -side, y + 50 * side)
    return write_geotiff(path, GROUND, crs=crs, transform=place)


def mercator(latitude_deg: float) -> float:
    return RADIUS * math.log(math.tan(math.radians(45.0 + latitude_deg / 2.0)))


@pytest.mark.parametrize("latitude_deg", [4.0, 6.0, -7.5])
def test_a_cylindrical_map_is_corrected_eastward(tmp_path: Path, latitude_deg: float) -> None:
    path = write_at(tmp_path / "s.tif", moon("+proj=eqc"), 0.0, RADIUS * math.radians(latitude_deg))
    with open_elevation(path) as source:
        assert source.map_scale == pytest.approx((1.0, math.cos(math.radians(latitude_deg))), abs=2e-6)
        assert source.pixel_size == pytest.approx((10.0, 10.0 * source.map_scale[1]), abs=1e-4)


@pytest.mark.parametrize("latitude_deg", [3.0, -6.0])
def test_a_mercator_map_is_corrected_both_ways(tmp_path: Path, latitude_deg: float) -> None:
    path = write_at(tmp_path / "s.tif", moon("+proj=merc"), 1e5, mercator(latitude_deg))
    with open_elevation(path) as source:
        assert source.map_scale == pytest.approx([math.cos(math.radians(latitude_deg))] * 2, abs=2e-6)


@pytest.mark.parametrize("away", [0.0, 80e3, 200e3, 330e3])
def test_a_polar_map_shrinks_away_from_the_pole(tmp_path: Path, away: float) -> None:
    path = write_at(tmp_path / "s.tif", moon("+proj=stere +lat_0=-90"), away, 0.0)
    scale = 1.0 / (1.0 + (away / (2.0 * RADIUS)) ** 2)
    with open_elevation(path) as source:
        assert source.map_scale == pytest.approx([scale if away > 110e3 else 1.0] * 2, abs=2e-6)


@pytest.mark.parametrize(
    ("code", "x", "y"),
    [(32633, 500e3, 5e6), (32733, 260e3, 4e6), (32661, 2e6, 1.9e6), (3857, 0.0, 0.0)],
)
def test_maps_of_the_earth(tmp_path: Path, code: int, x: float, y: float) -> None:
    """Independent: lengths along the meridian and the parallel, from the ellipsoid's radii of curvature."""
    crs, a, e2 = CRS.from_epsg(code), 6378137.0, 0.0066943799901413165
    step = 50.0
    ends = transform(crs, CRS.from_epsg(4326), [x - step, x + step, x, x], [y, y, y - step, y + step])
    longitude, latitude = np.radians(ends[0]), np.radians(ends[1])
    middle = latitude.mean()
    meridian = a * (1.0 - e2) / (1.0 - e2 * math.sin(middle) ** 2) ** 1.5
    parallel = a / math.sqrt(1.0 - e2 * math.sin(middle) ** 2) * math.cos(middle)
    east, north = (
        math.hypot(
            parallel * math.remainder(longitude[k + 1] - longitude[k], 2.0 * math.pi),
            meridian * (latitude[k + 1] - latitude[k]),
        )
        / (2.0 * step)
        for k in (0, 2)
    )
    expected = (north, east) if max(abs(north - 1.0), abs(east - 1.0)) > 1e-3 else (1.0, 1.0)
    with open_elevation(write_at(tmp_path / "s.tif", crs, x, y)) as source:
        assert source.map_scale == pytest.approx(expected, abs=2e-6)


def test_a_map_of_another_scale_is_refused_and_its_advice_makes_slopes_right(tmp_path: Path) -> None:
    """The equator's cylinder at 60 degrees: a slope of 15 degrees would read 7.6."""
    site = Site("Moon", 60.0, 20.0, "+proj=eqc +lat_ts=0 +lon_0=0")
    write_plane(tmp_path / "site.tif", site, 0.0, 5.0, 500)
    with pytest.raises(ElevationFileError) as caught:
        open_own_terrain(tmp_path / "site.tif")
    message = str(caught.value)
    assert "a metre of its map is 0.5 m east and 1 m north on the ground" in message
    assert "\n" not in message
    words = shlex.split(message[message.index("gdalwarp") :])
    assert words[-2:] == ["site.tif", "site-metres.tif"]
    assert words[words.index("-dstnodata") + 1] == "nan"
    local = CRS.from_proj4(words[words.index("-t_srs") + 1])
    assert "lat_0=60" in local.to_proj4()
    side = float(words[words.index("-tr") + 1])
    assert side == 2.5
    with rasterio.open(tmp_path / "site.tif") as source:
        place, width, height = calculate_default_transform(
            source.crs, local, source.width, source.height, *source.bounds, resolution=side
        )
        heights = np.empty((height, width))
        reproject(
            rasterio.band(source, 1),
            heights,
            dst_transform=place,
            dst_crs=local,
            dst_nodata=np.nan,
            resampling=Resampling.cubic,
        )
    write_geotiff(tmp_path / words[-1], heights[::-1], crs=local, transform=place, nodata=np.nan)
    terrain = open_own_terrain(tmp_path / words[-1])
    tile = cut_tile(terrain, terrain.tiles[0])
    assert measured_slope(tile) == pytest.approx(SLOPE_DEG, rel=1e-3)


def test_sheared_maps_are_refused(tmp_path: Path) -> None:
    """Away from its meridian a sinusoidal map keeps areas and lengths along parallels, but no angles."""
    x, y = RADIUS * math.radians(20.0) * math.cos(math.radians(30.0)), RADIUS * math.radians(30.0)
    with (
        pytest.raises(ElevationFileError, match=r"up to 9\.1% off"),
        open_elevation(write_at(tmp_path / "s.tif", moon("+proj=sinu"), x, y)),
    ):
        pass


def test_a_square_kilometre_of_map_stays_a_tile(tmp_path: Path) -> None:
    """It is 0.7 % less of ground: the last cells are unknown, and slopes are those of the ground."""
    site = Site("Moon", -79.0, 30.0, "+proj=stere +lat_0=-90 +lon_0=0")
    write_plane(tmp_path / "site.tif", site, 1.0, 5.0, 200)
    terrain = open_own_terrain(tmp_path / "site.tif")
    scale = (1.0 + math.sin(math.radians(79.0))) / 2.0
    assert terrain.tiles == (0,)
    assert terrain.map_scale == pytest.approx((scale, scale), abs=2e-6)
    assert terrain.source_pixel == pytest.approx(5.0 * scale, abs=1e-5)
    assert terrain.identity()["map_scale"] == terrain.map_scale
    tile = cut_tile(terrain, 0)
    known = int(1000 * scale)
    assert np.isfinite(tile[:known, :known]).all()
    assert np.isnan(tile[known:]).all()
    assert np.isnan(tile[:, known:]).all()
    assert measured_slope(tile) == pytest.approx(SLOPE_DEG, rel=1e-3)


def test_a_map_that_is_right_within_a_thousandth_is_taken_as_it_is(tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(1000, 1000)).astype(np.float32)
    place = Affine(1, 0, 90e3, 0, -1, 1000)
    path = write_geotiff(tmp_path / "s.tif", heights, crs=moon("+proj=stere +lat_0=-90"), transform=place)
    terrain = open_own_terrain(path)
    assert terrain.resampling == "none"
    assert "map_scale" not in terrain.identity()
    np.testing.assert_array_equal(cut_tile(terrain, 0), heights)


def test_a_local_system_in_metres_is_taken_as_said(tmp_path: Path) -> None:
    local = CRS.from_wkt('LOCAL_CS["site",UNIT["metre",1]]')
    path = write_geotiff(tmp_path / "s.tif", GROUND, 10.0, crs=local)
    assert open_own_terrain(path).map_scale == (1.0, 1.0)


def test_coordinates_that_do_not_exist_are_refused(tmp_path: Path) -> None:
    path = write_at(tmp_path / "s.tif", moon("+proj=stere +lat_0=-90"), 1e300, 0.0)
    with pytest.raises(ElevationFileError, match="the scale of its map is unknown"), open_elevation(path):
        pass


def test_a_pixel_of_ten_metres_of_map_is_not_too_coarse(tmp_path: Path) -> None:
    path = write_at(tmp_path / "s.tif", moon("+proj=stere +lat_0=-90 +k=0.995"), 0.0, 0.0)
    assert open_own_terrain(path).source_pixel == pytest.approx(10.0 / 0.995, abs=1e-4)
