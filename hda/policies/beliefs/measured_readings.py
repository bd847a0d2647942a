"""How often ground is safe that a measured look calls safe with some probability: counted on training tiles.

A reading is the V_P that Algorithm 1 gives a cell on the fused elevation map. What it is worth depends on the
side of the map's cells and on how many points lie in one: coarse posts step over rocks. The counts for each
class of the three stand in `measured_readings.json`, which names the command that made them.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.sensing.gridding import PIXEL_SIZES

TABLE = Path(__file__).with_name("measured_readings.json")
"""Where the counts are kept; `hda.look_statistics` writes it."""

DENSITY_EDGES = np.array([1.2, 2.0, 4.0, 10.0])
"""Mean number of points in a cell around a site: upper edges of its classes; the last class has none."""

PROBABILITY_EDGES = np.array([0.001, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 0.999, 1.0 - 1e-5, 1.0 - 1e-8])
"""V_P of a reading: upper edges of its classes; the last class has none."""

HOLE = PROBABILITY_EDGES.size + 1
"""Class of a site whose ground was scanned and has a hole under the lander."""

SHAPE = (len(PIXEL_SIZES), DENSITY_EDGES.size + 1, HOLE + 1)
"""Classes of cell size, of density, and of V_P."""

_WEIGHT = 200.0
"""Cells' worth of the share over all densities, and of that over all sizes, in each class's own share."""


@dataclass(frozen=True, eq=False)
class ReadingCounts:
    """Sites counted in each class; both of shape `SHAPE`.

    Attributes:
        cells: how many.
        safe: those of them that are truly safe.
    """

    cells: NDArray[np.int64]
    safe: NDArray[np.int64]

    def shares(self) -> Array:
        """Shape `SHAPE`, share of safe ground; rare classes lean on wider ones."""
        cells, safe = self.cells.astype(float), self.safe.astype(float)
        anywhere = safe.sum((0, 1)) / np.maximum(cells.sum((0, 1)), 1.0)
        sized = (safe.sum(1) + _WEIGHT * anywhere) / (cells.sum(1) + _WEIGHT)
        return (safe + _WEIGHT * sized[:, None, :]) / (cells + _WEIGHT)


def write_counts(counts: ReadingCounts, command: str, path: Path = TABLE) -> None:
    """Write the counts with the command that made them."""
    told = {
        "command": command,
        "pixel_sizes": list(PIXEL_SIZES),
        "density_edges": DENSITY_EDGES.tolist(),
        "probability_edges": PROBABILITY_EDGES.tolist(),
        "cells": counts.cells.tolist(),
        "safe": counts.safe.tolist(),
    }
    path.write_text(json.dumps(told) + "\n")


def read_counts(path: Path = TABLE) -> ReadingCounts:
    """Read the counts.

    Raises:
        ValueError: the file was counted over other classes.
    """
    told = json.loads(path.read_text())
    edges = (list(PIXEL_SIZES), DENSITY_EDGES.tolist(), PROBABILITY_EDGES.tolist())
    if (told["pixel_sizes"], told["density_edges"], told["probability_edges"]) != edges:
        raise ValueError(
            f"{path} holds other classes: count again with python -m hda.look_statistics --write"
        )
    return ReadingCounts(np.array(told["cells"], dtype=np.int64), np.array(told["safe"], dtype=np.int64))


@lru_cache(maxsize=1)
def safe_shares() -> NDArray[np.float32]:
    """Share of safe ground in each class, shape `SHAPE`."""
    return read_counts().shares().astype(np.float32)
