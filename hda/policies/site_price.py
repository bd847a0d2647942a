"""The price of a landing site: risk by the belief, propellant, and what the next look may show.

At each look every cell of the belief's square is priced in kilogrammes of propellant:

    J = propellant + (1 - safe) (divert + failure exp(-(known/surprise + unknown/island)))

`safe` is the probability that a touchdown aimed at the cell ends on safe ground, under the landing
dispersion. Should the site turn out unsafe, a later look must show another: `known` is the expected safe
ground, among cells that are probably safe, within range of a late divert from it, and `unknown` the expected
safe ground among the others, within the field of view that the next look will have around it and not too far
from the vertical. Unknown safe ground comes in islands, so exp(-unknown/island) is the Poisson probability
that there is none; known ground is lost to surprises of a few square metres. Where no look is left to act
on, the exponential is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.two_impulse import divert_cost
from guidance.validation import finite_number
from hda.policies.belief import GroundBelief
from hda.task.observation import Observation, ScenarioView

LATTICE = 8
"""[m] spacing at which propellant is estimated; it bends over hundreds of metres."""


@dataclass(frozen=True)
class HazardAwareWeights:
    """What the objective weighs; tuned on the tuning tiles.

    Attributes:
        failure_cost: [kg] of propellant that a failed landing is worth.
        divert_cost: [kg] of propellant that a late divert is expected to cost.
        surprise_area: [m^2] of known safe ground in range of a divert that lowers the risk by a factor e.
        island_area: [m^2] of expected safe ground not yet seen that lowers the risk by a factor e.
        divert_slope: [-] range of a late divert over the height at the next look.
        dispersion: [m] standard deviation of the touchdown about the site, along each axis.
        switch_gain: [kg] by which another site must be better than the present one.
        commit_time: [s] with less time to go than this the site is kept, and a look is of no more use.
    """

    failure_cost: float = 2000.0
    divert_cost: float = 2.0
    surprise_area: float = 10.0
    island_area: float = 500.0
    divert_slope: float = 0.04
    dispersion: float = 0.3
    switch_gain: float = 0.05
    commit_time: float = 2.5

    def __post_init__(self) -> None:
        """Refuse weights that mean nothing."""
        for name in ("failure_cost", "divert_cost", "divert_slope", "switch_gain", "commit_time"):
            finite_number(name, getattr(self, name), at_least=0.0)
        for name in ("surprise_area", "island_area", "dispersion"):
            finite_number(name, getattr(self, name), above=0.0)


class _Prices(NamedTuple):
    """What the kernel needs of `HazardAwareWeights`."""

    failure: float
    divert: float
    surprise_area: float
    island_area: float
    divert_slope: float


class _SafeAreas(NamedTuple):
    """Integral images of the known and of the unknown safe ground."""

    known: Array
    unknown: Array


class NextLook(NamedTuple):
    """Where the lander will be at the next look, coasting until then; lengths from the square's corner.

    Attributes:
        east: [m].
        north: [m].
        height: [m] above the plane.
        half_width_slope: half the look's width over the slant range.
        nadir_radius: [m] greatest distance from the point below the lander at which ground is seen.
        useful: whether it comes early enough to act on.
    """

    east: float
    north: float
    height: float
    half_width_slope: float
    nadir_radius: float
    useful: bool


def predict_next_look(
    observation: Observation, view: ScenarioView, corner: tuple[int, int], commit_time: float
) -> NextLook:
    """Coast for one decision interval."""
    interval, state = view.decision_interval, observation.state
    position = state.position + interval * (state.velocity + 0.5 * interval * view.gravity)
    height = float(position[2] - observation.target[2])
    return NextLook(
        east=float(position[0]) - corner[0],
        north=float(position[1]) - corner[1],
        height=height,
        half_width_slope=0.5 * math.tan(view.lidar.field_of_view),
        nadir_radius=max(height, 0.0) * math.tan(view.lidar.off_nadir_limit),
        useful=observation.time_to_go - interval > commit_time and height > 0.0,
    )


def landing_probability(safe: NDArray[np.float32], dispersion: float) -> NDArray[np.float32]:
    """Probability that a touchdown aimed at each cell's centre ends on a safe cell.

    Args:
        safe: shape (n, n), probability that each cell is safe.
        dispersion: [m] standard deviation of the touchdown along each axis, Gaussian, up to 2.5 m.

    Returns:
        Shape (n, n); 0 within two cells of the square's edge.
    """
    edges = np.array([math.erf(edge / (dispersion * math.sqrt(2.0))) for edge in (0.5, 1.5, 2.5)])
    weights = np.diff(edges, prepend=0.0) * np.array([1.0, 0.5, 0.5]) / edges[-1]
    out = np.empty_like(safe)
    _smooth_into(safe, weights, out)
    return out


@compile_kernel
def _smooth_into(safe: NDArray[np.float32], weights: Array, out: NDArray[np.float32]) -> None:
    """Weighted mean over five cells along each axis; beyond the square nothing is safe."""
    n = safe.shape[0]
    across = np.zeros((n, n))
    for row in range(n):
        for column in range(2, n - 2):
            total = weights[0] * safe[row, column]
            for step in (1, 2):
                total += weights[step] * (safe[row, column - step] + safe[row, column + step])
            across[row, column] = total
    out[:] = 0.0
    for row in range(2, n - 2):
        for column in range(n):
            total = weights[0] * across[row, column]
            for step in (1, 2):
                total += weights[step] * (across[row - step, column] + across[row + step, column])
            out[row, column] = total


def propellant_map(observation: Observation, view: ScenarioView, belief: GroundBelief) -> Array:
    """[kg] estimate for landing at each lattice point of the square, shape (m, m)."""
    points = np.arange(belief.side // LATTICE + 2, dtype=np.float64) * LATTICE
    return divert_cost(
        observation.state,
        belief.corner[0] + points,
        belief.corner[1] + points,
        float(observation.target[2]),
        view.lander,
        view.gravity,
    )


def summed_area(density: NDArray[np.float32]) -> Array:
    """Integral image, shape (n + 1, n + 1): entry (i, j) is the sum over rows below i and columns below j."""
    out = np.zeros((density.shape[0] + 1, density.shape[1] + 1))
    _sum_into(density, out)
    return out


@compile_kernel
def _sum_into(density: NDArray[np.float32], out: Array) -> None:
    rows, columns = density.shape
    below = np.zeros(columns)
    for row in range(rows):
        total = 0.0
        for column in range(columns):
            below[column] += density[row, column]
            total += below[column]
            out[row + 1, column + 1] = total


@compile_kernel
def _box(area: Array, row: int, column: int, half: float) -> float:
    """Sum over the cells within `half` of a cell along each axis."""
    n = area.shape[0] - 1
    cells = int(half)
    low_row, high_row = max(row - cells, 0), min(row + cells + 1, n)
    low, high = max(column - cells, 0), min(column + cells + 1, n)
    return area[high_row, high] - area[low_row, high] - area[high_row, low] + area[low_row, low]


@compile_kernel
def _split_by_likelihood(
    safe: NDArray[np.float32], next_look: NextLook, known: NDArray[np.float32], unknown: NDArray[np.float32]
) -> None:
    """Write what is probably safe, and what safe ground the next look may show among the rest."""
    for row in range(safe.shape[0]):
        north = (row + 0.5 - next_look.north) ** 2
        for column in range(safe.shape[1]):
            across = north + (column + 0.5 - next_look.east) ** 2
            likely = safe[row, column] > 0.5
            seen = across <= next_look.nadir_radius**2
            known[row, column] = safe[row, column] if likely else 0.0
            unknown[row, column] = safe[row, column] if not likely and seen else 0.0


class _Places(NamedTuple):
    """Where cells lie on the lattice along an axis: the number of the point before each, and the rest."""

    point: NDArray[np.int64]
    beyond: Array


@compile_kernel
def _interpolate(propellant: Array, places: _Places, row: int, column: int) -> float:
    """[kg] bilinear, at a cell's centre."""
    i, s, j, t = places.point[row], places.beyond[row], places.point[column], places.beyond[column]
    price = (1.0 - s) * ((1.0 - t) * propellant[i, j] + t * propellant[i, j + 1])
    return price + s * ((1.0 - t) * propellant[i + 1, j] + t * propellant[i + 1, j + 1])


@compile_kernel
def _price_blindly(
    landing: NDArray[np.float32],
    propellant: Array,
    places: _Places,
    prices: _Prices,
    share: float,
    out: Array,
) -> float:
    """Fill J as if no later look, or each with a share of the failures left, helped; the least J without."""
    least, n = np.inf, landing.shape[0]
    for row in range(n):
        for column in range(n):
            price, risk = _interpolate(propellant, places, row, column), 1.0 - landing[row, column]
            out[row, column] = price + risk * (prices.divert + prices.failure * share)
            least = min(least, price + risk * (prices.divert + prices.failure))
    return least


@compile_kernel
def _price_cells(
    landing: NDArray[np.float32],
    areas: _SafeAreas,
    lattice: tuple[Array, _Places],
    next_look: NextLook,
    prices: _Prices,
    most: float,
    out: Array,
) -> None:
    """Raise to J what is priced at no more than `most` where every failure is averted."""
    propellant, places = lattice
    height, n = next_look.height, landing.shape[0]
    divert_distance = max(prices.divert_slope * height, 1.0)
    for row in range(n):
        for column in range(n):
            if out[row, column] > most:
                continue
            price, risk = _interpolate(propellant, places, row, column), 1.0 - landing[row, column]
            across = (column + 0.5 - next_look.east) ** 2 + (row + 0.5 - next_look.north) ** 2
            half_width = next_look.half_width_slope * math.sqrt(across + height * height)
            exponent = _box(areas.known, row, column, divert_distance) / prices.surprise_area
            exponent += _box(areas.unknown, row, column, half_width) / prices.island_area
            out[row, column] = price + risk * (prices.divert + prices.failure * math.exp(-exponent))


def price_sites(
    safe: NDArray[np.float32],
    propellant: Array,
    next_look: NextLook,
    weights: HazardAwareWeights,
    within: float = math.inf,
) -> Array:
    """[kg] J of every cell, shape (n, n).

    Args:
        safe: shape (n, n), probability that each cell is safe.
        propellant: [kg] on the lattice.
        next_look: what it will be able to see.
        weights: of the objective.
        within: [kg] of the least J: what costs more may be given a price between that and its own. It takes
            a fraction of the time.
    """
    n = safe.shape[0]
    down = (np.arange(n) + 0.5) / LATTICE
    places = _Places(down.astype(np.int64), down - down.astype(np.int64))
    prices = _Prices(
        weights.failure_cost,
        weights.divert_cost,
        weights.surprise_area,
        weights.island_area,
        weights.divert_slope,
    )
    out, landing = np.empty((n, n)), landing_probability(safe, weights.dispersion)
    least = _price_blindly(landing, propellant, places, prices, 0.0 if next_look.useful else 1.0, out)
    if next_look.useful:
        known, unknown = np.empty_like(safe), np.empty_like(safe)
        _split_by_likelihood(safe, next_look, known, unknown)
        areas = _SafeAreas(summed_area(known), summed_area(unknown))
        _price_cells(landing, areas, (propellant, places), next_look, prices, least + within, out)
    return out
