"""Algorithm 1, the ALHAT safety map, written for reading: one cell, one orientation, three pads at a time.

Nothing here is shared with `hda`: the planes come from three pad contacts each, and a plane counts when the
fourth pad does not have to sink into the ground. Slow: some milliseconds a cell.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class OracleMap(NamedTuple):
    deterministic: NDArray[np.bool_]
    probability: NDArray[np.float64]
    slope: NDArray[np.float64]
    roughness: NDArray[np.float64]


class Limits(NamedTuple):
    footprint_diameter: float = 10.0
    pad_diameter: float = 1.0
    max_slope: float = math.radians(10.0)
    max_roughness: float = 0.30
    range_noise: float = 0.05 / 3.0


def radii_in_cells(limits: Limits, pixel_size: float) -> tuple[int, int]:
    """Radius of the circle of pad centres, and of a pad, in cells; in whole millimetres, to round truly."""

    def millimetres(length: float) -> int:
        return round(length * 1000)

    cell = millimetres(pixel_size)
    lander = -(-(millimetres(limits.footprint_diameter) - cell) // (2 * cell))
    pad = -(-millimetres(limits.pad_diameter) // cell) // 2
    return lander - pad, pad


def circle_cells(radius: int) -> list[tuple[int, int]]:
    """Cells (x, y) that a rasterised circle passes through, by its definition.

    In the octants about the y axis each column holds the cell nearest to the circle, decided by whether the
    midpoint between two cells lies inside it; the other octants are mirror images.
    """
    cells = set()
    for x in range(radius + 1):
        # The midpoint between rows y and y + 1 lies inside the circle when x^2 + (y + 1/2)^2 < radius^2.
        y = 0
        while 4 * x * x + (2 * y + 1) ** 2 < 4 * radius * radius:
            y += 1
        if x <= y:
            for a, b in ((x, y), (y, x)):
                cells |= {(a, b), (-a, b), (a, -b), (-a, -b)}
    return sorted(cells)


def orientations(radius: int) -> list[list[tuple[int, int]]]:
    """Pad centres (x east, y north), anticlockwise, of each distinct orientation of the square lander."""
    found = {}
    for x, y in circle_cells(radius):
        pads = [(x, y), (-y, x), (-x, -y), (y, -x)]
        found[frozenset(pads)] = pads
    return list(found.values())


def inside(pads: list[tuple[int, int]], x: int, y: int) -> bool:
    """Whether (x, y) lies strictly inside the square of the pads: to the left of each side."""
    for (ax, ay), (bx, by) in zip(pads, pads[1:] + pads[:1], strict=True):
        if (bx - ax) * (y - ay) - (by - ay) * (x - ax) <= 0:
            return False
    return True


def pad_contact(dem: NDArray[np.float64], column: int, row: int, pad_radius: int) -> float:
    """The highest ground under a pad."""
    highest = -math.inf
    for dy in range(-pad_radius, pad_radius + 1):
        for dx in range(-pad_radius, pad_radius + 1):
            if math.hypot(dx, dy) <= pad_radius + 0.5:
                height = dem[row + dy, column + dx]
                if math.isnan(height):
                    return math.nan
                highest = max(highest, float(height))
    return highest


def stable_planes(contacts: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Planes (point, upward unit normal) on which the lander can stand, from its (4, 3) pad contacts."""
    planes = []
    for triple in itertools.combinations(range(4), 3):
        (fourth,) = set(range(4)) - set(triple)
        p, q, r = contacts[list(triple)]
        normal = np.cross(q - p, r - p)
        normal *= math.copysign(1.0, normal[2]) / np.linalg.norm(normal)
        ground_above_pad = normal @ (contacts[fourth] - p)
        if ground_above_pad <= 1e-12:  # the fourth pad hangs over the ground, or just touches it
            planes.append((p, normal))
    return planes


def assess_cell(
    dem: NDArray[np.float64],
    column: int,
    row: int,
    pixel_size: float,
    limits: Limits,
    noise: NDArray[np.float64] | None = None,
) -> tuple[float, float, float]:
    """Worst slope and roughness, least probability of the roughness limit at one cell; NaN when unknown."""
    radius, pad_radius = radii_in_cells(limits, pixel_size)
    worst_slope, worst_roughness, least_probability = 0.0, -math.inf, 1.0
    for pads in orientations(radius):
        contacts = np.array(
            [
                (x * pixel_size, y * pixel_size, pad_contact(dem, column + x, row + y, pad_radius))
                for x, y in pads
            ]
        )
        if np.isnan(contacts).any():
            return math.nan, math.nan, 0.0
        for point, normal in stable_planes(contacts):
            slope = math.acos(min(normal[2], 1.0)) if normal[2] < 0.9 else math.asin(math.hypot(*normal[:2]))
            worst_slope = max(worst_slope, slope)
            for x in range(-radius, radius + 1):
                for y in range(-radius, radius + 1):
                    if not inside(pads, x, y):
                        continue
                    ground = np.array([x * pixel_size, y * pixel_size, dem[row + y, column + x]])
                    if math.isnan(ground[2]):
                        return math.nan, math.nan, 0.0
                    roughness = float(normal @ (ground - point))
                    own = limits.range_noise if noise is None else noise[row + y, column + x]
                    spread = own * math.cos(slope)
                    z_score = (roughness - limits.max_roughness) / spread
                    worst_roughness = max(worst_roughness, roughness)
                    least_probability = min(
                        least_probability, 0.5 * (1.0 - math.erf(z_score / math.sqrt(2.0)))
                    )
    return worst_slope, worst_roughness, least_probability


def assess(
    dem: NDArray[np.float64], pixel_size: float, limits: Limits, noise: NDArray[np.float64] | None = None
) -> OracleMap:
    """Algorithm 1 at every cell; `noise` [m] is each height's own error in place of the common one."""
    rows, columns = dem.shape
    reach = sum(radii_in_cells(limits, pixel_size))
    result = OracleMap(
        np.zeros(dem.shape, dtype=bool),
        np.zeros(dem.shape),
        np.full(dem.shape, np.nan),
        np.full(dem.shape, np.nan),
    )
    for row in range(reach, rows - reach):
        for column in range(reach, columns - reach):
            slope, roughness, probability = assess_cell(dem, column, row, pixel_size, limits, noise)
            result.slope[row, column] = slope
            result.roughness[row, column] = roughness
            if slope <= limits.max_slope:
                result.probability[row, column] = probability
                result.deterministic[row, column] = roughness <= limits.max_roughness
    return result
