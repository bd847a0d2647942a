"""Integral images: the sum over any rectangle of cells in four reads.

Entry (i, j) of an image of n x n cells, shape (n + 1, n + 1), is the sum over rows below i and columns below j.
"""

from __future__ import annotations

from guidance.arrays import Array
from guidance.kernel import compile_kernel


@compile_kernel
def add_two_rows(below: tuple[Array, Array], out: tuple[Array, Array]) -> None:
    """Write a row of two integral images from the sums of their columns so far, shape (n,) each.

    Two sums run side by side, since each addition waits for the one before.
    """
    below_first, below_second = below
    first_out, second_out = out
    first, second = 0.0, 0.0
    for column in range(below_first.size):
        first += below_first[column]
        second += below_second[column]
        first_out[column + 1] = first
        second_out[column + 1] = second


@compile_kernel
def sum_box(area: Array, row: int, column: int, half: float) -> float:
    """Sum over the cells within `half` of a cell along each axis."""
    n = area.shape[0] - 1
    cells = int(half)
    low_row, high_row = max(row - cells, 0), min(row + cells + 1, n)
    low, high = max(column - cells, 0), min(column + cells + 1, n)
    return area[high_row, high] - area[low_row, high] - area[high_row, low] + area[low_row, low]
