"""The square four-pad lander on a raster: its orientations, its pads and the cells between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

ROUNDING_GUARD = 1e-9  # [cells] a quotient this close above a whole number counts as that number


@dataclass(frozen=True)
class LanderFootprint:
    """Cells that a lander touches, as (north, east) offsets from the cell under its centre.

    Attributes:
        pads: (k, 2) int, pad 0 of each distinct orientation; the other three follow by quarter turns.
        strips: (s, 3) int, rows of the open squares between the pads: north, first east, last east.
        first_strip: (k + 1,) int, where the strips of each orientation begin in `strips`.
        pad_disc: (2 r + 1, 2 r + 1) bool, cells under a pad of radius r cells.
        half_size: [cells] from the centre to the outermost cell under a pad.
        support: (c, 2) int, every cell under a pad or between the pads in some orientation.
    """

    pads: NDArray[np.int64]
    strips: NDArray[np.int64]
    first_strip: NDArray[np.int64]
    pad_disc: NDArray[np.bool_]
    half_size: int
    support: NDArray[np.int64]

    @property
    def span(self) -> int:
        """[cells] least side of a map that holds the lander."""
        return 2 * self.half_size + 1

    def footprint_cells(self, orientation: int) -> NDArray[np.int64]:
        """(c, 2) offsets of the cells strictly inside the square of the pad centres of one orientation."""
        strips = self.strips[self.first_strip[orientation] : self.first_strip[orientation + 1]]
        return np.array(
            [(north, east) for north, first, last in strips for east in range(first, last + 1)],
            dtype=np.int64,
        )

    def pad_centres(self, orientation: int) -> NDArray[np.int64]:
        """(4, 2) offsets of the pad centres of one orientation, anticlockwise."""
        north, east = self.pads[orientation]
        return np.array([(north, east), (east, -north), (-north, -east), (-east, north)], dtype=np.int64)


def raster_circle(radius: int) -> list[tuple[int, int]]:
    """Cells of a quarter of the midpoint circle, (north, east), from east to just before north."""
    octant = []
    x, y, decision = 0, radius, 1 - radius
    while x <= y:
        octant.append((x, y))
        if decision < 0:
            decision += 2 * x + 3
        else:
            decision += 2 * (x - y) + 5
            y -= 1
        x += 1
    quarter = {(x, y) for x, y in octant} | {(y, x) for x, y in octant}
    quarter.discard((radius, 0))
    return sorted(quarter, key=lambda cell: math.atan2(cell[0], cell[1]))


@lru_cache(maxsize=32)
def make_footprint(footprint_diameter: float, pad_diameter: float, pixel_size: float) -> LanderFootprint:
    """Set a lander on a raster. Lengths in metres.

    The outer radius is rounded up to whole cells from the edge of the centre's cell, the pad radius is half
    the pad's cells, and the pad centres lie on a raster circle of the difference.

    Raises:
        ValueError: the lander is so small, or its pads so large, that the pads meet in its centre.
    """
    if pad_diameter >= footprint_diameter:
        raise ValueError(
            f"footprint_diameter {footprint_diameter:g} m is too small for pads of {pad_diameter:g} m"
        )
    outer = math.ceil((footprint_diameter / 2.0 - pixel_size / 2.0) / pixel_size - ROUNDING_GUARD)
    pad_radius = math.ceil(pad_diameter / pixel_size - ROUNDING_GUARD) // 2
    radius = outer - pad_radius
    if radius < 1:
        raise ValueError(
            f"footprint_diameter {footprint_diameter:g} m is too small for pads of {pad_diameter:g} m "
            f"on cells of {pixel_size:g} m"
        )
    pads = raster_circle(radius)
    strips: list[tuple[int, int, int]] = []
    first_strip = [0]
    for north, east in pads:
        strips += _open_square(north, east)
        first_strip.append(len(strips))
    span = np.arange(-pad_radius, pad_radius + 1)
    disc = span[:, None] ** 2 + span[None, :] ** 2 <= (pad_radius + 0.5) ** 2
    under_pads = np.argwhere(disc) - pad_radius
    corners = [(n, e) for north, east in pads for n, e in _corners(north, east)]
    support = {(n + dn, e + de) for n, e in corners for dn, de in under_pads.tolist()}
    support |= {(north, east) for north, first, last in strips for east in range(first, last + 1)}
    return LanderFootprint(
        pads=np.array(pads, dtype=np.int64),
        strips=np.array(strips, dtype=np.int64).reshape(-1, 3),
        first_strip=np.array(first_strip, dtype=np.int64),
        pad_disc=disc,
        half_size=outer,
        support=np.array(sorted(support), dtype=np.int64),
    )


def _corners(north: int, east: int) -> list[tuple[int, int]]:
    return [(north, east), (east, -north), (-north, -east), (-east, north)]


def _open_square(north: int, east: int) -> list[tuple[int, int, int]]:
    """Rows (north, first east, last east) of the cells strictly inside the square with this corner."""
    farthest = max(abs(north), abs(east))
    span = np.arange(-farthest, farthest + 1)
    rows, columns = span[:, None], span[None, :]
    inside = np.ones((span.size, span.size), dtype=bool)
    # Inside means nearer than every side: the outward normal of the side after a corner is corner + next
    # corner.
    corners = _corners(north, east)
    for (n0, e0), (n1, e1) in zip(corners, corners[1:] + corners[:1], strict=True):
        normal_north, normal_east = n0 + n1, e0 + e1
        inside &= normal_north * rows + normal_east * columns < north * north + east * east
    strips = []
    for row in np.flatnonzero(inside.any(axis=1)):
        filled = span[inside[row]]
        strips.append((int(span[row]), int(filled[0]), int(filled[-1])))
    return strips
