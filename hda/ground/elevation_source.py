"""What an open elevation model is, whatever file it comes from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array

HIGHEST = 1e9
"""[m] A number beyond it is no height on any body."""


class ElevationFileError(ValueError):
    """The file cannot be used as an elevation model in metres; the message says what to do."""


@dataclass(frozen=True, eq=False)
class ElevationFile:
    """An open elevation model.

    Attributes:
        shape: rows (south to north) and columns (west to east).
        pixel_size: [m] true sides of a pixel, north and east.
        read: gives rows first to last - 1 and columns first to last - 1 as float64 [m], NaN where unknown;
            arguments: first row, last row, first column, last column.
        map_scale: true metres per metre of the map, north and east, which `pixel_size` holds already; 1 where
            the two agree within `hda.ground.map_scale.UNCORRECTED`.
        kind: type of the stored numbers.
        scale: [m] of one stored unit.
        offset: [m] height of a stored zero.
    """

    shape: tuple[int, int]
    pixel_size: tuple[float, float]
    read: Callable[[int, int, int, int], Array]
    map_scale: tuple[float, float] = (1.0, 1.0)
    kind: np.dtype[Any] = np.dtype(np.float64)  # noqa: RUF009 (immutable)
    scale: float = 1.0
    offset: float = 0.0

    def stored(self, height: float) -> str:
        """The number in the file that gives a height [m], as one would type it."""
        value = (height - self.offset) / self.scale
        return f"{round(value) if self.kind.kind in 'iu' else value:.9g}"


def known_heights(
    stored: NDArray[Any], nodata: tuple[float, ...], scale: float = 1.0, offset: float = 0.0
) -> Array:
    """Heights [m] from stored numbers; NaN where they are not finite or one of `nodata`.

    A number of the file matches one of `nodata` to seven digits; beyond 1e9, where only ends of a type lie,
    to two.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is unknown below
        values = np.array(stored, dtype=np.float64)
        unknown = ~np.isfinite(values)
        for value in nodata:
            unknown |= np.abs(values - value) <= abs(value) * (1e-7 if abs(value) < HIGHEST else 1e-2)
        heights = values * scale + offset
    heights[unknown | np.isinf(heights)] = np.nan
    return heights
