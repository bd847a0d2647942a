"""A digital elevation model in a file: GeoTIFF, or numpy's .npy. Nothing in it is run or unpickled.

Both are given in the house frame: row 0 is the south edge, column 0 the west edge, metres, NaN where the
ground is unknown. Only the part that is asked for is read, so a file may be larger than memory.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.validation import finite_number

GEOTIFF_SUFFIXES = (".tif", ".tiff")
_METRE_NAMES = ("", "m", "metre", "meter", "metres", "meters")


class ElevationFileError(ValueError):
    """The file cannot be read as an elevation model in metres; the message says what to do."""


@dataclass(frozen=True, eq=False)
class ElevationFile:
    """An open elevation model.

    Attributes:
        shape: rows (south to north) and columns (west to east).
        pixel_size: [m] sides of a pixel, north and east.
        read: gives rows first to last - 1 and columns first to last - 1 as float64 [m], NaN where unknown;
            arguments: first row, last row, first column, last column.
    """

    shape: tuple[int, int]
    pixel_size: tuple[float, float]
    read: Callable[[int, int, int, int], NDArray[np.float64]]


@contextmanager
def open_elevation(path: Path, pixel_size: float | None = None) -> Iterator[ElevationFile]:
    """Open an elevation model.

    Args:
        path: GeoTIFF (.tif, .tiff; one band; a projected coordinate system in metres) or .npy
            (two-dimensional, metres, row 0 south).
        pixel_size: [m] of an .npy file, 1 if left out; a GeoTIFF knows its own.

    Raises:
        ElevationFileError: the file is missing, damaged, foreign, or not in metres.
        ValueError: pixel_size is out of range, or was given for a GeoTIFF.
    """
    suffix = path.suffix.lower()
    if suffix not in (".npy", *GEOTIFF_SUFFIXES):
        raise ElevationFileError(f"{path}: an elevation model must be a GeoTIFF (.tif, .tiff) or .npy file")
    if not path.is_file():
        raise ElevationFileError(f"{path}: there is no such file")
    if suffix == ".npy":
        side = 1.0 if pixel_size is None else finite_number("pixel_size", pixel_size, above=0.0)
        yield _open_npy(path, side)
        return
    if pixel_size is not None:
        raise ValueError(f"pixel_size is for .npy files; {path.name} says its own")
    with _open_geotiff(path) as source:
        yield source


def _open_npy(path: Path, side: float) -> ElevationFile:
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

    def read(first_row: int, last_row: int, first_column: int, last_column: int) -> NDArray[np.float64]:
        return _known(np.array(heights[first_row:last_row, first_column:last_column], dtype=np.float64))

    return ElevationFile((heights.shape[0], heights.shape[1]), (side, side), read)


def _known(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Infinite heights are unknown ones."""
    heights[~np.isfinite(heights)] = np.nan
    return heights


@contextmanager
def _open_geotiff(path: Path) -> Iterator[ElevationFile]:
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
        from rasterio.windows import Window
    except ImportError as error:
        raise ElevationFileError(
            f"{path}: GeoTIFF needs rasterio; install it with: pip install 'lunar-hda[geo]'"
        ) from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)  # refused below, in our words
            # One driver: others read addresses and further files that a file may name.
            dataset = rasterio.open(path, driver="GTiff")
    except (RasterioError, OSError, ValueError) as error:
        raise ElevationFileError(f"{path}: not a readable GeoTIFF ({error})") from error
    with dataset:
        pixel_size = _check_geotiff(path, dataset)
        rows, scale, offset = dataset.height, dataset.scales[0], dataset.offsets[0]
        north_up = dataset.transform.e < 0.0

        def read(first_row: int, last_row: int, first_column: int, last_column: int) -> NDArray[np.float64]:
            top = rows - last_row if north_up else first_row
            window = Window(first_column, top, last_column - first_column, last_row - first_row)  # pyright: ignore[reportCallIssue]
            try:
                band = dataset.read(1, window=window, masked=True)
            except (RasterioError, OSError, ValueError) as error:
                raise ElevationFileError(f"{path}: a part of it cannot be read ({error})") from error
            heights = band.astype(np.float64).filled(np.nan) * scale + offset
            return _known(heights[::-1] if north_up else heights)

        yield ElevationFile((rows, dataset.width), pixel_size, read)


def _check_geotiff(path: Path, dataset: Any) -> tuple[float, float]:
    """Sides of a pixel [m], north and east; refuse what is not one band of metres on a square grid."""
    reproject = "reproject it, e.g. gdalwarp -t_srs '+proj=stere +lat_0={:.4f} +lon_0={:.4f} +R=1737400"
    reproject += f" +units=m' -tr 1 1 -r cubic {path.name} {path.stem}-metres.tif"
    crs, transform = dataset.crs, dataset.transform
    if dataset.count != 1:
        raise ElevationFileError(f"{path}: must hold one band of heights, it holds {dataset.count}")
    if not _is_real(dataset.dtypes[0]):
        raise ElevationFileError(f"{path}: heights must be real numbers, got {dataset.dtypes[0]}")
    if crs is None:
        raise ElevationFileError(
            f"{path}: has no coordinate system, so its scale is unknown; set one with gdal_edit.py -a_srs, or"
            " save the heights as .npy"
        )
    if crs.is_geographic:
        west, south, east, north = dataset.bounds
        command = reproject.format((south + north) / 2.0, (west + east) / 2.0)
        raise ElevationFileError(f"{path}: is in degrees (a geographic coordinate system); {command}")
    if not crs.is_projected or abs(crs.linear_units_factor[1] - 1.0) > 1e-9:
        raise ElevationFileError(
            f"{path}: its coordinates must be metres of a projected system, got {crs.linear_units!r};"
            " reproject it with gdalwarp -t_srs '... +units=m'"
        )
    if (dataset.units[0] or "").strip().lower() not in _METRE_NAMES:
        raise ElevationFileError(f"{path}: heights must be in metres, got {dataset.units[0]!r}")
    sides = (abs(transform.e), transform.a)
    if transform.b != 0.0 or transform.d != 0.0 or min(sides) <= 0.0 or not np.isfinite(sides).all():
        raise ElevationFileError(f"{path}: is rotated or mirrored; gdalwarp -tr 1 1 puts it north up")
    if abs(sides[0] / sides[1] - 1.0) > 1e-3:
        raise ElevationFileError(
            f"{path}: its pixels are {sides[1]:g} x {sides[0]:g} m; make them square: gdalwarp -tr 1 1"
        )
    return sides


def _is_real(name: str) -> bool:
    try:
        return np.dtype(name).kind in "iuf"
    except TypeError:
        return False
