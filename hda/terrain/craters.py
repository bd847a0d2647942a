"""Impact craters: how many, how large, how deep, and the relief that they leave.

Pike's (1977) relations for simple craters take and give kilometres; the functions here take and give metres.
His sample starts at 400 m, so for small craters they are an extrapolation.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.validation import finite_number

KILOMETRE = 1000.0
LARGEST_SIMPLE_CRATER = 15.0 * KILOMETRE  # [m] beyond, craters are complex and Pike's relations others

STOPAR_DIAMETER = np.array([10.0, 40.0, 100.0, 200.0, 400.0])
"""[m] lower edges of the size classes of `STOPAR_DEPTH_RATIO`, which has one more class below 10 m."""
STOPAR_DEPTH_RATIO = np.array([0.10, 0.11, 0.13, 0.15, 0.17, 0.21])
"""[-] depth over diameter of fresh craters by size (Stopar et al. 2017; below 40 m its authors
extrapolate)."""
FRESHNESS_RANGE = (0.15, 1.0)
"""[-] share of its fresh depth that a crater still has; uniform. Stands in for ages and diffusion."""


class DepthLaw(enum.Enum):
    """How the depth of a crater (rim crest to floor) follows from its diameter."""

    UNIFORM = "uniform"
    """Depth over diameter uniform in `CraterPopulation.depth_ratio_range`."""
    PIKE = "pike"
    """Fresh craters: 0.196 D^1.010, kilometres (Pike 1977)."""
    STOPAR = "stopar"
    """Steps by size (Stopar et al. 2017) times a freshness uniform in 0.15 to 1."""


@dataclass(frozen=True)
class CraterPopulation:
    """Craters placed at random with a power law of sizes, N(>D) = coefficient D^-exponent per square metre.

    Attributes:
        coefficient: [m^(exponent - 2)] default 10^-1.1: equilibrium of small craters (Trask 1966, JPL TR
            32-800).
        exponent: [-] default 2 (Trask 1966).
        minimum_diameter: [m] smaller craters are left out (they vanish in the rock field).
        maximum_diameter: [m] larger craters are left out; at most 15 km, where craters become complex.
        depth_law: depth (rim crest to floor) from diameter.
        depth_ratio_range: [-] least and greatest depth over diameter under `DepthLaw.UNIFORM`. Small lunar
            craters run from 0.06 (Wu et al. 2020) to Pike's 0.2.
        ejecta_reach: [crater radii] distance from the centre at which the ejecta end.

    Raises:
        ValueError: a field is out of range.
    """

    coefficient: float = 10.0**-1.1
    exponent: float = 2.0
    minimum_diameter: float = 20.0
    maximum_diameter: float = 250.0
    depth_law: DepthLaw = DepthLaw.UNIFORM
    depth_ratio_range: tuple[float, float] = (0.08, 0.2)
    ejecta_reach: float = 3.0

    def __post_init__(self) -> None:
        """Refuse a population that cannot be drawn."""
        finite_number("coefficient", self.coefficient, at_least=0.0)
        finite_number("exponent", self.exponent, above=0.0)
        finite_number("minimum_diameter", self.minimum_diameter, above=0.0)
        finite_number(
            "maximum_diameter",
            self.maximum_diameter,
            above=self.minimum_diameter,
            at_most=LARGEST_SIMPLE_CRATER,
        )
        low, high = self.depth_ratio_range
        finite_number("depth_ratio_range[0]", low, at_least=0.0)
        finite_number("depth_ratio_range[1]", high, at_least=low, at_most=0.5)
        finite_number("ejecta_reach", self.ejecta_reach, above=1.0)
        if not isinstance(self.depth_law, DepthLaw):
            raise ValueError(f"depth_law must be a DepthLaw, got {self.depth_law!r}")

    def density_above(self, diameter: float) -> float:
        """[1/m^2] expected number of craters of at least `diameter` [m], between the two diameter limits."""
        inside = min(max(diameter, self.minimum_diameter), self.maximum_diameter)
        return self.coefficient * (inside**-self.exponent - self.maximum_diameter**-self.exponent)


@dataclass(frozen=True)
class Craters:
    """Craters that were drawn: arrays of equal length, in metres, positions from the south-west corner."""

    east: Array
    north: Array
    diameter: Array
    depth: Array
    rim_height: Array
    floor_diameter: Array


def pike_depth(diameter: Array) -> Array:
    """[m] rim crest to floor of a fresh simple crater of `diameter` [m] (Pike 1977: 0.196 D^1.010, km)."""
    return 0.196 * (np.asarray(diameter) / KILOMETRE) ** 1.010 * KILOMETRE


def pike_rim_height(diameter: Array) -> Array:
    """[m] rim crest above the plain of a fresh simple crater (Pike 1977: 0.036 D^1.014, km)."""
    return 0.036 * (np.asarray(diameter) / KILOMETRE) ** 1.014 * KILOMETRE


def pike_floor_diameter(diameter: Array) -> Array:
    """[m] diameter of the flat floor of a fresh simple crater (Pike 1977: 0.031 D^1.765, km)."""
    return 0.031 * (np.asarray(diameter) / KILOMETRE) ** 1.765 * KILOMETRE


def draw_depth(population: CraterPopulation, diameter: Array, rng: np.random.Generator) -> Array:
    """Draw the depth [m], rim crest to floor, of craters of `diameter` [m]."""
    if population.depth_law is DepthLaw.PIKE:
        return pike_depth(diameter)
    if population.depth_law is DepthLaw.STOPAR:
        fresh = STOPAR_DEPTH_RATIO[np.searchsorted(STOPAR_DIAMETER, diameter, side="right")]
        return diameter * fresh * rng.uniform(*FRESHNESS_RANGE, size=diameter.size)
    return diameter * rng.uniform(*population.depth_ratio_range, size=diameter.size)


def draw_craters(population: CraterPopulation, extent: float, rng: np.random.Generator) -> Craters:
    """Draw every crater whose ejecta can touch a square tile of side `extent` [m]: a Poisson field.

    Positions and diameters are drawn before depths, so a change of the depth law leaves the craters in place.
    """
    margin = population.ejecta_reach * population.maximum_diameter / 2.0
    side = extent + 2.0 * margin
    count = int(rng.poisson(population.density_above(population.minimum_diameter) * side**2))
    position = rng.uniform(-margin, extent + margin, size=(2, count))
    smallest = population.minimum_diameter**-population.exponent
    largest = population.maximum_diameter**-population.exponent
    diameter = (smallest - rng.random(count) * (smallest - largest)) ** (-1.0 / population.exponent)
    depth = draw_depth(population, diameter, rng)
    rim_height = depth * pike_rim_height(diameter) / pike_depth(diameter)
    return Craters(position[0], position[1], diameter, depth, rim_height, pike_floor_diameter(diameter))


@compile_kernel
def _crater_elevation(
    distance: float, radius: float, floor_radius: float, depth: float, rim_height: float, ejecta_reach: float
) -> float:
    """Elevation above the plain at `distance` from the centre: flat floor, parabolic wall, ejecta as x^-3."""
    if distance <= radius:
        climb = max(distance - floor_radius, 0.0) / (radius - floor_radius)
        return rim_height - depth + depth * climb * climb
    end = ejecta_reach**-3.0
    x = radius / distance
    return max(rim_height * (x * x * x - end) / (1.0 - end), 0.0)


@compile_kernel
def _add_craters(relief: NDArray[np.float32], table: Array, ejecta_reach: float, pixel_size: float) -> None:
    rows, columns = relief.shape
    for k in range(table.shape[0]):
        east, north, radius = table[k, 0] / pixel_size, table[k, 1] / pixel_size, table[k, 2] / pixel_size
        floor_radius, depth, rim_height = table[k, 3] / pixel_size, table[k, 4], table[k, 5]
        outer = ejecta_reach * radius
        for row in range(
            max(0, math.ceil(north - outer - 0.5)), min(rows, math.floor(north + outer - 0.5) + 1)
        ):
            dn = row + 0.5 - north
            half = math.sqrt(max(outer * outer - dn * dn, 0.0))
            first = max(0, math.ceil(east - half - 0.5))
            for column in range(first, min(columns, math.floor(east + half - 0.5) + 1)):
                de = column + 0.5 - east
                relief[row, column] += _crater_elevation(
                    math.sqrt(dn * dn + de * de), radius, floor_radius, depth, rim_height, ejecta_reach
                )


def crater_relief(craters: Craters, size: int, pixel_size: float, ejecta_reach: float) -> NDArray[np.float32]:
    """Relief [m] of craters on a plain at zero, at the cell centres; overlapping craters add up.

    Each has a flat floor of `floor_diameter` at rim_height - depth, a parabolic wall up to the rim crest and
    ejecta that fall as (radius / distance)^3, less the constant that brings them to zero at `ejecta_reach`
    radii.

    Returns:
        (size, size) float32, [m], row north, column east.
    """
    relief = np.zeros((size, size), dtype=np.float32)
    columns = (
        craters.east,
        craters.north,
        craters.diameter / 2.0,
        craters.floor_diameter / 2.0,
        craters.depth,
        craters.rim_height,
    )
    _add_craters(relief, np.ascontiguousarray(np.column_stack(columns)), ejecta_reach, pixel_size)
    return relief
