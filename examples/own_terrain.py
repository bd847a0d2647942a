"""Write a square kilometre of ground to an .npy file: what `studies.compare.command --terrain FILE` reads.

    python -m examples.own_terrain site.npy
    python -m studies.compare --terrain site.npy --episodes 100 --policies single-divert nearest-safe

The ground here is generated; yours may come from anywhere. An .npy file holds heights in metres, 1 m a cell,
row 0 at the south edge, NaN where the ground is unknown.
"""

from pathlib import Path

import numpy as np
import tyro

from hda.terrain.generator import generate_terrain, terrain_rng
from hda.terrain.settings import PAPER_TERRAIN


def write_site(path: tyro.conf.Positional[Path], seed: int = 50_000) -> None:
    """Write one tile, with a strip of unknown ground along its west edge.

    Args:
        path: file to write, .npy.
        seed: of the ground.
    """
    heights = generate_terrain(PAPER_TERRAIN, terrain_rng(seed))
    heights[:, :20] = np.nan
    np.save(path, heights, allow_pickle=False)


if __name__ == "__main__":
    tyro.cli(write_site)
