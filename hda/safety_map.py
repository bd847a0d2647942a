"""Algorithm 1: where a square four-pad lander can stand, and how surely (the ALHAT safety map).

The lander is set down at each cell in each distinct orientation of the raster. Its pads rest on the highest ground
under them; it stands on the higher of its two diagonals and rocks between two stable planes. The worst slope and the
worst roughness over orientations and planes decide (Ivanov et al. 2013; JPL patent US 9,141,113 B1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.kernel import compile_kernel, compile_parallel_kernel
from guidance.validation import finite_number
from hda.lander_footprint import LanderFootprint, make_footprint

COLUMN_BLOCK = 256  # cells of a row that are worked on together; their buffers stay in the first-level cache


@dataclass(frozen=True)
class SafetyCriteria:
    """The lander's size, the ground that it stands, and the error of the elevation.

    Attributes:
        footprint_diameter: [m] circle around the outer edges of the four pads (ALHAT: 10 m).
        pad_diameter: [m] diameter of a pad.
        max_slope: [rad] greatest safe angle of the lander's plane from horizontal (ALHAT: 10 deg).
        max_roughness: [m] greatest safe height of the ground above the lander's plane (ALHAT: 0.30 m).
        range_noise: [m] one standard deviation of the elevation (ALHAT: 5 cm at three).

    Raises:
        ValueError: a field is out of range.
    """

    footprint_diameter: float = 10.0
    pad_diameter: float = 1.0
    max_slope: float = math.radians(10.0)
    max_roughness: float = 0.30
    range_noise: float = 0.05 / 3.0

    def __post_init__(self) -> None:
        """Refuse criteria that mean nothing."""
        finite_number("footprint_diameter", self.footprint_diameter, above=0.0)
        finite_number("pad_diameter", self.pad_diameter, above=0.0)
        finite_number("max_slope", self.max_slope, at_least=0.0, at_most=math.pi / 2.0)
        finite_number("max_roughness", self.max_roughness, at_least=0.0)
        finite_number("range_noise", self.range_noise, at_least=0.0)


DEFAULT_CRITERIA = SafetyCriteria()


@dataclass(frozen=True)
class SafetyMap:
    """What Algorithm 1 says of each cell, with the lander's centre at the middle of the cell; all (m, n).

    Attributes:
        deterministic: True where slope and roughness keep their limits.
        probability: probability in [0, 1] that the roughness keeps its limit; 0 where the slope does not.
        slope: [rad] worst angle of the lander's plane from horizontal.
        roughness: [m] worst signed distance of the ground above the lander's plane; negative where the ground between
            the pads lies everywhere below it.

    Where the lander does not fit on the map, or the map has a hole under a pad or inside the footprint, a cell is
    unsafe: False, 0, NaN and NaN.
    """

    deterministic: NDArray[np.bool_]
    probability: NDArray[np.float64]
    slope: NDArray[np.float64]
    roughness: NDArray[np.float64]


def assess_safety(  # noqa: PLR0913
    dem: ArrayLike,
    pixel_size: float = 1.0,
    *,
    footprint_diameter: float = DEFAULT_CRITERIA.footprint_diameter,
    pad_diameter: float = DEFAULT_CRITERIA.pad_diameter,
    max_slope: float = DEFAULT_CRITERIA.max_slope,
    max_roughness: float = DEFAULT_CRITERIA.max_roughness,
    range_noise: float = DEFAULT_CRITERIA.range_noise,
) -> SafetyMap:
    """Assess every cell of a DEM as a landing site: Algorithm 1, worst case over all pad orientations.

    A site's probability is that of its worst cell, orientation and plane: P(roughness <= limit) with a normal error of
    the elevation seen square to the plane, so 0.5 (1 - erf(M / (sqrt 2 range_noise))) where M is the greatest height
    above the plane less max_roughness / cos(slope). The slope limit is a hard gate. With `range_noise` 0 the
    probability is the deterministic map.

    The number of orientations grows with footprint_diameter / pixel_size, and with its square the cells of each: 10 m
    at 1 m has 7 orientations of 41 to 57 cells, 10 m at 0.1 m has 64 of about 4000.

    Args:
        dem: (m, n) elevation [m]; NaN for a hole.
        pixel_size: [m] side of a cell.
        footprint_diameter: [m] see `SafetyCriteria`, as for all that follow.
        pad_diameter: [m].
        max_slope: [rad].
        max_roughness: [m].
        range_noise: [m], one standard deviation.

    Raises:
        ValueError: an argument is out of range, `dem` is not two-dimensional, holds infinities or is smaller than the
            lander, or the lander is too small for the pixel size.
    """
    criteria = SafetyCriteria(footprint_diameter, pad_diameter, max_slope, max_roughness, range_noise)
    pixel_size = finite_number("pixel_size", pixel_size, above=0.0)
    footprint = make_footprint(criteria.footprint_diameter, criteria.pad_diameter, pixel_size)
    elevation = _check_dem(dem, footprint)
    hole = np.isnan(elevation)
    if hole.any():
        elevation = np.where(hole, 0.0, elevation)
    slope, roughness, excess = _worst_case(elevation, footprint, pixel_size, criteria.max_roughness)
    known = _known_sites(hole, footprint)
    slope[~known] = np.nan
    roughness[~known] = np.nan
    # A comparison with NaN is False: unknown sites are unsafe.
    deterministic = (slope <= criteria.max_slope) & (roughness <= criteria.max_roughness)
    if criteria.range_noise == 0.0:
        probability = deterministic.astype(np.float64)
    else:
        probability = _probability(slope, excess, criteria.max_slope, criteria.range_noise)
    return SafetyMap(deterministic, probability, slope, roughness)


def _check_dem(dem: ArrayLike, footprint: LanderFootprint) -> NDArray[np.float64]:
    try:
        elevation = np.ascontiguousarray(dem, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError("dem must be an array of numbers") from error
    if np.ndim(dem) != 2:
        raise ValueError(f"dem must be two-dimensional, got shape {np.shape(dem)}")
    if min(elevation.shape) < footprint.span:
        raise ValueError(
            f"dem must have at least {footprint.span} x {footprint.span} cells to hold the lander, "
            f"got {elevation.shape[0]} x {elevation.shape[1]}"
        )
    if np.isinf(elevation).any():
        raise ValueError("dem must be finite, or NaN where the elevation is unknown; it holds infinities")
    return elevation


def _known_sites(hole: NDArray[np.bool_], footprint: LanderFootprint) -> NDArray[np.bool_]:
    """Where the lander fits on the map and stands over no hole."""
    known = np.zeros(hole.shape, dtype=np.bool_)
    reach = footprint.reach
    inner = (slice(reach, hole.shape[0] - reach), slice(reach, hole.shape[1] - reach))
    known[inner] = True
    rows, columns = np.nonzero(hole)
    for north, east in footprint.support:
        row, column = rows - north, columns - east
        inside = (row >= 0) & (row < hole.shape[0]) & (column >= 0) & (column < hole.shape[1])
        known[row[inside], column[inside]] = False
    return known


def _worst_case(
    elevation: NDArray[np.float64], footprint: LanderFootprint, pixel_size: float, max_roughness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Worst slope [rad], roughness [m] and height above the plane less max_roughness / cos(slope) [m] of each cell."""
    pad_map = elevation
    if footprint.pad_disc.size > 1:
        from scipy.ndimage import maximum_filter

        pad_map = maximum_filter(elevation, footprint=footprint.pad_disc, mode="nearest")
    slope = np.full(elevation.shape, np.nan)
    roughness = np.full(elevation.shape, np.nan)
    excess = np.full(elevation.shape, np.nan)
    _assess_rows(
        elevation,
        pad_map,
        (footprint.pads, footprint.first_strip, footprint.strips, footprint.reach),
        (pixel_size, max_roughness),
        (slope, roughness, excess),
    )
    return slope, roughness, excess


@compile_kernel
def _plane_gradients(pad_map, row, start, n, north, east, buffer):  # noqa: ANN001, ANN202
    """Gradients [m per cell] of the two stable planes, and the height of the centre, for `n` sites of a row."""
    z0 = pad_map[row + north, start + east : start + east + n]
    z1 = pad_map[row + east, start - north : start - north + n]
    z2 = pad_map[row - north, start - east : start - east + n]
    z3 = pad_map[row - east, start + north : start + north + n]
    east_a, north_a, east_b, north_b, centre = buffer[0], buffer[1], buffer[2], buffer[3], buffer[4]
    squared_radius = float(north * north + east * east)
    for i in range(n):
        first, second = 0.5 * (z0[i] + z2[i]), 0.5 * (z1[i] + z3[i])
        first_rules = first >= second
        # Half height differences between opposite pads, along pads 2 to 0 and along pads 3 to 1.
        along_a = 0.5 * (z0[i] - z2[i]) if first_rules else z0[i] - second
        along_b = 0.5 * (z0[i] - z2[i]) if first_rules else second - z2[i]
        across_a = z1[i] - first if first_rules else 0.5 * (z1[i] - z3[i])
        across_b = first - z3[i] if first_rules else 0.5 * (z1[i] - z3[i])
        centre[i] = first if first_rules else second
        east_a[i] = (along_a * east - across_a * north) / squared_radius
        north_a[i] = (along_a * north + across_a * east) / squared_radius
        east_b[i] = (along_b * east - across_b * north) / squared_radius
        north_b[i] = (along_b * north + across_b * east) / squared_radius


@compile_kernel
def _highest_ground(elevation, row, start, n, strips, buffer):  # noqa: ANN001, ANN202
    """Greatest elevation less gradient times offset over the cells between the pads, for both planes."""
    east_a, north_a, east_b, north_b = buffer[0], buffer[1], buffer[2], buffer[3]
    high_a, high_b, strip_a, strip_b = buffer[5], buffer[6], buffer[7], buffer[8]
    for i in range(n):
        high_a[i], high_b[i] = -np.inf, -np.inf
    for k in range(strips.shape[0]):
        north = strips[k, 0]
        for i in range(n):
            strip_a[i], strip_b[i] = -np.inf, -np.inf
        for east in range(strips[k, 1], strips[k, 2] + 1):
            z = elevation[row + north, start + east : start + east + n]
            for i in range(n):
                a, b = z[i] - east * east_a[i], z[i] - east * east_b[i]
                strip_a[i] = a if a > strip_a[i] else strip_a[i]
                strip_b[i] = b if b > strip_b[i] else strip_b[i]
        for i in range(n):
            a, b = strip_a[i] - north * north_a[i], strip_b[i] - north * north_b[i]
            high_a[i] = a if a > high_a[i] else high_a[i]
            high_b[i] = b if b > high_b[i] else high_b[i]


@compile_parallel_kernel
def _probability(slope, excess, max_slope, range_noise):  # noqa: ANN001, ANN202
    """0.5 (1 - erf(excess / (sqrt 2 range_noise))); 0 beyond the slope limit and where the site is unknown."""
    probability = np.zeros(slope.shape)
    for row in numba.prange(slope.shape[0]):
        for column in range(slope.shape[1]):
            if slope[row, column] <= max_slope:  # False for NaN
                scaled = excess[row, column] / (range_noise * math.sqrt(2.0))
                probability[row, column] = 0.5 * math.erfc(scaled)
    return probability


@compile_parallel_kernel
def _assess_rows(elevation, pad_map, footprint, scales, worst):  # noqa: ANN001, ANN202
    """Fill the three maps of `worst`, row by row: cells do not depend on one another.

    For an orientation, with pads 0 to 3 at opposite corners 0-2 and 1-3 and R pads' distance from the centre, the
    plane through the higher diagonal has along it the gradient (z0 - z2) / 2R and across it (z1 - h) / R or
    (h - z3) / R, where h is the height of the lander's centre, the mean of the diagonal's pads.
    """
    pads, first_strip, strips, reach = footprint
    pixel_size, max_roughness = scales
    slope, roughness, excess = worst
    rows, columns = elevation.shape
    for row in numba.prange(reach, rows - reach):
        buffer = np.empty((9, COLUMN_BLOCK))
        for start in range(reach, columns - reach, COLUMN_BLOCK):
            n = min(COLUMN_BLOCK, columns - reach - start)
            steepest, roughest, most = slope[row, start:], roughness[row, start:], excess[row, start:]
            for i in range(n):
                steepest[i], roughest[i], most[i] = 0.0, -np.inf, -np.inf
            for k in range(pads.shape[0]):
                _plane_gradients(pad_map, row, start, n, pads[k, 0], pads[k, 1], buffer)
                _highest_ground(elevation, row, start, n, strips[first_strip[k] : first_strip[k + 1]], buffer)
                east_a, north_a, east_b, north_b, centre = (
                    buffer[0],
                    buffer[1],
                    buffer[2],
                    buffer[3],
                    buffer[4],
                )
                high_a, high_b = buffer[5], buffer[6]
                for i in range(n):
                    squared_a = (east_a[i] ** 2 + north_a[i] ** 2) / pixel_size**2
                    squared_b = (east_b[i] ** 2 + north_b[i] ** 2) / pixel_size**2
                    secant_a, secant_b = math.sqrt(1.0 + squared_a), math.sqrt(1.0 + squared_b)
                    above_a, above_b = high_a[i] - centre[i], high_b[i] - centre[i]
                    steepest[i] = max(steepest[i], max(squared_a, squared_b))
                    roughest[i] = max(roughest[i], max(above_a / secant_a, above_b / secant_b))
                    margin_a, margin_b = (
                        above_a - max_roughness * secant_a,
                        above_b - max_roughness * secant_b,
                    )
                    most[i] = max(most[i], max(margin_a, margin_b))
            for i in range(n):
                steepest[i] = math.atan(math.sqrt(steepest[i]))
