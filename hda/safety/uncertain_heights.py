"""The probability of Algorithm 1 where each cell's height has an error of its own."""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.safety.stable_planes import (
    COLUMN_BLOCK,
    FootprintCells,
    RasterLimits,
    WorstCase,
    plane_gradients,
)

_LEAST_NOISE = 1e-9  # [m] a smaller error decides like none


@compile_kernel
def _worst_score(elevation, precision, row, start, n, strips, buffer):
    """Raise buffer[9] to the greatest (height above a plane less its limit) x precision between the pads."""
    east_a, north_a, east_b, north_b = buffer[0], buffer[1], buffer[2], buffer[3]
    limit_a, limit_b, floor_a, floor_b, score = buffer[5], buffer[6], buffer[7], buffer[8], buffer[9]
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
def score_sites(
    ground: tuple[Array, Array, Array],
    footprint: FootprintCells,
    limits: RasterLimits,
    max_slope: float,
    worst: WorstCase,
    probability: Array,
) -> None:
    """Fill `probability`: that of the worst cell, orientation and plane, 0.5 erfc(score / sqrt 2).

    Args:
        ground: (m, n) each: elevation [m], highest ground under a pad at each cell [m], and one standard
            deviation of each height [m].
        footprint: the lander.
        limits: side of a cell and greatest roughness.
        max_slope: [rad].
        worst: slope and roughness of each site, NaN where unknown.
        probability: shape (m, n), zeros; a site keeps its zero where the slope breaks its limit or is
            unknown.
    """
    elevation, pad_map, noise = ground
    pads, first_strip, strips, half_size = footprint
    rows, columns = elevation.shape
    precision = 1.0 / np.maximum(noise, _LEAST_NOISE)
    buffer = np.empty((10, COLUMN_BLOCK))
    limit_a, limit_b, score = buffer[5], buffer[6], buffer[9]
    for row in range(half_size, rows - half_size):
        for start in range(half_size, columns - half_size, COLUMN_BLOCK):
            n = min(COLUMN_BLOCK, columns - half_size - start)
            for i in range(n):
                score[i] = -np.inf
            for k in range(pads.shape[0]):
                plane_gradients(pad_map, row, start, n, pads[k, 0], pads[k, 1], buffer)
                for i in range(n):
                    square_a = (buffer[0, i] ** 2 + buffer[1, i] ** 2) / limits.pixel_size**2
                    square_b = (buffer[2, i] ** 2 + buffer[3, i] ** 2) / limits.pixel_size**2
                    limit_a[i] = buffer[4, i] + limits.max_roughness * math.sqrt(1.0 + square_a)
                    limit_b[i] = buffer[4, i] + limits.max_roughness * math.sqrt(1.0 + square_b)
                own = strips[first_strip[k] : first_strip[k + 1]]
                _worst_score(elevation, precision, row, start, n, own, buffer)
            for i in range(n):
                if worst.slope[row, start + i] <= max_slope:  # False for NaN
                    probability[row, start + i] = 0.5 * math.erfc(score[i] / math.sqrt(2.0))
