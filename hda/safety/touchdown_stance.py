"""The lander upright over true ground: at which height its pads or its belly first touch.

Ground between the centres of four cells is their bilinear interpolation, as for the rays of a LIDAR. A pad
rests on the highest ground under its disc: its middle, 16 points of its rim, and the centres of cells in
it. The belly is met by the centres of cells between the pads, as in Algorithm 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import finite_number
from hda.safety.criteria import SafetyCriteria

_RIM = 16  # points of a pad's rim
_RIM_EAST = np.cos(2.0 * np.pi * np.arange(_RIM) / _RIM)
_RIM_NORTH = np.sin(2.0 * np.pi * np.arange(_RIM) / _RIM)


@dataclass(frozen=True)
class Stance:
    """Where a square four-pad lander meets level ground.

    Attributes:
        pad_distance: [m] from its axis to the middle of each pad.
        pad_radius: [m].
        clearance: [m] of the belly above the plane of the pads.
        bearing: [rad] of the first pad from the axis, from east toward north; the others follow by quarter
            turns.

    Raises:
        ValueError: a field is out of range.
    """

    pad_distance: float
    pad_radius: float
    clearance: float
    bearing: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot stand."""
        finite_number("pad_distance", self.pad_distance, above=0.0)
        finite_number("pad_radius", self.pad_radius, above=0.0)
        finite_number("clearance", self.clearance, at_least=0.0)
        finite_number("bearing", self.bearing)

    @classmethod
    def of(cls, criteria: SafetyCriteria, bearing: float = 0.0) -> Stance:
        """The lander of some criteria: pads inside its circle, and the greatest roughness as clearance."""
        distance = 0.5 * (criteria.footprint_diameter - criteria.pad_diameter)
        return cls(distance, 0.5 * criteria.pad_diameter, criteria.max_roughness, bearing)

    @property
    def edge_distance(self) -> float:
        """[m] from the axis to the line through two neighbouring pads."""
        return self.pad_distance * math.sqrt(0.5)

    @property
    def pads(self) -> Array:
        """[m] shape (4, 2), middles of the pads east and north of the axis, anticlockwise."""
        angles = self.bearing + 0.5 * np.pi * np.arange(4)
        return self.pad_distance * np.column_stack([np.cos(angles), np.sin(angles)])


class Footing(NamedTuple):
    """A lander over its ground, for the kernels.

    Attributes:
        elevation: [m] shape (rows, columns), 1 m a cell; NaN where unknown.
        pads: [m] shape (4, 2).
        pad_radius: [m].
        clearance: [m].
        plane: [m] height that stands for the ground where none is known.
    """

    elevation: NDArray[np.float32]
    pads: Array
    pad_radius: float
    clearance: float
    plane: float


def make_footing(elevation: NDArray[np.float32], stance: Stance, plane: float) -> Footing:
    """Set a lander over a map of heights, read-only as a tile's is."""
    return Footing(elevation, stance.pads, stance.pad_radius, stance.clearance, plane)


@compile_kernel
def ground_at(elevation: NDArray[np.float32], x: float, y: float) -> float:
    """[m] ground at a point, bilinear between the centres of cells; NaN where a neighbour is unknown."""
    rows, columns = elevation.shape
    u, v = x - 0.5, y - 0.5
    if not (0.0 <= u <= columns - 1.0 and 0.0 <= v <= rows - 1.0):
        return math.nan
    column, row = min(int(u), columns - 2), min(int(v), rows - 2)
    s, t = u - column, v - row
    south = (1.0 - s) * elevation[row, column] + s * elevation[row, column + 1]
    north = (1.0 - s) * elevation[row + 1, column] + s * elevation[row + 1, column + 1]
    return (1.0 - t) * south + t * north


@compile_kernel
def pad_height(elevation: NDArray[np.float32], x: float, y: float, radius: float) -> tuple[float, bool]:
    """[m] highest known ground under a pad (-inf if none is), and whether all of it is known."""
    rows, columns = elevation.shape
    highest, known = -np.inf, True
    for k in range(-1, _RIM):
        east, north = 0.0, 0.0
        if k >= 0:
            east, north = radius * _RIM_EAST[k], radius * _RIM_NORTH[k]
        height = ground_at(elevation, x + east, y + north)
        known = known and not math.isnan(height)
        if height > highest:
            highest = height
    for row in range(max(math.ceil(y - radius - 0.5), 0), min(math.floor(y + radius - 0.5) + 1, rows)):
        for column in range(
            max(math.ceil(x - radius - 0.5), 0), min(math.floor(x + radius - 0.5) + 1, columns)
        ):
            across = (column + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2
            if across <= radius * radius and elevation[row, column] > highest:
                highest = float(elevation[row, column])
    return highest, known


@compile_kernel
def between_pads(pads: Array, east: float, north: float) -> bool:
    """Whether a point, from the lander's axis, lies strictly inside the square of the pads' middles."""
    first = abs(pads[0, 0] * east + pads[0, 1] * north)
    second = abs(pads[1, 0] * east + pads[1, 1] * north)
    return first + second < pads[0, 0] ** 2 + pads[0, 1] ** 2


@compile_kernel
def contact_height(footing: Footing, x: float, y: float) -> float:
    """[m] height of the pads' plane at which the upright lander over (x, y) first touches known ground.

    Where there is none below it, the plane's height.
    """
    elevation, pads, radius, clearance, plane = footing
    rows, columns = elevation.shape
    highest = -np.inf
    for k in range(4):
        height, _ = pad_height(elevation, x + pads[k, 0], y + pads[k, 1], radius)
        if height > highest:
            highest = height
    reach = math.sqrt(pads[0, 0] ** 2 + pads[0, 1] ** 2)
    for row in range(max(math.floor(y - reach), 0), min(math.floor(y + reach) + 1, rows)):
        for column in range(max(math.floor(x - reach), 0), min(math.floor(x + reach) + 1, columns)):
            height = float(elevation[row, column]) - clearance
            if height > highest and between_pads(pads, column + 0.5 - x, row + 0.5 - y):
                highest = height
    return highest if highest > -np.inf else plane


def set_down(footing: Footing | None, site: Array) -> Array:
    """[m] shape (3,), a site at the height where the lander touches true ground; itself without ground."""
    if footing is None:
        return site
    return np.array([site[0], site[1], contact_height(footing, float(site[0]), float(site[1]))])


@compile_kernel
def highest_around(footing: Footing, x: float, y: float, reach: float) -> float:
    """[m] a height that `contact_height` nowhere exceeds within `reach` [m] of (x, y) along each axis."""
    elevation, pads = footing.elevation, footing.pads
    rows, columns = elevation.shape
    reach += math.sqrt(pads[0, 0] ** 2 + pads[0, 1] ** 2) + footing.pad_radius + 1.0
    south, north = math.floor(y - reach), math.floor(y + reach) + 1
    west, east = math.floor(x - reach), math.floor(x + reach) + 1
    unknown = south < 0 or west < 0 or north > rows or east > columns
    highest = -np.inf
    for row in range(max(south, 0), min(north, rows)):
        for column in range(max(west, 0), min(east, columns)):
            height = elevation[row, column]
            unknown = unknown or math.isnan(height)
            if height > highest:
                highest = float(height)
    return max(highest, footing.plane) if unknown else highest
