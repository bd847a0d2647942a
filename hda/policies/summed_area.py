"""Integral images: the sum over any rectangle of cells in four reads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel


def summed_area(density: NDArray[np.float32]) -> Array:
    """Integral image, shape (n + 1, n + 1): entry (i, j) is the sum over rows below i and columns below j."""
    out = np.zeros((density.shape[0] + 1, density.shape[1] + 1))
    _sum_into(density, out)
    return out


@compile_kernel
def _sum_into(density: NDArray[np.float32], out: Array) -> None:
    rows, columns = density.shape
    below = np.zeros(columns)
    for row in range(rows):
        total = 0.0
        for column in range(columns):
            below[column] += density[row, column]
            total += below[column]
            out[row + 1, column + 1] = total


@compile_kernel
def sum_box(area: Array, row: int, column: int, half: float) -> float:
    """Sum over the cells within `half` of a cell along each axis."""
    n = area.shape[0] - 1
    cells = int(half)
    low_row, high_row = max(row - cells, 0), min(row + cells + 1, n)
    low, high = max(column - cells, 0), min(column + cells + 1, n)
    return area[high_row, high] - area[low_row, high] - area[high_row, low] + area[low_row, low]
