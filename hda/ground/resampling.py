"""Elevation on another grid: cubic convolution onto a finer one, area averages onto a coarser one.

Both are weighted sums along rows and along columns. A plane stays the same plane; where averaged cells cut
through pixels, to within its fall over half a pixel. A cell that needs an unknown pixel is unknown.

Source of the cubic kernel: Keys, IEEE Transactions on Acoustics, Speech, and Signal Processing 29, 1981
(a = -1/2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array

if TYPE_CHECKING:
    from scipy.sparse import csr_array


@dataclass(frozen=True, eq=False)
class AxisWeights:
    """How the cells along one axis follow from the pixels along it.

    Attributes:
        first: first pixel that is needed.
        last: one past the last.
        weights: shape (cells, last - first); each row sums to 1.
    """

    first: int
    last: int
    weights: csr_array


def axis_weights(first_cell: int, cells: int, pixel_size: float, pixels: int) -> AxisWeights:
    """Weights of cells `first_cell` to `first_cell + cells - 1`, 1 m each, from pixels of another size.

    Args:
        first_cell: cell 0 begins where pixel 0 begins.
        cells: at least 1.
        pixel_size: [m]; at most 1: area average; above: cubic convolution, with straight continuation beyond
            the first and last pixel.
        pixels: along the whole axis, at least 4 where they are larger than a cell.
    """
    from scipy.sparse import coo_array

    pairs = _average_pairs if pixel_size <= 1.0 else _cubic_pairs
    cell, pixel, weight = pairs(first_cell, cells, pixel_size, pixels)
    used = weight != 0.0
    cell, pixel, weight = cell[used], pixel[used], weight[used]
    first, last = int(pixel.min()), int(pixel.max()) + 1
    matrix = coo_array((weight, (cell, pixel - first)), shape=(cells, last - first)).tocsr()
    return AxisWeights(first, last, matrix)


def _average_pairs(
    first_cell: int, cells: int, pixel_size: float, pixels: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Each pixel counts with the share of the cell that it covers."""
    across = math.ceil(1.0 / pixel_size) + 1
    west = first_cell + np.arange(cells, dtype=np.float64)[:, None]
    pixel = np.floor(west / pixel_size).astype(np.intp) + np.arange(across)
    begin, end = np.maximum(pixel * pixel_size, west), np.minimum((pixel + 1) * pixel_size, west + 1.0)
    weight = np.clip(end - begin, 0.0, None)
    weight[(weight < 1e-9) | (pixel >= pixels)] = 0.0  # rounding at the edges of pixels
    weight /= weight.sum(axis=1, keepdims=True)
    cell = np.broadcast_to(np.arange(cells)[:, None], pixel.shape)
    return cell.ravel(), np.minimum(pixel, pixels - 1).ravel(), weight.ravel()


def _cubic_pairs(
    first_cell: int, cells: int, pixel_size: float, pixels: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Keys' kernel over the four nearest pixels; a pixel beyond the edge is the mirror 2 edge - inner."""
    place = (first_cell + np.arange(cells) + 0.5) / pixel_size - 0.5
    nearest = np.floor(place).astype(np.intp)
    pixel = nearest[:, None] + np.arange(-1, 3)
    weight = _keys(np.abs(place[:, None] - pixel))
    cell = np.broadcast_to(np.arange(cells)[:, None], pixel.shape).ravel()
    pixel, weight = pixel.ravel(), weight.ravel()
    edge = np.clip(pixel, 0, pixels - 1)
    beyond = pixel != edge
    return (
        np.concatenate([cell, cell[beyond]]),
        np.concatenate([edge, (2 * edge - pixel)[beyond]]),
        np.concatenate([np.where(beyond, 2.0 * weight, weight), -weight[beyond]]),
    )


def _keys(distance: Array) -> Array:
    near = (1.5 * distance - 2.5) * distance**2 + 1.0
    far = ((-0.5 * distance + 2.5) * distance - 4.0) * distance + 2.0
    return np.where(distance < 1.0, near, np.where(distance < 2.0, far, 0.0))


def resample(heights: Array, north: AxisWeights, east: AxisWeights) -> Array:
    """Heights of the cells from those of the pixels that `north` and `east` ask for.

    Args:
        heights: [m] shape (north.last - north.first, east.last - east.first), NaN where unknown.
        north: weights along rows.
        east: weights along columns.

    Returns:
        [m] shape (cells north, cells east), NaN where an unknown pixel was needed.
    """
    unknown = np.isnan(heights)
    cells = _both_axes(np.where(unknown, 0.0, heights), north.weights, east.weights)
    if unknown.any():
        cells[_both_axes(unknown.astype(np.float64), abs(north.weights), abs(east.weights)) > 0.0] = np.nan
    return cells


def _both_axes(values: Array, north: csr_array, east: csr_array) -> Array:
    return (east @ (north @ values).T).T
