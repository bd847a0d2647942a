"""Write ground to a file: what `python -m studies.compare --terrain FILE` reads.

    python -m examples.own_terrain site.npy
    python -m studies.compare --terrain site.npy --episodes 100 --policies single-divert nearest-safe

An .npy file holds heights in metres, 1 m a cell, row 0 at the south edge, NaN where the ground is unknown. A
name that ends in .tif gives what an orbiter sees instead: a GeoTIFF with posts of 5 m on the Moon's
south-polar map, without a rock or a small crater. They are added with --detail:

    python -m examples.own_terrain site.tif
    python -m studies.compare --terrain site.tif --detail 1 --policies nearest-safe hazard-aware

The ground here is generated; yours may come from anywhere.
"""

from pathlib import Path

import numpy as np
import tyro

from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng
from hda.terrain.rocks import RockPopulation
from hda.terrain.settings import PAPER_TERRAIN

POST = 5
"""[m] of the GeoTIFF."""


def write_site(path: tyro.conf.Positional[Path], seed: int = 50_000) -> None:
    """Write a square kilometre.

    Args:
        path: file to write, .npy with a strip of unknown ground along its west edge, or .tif.
        seed: of the ground.
    """
    if path.suffix == ".tif":
        write_orbital_model(path, seed)
        return
    heights = generate_terrain(PAPER_TERRAIN, terrain_rng(seed))
    heights[:, :20] = np.nan
    np.save(path, heights, allow_pickle=False)


def write_orbital_model(path: Path, seed: int) -> None:
    """Write hills and craters of more than 20 m as a GeoTIFF; each post is the mean of its 5 x 5 m."""
    import rasterio
    from rasterio.crs import CRS
    from rasterio.transform import Affine

    hills = TerrainParameters(rocks=RockPopulation(area_fraction=0.0))
    heights = generate_terrain(hills, terrain_rng(seed))
    count = hills.size // POST
    posts = heights.reshape(count, POST, count, POST).mean(axis=(1, 3))
    map_of_the_pole = CRS.from_proj4("+proj=stere +lat_0=-90 +lon_0=0 +R=1737400 +units=m")
    place = Affine(POST, 0.0, 5000.0, 0.0, -POST, 6000.0)
    kind = {"driver": "GTiff", "count": 1, "dtype": posts.dtype, "crs": map_of_the_pole, "transform": place}
    with rasterio.open(path, "w", width=count, height=count, **kind) as stream:
        stream.write(posts[::-1], 1)  # the north edge first


if __name__ == "__main__":
    tyro.cli(write_site)
