"""Integral images: the sum over any rectangle of cells in four reads.

Entry (i, j) of an image of n x n cells is the sum over rows below i and columns below j. Only the part of it
is kept that will be read.
"""

from __future__ import annotations

from typing import NamedTuple

from guidance.arrays import Array
from guidance.kernel import compile_kernel


class SummedArea(NamedTuple):
    """Part of an integral image.

    Attributes:
        sums: shape (rows, columns), its entries from row `first` and column 0 on.
        first: row of the first entries.
        cells: n.
    """

    sums: Array
    first: int
    cells: int


@compile_kernel
def add_two_rows(below: tuple[Array, Array], out: tuple[Array, Array]) -> None:
    """Write a row of two integral images from the sums of their columns so far.

    Two sums run side by side, since each addition waits for the one before.
    """
    below_first, below_second = below
    first_out, second_out = out
    first, second = 0.0, 0.0
    first_out[0], second_out[0] = first, second
    for column in range(first_out.size - 1):
        first += below_first[column]
        second += below_second[column]
        first_out[column + 1] = first
        second_out[column + 1] = second


@compile_kernel
def sum_box(area: SummedArea, row: int, column: int, half: float) -> float:
    """Sum over the cells within `half` of a cell along each axis."""
    sums, cells = area.sums, int(half)
    low_row, high_row = max(row - cells, 0) - area.first, min(row + cells + 1, area.cells) - area.first
    low, high = max(column - cells, 0), min(column + cells + 1, area.cells)
    return sums[high_row, high] - sums[low_row, high] - sums[high_row, low] + sums[low_row, low]
