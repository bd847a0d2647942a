"""A map of safety under the error with which a touchdown meets its site."""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array


def smooth_map(safety: Array, dispersion: float) -> Array:
    """Mean of a map over a Gaussian scatter about each pixel; beyond its edge the map is 0.

    Args:
        safety: shape (m, n).
        dispersion: standard deviation along each axis, in pixels; 0 leaves the map as it is.

    Returns:
        Shape (m, n).
    """
    if dispersion <= 0.0:
        return safety
    reach = np.arange(math.ceil(3.0 * dispersion) + 1)
    within = np.array([math.erf((k + 0.5) / (dispersion * math.sqrt(2.0))) for k in reach])
    share = np.diff(within, prepend=0.0) * np.where(reach == 0, 1.0, 0.5) / within[-1]
    out = safety
    for _ in range(2):  # along the rows, then along the columns
        cells = np.arange(out.shape[1])
        apart = np.abs(np.subtract.outer(cells, cells))
        out = (out @ np.where(apart < reach.size, share[np.minimum(apart, reach.size - 1)], 0.0)).T
    return out
