"""A four-pad lander over a raster, written for reading; nothing is shared with `hda`.

The ground is scipy's bilinear surface, and every post of it is asked whether it lies under a pad or between.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

Array = NDArray[np.float64]


def surface(elevation: NDArray[np.float32]) -> RegularGridInterpolator:
    rows, columns = elevation.shape
    return RegularGridInterpolator(
        (np.arange(rows) + 0.5, np.arange(columns) + 0.5), elevation.astype(float), bounds_error=False
    )


def pad_middles(x: float, y: float, distance: float, bearing: float) -> list[tuple[float, float]]:
    return [
        (
            x + distance * math.cos(bearing + k * math.pi / 2),
            y + distance * math.sin(bearing + k * math.pi / 2),
        )
        for k in range(4)
    ]


def pad_height(elevation: NDArray[np.float32], x: float, y: float, radius: float, points: int = 16) -> float:
    """Highest of the middle, some points of the rim, and the posts within."""
    ground = surface(elevation)
    candidates = [float(ground((y, x)))]
    for k in range(points):
        angle = 2.0 * math.pi * k / points
        candidates.append(float(ground((y + radius * math.sin(angle), x + radius * math.cos(angle)))))
    rows, columns = elevation.shape
    for row in range(rows):
        for column in range(columns):
            if math.hypot(column + 0.5 - x, row + 0.5 - y) <= radius:
                candidates.append(float(elevation[row, column]))
    return max(candidates)


def is_between(x: float, y: float, pads: list[tuple[float, float]]) -> bool:
    """Strictly inside the square of the pads: to the left of each side, walked anticlockwise."""
    for (x0, y0), (x1, y1) in zip(pads, pads[1:] + pads[:1], strict=True):
        if (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0) <= 0.0:
            return False
    return True


def contact_height(
    elevation: NDArray[np.float32],
    x: float,
    y: float,
    distance: float,
    radius: float,
    clearance: float,
    bearing: float,
) -> float:
    """Highest of four pads, and of the posts between them less the clearance."""
    pads = pad_middles(x, y, distance, bearing)
    heights = [pad_height(elevation, px, py, radius) for px, py in pads]
    rows, columns = elevation.shape
    for row in range(rows):
        for column in range(columns):
            if is_between(column + 0.5, row + 0.5, pads):
                heights.append(float(elevation[row, column]) - clearance)
    return max(heights)


def plane_through(points: list[tuple[float, float, float]]) -> Array:
    """(gx, gy, z0) of the plane through three points."""
    return np.linalg.solve(np.array([[x, y, 1.0] for x, y, _ in points]), np.array([z for *_, z in points]))
