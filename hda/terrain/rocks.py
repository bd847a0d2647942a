"""Rocks: hemi-ellipsoids with an exponential law of covered area, seen by the highest point of a cell."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import finite_number

LEAST_AXIS_RATIO = 0.5  # [-] short over long axis of a rock, seen from above, is uniform from this to 1


@dataclass(frozen=True)
class RockPopulation:
    """Rocks of diameter D and more cover a share k exp(-q D) of the ground, q = q0 + q1 / k.

    Golombek and Rapp (1997), with q as in Bernard and Golombek (2001).

    The defaults are the Martian fit at its dense end, which fills the ground with metre-sized blocks; real
    lunar ground has far fewer. They make a hard task, they do not describe a site.

    Attributes:
        area_fraction: [-] k, share of the ground covered by rocks of all sizes.
        decay_constant: [1/m] q0 (Bernard and Golombek 2001).
        decay_slope: [1/m] q1 (Bernard and Golombek 2001).
        minimum_diameter: [m] smaller rocks are left out.
        maximum_diameter: [m] larger rocks are left out (extrapolated laws give too many blocks; Cintala and
            McBride 1995).

    Raises:
        ValueError: a field is out of range.
    """

    area_fraction: float = 0.2
    decay_constant: float = 1.79
    decay_slope: float = 0.152
    minimum_diameter: float = 0.5
    maximum_diameter: float = 4.0

    def __post_init__(self) -> None:
        """Refuse a population that cannot be drawn."""
        finite_number("area_fraction", self.area_fraction, at_least=0.0, at_most=1.0)
        finite_number("decay_constant", self.decay_constant, at_least=0.0)
        finite_number("decay_slope", self.decay_slope, at_least=0.0)
        finite_number("minimum_diameter", self.minimum_diameter, above=0.0)
        finite_number("maximum_diameter", self.maximum_diameter, above=self.minimum_diameter)
        if self.area_fraction > 0.0 and self.decay == 0.0:
            raise ValueError("decay_constant and decay_slope must not both be zero")

    @property
    def decay(self) -> float:
        """[1/m] q of the law."""
        return self.decay_constant + (
            self.decay_slope / self.area_fraction if self.area_fraction > 0.0 else 0.0
        )

    def area_share_above(self, diameter: float) -> float:
        """[-] share of the ground under rocks of at least `diameter` [m], without the diameter limits."""
        return self.area_fraction * math.exp(-self.decay * diameter)

    def density_above(self, diameter: Array) -> Array:
        """[1/m^2] expected number of rocks of at least `diameter` [m], without the upper limit.

        The law of area says that -dF/dD = (pi D^2 / 4) n(D); the integral of n is
        (4 k q / pi) (exp(-q D) / D - q E1(q D)).
        """
        from scipy.special import exp1

        q = self.decay
        d = np.asarray(diameter, dtype=np.float64)
        return 4.0 * self.area_fraction * q / math.pi * (np.exp(-q * d) / d - q * exp1(q * d))


@dataclass(frozen=True)
class Rocks:
    """Rocks that were drawn, as arrays of equal length.

    Metres from the south-west corner; the azimuth [rad] of the long axis counts from east to north.
    """

    east: Array
    north: Array
    diameter: Array
    axis_ratio: Array
    azimuth: Array

    def __len__(self) -> int:
        """How many rocks there are."""
        return self.diameter.size

    def keep(self, mask: NDArray[np.bool_]) -> Rocks:
        """The rocks where `mask` is true."""
        return Rocks(
            self.east[mask], self.north[mask], self.diameter[mask], self.axis_ratio[mask], self.azimuth[mask]
        )


def rock_margin(population: RockPopulation) -> float:
    """[m] greatest distance from its centre at which a rock still rises from the ground."""
    return population.maximum_diameter / 2.0 / math.sqrt(LEAST_AXIS_RATIO)


def draw_rocks(population: RockPopulation, extent: float, rng: np.random.Generator) -> Rocks:
    """Draw every rock that can touch a square tile of side `extent` [m]: a uniform Poisson field."""
    margin = rock_margin(population)
    # The law falls steeply, so its inverse is read from a table that is fine in log D (relative error below
    # 1e-6).
    sizes = np.geomspace(population.minimum_diameter, population.maximum_diameter, 4097)
    above = population.density_above(sizes) - population.density_above(sizes[-1:])
    count = int(rng.poisson(max(above[0], 0.0) * (extent + 2.0 * margin) ** 2))
    position = rng.uniform(-margin, extent + margin, size=(2, count))
    diameter = np.interp(rng.uniform(0.0, above[0], size=count), above[::-1], sizes[::-1])
    axis_ratio = rng.uniform(LEAST_AXIS_RATIO, 1.0, size=count)
    azimuth = rng.uniform(0.0, math.pi, size=count)
    return Rocks(position[0], position[1], diameter, axis_ratio, azimuth)


@compile_kernel
def _least_form(a: float, b: float, c: float, west: float, south: float, side: float) -> float:
    """Least a x^2 + 2 b x y + c y^2 over the square of `side` whose south-west corner is (west, south)."""
    east, north = west + side, south + side
    if west <= 0.0 <= east and south <= 0.0 <= north:
        return 0.0
    least = math.inf
    for x in (west, east):
        y = min(max(-b * x / c, south), north)
        least = min(least, a * x * x + 2.0 * b * x * y + c * y * y)
    for y in (south, north):
        x = min(max(-b * y / a, west), east)
        least = min(least, a * x * x + 2.0 * b * x * y + c * y * y)
    return least


@compile_kernel
def _raise_rocks(heights: NDArray[np.float32], table: Array, pixel_size: float) -> None:
    rows, columns = heights.shape
    for k in range(table.shape[0]):
        east, north, radius = table[k, 0], table[k, 1], table[k, 2] / 2.0
        cosine, sine = math.cos(table[k, 4]), math.sin(table[k, 4])
        long_axis, short_axis = radius / math.sqrt(table[k, 3]), radius * math.sqrt(table[k, 3])
        p, q = 1.0 / (long_axis * long_axis), 1.0 / (short_axis * short_axis)
        a, c = cosine * cosine * p + sine * sine * q, sine * sine * p + cosine * cosine * q
        b = cosine * sine * (p - q)
        reach_east = math.sqrt(
            long_axis * long_axis * cosine * cosine + short_axis * short_axis * sine * sine
        )
        reach_north = math.sqrt(
            long_axis * long_axis * sine * sine + short_axis * short_axis * cosine * cosine
        )
        last_row = min(rows - 1, math.floor((north + reach_north) / pixel_size))
        last_column = min(columns - 1, math.floor((east + reach_east) / pixel_size))
        for row in range(max(0, math.floor((north - reach_north) / pixel_size)), last_row + 1):
            for column in range(max(0, math.floor((east - reach_east) / pixel_size)), last_column + 1):
                form = _least_form(a, b, c, column * pixel_size - east, row * pixel_size - north, pixel_size)
                if form < 1.0:
                    height = radius * math.sqrt(1.0 - form)
                    if height > heights[row, column]:
                        heights[row, column] = height


def rock_heights(rocks: Rocks, size: int, pixel_size: float) -> NDArray[np.float32]:
    """Greatest rock height [m] in each cell (the cell maximum, not the height at its centre).

    A rock is half an ellipsoid, diameter / 2 high; its outline has the area of a circle of its diameter.
    Point sampling would lose most rocks smaller than a cell. Where rocks overlap the highest counts.

    Returns:
        (size, size) float32, [m], zero where there is no rock, row north, column east.
    """
    heights = np.zeros((size, size), dtype=np.float32)
    columns = (rocks.east, rocks.north, rocks.diameter, rocks.axis_ratio, rocks.azimuth)
    _raise_rocks(heights, np.ascontiguousarray(np.column_stack(columns)), pixel_size)
    return heights
