"""Which reading of measured ground each cell keeps, and what the readings are worth, in compiled code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from guidance.kernel import compile_kernel
from hda.policies.beliefs.measured_readings import HOLE

UNREAD = -1
"""Class of a cell that no look has read."""

Layers = tuple[NDArray[np.int8], NDArray[np.int8], NDArray[np.int8]]
"""Classes of the size of the map, of the density of its points and of V_P, shape (n, n) each."""


@compile_kernel
def keep_better(
    places: tuple[NDArray[np.int64], NDArray[np.int64]],
    found: tuple[NDArray[np.int8], NDArray[np.int8], np.int8],
    kept: Layers,
    placement: tuple[NDArray[np.float32], NDArray[np.float32]],
    misplaced: np.float32,
) -> None:
    """Let each cell of a square keep the better of its reading and that of a map.

    Args:
        places: shape (n,) each, row and column of the map that hold the square's rows and columns of cells;
            many lie beside the map.
        found: of the map: classes of V_P and of density, shape (rows, columns), and number of its cell size.
        kept: the square's classes of size, density and V_P, shape (n, n); changed in place.
        placement: share of the points of the map's cells that are the newest look's, and [m^2] shape (n, n),
            variance of the looks' places, which is changed in place; both empty where no look errs.
        misplaced: [m^2] that of the newest look.
    """
    rows, columns = places
    reading, density, number = found
    sizes, densities, readings = kept
    share, variance = placement
    for i in range(rows.size):
        if not 0 <= rows[i] < reading.shape[0]:
            continue
        for j in range(columns.size):
            if not 0 <= columns[j] < reading.shape[1]:
                continue
            new, old = reading[rows[i], columns[j]], sizes[i, j]
            hole, finer = old != UNREAD and readings[i, j] == HOLE, number < old
            first, again = old == UNREAD, old == number
            better = first or again or (hole and new != HOLE) or (finer and (hole or new != HOLE))
            if new == UNREAD or not better:
                continue
            if variance.size > 0:
                part = share[rows[i], columns[j]] if old == number else np.float32(1.0)
                variance[i, j] += part * (misplaced - variance[i, j])
            sizes[i, j], densities[i, j] = number, density[rows[i], columns[j]]
            readings[i, j] = new


@compile_kernel
def look_up(
    classes: Layers, shares: NDArray[np.float32], prior: np.float32, out: NDArray[np.float32]
) -> None:
    """Share of safe ground in the classes of each cell of a square; the prior where none was read."""
    sizes, densities, readings = classes
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            size = sizes[i, j]
            out[i, j] = prior if size == UNREAD else shares[size, densities[i, j], readings[i, j]]
