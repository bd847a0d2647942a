"""A user's own ground: an elevation model from a file, cut into square kilometres at 1 m a cell.

Tiles are counted from the south-west corner of the file, row by row; what is left over at its north and east
edges is not used. A tile of which more than a tenth is unknown is left out. A value that only looks like
ground is refused (`hda.ground.undeclared_voids`). To a model of coarse posts the hazards that it cannot show
may be added (`hda.ground.detail`).
"""

from __future__ import annotations

import hashlib
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from guidance.arrays import Array
from hda.ground.detail import AddedGround, GroundDetail, draw_detail, measure_surface
from hda.ground.elevation_file import ElevationFile, NoData, no_data_values, open_elevation
from hda.ground.map_scale import GREATEST
from hda.ground.post_means import lay_posts
from hda.ground.resampling import axis_weights, resample
from hda.ground.survey import survey_tile
from hda.ground.undeclared_voids import TileFinding, judge_tile, refuse_voids

OWN_SPLIT = "own"
TILE_SIZE = 1000
"""[cells of 1 m] side of a tile."""

COARSEST_PIXEL = 10.0
"""[m] A lander is 10 m wide: a coarser model does not tell where it can stand."""

MOST_UNKNOWN = 0.1
MOST_TILES = 10_000
_STRIP = 100  # rows of cells that are resampled together: bounds the memory for fine pixels


@dataclass(frozen=True)
class OwnTerrain:
    """An elevation model of a user's own; in a preset it takes the place of `TerrainParameters`.

    Attributes:
        file: where it lies; another place of the same content is the same terrain.
        sha256: of the file.
        source_pixel: [m] true side of a pixel of the file, eastward.
        tile_columns: tiles from west to east; tile n is number n % tile_columns of row n // tile_columns.
        tiles: numbers of the tiles that are used.
        left_out: how many are not, because more than a tenth of them is unknown.
        maximum_elevation: [m] each tile is shifted so that its highest cell stands here.
        band: of the file, counted from 1.
        nodata: stored numbers that mean unknown ground, besides the one that the file declares.
        map_scale: true metres per metre of the map, north and east, where the pixels were corrected for it.
        flat_is_ground: areas of one exact height were taken as ground.
        too_safe: those of `tiles` over which no episode begins, for want of hazard around a first target.
        detail: what is added to the model; None for nothing.
    """

    file: Path = field(compare=False)
    sha256: str
    source_pixel: float
    tile_columns: int
    tiles: tuple[int, ...]
    left_out: int = 0
    maximum_elevation: float = 50.0
    band: int = 1
    nodata: tuple[float, ...] = ()
    map_scale: tuple[float, float] = (1.0, 1.0)
    flat_is_ground: bool = False
    too_safe: tuple[int, ...] = ()
    detail: GroundDetail | None = None

    @property
    def flown_tiles(self) -> tuple[int, ...]:
        """Numbers of the tiles over which episodes begin."""
        return tuple(number for number in self.tiles if number not in self.too_safe)

    @property
    def resampling(self) -> str:
        """How cells of 1 m are made of the file's pixels."""
        if self.source_pixel == 1.0:
            return "none"
        return "cubic convolution" if self.source_pixel > 1.0 else "area average"

    def identity(self) -> dict[str, Any]:
        """All that decides its tiles; not where the file lies, nor what is flown."""
        values = asdict(self)
        for name in ("file", "flat_is_ground", "too_safe", "detail"):
            del values[name]
        for name, usual in (("band", 1), ("nodata", ()), ("map_scale", (1.0, 1.0))):
            if values[name] == usual:
                del values[name]
        if self.detail is not None:
            values["added"] = self.detail.description(self.source_pixel)
        return {**values, "resampling": self.resampling}

    def description(self) -> dict[str, Any]:
        """For the provenance: the name of the file, all that decides the tiles, and what is not flown."""
        choices = {"flat_is_ground": self.flat_is_ground, "too_safe": self.too_safe}
        return {"file": self.file.name, **self.identity(), **choices}


def open_own_terrain(
    file: Path,
    pixel_size: float | None = None,
    *,
    band: int | None = None,
    nodata: NoData = None,
    flat_is_ground: bool = False,
    detail: GroundDetail | None = None,
) -> OwnTerrain:
    """Read what an elevation model holds, and choose the tiles.

    Args:
        file: GeoTIFF in a coordinate system in metres, or .npy with row 0 at the south edge.
        pixel_size: [m] of an .npy file; 1 if left out.
        band: of a GeoTIFF, counted from 1; needed where there are several.
        nodata: numbers in the file that mean unknown ground, one or several, besides that which it declares.
        flat_is_ground: an area of one exact height is ground, though it looks like a value that stands for
            unknown ground.
        detail: what is added to a model with posts of more than 1 m.

    Raises:
        ElevationFileError: the file is missing, damaged, foreign, not in metres, on a map of another scale,
            or holds a value that looks like unknown ground.
        ValueError: it is coarser than the lander, smaller than a tile, too large, or has no tile whose ground
            is known; it shows already what `detail` would add; or an argument is out of range.
    """
    file = file.expanduser().resolve()
    with open_elevation(file, pixel_size, band=band, nodata=nodata) as source:
        tile_rows, tile_columns = _count_tiles(file, source)
        if detail is not None and min(source.pixel_size) <= 1.0:
            raise ValueError(
                f"{file}: pixels of {min(source.pixel_size):g} m show their own hazards; detail is for pixels"
                " of more than 1 m"
            )
        findings = [
            _look_at_tile(source, number, tile_columns, not flat_is_ground)
            for number in range(tile_rows * tile_columns)
        ]
        used = [finding for finding in findings if finding.unknown_share <= MOST_UNKNOWN]
        if not used:
            raise ValueError(
                f"{file}: more than {MOST_UNKNOWN:.0%} of every {TILE_SIZE} x {TILE_SIZE} m is unknown"
                f" ground; cut out a part with fewer holes{_cutting(file)}"
            )
        refuse_voids(file, source, used, flat_is_ground)
    return OwnTerrain(
        file,
        _digest(file),
        source.pixel_size[1],
        tile_columns,
        tuple(finding.number for finding in used),
        len(findings) - len(used),
        band=1 if band is None else band,
        nodata=no_data_values(nodata),
        map_scale=source.map_scale,
        flat_is_ground=flat_is_ground,
        detail=detail,
    )


def cut_tile(terrain: OwnTerrain, number: int) -> Array:
    """Heights of one tile [m] as the file has them, shape (1000, 1000), row 0 south, NaN where unknown.

    Raises:
        ElevationFileError: the file cannot be read any more.
        ValueError: it is not the file that was opened.
    """
    heights = np.full((TILE_SIZE, TILE_SIZE), np.nan)
    with _reopen(terrain) as source:
        (rows, columns), (side_north, side_east) = source.shape, source.pixel_size
        (first_north, cells_north), (first_east, cells_east) = _cells_of(terrain, source, number)
        east = axis_weights(first_east, cells_east, side_east, columns)
        for first in range(0, cells_north, _STRIP):
            last = min(first + _STRIP, cells_north)
            north = axis_weights(first_north + first, last - first, side_north, rows)
            pixels = source.read(north.first, north.last, east.first, east.last)
            heights[first:last, :cells_east] = resample(pixels, north, east)
    return heights


def add_detail(terrain: OwnTerrain, detail: GroundDetail, number: int) -> AddedGround:
    """What is added to one tile; arrays of shape (1000, 1000), row 0 south, 0 beyond the file.

    Raises:
        ElevationFileError: the file cannot be read any more.
        ValueError: it is not the file that was opened.
    """
    with _reopen(terrain) as source:
        (first_north, cells_north), (first_east, cells_east) = _cells_of(terrain, source, number)
        rows, columns = _posts_of(source, number, terrain.tile_columns)
        posts = source.read(*rows, *columns)
        north, east = (
            lay_posts(first, cells, side, count)
            for first, cells, side, count in zip(
                (first_north, first_east),
                (cells_north, cells_east),
                source.pixel_size,
                source.shape,
                strict=True,
            )
        )
    drawn = draw_detail(
        detail, measure_surface(posts, terrain.source_pixel), north, east, terrain.source_pixel, number
    )
    south, west = first_north - north.first_cell, first_east - east.first_cell
    part, whole = np.s_[south : south + cells_north, west : west + cells_east], (TILE_SIZE, TILE_SIZE)
    relief, kinds = np.zeros(whole), np.zeros(whole, dtype=np.uint8)
    relief[:cells_north, :cells_east], kinds[:cells_north, :cells_east] = (
        drawn.relief[part],
        drawn.kinds[part],
    )
    return AddedGround(relief, kinds)


def _reopen(terrain: OwnTerrain) -> AbstractContextManager[ElevationFile]:
    if _digest(terrain.file) != terrain.sha256:
        raise ValueError(f"{terrain.file} was changed since it was opened")
    pixel_size = terrain.source_pixel if terrain.file.suffix.lower() == ".npy" else None
    return open_elevation(terrain.file, pixel_size, band=terrain.band, nodata=terrain.nodata)


def _cells_of(terrain: OwnTerrain, source: ElevationFile, number: int) -> tuple[tuple[int, int], ...]:
    """First cell of a tile and how many the file has there, north and east."""
    firsts = (place * TILE_SIZE for place in divmod(number, terrain.tile_columns))
    return tuple(
        (first, min(TILE_SIZE, int(count * side + 1e-6) - first))
        for first, count, side in zip(firsts, source.shape, source.pixel_size, strict=True)
    )


def _count_tiles(file: Path, source: ElevationFile) -> tuple[int, int]:
    """Rows and columns of whole tiles."""
    coarsest = max(side / scale for side, scale in zip(source.pixel_size, source.map_scale, strict=True))
    if coarsest > COARSEST_PIXEL * (1.0 + 1e-9):
        raise ValueError(
            f"{file}: pixels of {coarsest:g} m; coarser than {COARSEST_PIXEL:g} m does not show where a"
            " lander can stand"
        )
    north, east = (count * side for count, side in zip(source.shape, source.pixel_size, strict=True))
    # A square kilometre of map that is a little less of ground is still a tile; its last cells are unknown.
    short = GREATEST * TILE_SIZE if source.map_scale != (1.0, 1.0) else 1e-6
    tile_rows, tile_columns = (int((extent + short) // TILE_SIZE) for extent in (north, east))
    if tile_rows * tile_columns == 0:
        raise ValueError(
            f"{file}: covers {east:g} x {north:g} m; at least {TILE_SIZE} x {TILE_SIZE} m are needed"
        )
    if tile_rows * tile_columns > MOST_TILES:
        raise ValueError(
            f"{file}: covers {east:g} x {north:g} m, more than {MOST_TILES} tiles; cut out a part of it"
            f"{_cutting(file)}"
        )
    return tile_rows, tile_columns


def _cutting(file: Path) -> str:
    """With what a part of a file is cut out."""
    return "" if file.suffix.lower() == ".npy" else ", e.g. with gdal_translate -projwin"


def _look_at_tile(source: ElevationFile, number: int, tile_columns: int, markers: bool) -> TileFinding:
    """Read the file's pixels on a tile, and judge them."""
    rows, columns = _posts_of(source, number, tile_columns)
    return judge_tile(survey_tile(source, number, rows, columns, markers), max(source.pixel_size))


def _posts_of(source: ElevationFile, number: int, tile_columns: int) -> tuple[tuple[int, int], ...]:
    """First pixel of the file on a tile and one past the last, north and east."""
    return tuple(
        (round(place * TILE_SIZE / side), min(count, round((place + 1) * TILE_SIZE / side)))
        for place, side, count in zip(
            divmod(number, tile_columns), source.pixel_size, source.shape, strict=True
        )
    )


def _digest(file: Path) -> str:
    """SHA-256 of a file, computed again in this process only where its size or time has changed."""
    status = file.stat()
    return _digest_of_state(file, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=16)
def _digest_of_state(file: Path, size: int, modified: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
