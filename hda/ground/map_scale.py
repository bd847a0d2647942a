"""How long a metre of a map is on the body that it shows.

A map projection keeps lengths along a few lines only. At a place of the map, the true lengths of a small step
east and of one north are those of the chords between points on the coordinate system's ellipsoid (central
differences over 100 m: exact to 1e-8). The two, and the angle between them, give the greatest and the least
scale in any direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from guidance.arrays import Array

UNCORRECTED = 1e-3
"""A file whose scale deviates by no more is taken as it is: its pixels are not resampled for that."""

GREATEST = 1e-2
"""A file whose scale deviates by more anywhere is refused."""

_STEP = 100.0  # [m], about: long enough for the rounding of a projection's inverse, short for its curvature
_NODES = 17  # places along each side of a file at which its scale is looked at


class UnknownScaleError(ValueError):
    """The coordinate system does not say how long a metre of the map is."""


@dataclass(frozen=True)
class Ellipsoid:
    """The surface that a coordinate system's latitudes are on.

    Attributes:
        equatorial: [m] radius.
        polar: [m] radius.
    """

    equatorial: float
    polar: float

    @property
    def proj4(self) -> str:
        """As parameters of PROJ."""
        if self.equatorial == self.polar:
            return f"+R={self.equatorial:.12g}"
        return f"+a={self.equatorial:.12g} +b={self.polar:.12g}"

    def place(self, longitude: Array, latitude: Array) -> Array:
        """Cartesian places [m], shape (..., 3), of angles [deg] of shape (...)."""
        east, north = np.radians(longitude), np.radians(latitude)
        squeezed = (self.polar / self.equatorial) ** 2
        normal = self.equatorial / np.sqrt(np.cos(north) ** 2 + squeezed * np.sin(north) ** 2)
        out = normal * np.cos(north)
        return np.stack([out * np.cos(east), out * np.sin(east), squeezed * normal * np.sin(north)], axis=-1)


@dataclass(frozen=True, eq=False)
class MapScale:
    """The scale of a map over a file.

    Attributes:
        north: true metres per metre of the map, northward at the middle of the file.
        east: the same, eastward.
        greatest_deviation: from 1, in any direction anywhere on the file.
        residual_deviation: the same, once `north` and `east` have been corrected.
    """

    north: float
    east: float
    greatest_deviation: float
    residual_deviation: float


@dataclass(frozen=True, eq=False)
class MapFrame:
    """Where the pixels of a north-up or south-up file lie.

    Attributes:
        crs: the file's coordinate system (rasterio's CRS).
        ellipsoid: that of the coordinate system.
        unit: [m] of its coordinates, about.
        corner: coordinates of the outer corner of the first pixel of the first row.
        column_step: from one column to the next, in coordinates.
        row_step: from one row to the next.
        shape: rows and columns.
    """

    crs: Any
    ellipsoid: Ellipsoid
    unit: float
    corner: tuple[float, float]
    column_step: tuple[float, float]
    row_step: tuple[float, float]
    shape: tuple[int, int]

    def coordinates(self, row: Array, column: Array) -> Array:
        """The x and y, shape (2, ...), of places counted in pixels."""
        return np.stack(
            [
                self.corner[axis] + column * self.column_step[axis] + row * self.row_step[axis]
                for axis in (0, 1)
            ]
        )

    def longitude_latitude(self, places: Array) -> Array:
        """Angles [deg], shape (2, ...), of coordinates of that shape.

        Raises:
            UnknownScaleError: a place lies outside of what the coordinate system covers.
        """
        from rasterio.crs import CRS
        from rasterio.warp import transform

        # On the file's own ellipsoid: from there to another datum nothing is known about most bodies.
        angles = CRS.from_proj4(f"+proj=longlat {self.ellipsoid.proj4} +no_defs")
        try:
            found = np.array(transform(self.crs, angles, places[0].ravel(), places[1].ravel())[:2])
        except Exception as error:  # GDAL's own errors come through, of a private class
            raise UnknownScaleError(f"its coordinates cannot be turned into angles ({error})") from error
        if not np.isfinite(found).all() or (np.abs(found[1]) > 90.0 + 1e-9).any():
            raise UnknownScaleError("it reaches beyond what its coordinate system can show")
        return found.reshape(places.shape)

    def pixel_metric(self, row: Array, column: Array) -> Array:
        """True squared lengths and product [m^2] of a pixel's sides at some places, shape (n, 2, 2).

        The first axis is along a row, the second across rows.

        Raises:
            UnknownScaleError: a place lies outside of what the coordinate system covers.
        """
        with np.errstate(all="ignore"):  # what comes of senseless coordinates is refused below
            metric = self._metric(row, column)
        if not np.isfinite(metric).all() or (metric[:, (0, 1), (0, 1)] <= 0.0).any():
            raise UnknownScaleError("its pixels are too small or too large for their coordinates")
        return metric

    def _metric(self, row: Array, column: Array) -> Array:
        sides = []
        for step, (down, right) in ((self.column_step, (0.0, 1.0)), (self.row_step, (1.0, 0.0))):
            pixels = max(1.0, _STEP / (math.hypot(*step) * self.unit)) / 2.0
            ends = [
                self.ellipsoid.place(
                    *self.longitude_latitude(
                        self.coordinates(row + sign * pixels * down, column + sign * pixels * right)
                    )
                )
                for sign in (1.0, -1.0)
            ]
            sides.append((ends[0] - ends[1]) / (2.0 * pixels))
        return np.array([[np.sum(a * b, axis=-1) for b in sides] for a in sides]).transpose(2, 0, 1)

    def middle(self) -> tuple[Array, Array]:
        """Row and column of the middle of the file, shape (1,)."""
        return np.array([self.shape[0] / 2.0]), np.array([self.shape[1] / 2.0])


def find_ellipsoid(description: dict[str, Any]) -> Ellipsoid | None:
    """The ellipsoid in a coordinate system's PROJJSON; None for one that is not tied to a body."""
    for key in ("source_crs", "base_crs", "datum", "datum_ensemble"):
        if key in description:
            return find_ellipsoid(description[key])
    for part in description.get("components", ()):
        found = find_ellipsoid(part)
        if found is not None:
            return found
    axes = description.get("ellipsoid", {})
    equatorial = _metres(axes.get("radius", axes.get("semi_major_axis", 0.0)))
    inverse_flattening = float(axes.get("inverse_flattening", 0.0))
    flattening = 1.0 / inverse_flattening if inverse_flattening else 0.0
    polar = _metres(axes["semi_minor_axis"]) if "semi_minor_axis" in axes else equatorial * (1.0 - flattening)
    usable = all(math.isfinite(radius) and radius > 0.0 for radius in (equatorial, polar))
    return Ellipsoid(equatorial, polar) if usable else None


def _metres(length: Any) -> float:
    if isinstance(length, dict):
        unit = length.get("unit", "metre")
        factor = unit.get("conversion_factor", 1.0) if isinstance(unit, dict) else 1.0
        return float(length["value"]) * float(factor)
    return float(length)


def measure_scale(frame: MapFrame) -> MapScale:
    """The scale of a map in metres, over a whole file.

    Raises:
        UnknownScaleError: the file reaches outside of what the coordinate system covers.
    """
    rows, columns = frame.shape
    nominal = np.array([math.hypot(*frame.column_step), math.hypot(*frame.row_step)])
    row, column = np.meshgrid(np.linspace(0.0, rows, _NODES), np.linspace(0.0, columns, _NODES))
    metric = frame.pixel_metric(row.ravel(), column.ravel()) / np.outer(nominal, nominal)
    middle = frame.pixel_metric(*frame.middle())[0] / np.outer(nominal, nominal)
    east, north = np.sqrt(np.diag(middle))
    correction = np.array([east, north])
    return MapScale(
        float(north),
        float(east),
        _deviation(metric),
        _deviation(metric / np.outer(correction, correction)),
    )


def _deviation(metric: Array) -> float:
    """Greatest difference from 1 of the scale in any direction."""
    return float(np.abs(np.sqrt(np.linalg.eigvalsh(metric)) - 1.0).max())
