"""A GeoTIFF as an elevation model: one band of metres on a north-up map whose scale is known.

What cannot be flown over is refused in one line that says what to do with this very file.
"""

from __future__ import annotations

import math
import shlex
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from guidance.arrays import Array
from hda.ground.elevation_source import ElevationFile, ElevationFileError, known_heights
from hda.ground.map_scale import (
    GREATEST,
    UNCORRECTED,
    Ellipsoid,
    MapFrame,
    UnknownScaleError,
    find_ellipsoid,
    measure_scale,
)

_METRE_NAMES = ("m", "metre", "meter", "metres", "meters")
_NO_NAMES = ("", "unknown", "none", "undefined", "unspecified", "n/a", "null")
_AS_ARRAY = "save its heights as .npy: 1 m a cell, row 0 at the south edge"
_ROUNDING = 1e-9  # of a pixel's side: rotation terms that are rounding


@contextmanager
def open_geotiff(path: Path, band: int | None, nodata: tuple[float, ...]) -> Iterator[ElevationFile]:
    """Open a GeoTIFF that exists.

    Args:
        path: of the file.
        band: the one that holds the heights, counted from 1; None for the only one.
        nodata: stored numbers that mean unknown ground, besides the one that the file declares.

    Raises:
        ElevationFileError: the file is damaged, or not one band of metres on a north-up map of known scale.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
        from rasterio.windows import Window
    except ImportError as error:
        raise ElevationFileError(
            f"{path}: GeoTIFF needs rasterio; install it with: pip install 'lunar-hda[geo]'"
        ) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused below, in our words
            # One driver: others read addresses and further files that a file may name.
            dataset = rasterio.open(path, driver="GTiff")
    except (RasterioError, OSError, ValueError) as error:
        raise ElevationFileError(f"{path}: not a readable GeoTIFF ({error})") from error
    with dataset:
        chosen = _choose_band(path, dataset, band)
        sides, map_scale = _GeoTiff(path, dataset, nodata).check(chosen)
        rows, scale, offset = dataset.height, dataset.scales[chosen - 1], dataset.offsets[chosen - 1]
        north_up = dataset.transform.e < 0.0
        # GDAL makes a mask of an alpha band of whole numbers only.
        alphas = [
            k for k, color in enumerate(dataset.colorinterp, 1) if color.name == "alpha" and k != chosen
        ]

        def read(first_row: int, last_row: int, first_column: int, last_column: int) -> Array:
            top = rows - last_row if north_up else first_row
            window = Window(first_column, top, last_column - first_column, last_row - first_row)  # pyright: ignore[reportCallIssue]
            try:
                stored = dataset.read(chosen, window=window, masked=True)
                seen = [dataset.read(alpha, window=window) > 0 for alpha in alphas]
            except (RasterioError, OSError, ValueError) as error:
                raise ElevationFileError(f"{path}: a part of it cannot be read ({error})") from error
            heights = known_heights(stored.data, nodata, scale, offset)
            for known in (~np.ma.getmaskarray(stored), *seen):
                heights[~known] = np.nan
            return heights[::-1] if north_up else heights

        kind = np.dtype(dataset.dtypes[chosen - 1])
        yield ElevationFile((rows, dataset.width), sides, read, map_scale, kind, scale, offset)


def _choose_band(path: Path, dataset: Any, band: int | None) -> int:
    """The band that holds the heights, counted from 1."""
    if band is None and dataset.count == 1:
        return 1
    if band is None:
        told = zip(dataset.descriptions, dataset.colorinterp, strict=True)
        names = ", ".join(f"{k}: {text or color.name}" for k, (text, color) in enumerate(told, 1))
        raise ElevationFileError(
            f"{path}: holds {dataset.count} bands ({names}); must be one band of heights: --band 1 takes the"
            " first (band=1 in Python)"
        )
    if isinstance(band, bool) or band not in range(1, dataset.count + 1):
        raise ElevationFileError(f"{path}: band must be 1 to {dataset.count}, got {band!r}")
    return int(band)


class _GeoTiff:
    """What a GeoTIFF says about itself, and the advice that fits it."""

    def __init__(self, path: Path, dataset: Any, nodata: tuple[float, ...]) -> None:
        self.path, self.dataset, self.nodata = path, dataset, nodata
        self.crs = dataset.crs
        self.description = _describe(self.crs)
        self.ellipsoid = find_ellipsoid(self.description)

    def check(self, band: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """True sides of a pixel [m], and true metres per metre of the map; both north and east."""
        path, dataset = self.path, self.dataset
        if not _is_real(dataset.dtypes[band - 1]):
            raise ElevationFileError(f"{path}: heights must be real numbers, got {dataset.dtypes[band - 1]}")
        scale, offset = dataset.scales[band - 1], dataset.offsets[band - 1]
        if scale == 0.0 or not (math.isfinite(scale) and math.isfinite(offset)):
            raise ElevationFileError(f"{path}: scale {scale:g} and offset {offset:g} make no heights")
        self._check_units(band)
        transform = dataset.transform
        sides = (abs(transform.e), transform.a)
        turned = max(abs(transform.b), abs(transform.d)) > _ROUNDING * min(map(abs, sides))
        if turned or min(sides) <= 0.0 or not np.isfinite(sides).all():
            raise ElevationFileError(f"{path}: is rotated or mirrored; {self._advice()}")
        if abs(sides[0] / sides[1] - 1.0) > 1e-3:
            raise ElevationFileError(
                f"{path}: its pixels are {sides[1]:g} x {sides[0]:g} m; make them square: {self._advice()}"
            )
        if not self.crs.is_projected:  # a site's own metres: they are taken as said
            return sides, (1.0, 1.0)
        if self.ellipsoid is None:
            raise ElevationFileError(f"{path}: its coordinate system is on no body; {self._advice()}")
        return self._true_sides(sides, self.ellipsoid)

    def _check_units(self, band: int) -> None:
        """Refuse coordinates and heights that are not in metres."""
        path, crs = self.path, self.crs
        if crs is None:
            raise ElevationFileError(
                f"{path}: has no coordinate system, so its scale is unknown; set one with"
                f" gdal_edit.py -a_srs CRS {shlex.quote(path.name)}, or save the heights as .npy"
            )
        if crs.is_geographic:
            raise ElevationFileError(
                f"{path}: is in degrees (a geographic coordinate system); {self._advice()}"
            )
        unit, factor = self._linear_unit()
        if factor is None or abs(factor - 1.0) > 1e-9:
            raise ElevationFileError(
                f"{path}: its coordinates must be metres of a projected system, got {unit!r};"
                f" {self._advice()}"
            )
        name = (self.dataset.units[band - 1] or "").strip(" []()").lower()
        if name not in _METRE_NAMES + _NO_NAMES:
            raise ElevationFileError(
                f"{path}: heights must be in metres, got {self.dataset.units[band - 1]!r}; convert them, e.g."
                f" with gdal_calc.py, and set the unit: gdal_edit.py -units m {shlex.quote(path.name)}"
            )

    def _linear_unit(self) -> tuple[str, float | None]:
        """Name of the unit of the coordinates, and how many metres it is; None for what is no length."""
        if self.crs.is_projected:
            name, factor = self.crs.linear_units_factor
            return name, float(factor)
        if self.description.get("type") != "EngineeringCRS":
            return self.description.get("type", "an unknown kind"), None
        unit = self.description["coordinate_system"]["axis"][0].get("unit", "unknown")
        if isinstance(unit, dict):
            return unit.get("name", "unknown"), unit.get("conversion_factor")
        return unit, 1.0 if unit == "metre" else None

    def _true_sides(
        self, sides: tuple[float, float], ellipsoid: Ellipsoid
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        try:
            scale = measure_scale(self._frame(ellipsoid))
        except UnknownScaleError as error:
            raise ElevationFileError(
                f"{self.path}: the scale of its map is unknown, {error}; {_AS_ARRAY}"
            ) from error
        deviation = max(scale.greatest_deviation, scale.residual_deviation)
        if deviation > GREATEST:
            raise ElevationFileError(
                f"{self.path}: a metre of its map is {scale.east:.4g} m east and {scale.north:.4g} m north on"
                f" the ground (up to {deviation:.1%} off), so its slopes would be wrong; {self._advice()}"
            )
        if deviation <= UNCORRECTED:
            return sides, (1.0, 1.0)
        north, east = round(scale.north, 6), round(scale.east, 6)  # the same with every version of PROJ
        return (sides[0] * north, sides[1] * east), (north, east)

    def _frame(self, ellipsoid: Ellipsoid) -> MapFrame:
        transform, crs = self.dataset.transform, self.crs
        degree = math.radians(ellipsoid.equatorial)
        return MapFrame(
            crs,
            ellipsoid,
            degree if crs.is_geographic else float(crs.linear_units_factor[1]),
            (transform.c, transform.f),
            (transform.a, transform.d),
            (transform.b, transform.e),
            (self.dataset.height, self.dataset.width),
        )

    def _advice(self) -> str:
        """How to make a file of it that can be flown over."""
        if self.ellipsoid is None or not (self.crs.is_geographic or self.crs.is_projected):
            return f"resample it to square north-up pixels in metres, or {_AS_ARRAY}"
        frame = self._frame(self.ellipsoid)
        try:
            longitude, latitude = frame.longitude_latitude(frame.coordinates(*frame.middle()))[:, 0]
            metric = frame.pixel_metric(*frame.middle())[0]
        except UnknownScaleError:
            return (
                f"its coordinates do not lie in that system: correct it (gdal_edit.py -a_srs), or {_AS_ARRAY}"
            )
        side = float(f"{math.sqrt(min(metric[0, 0], metric[1, 1])):.2g}") or 1.0
        local = f"+proj=stere +lat_0={latitude:.4f} +lon_0={longitude:.4f} {self.ellipsoid.proj4} +units=m"
        floats = "" if np.dtype(self.dataset.dtypes[0]).kind == "f" else " -ot Float32"
        source = f" -srcnodata {self.nodata[0]:.9g}" if len(self.nodata) == 1 else ""
        names = (shlex.quote(name) for name in (self.path.name, f"{self.path.stem}-metres.tif"))
        return (
            f"reproject it to a map of the site: gdalwarp -t_srs '{local}' -tr {side:g} {side:g} -r cubic"
            f"{floats}{source} -dstnodata nan {' '.join(names)}"
        )


def _describe(crs: Any) -> dict[str, Any]:
    """A coordinate system as PROJJSON; empty where there is none."""
    from rasterio.errors import RasterioError

    try:
        return {} if crs is None else crs.to_dict(projjson=True)
    except (RasterioError, ValueError):
        return {}


def _is_real(name: str) -> bool:
    try:
        return np.dtype(name).kind in "iuf"
    except TypeError:
        return False
