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

LARGEST_DISTANCE = 24
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
    """Exact Euclidean distance: along columns first, then the lower envelope of parabolas along each row.

    Source: Felzenszwalb and Huttenlocher, Theory of Computing 8, 2012.
    """
    rows, columns = marked.shape
    along = np.full((rows, columns), limit, dtype=np.int32)
    for row in range(rows):
        for column in range(columns):
            if marked[row, column]:
                along[row, column] = 0
            elif row > 0:
                along[row, column] = min(along[row - 1, column] + 1, limit)
    for row in range(rows - 2, -1, -1):
        for column in range(columns):
            along[row, column] = min(along[row, column], along[row + 1, column] + 1)
    vertex = np.empty(columns, dtype=np.int64)
    edge = np.empty(columns + 1)
    for row in range(rows):
        last = -1
        for column in range(columns):
            height = along[row, column]
            if height == limit:
                continue
            start = -np.inf
            while last >= 0:
                other = vertex[last]
                rise = height**2 + column**2 - along[row, other] ** 2 - other**2
                start = rise / (2.0 * (column - other))
                if start > edge[last]:
                    break
                last -= 1
                start = -np.inf
            last += 1
            vertex[last] = column
            edge[last] = start
        count, current = last + 1, 0
        for column in range(columns):
            if count == 0:
                out[row, column] = limit**2
                continue
            while current + 1 < count and edge[current + 1] < column:
                current += 1
            nearest = vertex[current]
            out[row, column] = min((column - nearest) ** 2 + along[row, nearest] ** 2, limit**2)


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


def infer_unseen(probability: NDArray[np.float32], seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Probability that each cell is safe, seen or not.

    Args:
        probability: shape (n, n), posterior of the cells that were seen.
        seen: shape (n, n).

    Returns:
        Shape (n, n): the posterior where seen, else the share of the training ground that is safe at such
        distances from seen ground.
    """
    likely = probability > 0.5
    out = probability.copy()
    _infer_into(
        squared_distance(seen & likely),
        squared_distance(seen & ~likely),
        seen,
        _class_of_square(),
        safe_share_table(),
        out,
    )
    return out
