"""A map of safety under the error with which a touchdown meets its site."""

from __future__ import annotations

import math

import numpy as np

from guidance.arrays import Array
from hda.policies.landing_dispersion import gaussian_shares


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
    share = gaussian_shares(dispersion, math.ceil(3.0 * dispersion))
    out = safety
    for _ in range(2):  # along the rows, then along the columns
        cells = np.arange(out.shape[1])
        apart = np.abs(np.subtract.outer(cells, cells))
        out = (out @ np.where(apart < share.size, share[np.minimum(apart, share.size - 1)], 0.0)).T
    return out
