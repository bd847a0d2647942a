"""The kernel of Algorithm 1: worst slope and roughness over a lander's orientations and stable planes.

Row by row, a block of columns at a time, so that the inner loops run over neighbouring sites and vectorise.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel, compile_parallel_kernel

COLUMN_BLOCK = 256  # sites of a row worked on together; their buffers stay in the first-level cache


class SiteBlock(NamedTuple):
    """Neighbouring sites of a row: the row, the first site's column, and how many they are."""

    row: int
    start: int
    sites: int


class PlaneGradients(NamedTuple):
    """The stable planes a and b of each site of a block: slopes [m per cell], height of the centre [m]."""

    east_a: Array
    north_a: Array
    east_b: Array
    north_b: Array
    centre: Array


class _Heights(NamedTuple):
    """[m] highest ground above planes a and b of each site of a block: so far, and in one strip."""

    high_a: Array
    high_b: Array
    strip_a: Array
    strip_b: Array


@compile_kernel
def make_planes() -> PlaneGradients:
    """Room for the planes of a block."""
    room = np.empty((5, COLUMN_BLOCK))
    return PlaneGradients(room[0], room[1], room[2], room[3], room[4])


@compile_kernel
def fit_planes(pad_map: Array, block: SiteBlock, north: int, east: int, planes: PlaneGradients) -> None:
    """Fill `planes` with the two stable planes of each site, pad 0 at the offset (north, east) [cells]."""
    row, start, n = block
    east_a, north_a, east_b, north_b, centre = planes
    z0 = pad_map[row + north, start + east : start + east + n]
    z1 = pad_map[row + east, start - north : start - north + n]
    z2 = pad_map[row - north, start - east : start - east + n]
    z3 = pad_map[row - east, start + north : start + north + n]
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
def _find_highest(
    elevation: Array,
    block: SiteBlock,
    strips: NDArray[np.int64],
    planes: PlaneGradients,
    heights: _Heights,
) -> None:
    """Greatest elevation less gradient times offset over the cells between the pads, for both planes."""
    row, start, n = block
    east_a, north_a, east_b, north_b, _ = planes
    high_a, high_b, strip_a, strip_b = heights
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


class FootprintCells(NamedTuple):
    """What the kernel needs of a `LanderFootprint`, under the same names."""

    pads: NDArray[np.int64]
    first_strip: NDArray[np.int64]
    strips: NDArray[np.int64]
    half_size: int


class RasterLimits(NamedTuple):
    """[m] side of a cell, and greatest roughness."""

    pixel_size: float
    max_roughness: float


class WorstCase(NamedTuple):
    """Worst slope [rad], roughness [m] and height above the plane less its limit [m], of each cell."""

    slope: Array
    roughness: Array
    excess: Array


@compile_kernel
def _assess_row(
    row: int,
    elevation: Array,
    pad_map: Array,
    footprint: FootprintCells,
    limits: RasterLimits,
    worst: WorstCase,
) -> None:
    """Fill one row of the three maps of `worst`.

    For an orientation, with pads 0 to 3 at opposite corners 0-2 and 1-3 and R pads' distance from the centre,
    the plane through the higher diagonal has along it the gradient (z0 - z2) / 2R and across it (z1 - h) / R
    or (h - z3) / R, where h is the height of the lander's centre, the mean of the diagonal's pads.
    """
    pads, first_strip, strips, half_size = footprint
    pixel_size, max_roughness = limits
    slope, roughness, excess = worst
    columns = elevation.shape[1]
    planes, room = make_planes(), np.empty((4, COLUMN_BLOCK))
    heights = _Heights(room[0], room[1], room[2], room[3])
    east_a, north_a, east_b, north_b, centre = planes
    high_a, high_b, _, _ = heights
    for start in range(half_size, columns - half_size, COLUMN_BLOCK):
        n = min(COLUMN_BLOCK, columns - half_size - start)
        block = SiteBlock(row, start, n)
        steepest, roughest, most = slope[row, start:], roughness[row, start:], excess[row, start:]
        for i in range(n):
            steepest[i], roughest[i], most[i] = 0.0, -np.inf, -np.inf
        for k in range(pads.shape[0]):
            fit_planes(pad_map, block, pads[k, 0], pads[k, 1], planes)
            _find_highest(elevation, block, strips[first_strip[k] : first_strip[k + 1]], planes, heights)
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


@compile_parallel_kernel
def assess_rows(
    elevation: Array, pad_map: Array, footprint: FootprintCells, limits: RasterLimits, worst: WorstCase
) -> None:
    """Fill the three maps of `worst`, row by row over the cores: cells do not depend on one another."""
    half_size = footprint.half_size
    for row in numba.prange(half_size, elevation.shape[0] - half_size):
        _assess_row(row, elevation, pad_map, footprint, limits, worst)


@compile_kernel
def assess_rows_on_one_core(
    elevation: Array, pad_map: Array, footprint: FootprintCells, limits: RasterLimits, worst: WorstCase
) -> None:
    """The same on one core: for a map so small that waking the others costs more than it spares."""
    half_size = footprint.half_size
    for row in range(half_size, elevation.shape[0] - half_size):
        _assess_row(row, elevation, pad_map, footprint, limits, worst)
