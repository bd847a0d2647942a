"""What the cells that were seen say about those between and around them.

From high up a look reads one cell in nine. Safe ground lies in islands, so an unseen cell is judged by its
distances to the nearest cells that were seen safe and seen unsafe. `surroundings.csv` holds the share of safe
cells for each pair of distance classes, counted on the training tiles under simulated looks
(`python -m hda.belief_statistics`): a histogram, calibrated by construction.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel

DISTANCE_EDGES = np.array([1.2, 1.6, 2.1, 2.5, 3.2, 4.5, 6.0, 8.0, 11.0, 15.0, 20.0])
"""[m] upper edges of the distance classes; the last class has none."""

LARGEST_DISTANCE = 21
"""[m] distances are not told apart beyond this."""

TABLE = Path(__file__).with_name("surroundings.csv")
"""Where the counted shares are kept; `hda.belief_statistics` writes it."""


@lru_cache(maxsize=1)
def safe_share_table() -> Array:
    """Share of safe ground, shape (classes, classes): row by distance to safe, column to unsafe cells."""
    return np.loadtxt(TABLE, delimiter=",")


@lru_cache(maxsize=1)
def _class_of_square() -> NDArray[np.int64]:
    """Distance class of each squared distance in whole metres."""
    return np.searchsorted(DISTANCE_EDGES, np.sqrt(np.arange(LARGEST_DISTANCE**2 + 1)))


def squared_distance(marked: NDArray[np.bool_], limit: int = LARGEST_DISTANCE) -> NDArray[np.int32]:
    """[m^2] squared distance from each cell to the nearest marked one, at most `limit` [m] squared."""
    out = np.empty(marked.shape, dtype=np.int32)
    _squared_distance_into(marked, limit, out)
    return out


@compile_kernel
def _squared_distance_into(marked: NDArray[np.bool_], limit: int, out: NDArray[np.int32]) -> None:
    """Exact Euclidean distance: along columns first, then along each row outward, while any cell can gain.

    Whole rows take each step, in 32 bits, so that it runs on the vector units.
    """
    rows, columns = marked.shape
    none, one, far = np.int32(0), np.int32(1), np.int32(limit)
    along = np.empty((rows, columns), dtype=np.int32)
    before = np.full(columns, far, dtype=np.int32)
    for row in range(rows):
        here, mark = along[row], marked[row]
        for column in range(columns):
            further = min(np.int32(before[column] + one), far)
            here[column] = none if mark[column] else further
        before = here
    for row in range(rows - 2, -1, -1):
        here, after = along[row], along[row + 1]
        for column in range(columns):
            here[column] = min(here[column], np.int32(after[column] + one))
    reach = min(limit, columns)
    padded = np.full(columns + 2 * reach, np.int32(limit * limit), dtype=np.int32)
    square = padded[reach : reach + columns]
    for row in range(rows):
        here, nearest = along[row], out[row]
        least = far
        for column in range(columns):
            square[column] = np.int32(here[column] * here[column])
            nearest[column] = square[column]
            least = min(least, here[column])
        greatest, step = (limit * limit if least < far else 0), 1
        while step < reach and step * step < greatest:
            west, east, more = padded[reach - step :], padded[reach + step :], np.int32(step * step)
            most = none
            for column in range(columns):
                through = np.int32(min(west[column], east[column]) + more)
                nearest[column] = min(nearest[column], through)
                most = max(most, nearest[column])
            greatest, step = int(most), step + 1


@compile_kernel
def _infer_into(
    to_safe: NDArray[np.int32],
    to_unsafe: NDArray[np.int32],
    seen: NDArray[np.bool_],
    class_of_square: NDArray[np.int64],
    table: Array,
    out: NDArray[np.float32],
) -> None:
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            if not seen[row, column]:
                i, j = class_of_square[to_safe[row, column]], class_of_square[to_unsafe[row, column]]
                out[row, column] = table[i, j]


def _near_seen(seen: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Rows and columns of the rectangle outside which no cell is within LARGEST_DISTANCE of a seen one."""
    parts = []
    for axis in (1, 0):
        places = np.flatnonzero(seen.any(axis=axis))
        first, last = (places[0], places[-1]) if places.size else (0, -1)
        parts.append(slice(max(first - LARGEST_DISTANCE, 0), last + LARGEST_DISTANCE + 1))
    return parts[0], parts[1]


def infer_unseen(probability: NDArray[np.float32], seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Probability that each cell is safe, seen or not.

    Args:
        probability: shape (n, n), posterior of the cells that were seen.
        seen: shape (n, n).

    Returns:
        Shape (n, n): the posterior where seen, else the share of the training ground that is safe at such
        distances from seen ground.
    """
    table, near = safe_share_table(), _near_seen(seen)
    seen, part = np.ascontiguousarray(seen[near]), probability[near].copy()  # in one order, for the kernels
    likely = part > 0.5
    to_safe, to_unsafe = squared_distance(seen & likely), squared_distance(seen & ~likely)
    _infer_into(to_safe, to_unsafe, seen, _class_of_square(), table, part)
    out = np.full(probability.shape, table[-1, -1], dtype=np.float32)
    out[near] = part
    return out
