"""The probability of Algorithm 1 where each cell's height has an error of its own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.safety.stable_planes import (
    COLUMN_BLOCK,
    FootprintCells,
    PlaneGradients,
    RasterLimits,
    SiteBlock,
    fit_planes,
    make_planes,
)

_GAP = 8  # so few sites between two runs are scored too: a short run costs more than it spares
_LEAST_NOISE = 1e-9  # [m] a smaller error decides like none


class UncertainGround(NamedTuple):
    """Ground whose heights err; (m, n) each.

    Attributes:
        elevation: [m].
        pad_map: [m] highest ground under a pad at each cell.
        noise: [m] one standard deviation of each height.
    """

    elevation: Array
    pad_map: Array
    noise: Array


class _WeighedGround(NamedTuple):
    """`UncertainGround` with the precision of each height [1/m], the inverse of its deviation."""

    elevation: Array
    pad_map: Array
    precision: Array


class _Scores(NamedTuple):
    """Of each site of a block.

    Attributes:
        limit_a: [m] greatest safe height at the centre, by plane a.
        limit_b: [m] the same by plane b.
        floor_a: [m] the same by plane a in the strip at hand, north of the centre or south.
        floor_b: [m] the same by plane b.
        worst: greatest height above a limit, in deviations.
    """

    limit_a: Array
    limit_b: Array
    floor_a: Array
    floor_b: Array
    worst: Array


@compile_kernel
def _raise_scores(
    elevation: Array,
    precision: Array,
    block: SiteBlock,
    strips: NDArray[np.int64],
    planes: PlaneGradients,
    scores: _Scores,
) -> None:
    """Raise `worst` to the greatest (height above a plane less its limit) x precision between the pads."""
    row, start, n = block
    east_a, north_a, east_b, north_b, _ = planes
    limit_a, limit_b, floor_a, floor_b, score = scores
    for k in range(strips.shape[0]):
        north = strips[k, 0]
        for i in range(n):
            floor_a[i] = limit_a[i] + north * north_a[i]
            floor_b[i] = limit_b[i] + north * north_b[i]
        for east in range(strips[k, 1], strips[k, 2] + 1):
            z = elevation[row + north, start + east : start + east + n]
            w = precision[row + north, start + east : start + east + n]
            for i in range(n):
                a = (z[i] - floor_a[i] - east * east_a[i]) * w[i]
                b = (z[i] - floor_b[i] - east * east_b[i]) * w[i]
                a = a if a > b else b
                score[i] = a if a > score[i] else score[i]


@compile_kernel
def _find_slopes(
    pad_map: Array,
    block: SiteBlock,
    pads: NDArray[np.int64],
    pixel_size: float,
    planes: PlaneGradients,
    slope: Array,
) -> None:
    """Fill `slope` [rad]: the steepest plane of each site, over all orientations."""
    east_a, north_a, east_b, north_b, _ = planes
    n = block.sites
    for i in range(n):
        slope[i] = 0.0
    for k in range(pads.shape[0]):
        fit_planes(pad_map, block, pads[k, 0], pads[k, 1], planes)
        for i in range(n):
            square_a = (east_a[i] ** 2 + north_a[i] ** 2) / pixel_size**2
            square_b = (east_b[i] ** 2 + north_b[i] ** 2) / pixel_size**2
            slope[i] = max(slope[i], max(square_a, square_b))
    for i in range(n):
        slope[i] = math.atan(math.sqrt(slope[i]))


@compile_kernel
def _next_run(slope: Array, start: int, sites: int, max_slope: float) -> tuple[int, int]:
    """First site from `start` on that is gentle enough, and one past the last before a wider gap."""
    first = start
    while first < sites and not slope[first] <= max_slope:
        first += 1
    last, site = first, first
    while site < sites and site - last <= _GAP:
        if slope[site] <= max_slope:
            last = site + 1
        site += 1
    return first, last


@compile_kernel
def _score_block(
    ground: _WeighedGround,
    block: SiteBlock,
    footprint: FootprintCells,
    limits: RasterLimits,
    planes: PlaneGradients,
    scores: _Scores,
) -> None:
    """Fill `scores.worst` over all orientations."""
    elevation, pad_map, precision = ground
    pads, first_strip, strips, _ = footprint
    east_a, north_a, east_b, north_b, centre = planes
    limit_a, limit_b, _, _, worst = scores
    for i in range(block.sites):
        worst[i] = -np.inf
    for k in range(pads.shape[0]):
        fit_planes(pad_map, block, pads[k, 0], pads[k, 1], planes)
        for i in range(block.sites):
            square_a = (east_a[i] ** 2 + north_a[i] ** 2) / limits.pixel_size**2
            square_b = (east_b[i] ** 2 + north_b[i] ** 2) / limits.pixel_size**2
            limit_a[i] = centre[i] + limits.max_roughness * math.sqrt(1.0 + square_a)
            limit_b[i] = centre[i] + limits.max_roughness * math.sqrt(1.0 + square_b)
        own = strips[first_strip[k] : first_strip[k + 1]]
        _raise_scores(elevation, precision, block, own, planes, scores)


@compile_kernel
def score_sites(
    ground: UncertainGround,
    footprint: FootprintCells,
    limits: RasterLimits,
    max_slope: float,
    probability: Array,
) -> None:
    """Fill `probability`: that of the worst cell, orientation and plane, 0.5 erfc(score / sqrt 2).

    Args:
        ground: the heights and their errors, (m, n).
        footprint: the lander.
        limits: side of a cell and greatest roughness.
        max_slope: [rad].
        probability: shape (m, n), zeros; a site keeps its zero where the slope breaks its limit, or where the
            lander does not fit on the map.
    """
    elevation, pad_map, noise = ground
    pads, _, _, half_size = footprint
    rows, columns = elevation.shape
    weighed = _WeighedGround(elevation, pad_map, 1.0 / np.maximum(noise, _LEAST_NOISE))
    planes, room = make_planes(), np.empty((6, COLUMN_BLOCK))
    scores, slope = _Scores(room[0], room[1], room[2], room[3], room[4]), room[5]
    for row in range(half_size, rows - half_size):
        for start in range(half_size, columns - half_size, COLUMN_BLOCK):
            n = min(COLUMN_BLOCK, columns - half_size - start)
            _find_slopes(pad_map, SiteBlock(row, start, n), pads, limits.pixel_size, planes, slope)
            first, last = _next_run(slope, 0, n, max_slope)
            while first < n:
                block = SiteBlock(row, start + first, last - first)
                _score_block(weighed, block, footprint, limits, planes, scores)
                for i in range(first, last):
                    if slope[i] <= max_slope:
                        score = scores.worst[i - first]
                        probability[row, start + i] = 0.5 * math.erfc(score / math.sqrt(2.0))
                first, last = _next_run(slope, last, n, max_slope)
