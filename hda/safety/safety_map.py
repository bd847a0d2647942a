"""Algorithm 1: where a square four-pad lander can stand, and how surely (the ALHAT safety map).

The lander is set down at each cell in each distinct orientation of the raster. Its pads rest on the highest
ground under them; it stands on the higher of its two diagonals and rocks between two stable planes. The worst
slope and the worst roughness over orientations and planes decide (Ivanov et al. 2013; JPL patent US 9,141,113
B1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel, compile_parallel_kernel
from guidance.validation import finite_number
from hda.safety.criteria import DEFAULT_CRITERIA, SafetyCriteria
from hda.safety.lander_footprint import LanderFootprint, make_footprint
from hda.safety.stable_planes import (
    FootprintCells,
    RasterLimits,
    WorstCase,
    assess_rows,
    assess_rows_on_one_core,
)
from hda.safety.uncertain_heights import UncertainGround, score_sites

HIGHEST = 1e9
"""[m] No ground is higher or deeper: such a number is a no-data value that nobody declared."""


@dataclass(frozen=True)
class SafetyMap:
    """What Algorithm 1 says of each cell, with the lander's centre at the middle of the cell; all (m, n).

    Attributes:
        deterministic: True where slope and roughness keep their limits.
        probability: probability in [0, 1] that the roughness keeps its limit; 0 where the slope does not.
        slope: [rad] worst angle of the lander's plane from horizontal.
        roughness: [m] worst signed distance of the ground above the lander's plane; negative where the ground
            between the pads lies everywhere below it.

    Where the lander does not fit on the map, or the map has a hole under a pad or inside the footprint, a
    cell is unsafe: False, 0, NaN and NaN.
    """

    deterministic: NDArray[np.bool_]
    probability: Array
    slope: Array
    roughness: Array


def assess_safety(
    dem: ArrayLike,
    pixel_size: float = 1.0,
    *,
    footprint_diameter: float = DEFAULT_CRITERIA.footprint_diameter,
    pad_diameter: float = DEFAULT_CRITERIA.pad_diameter,
    max_slope: float = DEFAULT_CRITERIA.max_slope,
    max_roughness: float = DEFAULT_CRITERIA.max_roughness,
    range_noise: float | ArrayLike = DEFAULT_CRITERIA.range_noise,
) -> SafetyMap:
    """Assess every cell of a DEM as a landing site: Algorithm 1, worst case over all pad orientations.

    A site's probability is that of its worst cell, orientation and plane: P(roughness <= limit) with a normal
    error of the elevation seen square to the plane, so 0.5 (1 - erf(M / (sqrt 2 range_noise))) where M is the
    greatest height above the plane less max_roughness / cos(slope). The slope limit is a hard gate. With
    `range_noise` 0 the probability is the deterministic map.

    The number of orientations grows with footprint_diameter / pixel_size, and with its square the cells of
    each: 10 m at 1 m has 7 orientations of 41 to 57 cells, 10 m at 0.1 m has 64 of about 4000.

    Args:
        dem: (m, n) elevation [m]; NaN for a hole.
        pixel_size: [m] side of a cell.
        footprint_diameter: [m] see `SafetyCriteria`, as for all that follow.
        pad_diameter: [m].
        max_slope: [rad].
        max_roughness: [m].
        range_noise: [m], one standard deviation; of each cell's own height where it is an array of the
            shape of `dem`. The probability is then that of the cell whose height above the limit is greatest
            in its own deviations; holes may be NaN in both.

    Raises:
        ValueError: an argument is out of range, `dem` is not two-dimensional, holds infinities or is smaller
            than the lander, or the lander is too small for the pixel size.
    """
    common: Any = range_noise if np.ndim(range_noise) == 0 else 0.0
    criteria = SafetyCriteria(footprint_diameter, pad_diameter, max_slope, max_roughness, common)
    pixel_size = finite_number("pixel_size", pixel_size, above=0.0)
    elevation = elevation_array(dem)
    footprint = _fit_footprint(criteria, pixel_size, elevation.shape)
    hole = np.isnan(elevation)
    elevation[hole] = 0.0  # any number: what it touches is marked unknown below
    noise = None if np.ndim(range_noise) == 0 else _cell_noise(range_noise, hole)
    pad_map = _pad_map(elevation, footprint)
    cells = FootprintCells(footprint.pads, footprint.first_strip, footprint.strips, footprint.half_size)
    limits = RasterLimits(pixel_size, criteria.max_roughness)
    worst = WorstCase(*(np.full(elevation.shape, np.nan) for _ in WorstCase._fields))
    assess = assess_rows if noise is None else assess_rows_on_one_core  # on board there is one
    assess(elevation, pad_map, cells, limits, worst)
    known = _known_sites(hole, footprint)
    worst.slope[~known] = np.nan
    worst.roughness[~known] = np.nan
    # A comparison with NaN is False: unknown sites are unsafe.
    deterministic = (worst.slope <= criteria.max_slope) & (worst.roughness <= criteria.max_roughness)
    if noise is not None:
        probability = np.zeros(elevation.shape)
        ground = UncertainGround(elevation, pad_map, noise)
        score_sites(ground, cells, limits, criteria.max_slope, probability)
        probability[~known] = 0.0
    elif criteria.range_noise == 0.0:
        probability = deterministic.astype(np.float64)
    else:
        probability = _probability(worst.slope, worst.excess, criteria.max_slope, criteria.range_noise)
    return SafetyMap(deterministic, probability, worst.slope, worst.roughness)


def assess_on_board(
    dem: ArrayLike, pixel_size: float, range_noise: ArrayLike, criteria: SafetyCriteria
) -> tuple[Array, NDArray[np.bool_]]:
    """What a vehicle needs of `assess_safety` with an error for each cell, in half the time: the same bits.

    Args:
        dem: (m, n) elevation [m]; NaN for a hole.
        pixel_size: [m] side of a cell.
        range_noise: [m] shape (m, n), one standard deviation of each height; any number in holes.
        criteria: limits and lander; its own `range_noise` does not count.

    Returns:
        Shape (m, n) both: the probability of Algorithm 1, and where it is known: the lander fits on the map
        and stands over no hole. Elsewhere the probability is 0.

    Raises:
        ValueError: as `assess_safety`.
    """
    pixel_size = finite_number("pixel_size", pixel_size, above=0.0)
    elevation = elevation_array(dem)
    footprint = _fit_footprint(criteria, pixel_size, elevation.shape)
    hole = np.isnan(elevation)
    elevation[hole] = 0.0
    ground = UncertainGround(elevation, _pad_map(elevation, footprint), _cell_noise(range_noise, hole))
    cells = FootprintCells(footprint.pads, footprint.first_strip, footprint.strips, footprint.half_size)
    probability = np.zeros(elevation.shape)
    score_sites(
        ground, cells, RasterLimits(pixel_size, criteria.max_roughness), criteria.max_slope, probability
    )
    known = _known_sites(hole, footprint)
    probability[~known] = 0.0
    return probability, known


def _cell_noise(range_noise: ArrayLike, hole: NDArray[np.bool_]) -> Array:
    """Each cell's own deviation [m], 0 in holes.

    Raises:
        ValueError: it has another shape than the map, or is negative or not finite where the ground is known.
    """
    try:
        noise = np.array(range_noise, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError("range_noise must be a number or an array of numbers") from error
    if noise.shape != hole.shape:
        raise ValueError(f"range_noise must have the shape of dem, {hole.shape}, got {noise.shape}")
    noise[hole] = 0.0
    if not (np.isfinite(noise).all() and (noise >= 0.0).all()):
        raise ValueError("range_noise must be finite and at least 0 in every known cell")
    return noise


def elevation_array(dem: ArrayLike) -> Array:
    """Copy a DEM as float64 [m], shape (m, n); NaN where it is NaN or masked.

    Raises:
        ValueError: it is not two-dimensional, not of real numbers, or holds heights that no ground has.
    """
    try:
        given = np.asanyarray(dem)
        if given.dtype.kind not in "biufO":
            raise TypeError(given.dtype)
        if isinstance(given, np.ma.MaskedArray):
            given = np.ma.filled(given.astype(np.float64), np.nan)
        elevation = np.array(given, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError("dem must be an array of numbers") from error
    if elevation.ndim != 2:
        raise ValueError(f"dem must be two-dimensional, got shape {elevation.shape}")
    if np.isinf(elevation).any():
        raise ValueError("dem must be finite, or NaN where the elevation is unknown; it holds infinities")
    if (np.abs(elevation) > HIGHEST).any():
        raise ValueError(
            f"dem must hold heights within {HIGHEST:g} m, or NaN where the elevation is unknown, got"
            f" {np.nanmin(elevation):g} to {np.nanmax(elevation):g} m"
        )
    return elevation


def _fit_footprint(criteria: SafetyCriteria, pixel_size: float, shape: tuple[int, ...]) -> LanderFootprint:
    """The lander on the raster of a DEM, shape (m, n).

    Raises:
        ValueError: the DEM is smaller than the lander, or the lander is too small for the pixel size.
    """
    side = min(shape)
    if criteria.footprint_diameter > (side + 1) * pixel_size:  # before a large footprint is laid out
        raise ValueError(
            f"dem must hold the lander, {criteria.footprint_diameter:g} m wide, got {side} cells of"
            f" {pixel_size:g} m"
        )
    footprint = make_footprint(criteria.footprint_diameter, criteria.pad_diameter, pixel_size)
    if side < footprint.span:
        raise ValueError(
            f"dem must have at least {footprint.span} x {footprint.span} cells to hold the lander, "
            f"got {shape[0]} x {shape[1]}"
        )
    return footprint


def _known_sites(hole: NDArray[np.bool_], footprint: LanderFootprint) -> NDArray[np.bool_]:
    """Where the lander fits on the map and stands over no hole."""
    known = np.zeros(hole.shape, dtype=np.bool_)
    edge = footprint.half_size
    known[edge : hole.shape[0] - edge, edge : hole.shape[1] - edge] = True
    _mark_unknown(hole, footprint.support, known)
    return known


@compile_kernel
def _mark_unknown(hole: NDArray[np.bool_], support: NDArray[np.int64], known: NDArray[np.bool_]) -> None:
    """Clear `known` where a lander would have a hole under a pad or between the pads."""
    rows, columns = hole.shape
    for row in range(rows):
        for column in range(columns):
            if hole[row, column]:
                for k in range(support.shape[0]):
                    site_row, site_column = row - support[k, 0], column - support[k, 1]
                    if 0 <= site_row < rows and 0 <= site_column < columns:
                        known[site_row, site_column] = False


def _pad_map(elevation: Array, footprint: LanderFootprint) -> Array:
    """[m] highest ground under a pad centred on each cell."""
    if footprint.pad_disc.size == 1:
        return elevation
    from scipy.ndimage import maximum_filter

    return maximum_filter(elevation, footprint=footprint.pad_disc, mode="nearest")


@compile_parallel_kernel
def _probability(slope, excess, max_slope, range_noise):
    """0.5 (1 - erf(excess / (sqrt 2 range_noise))); 0 beyond the slope limit and where unknown."""
    probability = np.zeros(slope.shape)
    for row in numba.prange(slope.shape[0]):
        for column in range(slope.shape[1]):
            if slope[row, column] <= max_slope:  # False for NaN
                scaled = excess[row, column] / (range_noise * math.sqrt(2.0))
                probability[row, column] = 0.5 * math.erfc(scaled)
    return probability
