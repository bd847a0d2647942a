"""Rays against ground: where a straight line first meets a digital elevation model.

Between the centres of four neighbouring cells the ground is their bilinear interpolation. A ray goes from
patch to patch (Amanatides and Woo, Eurographics 1987); in each, its height above the ground is a quadratic in
the range, so that the first root is exact and what lies in front hides what lies behind.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel

_ROUNDING = 1e-6  # [m] below the ground by which a ray may enter a patch
_FARTHEST = 1e7  # [m] where a vertical ray ends
Vector = Array | tuple[float, float, float]

_NO_HIT = (math.nan, 0.0, 0.0)


@compile_kernel
def _span_inside(start: float, step: float, last: float) -> tuple[float, float]:
    """Ranges between which start + range x step lies in [0, last]."""
    if step == 0.0:
        return (-np.inf, np.inf) if 0.0 <= start <= last else (np.inf, -np.inf)
    first, second = -start / step, (last - start) / step
    return min(first, second), max(first, second)


@compile_kernel
def find_ground(
    elevation: NDArray[np.float32], origin: Vector, direction: Vector, top: float
) -> tuple[float, float, float]:
    """Range at which a ray first meets the ground, and the ground's slope there.

    Args:
        elevation: [m] shape (rows, columns), 1 m a cell, cell (0, 0) centred at (0.5, 0.5) m; NaN for a hole.
        origin: [m] three numbers.
        direction: three numbers, a unit vector.
        top: [m] no ground is higher.

    Returns:
        [m] range, NaN where the ray meets no known ground; and the rise of the ground to the east and to the
        north [m/m].
    """
    rows, columns = elevation.shape
    u0, v0, z0 = origin[0] - 0.5, origin[1] - 0.5, origin[2]
    du, dv, dz = direction[0], direction[1], direction[2]
    start = 0.0
    if z0 > top:
        if dz >= 0.0:
            return _NO_HIT
        start = (top - z0) / dz
    enter_u, leave_u = _span_inside(u0, du, columns - 1.0)
    enter_v, leave_v = _span_inside(v0, dv, rows - 1.0)
    t, end = max(start, enter_u, enter_v), min(leave_u, leave_v, _FARTHEST)
    if not t < end:
        return _NO_HIT
    column = min(max(math.floor(u0 + t * du), 0), columns - 2)
    row = min(max(math.floor(v0 + t * dv), 0), rows - 2)
    east_side, north_side = (1.0 if du > 0.0 else 0.0), (1.0 if dv > 0.0 else 0.0)
    to_column = (column + east_side - u0) / du if du != 0.0 else np.inf
    to_row = (row + north_side - v0) / dv if dv != 0.0 else np.inf
    while True:
        leave = max(min(to_column, to_row, end), t)
        corner = elevation[row, column]
        east = elevation[row, column + 1] - corner
        north = elevation[row + 1, column] - corner
        twist = elevation[row + 1, column + 1] - elevation[row + 1, column] - east
        u, v = u0 + t * du - column, v0 + t * dv - row
        if not math.isnan(twist):
            constant = z0 + t * dz - (corner + east * u + north * v + twist * u * v)
            if constant < -_ROUNDING:
                return _NO_HIT  # it came in from below: through a hole or the map's side
            constant = max(constant, 0.0)
            linear = dz - east * du - north * dv - twist * (du * v + dv * u)
            square = -twist * du * dv
            length = leave - t
            below = (square * length + linear) * length + constant <= 0.0
            discriminant = linear * linear - 4.0 * square * constant
            dips = square > 0.0 and -2.0 * square * length < linear < 0.0 and discriminant >= 0.0
            if below or dips:
                root = 0.0
                if constant > 0.0:
                    root = 2.0 * constant / (math.sqrt(max(discriminant, 0.0)) - linear)
                root = min(root, length)
                return t + root, east + twist * (v + root * dv), north + twist * (u + root * du)
        if leave >= end:
            return _NO_HIT
        t = leave
        if to_column <= to_row:
            column += 1 if du > 0.0 else -1
            to_column = (column + east_side - u0) / du
        else:
            row += 1 if dv > 0.0 else -1
            to_row = (row + north_side - v0) / dv
        if not (0 <= column < columns - 1 and 0 <= row < rows - 1):
            return _NO_HIT
