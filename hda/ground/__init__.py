"""Tiles of ground with their true safety map: generated, or cut from a user's file, split and cached.

`library` is the door: tiles by split and number. The rest reads a user's elevation model: the file, its
bands and its map's scale, what voids it does not declare, and its heights at 1 m a cell. It imports
`hda.safety` and `hda.terrain`; scenarios import it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.ground.detail import GroundDetail
    from hda.ground.library import SPLITS, Ground, load_tile, prepare_tiles
    from hda.ground.own_terrain import OwnTerrain, open_own_terrain
    from hda.ground.tile import Tile, make_tile

_HOMES = {
    "hda.ground.detail": ("GroundDetail",),
    "hda.ground.library": (
        "SPLITS",
        "Ground",
        "load_tile",
        "prepare_tiles",
    ),
    "hda.ground.own_terrain": (
        "OwnTerrain",
        "open_own_terrain",
    ),
    "hda.ground.tile": (
        "Tile",
        "make_tile",
    ),
}

__all__ = [
    "SPLITS",
    "Ground",
    "GroundDetail",
    "OwnTerrain",
    "Tile",
    "load_tile",
    "make_tile",
    "open_own_terrain",
    "prepare_tiles",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
