"""Count on the training tiles what the belief assumes: levels of V_P, and safe ground around seen ground.

python -m hda.belief_statistics         counts, and prints them beside what is in use
python -m hda.belief_statistics --write counts, and writes hda/policies/beliefs/surroundings.csv
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
import tyro
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.console import one_line_errors, tolerate_encoding
from guidance.validation import finite_number
from hda.ground.library import Ground, load_tile
from hda.policies.beliefs.belief import LEVEL_SHARES, LEVELS
from hda.policies.beliefs.surroundings import DISTANCE_EDGES, TABLE, safe_share_table, squared_distance
from hda.task.presets import PRESETS

LOOKS_PER_TILE = 6
LOOK_WIDTHS = (187.0, 155.0, 118.0, 72.0)
"""[m] of the first four looks of a fuel-optimal descent."""
_PIXELS = 64
_MARGIN = 36  # [m] around the widest look
_BORDER = 10  # [m] of a tile's edge that Algorithm 1 cannot assess


@dataclass(frozen=True)
class BeliefStatistics:
    """Command line of the count.

    Attributes:
        tiles: training tiles that are counted of each ground, the first ones.
        write: write hda/policies/beliefs/surroundings.csv instead of comparing with it.
    """

    tiles: int = 40
    write: bool = False

    def __post_init__(self) -> None:
        """Check the number of tiles."""
        finite_number("tiles", self.tiles, at_least=1)


def level_shares(probability: NDArray[np.float32]) -> Array:
    """Share of cells nearest to each level of V_P, shape (levels,)."""
    edges = 0.5 * (LEVELS[1:] + LEVELS[:-1])
    edges[[0, -1]] = 1e-3, 0.999
    counts = np.bincount(np.searchsorted(edges, probability.ravel()), minlength=LEVELS.size)
    return counts / probability.size


def count_surroundings(safe: NDArray[np.bool_], width: float, center: Array) -> tuple[Array, Array]:
    """Cells and safe cells in each pair of distance classes around one noiseless look, shape (k, k) each."""
    half = round(max(LOOK_WIDTHS) / 2.0) + _MARGIN
    corner = np.floor(center).astype(int) - half
    window = safe[corner[1] : corner[1] + 2 * half, corner[0] : corner[0] + 2 * half]
    offset = ((np.arange(_PIXELS) + 0.5) / _PIXELS - 0.5) * width
    columns, rows = (np.floor(center[axis] + offset).astype(int) - corner[axis] for axis in (0, 1))
    seen = np.zeros(window.shape, dtype=np.bool_)
    seen[np.ix_(rows, columns)] = True
    to_safe = np.searchsorted(DISTANCE_EDGES, np.sqrt(squared_distance(seen & window)[~seen]))
    to_unsafe = np.searchsorted(DISTANCE_EDGES, np.sqrt(squared_distance(seen & ~window)[~seen]))
    classes = DISTANCE_EDGES.size + 1
    cells, good = np.zeros((classes, classes)), np.zeros((classes, classes))
    np.add.at(cells, (to_safe, to_unsafe), 1.0)
    np.add.at(good, (to_safe, to_unsafe), window[~seen])
    return cells, good


def measure(tiles: int) -> tuple[Array, Array]:
    """Level shares and the safe-share table, over the first training tiles of each ground that presets use.

    Pairs of classes that never occur take the value of pairs with the same quotient of distances: one half.
    """
    classes = DISTANCE_EDGES.size + 1
    cells, good = np.zeros((classes, classes)), np.zeros((classes, classes))
    levels = np.zeros(LEVELS.size)
    for ground in dict.fromkeys(Ground(preset.terrain, preset.criteria) for preset in PRESETS.values()):
        rng = np.random.default_rng(0)
        for number in range(tiles):
            tile = load_tile(ground, number, "train")
            levels += level_shares(tile.probability[_BORDER:-_BORDER, _BORDER:-_BORDER])
            for _ in range(LOOKS_PER_TILE):
                width, center = float(rng.choice(LOOK_WIDTHS)), rng.uniform(250.0, 750.0, 2)
                counted = count_surroundings(np.asarray(tile.deterministic), width, center)
                cells += counted[0]
                good += counted[1]
    return levels / levels.sum(), np.where(cells > 0.0, good / np.maximum(cells, 1.0), 0.5)


def main() -> None:
    """Print, or write, what was counted."""
    tolerate_encoding()
    options = tyro.cli(BeliefStatistics, description=__doc__)
    with one_line_errors():
        levels, table = measure(options.tiles)
    out = sys.stdout.write
    out("levels of V_P: " + " ".join(f"{share:.4f}" for share in levels) + "\n")
    out("        in use: " + " ".join(f"{share:.4f}" for share in LEVEL_SHARES) + "\n")
    if options.write:
        np.savetxt(TABLE, table, fmt="%.5f", delimiter=",")
        out(f"wrote {TABLE}\n")
        return
    out(f"safe share: greatest change from what is in use {np.abs(table - safe_share_table()).max():.5f}\n")


if __name__ == "__main__":
    main()
