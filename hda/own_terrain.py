"""A user's own ground: an elevation model from a file, cut into square kilometres at 1 m a cell.

Tiles are counted from the south-west corner of the file, row by row; what is left over at its north and east
edges is not used. A tile of which more than a tenth is unknown is left out.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hda.elevation_file import ElevationFile, open_elevation
from hda.resampling import axis_weights, resample

OWN_SPLIT = "own"
TILE_SIZE = 1000
"""[cells of 1 m] side of a tile."""

COARSEST_PIXEL = 10.0
"""[m] A lander is 10 m wide: a coarser model does not tell where it can stand."""

MOST_UNKNOWN = 0.1
MOST_TILES = 10_000
MOST_RELIEF = 3000.0
"""[m] More than this on one tile is a no-data value that the file does not declare."""

_STRIP = 100  # rows of cells that are resampled together: bounds the memory for fine pixels


@dataclass(frozen=True)
class OwnTerrain:
    """An elevation model of a user's own; in a preset it takes the place of `TerrainParameters`.

    Attributes:
        file: where it lies; another place of the same content is the same terrain.
        sha256: of the file.
        source_pixel: [m] side of a pixel of the file.
        tile_columns: tiles from west to east; tile n is number n % tile_columns of row n // tile_columns.
        tiles: numbers of the tiles that are used.
        left_out: tiles that are not, because more than a tenth of them is unknown.
        maximum_elevation: [m] each tile is shifted so that its highest cell stands here.
    """

    file: Path = field(compare=False)
    sha256: str
    source_pixel: float
    tile_columns: int
    tiles: tuple[int, ...]
    left_out: int = 0
    maximum_elevation: float = 50.0

    @property
    def resampling(self) -> str:
        """How cells of 1 m are made of the file's pixels."""
        if self.source_pixel == 1.0:
            return "none"
        return "cubic convolution" if self.source_pixel > 1.0 else "area average"

    def identity(self) -> dict[str, Any]:
        """All that decides its tiles; not where the file lies."""
        values = asdict(self)
        del values["file"]
        return {**values, "resampling": self.resampling}

    def description(self) -> dict[str, Any]:
        """For the provenance: the name of the file and all that decides the tiles."""
        return {"file": self.file.name, **self.identity()}


def open_own_terrain(file: Path, pixel_size: float | None = None) -> OwnTerrain:
    """Read what an elevation model holds, and choose the tiles.

    Args:
        file: GeoTIFF in a projected coordinate system in metres, or .npy with row 0 at the south edge.
        pixel_size: [m] of an .npy file; 1 if left out.

    Raises:
        ElevationFileError: the file is missing, damaged, foreign, or not in metres.
        ValueError: it is coarser than the lander, smaller than a tile, too large, or has no tile whose ground
            is known.
    """
    file = file.expanduser().resolve()
    with open_elevation(file, pixel_size) as source:
        tile_rows, tile_columns = _count_tiles(file, source)
        numbers = range(tile_rows * tile_columns)
        tiles = tuple(n for n in numbers if _unknown_share(source, n, tile_columns) <= MOST_UNKNOWN)
        if not tiles:
            raise ValueError(
                f"{file}: more than {MOST_UNKNOWN:.0%} of every {TILE_SIZE} x {TILE_SIZE} m is unknown"
                " ground; cut out a part with fewer holes, e.g. with gdal_translate -projwin"
            )
        side = source.pixel_size[1]
    return OwnTerrain(file, _digest(file), side, tile_columns, tiles, len(numbers) - len(tiles))


def cut_tile(terrain: OwnTerrain, number: int) -> NDArray[np.float64]:
    """Heights of one tile [m], shape (1000, 1000), row 0 south, NaN where unknown.

    Raises:
        ElevationFileError: the file cannot be read any more.
        ValueError: it is not the file that was opened, or a tile's heights cannot be real.
    """
    if _digest(terrain.file) != terrain.sha256:
        raise ValueError(f"{terrain.file} was changed since it was opened")
    row, column = divmod(number, terrain.tile_columns)
    pixel_size = terrain.source_pixel if terrain.file.suffix.lower() == ".npy" else None
    heights = np.empty((TILE_SIZE, TILE_SIZE))
    with open_elevation(terrain.file, pixel_size) as source:
        (rows, columns), (side_north, side_east) = source.shape, source.pixel_size
        east = axis_weights(column * TILE_SIZE, TILE_SIZE, side_east, columns)
        for first in range(0, TILE_SIZE, _STRIP):
            north = axis_weights(row * TILE_SIZE + first, _STRIP, side_north, rows)
            pixels = source.read(north.first, north.last, east.first, east.last)
            heights[first : first + _STRIP] = resample(pixels, north, east)
    relief = np.nanmax(heights) - np.nanmin(heights) if np.isfinite(heights).any() else 0.0
    if relief > MOST_RELIEF:
        raise ValueError(
            f"{terrain.file}: tile {number} has heights from {np.nanmin(heights):g} to {np.nanmax(heights):g}"
            " m; probably a no-data value that the file does not declare (gdal_edit.py -a_nodata VALUE)"
        )
    return heights


def _count_tiles(file: Path, source: ElevationFile) -> tuple[int, int]:
    """Rows and columns of whole tiles."""
    if max(source.pixel_size) > COARSEST_PIXEL:
        raise ValueError(
            f"{file}: pixels of {max(source.pixel_size):g} m; coarser than {COARSEST_PIXEL:g} m does not show"
            " where a lander can stand"
        )
    north, east = (count * side for count, side in zip(source.shape, source.pixel_size, strict=True))
    tile_rows, tile_columns = (int((extent + 1e-6) // TILE_SIZE) for extent in (north, east))
    if tile_rows * tile_columns == 0:
        raise ValueError(
            f"{file}: covers {east:g} x {north:g} m; at least {TILE_SIZE} x {TILE_SIZE} m are needed"
        )
    if tile_rows * tile_columns > MOST_TILES:
        raise ValueError(
            f"{file}: covers {east:g} x {north:g} m, more than {MOST_TILES} tiles; cut out a part of it"
        )
    return tile_rows, tile_columns


def _unknown_share(source: ElevationFile, number: int, tile_columns: int) -> float:
    """Share of the file's pixels on a tile whose height is unknown."""
    first_row, last_row, first_column, last_column = (
        round((place + step) * TILE_SIZE / side)
        for place, side in zip(divmod(number, tile_columns), source.pixel_size, strict=True)
        for step in (0, 1)
    )
    unknown = 0
    step = max(1, round(_STRIP / source.pixel_size[0]))
    for first in range(first_row, last_row, step):
        part = source.read(first, min(first + step, last_row), first_column, last_column)
        unknown += int(np.isnan(part).sum())
    return unknown / ((last_row - first_row) * (last_column - first_column))


def _digest(file: Path) -> str:
    """SHA-256 of a file, computed again in this process only where its size or time has changed."""
    status = file.stat()
    return _digest_of_state(file, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _digest_of_state(file: Path, size: int, modified: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
