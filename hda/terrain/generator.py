"""Hazardous lunar ground: a digital elevation model (DEM) from seeded, published statistics.

Fractal base + craters + rocks with islands of clear ground. Each part is a frozen dataclass of its own.
`python -m hda.terrain --seed 3 --show out.png` draws a tile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.validation import finite_number
from hda.terrain.base_surface import BaseSurface, generate_base_surface
from hda.terrain.craters import CraterPopulation, crater_relief, draw_craters
from hda.terrain.islands import IslandField, generate_island_field
from hda.terrain.rocks import RockPopulation, draw_rocks, rock_heights, rock_margin


@dataclass(frozen=True)
class TerrainParameters:
    """Everything that decides a tile but its seed.

    Attributes:
        base_surface: the ground without craters and rocks.
        craters: sizes, depths and ejecta of craters.
        rocks: sizes and abundance of rocks outside the islands.
        islands: where rocks are cleared away.
        size: [cells] side of the square tile.
        pixel_size: [m] side of a cell.
        maximum_elevation: [m] the tile is shifted so that its highest cell stands here (the paper's z_f).

    Raises:
        ValueError: a field is out of range.
    """

    base_surface: BaseSurface = field(default_factory=BaseSurface)
    craters: CraterPopulation = field(default_factory=CraterPopulation)
    rocks: RockPopulation = field(default_factory=RockPopulation)
    islands: IslandField = field(default_factory=IslandField)
    size: int = 1000
    pixel_size: float = 1.0
    maximum_elevation: float = 50.0

    def __post_init__(self) -> None:
        """Refuse a tile that cannot be made."""
        if not isinstance(self.size, (int, np.integer)) or self.size < 2:
            raise ValueError(f"size must be a whole number of at least 2 cells, got {self.size!r}")
        finite_number("pixel_size", self.pixel_size, above=0.0)
        finite_number("maximum_elevation", self.maximum_elevation)

    @property
    def extent(self) -> float:
        """[m] side of the tile."""
        return self.size * self.pixel_size


def terrain_rng(seed: int) -> np.random.Generator:
    """The Generator of the tile with this number; the same as `np.random.default_rng(seed)`."""
    return np.random.default_rng(np.random.SeedSequence(seed))


def generate_terrain(parameters: TerrainParameters, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw a tile.

    Each component draws from its own child of `rng`, so a change of the rocks leaves the craters as they are.
    A cell holds the ground at its centre plus the greatest rock height anywhere in the cell.

    Args:
        parameters: what the ground is like.
        rng: source of every draw; `terrain_rng(tile)` for a numbered tile. Spawning marks it, so a second
            call with the same Generator gives another tile.

    Returns:
        (size, size) float32, [m]. Row grows north, column east; row 0 is the south edge; the centre of a cell
        lies at ((column + 0.5) pixel_size, (row + 0.5) pixel_size).
    """
    base_rng, crater_rng, island_rng, rock_rng = rng.spawn(4)
    size, pixel_size = parameters.size, parameters.pixel_size
    dem = generate_base_surface(parameters.base_surface, size, pixel_size, base_rng)
    craters = draw_craters(parameters.craters, parameters.extent, crater_rng)
    dem += crater_relief(craters, size, pixel_size, parameters.craters.ejecta_reach)
    dem += _generate_rocks(parameters, island_rng, rock_rng)
    dem -= dem.max()  # two steps: the highest cell is then exact
    dem += np.float32(parameters.maximum_elevation)
    return dem


def _generate_rocks(
    parameters: TerrainParameters, island_rng: np.random.Generator, rock_rng: np.random.Generator
) -> NDArray[np.float32]:
    pixel_size, islands = parameters.pixel_size, parameters.islands
    # Rocks just outside the tile reach into it, so the field has to know where they may lie.
    margin = math.ceil(rock_margin(parameters.rocks) / pixel_size)
    abundance = generate_island_field(islands, parameters.size + 2 * margin, pixel_size, island_rng)
    rocks = draw_rocks(parameters.rocks, parameters.extent, rock_rng)
    spared = rock_rng.random(len(rocks)) < islands.remaining_share
    row = np.floor(rocks.north / pixel_size).astype(np.intp) + margin
    column = np.floor(rocks.east / pixel_size).astype(np.intp) + margin
    rocks = rocks.keep((abundance[row, column] > islands.threshold) | spared)
    return rock_heights(rocks, parameters.size, pixel_size)
