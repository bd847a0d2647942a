"""Hazardous lunar ground from seeded, published statistics; `python -m hda.terrain` draws a tile.

A fractal base surface, craters, rocks, and islands of clear ground, each a frozen dataclass of its own;
`settings` holds the named ones. It gives heights; what is kept of them is `hda.ground`, which imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.terrain.generator import TerrainParameters, generate_terrain
    from hda.terrain.settings import BLOCKY_ROCKS, BOULDERS, PAPER_TERRAIN

_HOMES = {
    "hda.terrain.generator": (
        "TerrainParameters",
        "generate_terrain",
    ),
    "hda.terrain.settings": (
        "BLOCKY_ROCKS",
        "BOULDERS",
        "PAPER_TERRAIN",
    ),
}

__all__ = [
    "BLOCKY_ROCKS",
    "BOULDERS",
    "PAPER_TERRAIN",
    "TerrainParameters",
    "generate_terrain",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
