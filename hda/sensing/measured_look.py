"""A look of a ranging LIDAR: scan, elevation map, and Algorithm 1 on board."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.safety.criteria import SafetyCriteria
from hda.safety.lander_footprint import LanderFootprint, make_footprint
from hda.safety.safety_map import assess_on_board
from hda.sensing.gridding import ElevationMap, PixelGrid, grid_points, lay_grid
from hda.sensing.ranging import PointCloud, RangingLidar


@dataclass(frozen=True, eq=False)
class MeasuredGround:
    """What one scan says of the ground, in the frame in which the vehicle believes itself to be.

    Attributes:
        elevation: heights, with their spread and the points behind them.
        probability: shape (rows, columns), V_P of Algorithm 1 for the lander's centre in each cell; 0 where
            it is not known.
        known: shape (rows, columns), where the lander fits on the map and stands over no hole.
    """

    elevation: ElevationMap
    probability: Array
    known: NDArray[np.bool_]

    @property
    def grid(self) -> PixelGrid:
        """Where the cells lie."""
        return self.elevation.grid

    def safety_map(self, center: Array, width: float, pixels: int) -> NDArray[np.float32]:
        """V_P at the centres of the pixels of a square look; 0 where it is not known.

        Args:
            center: [m] shape (2,) or (3,), middle of the square.
            width: [m] side of the square.
            pixels: along each side.

        Returns:
            Shape (pixels, pixels), row north, column east.
        """
        return self._at_pixels(self.probability.astype(np.float32), center, width, pixels)

    def known_map(self, center: Array, width: float, pixels: int) -> NDArray[np.bool_]:
        """Whether V_P is known at the centres of the pixels of a square look, as `safety_map`."""
        return self._at_pixels(self.known, center, width, pixels)

    def _at_pixels(self, values: NDArray[Any], center: Array, width: float, pixels: int) -> NDArray[Any]:
        """Values of the cells that hold the pixels' centres; 0 outside the grid."""
        offset = ((np.arange(pixels) + 0.5) / pixels - 0.5) * width
        rows, columns = self.grid.rows_of(center[1] + offset), self.grid.columns_of(center[0] + offset)
        in_rows = (rows >= 0) & (rows < self.grid.rows)
        in_columns = (columns >= 0) & (columns < self.grid.columns)
        out = np.zeros((pixels, pixels), dtype=values.dtype)
        out[np.ix_(in_rows, in_columns)] = values[np.ix_(rows[in_rows], columns[in_columns])]
        return out


def assess_elevation(elevation: ElevationMap, criteria: SafetyCriteria) -> MeasuredGround:
    """Algorithm 1 on a measured elevation map, each height with its own spread.

    Where the lander fits on no map of this size, or into one of its cells, nothing is known.
    """
    grid = elevation.grid
    if not _lander_fits(grid, criteria):
        return MeasuredGround(elevation, np.zeros(grid.shape), np.zeros(grid.shape, dtype=np.bool_))
    probability, known = assess_on_board(elevation.height, grid.pixel_size, elevation.spread, criteria)
    return MeasuredGround(elevation, probability, known)


def find_holes(ground: MeasuredGround, criteria: SafetyCriteria) -> NDArray[np.bool_]:
    """Shape (rows, columns): where the lander fits on the map, but stands over ground without an echo."""
    holes = np.zeros(ground.grid.shape, dtype=np.bool_)
    if _lander_fits(ground.grid, criteria):
        edge = _make_footprint(ground.grid, criteria).half_size
        inner = np.s_[edge : holes.shape[0] - edge, edge : holes.shape[1] - edge]
        holes[inner] = ~ground.known[inner]
    return holes


def _lander_fits(grid: PixelGrid, criteria: SafetyCriteria) -> bool:
    """Whether the raster of a grid holds the lander, and tells its pads apart."""
    if grid.pixel_size >= criteria.footprint_diameter:
        return False
    return min(grid.shape) >= _make_footprint(grid, criteria).span


def _make_footprint(grid: PixelGrid, criteria: SafetyCriteria) -> LanderFootprint:
    return make_footprint(criteria.footprint_diameter, criteria.pad_diameter, grid.pixel_size)


def measure_ground(
    cloud: PointCloud, lidar: RangingLidar, position: Array, target: Array, criteria: SafetyCriteria
) -> MeasuredGround:
    """Grid the points of a scan and assess them.

    The cells are sized by the spacing of the rays on the ground that was measured, which lies below the
    target plane. From the plane's height or below it nothing is known: the map is empty.

    Args:
        cloud: the echoes.
        lidar: the sensor that gave them.
        position: [m] shape (3,), where the vehicle believes itself to be.
        target: [m] shape (3,), where it believes the centre of the scan to be, on the target plane.
        criteria: of the lander.
    """
    height = float(position[2] - target[2])
    offset, deviation = cloud.offset, cloud.deviation
    if height <= 0.0:
        offset, deviation = offset[:0], deviation[:0]
    points = offset + position
    spacing = lidar.ray_spacing(position, target)
    if len(points):
        spacing *= float(-offset[:, 2].mean()) / height
    grid = lay_grid(points, lidar.gridding.pixel_size(spacing), lidar.rays)
    return assess_elevation(grid_points(points, deviation, grid, lidar.gridding.percentile), criteria)
