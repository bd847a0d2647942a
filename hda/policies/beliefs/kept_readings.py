"""Which reading of measured ground each cell keeps, and what the readings are worth, in compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.kernel import compile_kernel
from hda.policies.beliefs.measured_readings import HOLE

UNREAD = -1
"""Class of a cell that no look has read."""


class ReadingLayers(NamedTuple):
    """What the cells of a square have read, shape (n, n) each.

    Attributes:
        size: number of the cell size of the map that the reading is from.
        density: class of its points.
        probability: class of V_P.
    """

    size: NDArray[np.int8]
    density: NDArray[np.int8]
    probability: NDArray[np.int8]


class MapReadings(NamedTuple):
    """What a map reads.

    Attributes:
        number: of its cell size.
        density: shape (rows, columns), class of its points.
        probability: shape (rows, columns), class of V_P.
    """

    number: np.int8
    density: NDArray[np.int8]
    probability: NDArray[np.int8]


class CellPlaces(NamedTuple):
    """Row and column of a map that hold a square's rows and columns of cells; many lie beside the map.

    Attributes:
        rows: shape (n,).
        columns: shape (n,).
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]


class LookPlaces(NamedTuple):
    """How well the looks behind a square are placed; both arrays are empty where no look errs.

    Attributes:
        share: shape (rows, columns), of the points of the map's cells those of the newest look.
        variance: [m^2] shape (n, n), of the square's cells.
        newest: [m^2] of the newest look.
    """

    share: NDArray[np.float32]
    variance: NDArray[np.float32]
    newest: np.float32


@compile_kernel
def keep_better(cells: CellPlaces, found: MapReadings, kept: ReadingLayers, places: LookPlaces) -> None:
    """Replace the reading of each cell of a square by that of a map, where the map's is the better.

    It is where the cell has no reading, one of the same or of larger cells of a map, or a hole and the map
    none. A hole is never better than what larger cells know.

    Args:
        cells: of the map, under those of the square.
        found: the map's readings.
        kept: the square's; changed in place.
        places: of the looks; the variance is changed in place.
    """
    rows, columns = cells
    number, density, reading = found
    sizes, densities, readings = kept
    share, variance, misplaced = places
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
    classes: ReadingLayers, shares: NDArray[np.float32], prior: np.float32, out: NDArray[np.float32]
) -> None:
    """Share of safe ground in the classes of each cell of a square; the prior where none was read."""
    sizes, densities, readings = classes
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            size = sizes[i, j]
            out[i, j] = prior if size == UNREAD else shares[size, densities[i, j], readings[i, j]]
