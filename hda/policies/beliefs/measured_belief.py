"""What all measured looks so far say of the ground, cell by cell.

The scans are fused on one elevation map for each size of cells, and each map is assessed by Algorithm 1. A
cell of the belief keeps the reading of the finest map that knows it, or a hole where all that scanned it have
one; how often ground is safe that reads so was counted on training tiles (`measured_readings`). A second look
from the same height sharpens the map, one from below replaces its reading.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.policies.beliefs.belief import LEVEL_SHARES, LEVELS, CellSquare
from hda.policies.beliefs.kept_readings import (
    UNREAD,
    CellPlaces,
    LookPlaces,
    MapReadings,
    ReadingLayers,
    keep_better,
    look_up,
)
from hda.policies.beliefs.measured_readings import DENSITY_EDGES, HOLE, PROBABILITY_EDGES, safe_shares
from hda.policies.beliefs.placement_error import Placement
from hda.safety.criteria import SafetyCriteria
from hda.sensing.fusion import fuse_elevations, place_on
from hda.sensing.gridding import PIXEL_SIZES, ElevationMap
from hda.sensing.measured_look import MeasuredGround, assess_elevation, find_holes

_NOTHING: NDArray[np.float32] = np.empty((0, 0), dtype=np.float32)
_SCANNED = 0.8  # share of the cells around a site with points, for a hole to be one


@dataclass(frozen=True, eq=False)
class MeasuredBelief:
    """The belief over a square of 1 m cells.

    Attributes:
        square: where it lies.
        size_class: shape (n, n), number in `PIXEL_SIZES` of the map that each cell's reading is from; -1
            where there is none.
        density_class: shape (n, n), class of the points in a cell of that map.
        probability_class: shape (n, n), class of the reading.
        elevations: the fused map of each size of cells that was seen.
        placement: by how much the looks may be misplaced; None where no look errs.
    """

    square: CellSquare
    size_class: NDArray[np.int8] = field(repr=False)
    density_class: NDArray[np.int8] = field(repr=False)
    probability_class: NDArray[np.int8] = field(repr=False)
    elevations: dict[float, ElevationMap] = field(default_factory=dict, repr=False)
    placement: Placement | None = None

    @classmethod
    def blank(cls, center: Array, half_side: int) -> MeasuredBelief:
        """Nothing seen yet, over the cells within `half_side` [m] of `center` along each axis."""
        square = CellSquare.around(center, half_side)
        sizes, densities, readings = np.full((3, square.side, square.side), UNREAD, dtype=np.int8)
        return cls(square, sizes, densities, readings)

    @property
    def corner(self) -> tuple[int, int]:
        """(x, y) of the square's south-west corner [m]."""
        return self.square.corner

    @property
    def side(self) -> int:
        """Cells along each side."""
        return self.square.side

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Shape (n, n), whether a cell has a reading."""
        return self.size_class != UNREAD

    def fused(
        self,
        ground: MeasuredGround,
        criteria: SafetyCriteria,
        percentile: float | None,
        misplaced: float = 0.0,
    ) -> MeasuredBelief:
        """The belief after one more look; one that measured nothing leaves it as it was, places and all.

        Args:
            ground: what was measured.
            criteria: of the lander.
            percentile: by which heights are gridded.
            misplaced: [m^2] variance of the look's place along each horizontal axis.
        """
        if 0 in ground.grid.shape:
            return self
        size, scan = ground.grid.pixel_size, ground.elevation
        before = self.elevations.get(size)
        if before is not None:
            ground = assess_elevation(fuse_elevations(before, ground.elevation, percentile), criteria)
        reading, density = classify_readings(ground, criteria)
        axis = np.arange(self.side, dtype=np.float64) + 0.5
        cells = CellPlaces(
            ground.grid.rows_of(self.corner[1] + axis), ground.grid.columns_of(self.corner[0] + axis)
        )
        kept = ReadingLayers(self.size_class.copy(), self.density_class.copy(), self.probability_class.copy())
        placement, places = None, LookPlaces(_NOTHING, _NOTHING, np.float32(misplaced))
        if misplaced > 0.0 or self.placement is not None:
            newer = place_on(ground.grid, scan).count / np.maximum(ground.elevation.count, 1)
            before_look = self.placement or Placement.blank(self.side)
            placement = Placement(before_look.variance.copy(), misplaced)
            places = LookPlaces(newer.astype(np.float32), placement.variance, np.float32(misplaced))
        found = MapReadings(np.int8(PIXEL_SIZES.index(size)), density, reading)
        keep_better(cells, found, kept, places)
        elevations = self.elevations | {size: ground.elevation}
        return MeasuredBelief(self.square, *kept, elevations, placement)

    def probability(self) -> NDArray[np.float32]:
        """Shape (n, n), share of safe ground among cells that read as each does; the prior where unread."""
        prior = np.float32(LEVEL_SHARES[LEVELS.size // 2 :].sum() / LEVEL_SHARES.sum())
        out = np.empty((self.side, self.side), dtype=np.float32)
        layers = ReadingLayers(self.size_class, self.density_class, self.probability_class)
        look_up(layers, safe_shares(), prior, out)
        return out

    def cell(self, site: Array) -> tuple[int, int] | None:
        """(row, column) of the cell under `site`, or None outside the square."""
        return self.square.cell(site)

    def site(self, row: int, column: int, plane: float) -> Array:
        """[m] shape (3,), centre of a cell at the height of the target plane."""
        return self.square.site(row, column, plane)


def classify_readings(
    ground: MeasuredGround, criteria: SafetyCriteria
) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """Class of V_P and of the density of points of every cell.

    The class of V_P is -1 where the ground was not scanned, or the lander fits on no map of this size or into
    one of its cells; it is `HOLE` where most cells around hold points, but one under the lander does not.
    """
    from scipy.ndimage import uniform_filter

    count = ground.elevation.count
    span = 2 * round(0.5 * criteria.footprint_diameter / ground.grid.pixel_size) + 1
    scanned = uniform_filter((count > 0).astype(np.float32), span, mode="constant")
    points = uniform_filter(count.astype(np.float32), span, mode="constant")
    density = np.searchsorted(DENSITY_EDGES, points / np.maximum(scanned, 1e-6)).astype(np.int8)
    reading = np.searchsorted(PROBABILITY_EDGES, ground.probability).astype(np.int8)
    reading[~ground.known] = UNREAD
    reading[find_holes(ground, criteria) & (scanned >= _SCANNED)] = HOLE
    return reading, density
