"""A digital elevation model in a file: GeoTIFF, or numpy's .npy. Nothing in it is run or unpickled.

Both are given in the house frame: row 0 is the south edge, column 0 the west edge, metres, NaN where the
ground is unknown. Only the part that is asked for is read, so a file may be larger than memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from guidance.arrays import Array
from guidance.validation import finite_number
from hda.ground.elevation_source import ElevationFile, ElevationFileError, known_heights
from hda.ground.geotiff import open_geotiff

__all__ = [
    "GEOTIFF_SUFFIXES",
    "ElevationFile",
    "ElevationFileError",
    "NoData",
    "no_data_values",
    "open_elevation",
]

GEOTIFF_SUFFIXES = (".tif", ".tiff")

NoData = float | tuple[float, ...] | list[float] | None
"""Numbers that mean unknown ground: none, one or several."""


@contextmanager
def open_elevation(
    path: Path, pixel_size: float | None = None, *, band: int | None = None, nodata: NoData = None
) -> Iterator[ElevationFile]:
    """Open an elevation model.

    Args:
        path: GeoTIFF (.tif, .tiff; a coordinate system in metres) or .npy (two-dimensional, metres, row 0
            south).
        pixel_size: [m] of an .npy file, 1 if left out; a GeoTIFF knows its own.
        band: of a GeoTIFF, the one that holds the heights, counted from 1; needed where there are several.
        nodata: stored numbers that mean unknown ground, besides the one that a GeoTIFF declares.

    Raises:
        ElevationFileError: the file is missing, damaged, foreign, or not in metres.
        ValueError: an argument is out of range or not for this kind of file.
    """
    suffix = path.suffix.lower()
    values = no_data_values(nodata)
    if suffix not in (".npy", *GEOTIFF_SUFFIXES):
        raise ElevationFileError(f"{path}: an elevation model must be a GeoTIFF (.tif, .tiff) or .npy file")
    if not path.is_file():
        raise ElevationFileError(f"{path}: there is no such file")
    if suffix == ".npy":
        side = 1.0 if pixel_size is None else finite_number("pixel_size", pixel_size, above=0.0)
        if band not in (None, 1):
            raise ValueError(f"band is for GeoTIFF files; {path.name} holds one array, got {band!r}")
        yield _open_npy(path, side, values)
        return
    if pixel_size is not None:
        raise ValueError(f"pixel_size is for .npy files; {path.name} says its own")
    with open_geotiff(path, band, values) as source:
        yield source


def no_data_values(nodata: NoData) -> tuple[float, ...]:
    """Numbers that mean unknown ground, from one or several.

    Raises:
        ValueError: one is not a finite number; heights that are not finite are unknown anyway.
    """
    if nodata is None:
        return ()
    values = nodata if isinstance(nodata, tuple | list | np.ndarray) else (nodata,)
    return tuple(sorted({finite_number("nodata", value) for value in values}))


def _open_npy(path: Path, side: float, nodata: tuple[float, ...]) -> ElevationFile:
    try:
        heights = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # a damaged header makes numpy raise errors of many kinds (EOF, token, syntax)
        raise ElevationFileError(f"{path}: not a readable .npy file of numbers ({error})") from error
    if not isinstance(heights, np.ndarray):
        heights.close()
        raise ElevationFileError(f"{path}: an archive of arrays; save the one array as .npy")
    if heights.ndim != 2 or heights.dtype.kind not in "iuf":
        raise ElevationFileError(
            f"{path}: must hold heights in two dimensions, got {heights.dtype} of shape {heights.shape}"
        )

    def read(first_row: int, last_row: int, first_column: int, last_column: int) -> Array:
        return known_heights(heights[first_row:last_row, first_column:last_column], nodata)

    return ElevationFile((heights.shape[0], heights.shape[1]), (side, side), read, kind=heights.dtype)
