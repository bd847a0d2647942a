"""A slope of known angle on a body, as an elevation model on some map of it.

Heights are those above the tangent plane at the middle of the site: nothing of the scale of the map is used.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
from rasterio.crs import CRS
from rasterio.transform import Affine
from rasterio.warp import transform

BODIES = {
    "Moon": (1737400.0, 1737400.0),
    "Mars": (3396190.0, 3376200.0),
    "Earth": (6378137.0, 6356752.314245),
}
SLOPE_DEG = 15.0


@dataclass(frozen=True)
class Site:
    """A place on a body, and the map that it is shown on."""

    body: str
    latitude: float
    longitude: float
    projection: str

    @property
    def ellipsoid(self) -> str:
        a, b = BODIES[self.body]
        return f"+a={a} +b={b}" if a != b else f"+R={a}"

    @property
    def crs(self) -> CRS:
        return CRS.from_proj4(f"{self.projection} {self.ellipsoid} +units=m")

    @property
    def angles(self) -> CRS:
        return CRS.from_proj4(f"+proj=longlat {self.ellipsoid} +no_defs")

    def tangent(self, longitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
        """East and north of the middle of the site [m], shape (2, ...), in its tangent plane."""
        a, b = BODIES[self.body]

        def place(lon: np.ndarray, lat: np.ndarray) -> np.ndarray:
            lon, lat = np.radians(lon), np.radians(lat)
            n = a * a / np.sqrt((a * np.cos(lat)) ** 2 + (b * np.sin(lat)) ** 2)
            return np.array(
                [n * np.cos(lat) * np.cos(lon), n * np.cos(lat) * np.sin(lon), n * (b / a) ** 2 * np.sin(lat)]
            )

        middle = np.array(self.longitude), np.array(self.latitude)
        lon, lat = np.radians(self.longitude), np.radians(self.latitude)
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        away = np.moveaxis(place(longitude, latitude), 0, -1) - place(*middle)
        return np.stack([away @ east, away @ north])


def draw_site(rng: np.random.Generator) -> Site:
    """A body, a place and a projection; about half of them keep lengths there."""
    body = str(rng.choice(list(BODIES)))
    latitude, longitude = float(rng.uniform(-89.0, 89.0)), float(rng.uniform(-180.0, 180.0))
    if rng.random() < 0.3:
        latitude = float(rng.uniform(-12.0, 12.0))  # where cylindrical maps are nearly right
    near = float(np.clip(latitude + rng.normal() * 8.0, -85.0, 85.0))
    pole = 90 if latitude > 0 else -90
    zone = 6.0 * np.floor(longitude / 6.0) + 3.0
    projection = rng.choice(
        [
            f"+proj=eqc +lat_ts=0 +lon_0={longitude - 1:.3f}",
            f"+proj=eqc +lat_ts={near:.3f} +lon_0=0",
            f"+proj=merc +lon_0={longitude - 1:.3f}",
            f"+proj=merc +lat_ts={near:.3f} +lon_0=0",
            f"+proj=stere +lat_0={pole} +lon_0=0",
            f"+proj=stere +lat_0={near:.3f} +lon_0={longitude + rng.normal():.3f}",
            f"+proj=tmerc +lat_0=0 +lon_0={zone} +k=0.9997",
            f"+proj=sinu +lon_0={longitude + rng.normal() * 5.0:.3f}",
            f"+proj=laea +lat_0={near:.3f} +lon_0={longitude + rng.normal():.3f}",
            f"+proj=lcc +lat_1={abs(near) + 1.0:.3f} +lat_2={abs(near) + 3.0:.3f} +lon_0={longitude:.3f}",
        ]
    )
    return Site(body, latitude, longitude, str(projection))


def write_plane(path: Path, site: Site, azimuth: float, side: float, pixels: int) -> None:
    """A GeoTIFF around the site; its ground rises by SLOPE_DEG toward an azimuth [rad, east to north]."""
    (x,), (y,) = transform(site.angles, site.crs, [site.longitude], [site.latitude])[:2]
    corner = x - pixels * side / 2.0, y + pixels * side / 2.0
    columns, rows = np.meshgrid(np.arange(pixels) + 0.5, np.arange(pixels) + 0.5)
    longitude, latitude = transform(
        site.crs, site.angles, (corner[0] + columns * side).ravel(), (corner[1] - rows * side).ravel()
    )[:2]
    east, north = site.tangent(np.array(longitude), np.array(latitude)).reshape(2, pixels, pixels)
    heights = np.tan(np.radians(SLOPE_DEG)) * (np.cos(azimuth) * east + np.sin(azimuth) * north)
    shape = {"height": pixels, "width": pixels, "count": 1, "dtype": "float64"}
    place = Affine(side, 0, corner[0], 0, -side, corner[1])
    with rasterio.open(path, "w", driver="GTiff", crs=site.crs, transform=place, **shape) as stream:
        stream.write(heights, 1)


def measured_slope(tile: np.ndarray) -> float:
    """[deg] of the plane that fits a tile of cells of 1 m best."""
    row, column = np.nonzero(np.isfinite(tile))
    design = np.column_stack([column, row, np.ones(row.size)])
    (east, north, _), *_ = np.linalg.lstsq(design, tile[row, column], rcond=None)
    return float(np.degrees(np.arctan(np.hypot(east, north))))
