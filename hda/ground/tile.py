"""One square kilometre of ground with its true safety map."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from hda.safety.criteria import SafetyCriteria
from hda.safety.safety_map import assess_safety, elevation_array


@dataclass(frozen=True, eq=False)
class Tile:
    """A digital terrain model at 1 m a cell with Algorithm 1's verdict on it.

    Cell (row, column) is centred at (column + 1/2, row + 1/2) m; row 0 is the south edge. Arrays are
    read-only.

    Attributes:
        number: tile number in the library, or -1 for a tile that is not from the library.
        elevation: [m] shape (rows, columns); its maximum is the target plane.
        probability: shape (rows, columns), V_P in [0, 1].
        deterministic: shape (rows, columns), V_D: whether the cell is safe.
        added: shape (rows, columns), what was added to a user's ground (`hda.ground.detail`): bits
            `ADDED_CRATER` and `ADDED_ROCK`; None where nothing was.
    """

    number: int
    elevation: NDArray[np.float32]
    probability: NDArray[np.float32]
    deterministic: NDArray[np.bool_]
    added: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        """Check that the layers belong together, and freeze them."""
        for name in ("elevation", "probability", "deterministic", "added"):
            layer = getattr(self, name)
            if layer is None:
                continue
            if layer.shape != self.elevation.shape or layer.ndim != 2:
                raise ValueError(f"{name} must have shape {self.elevation.shape}, got {layer.shape}")
            layer.flags.writeable = False

    @cached_property
    def highest(self) -> float:
        """[m] the greatest known height."""
        return float(np.nanmax(self.elevation))

    def is_safe(self, position: Array) -> bool:
        """Whether the cell under `position` [m] is safe; outside the map nothing is."""
        if not np.isfinite(position[:2]).all():
            return False
        row, column = int(np.floor(position[1])), int(np.floor(position[0]))
        rows, columns = self.deterministic.shape
        return bool(0 <= row < rows and 0 <= column < columns and self.deterministic[row, column])

    def hazard_share(self, center: Array, radius: float) -> float:
        """Share of the cells whose centres lie within `radius` [m] of `center` that are unsafe."""
        return _hazard_share(self.deterministic, float(center[0]), float(center[1]), radius)


@compile_kernel
def _lies_within(dx: float, dy: float, radius: float) -> bool:
    return dx * dx + dy * dy <= radius * radius


@compile_kernel
def _hazard_share(safe: NDArray[np.bool_], x: float, y: float, radius: float) -> float:
    rows, columns = safe.shape
    cells = 0
    clear = 0
    for row in range(int(y - radius) - 1, int(y + radius) + 2):
        dy = row + 0.5 - y
        reach = math.sqrt(max(0.0, radius * radius - dy * dy))
        first, last = math.ceil(x - reach - 0.5), math.floor(x + reach - 0.5)
        if _lies_within(first - 0.5 - x, dy, radius):  # the root was rounded
            first -= 1
        elif not _lies_within(first + 0.5 - x, dy, radius):
            first += 1
        if _lies_within(last + 1.5 - x, dy, radius):
            last += 1
        elif not _lies_within(last + 0.5 - x, dy, radius):
            last -= 1
        cells += max(last - first + 1, 0)
        if 0 <= row < rows:
            within = safe[row, max(first, 0) : max(min(last + 1, columns), 0)]
            for k in range(within.size):
                clear += within[k]
    return (cells - clear) / cells


def make_tile(
    dem: ArrayLike, criteria: SafetyCriteria, number: int = -1, maximum_elevation: float = 50.0
) -> Tile:
    """Shift a DEM so that its greatest height is the target plane, and assess its safety.

    Args:
        dem: [m] shape (rows, columns), 1 m a cell, row 0 south; NaN where the ground is unknown (unsafe).
        criteria: limits and lander size of Algorithm 1.
        number: tile number in the library.
        maximum_elevation: [m] height of the target plane.

    Returns:
        The tile; the assessment is made on the stored single-precision elevation.

    Raises:
        ValueError: the DEM is not two-dimensional, too small for the lander, has no finite cell, or is not of
            real heights.
    """
    heights = elevation_array(dem)
    if not np.isfinite(heights).any():
        raise ValueError("dem must hold at least one finite height")
    elevation = (heights - np.nanmax(heights) + maximum_elevation).astype(np.float32)
    safety = assess_safety(elevation.astype(np.float64), 1.0, **asdict(criteria))
    return Tile(
        number=number,
        elevation=elevation,
        probability=safety.probability.astype(np.float32),
        deterministic=safety.deterministic,
    )
