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
from guidance.kernel import compile_vector_kernel
from guidance.two_impulse import divert_cost
from guidance.validation import finite_number
from hda.policies.belief import GroundBelief
from hda.policies.summed_area import add_two_rows, sum_box
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


@compile_vector_kernel
def _smooth_into(safe: NDArray[np.float32], weights: Array, out: NDArray[np.float32]) -> None:
    """Weighted mean over five cells along each axis; beyond the square nothing is safe."""
    n = safe.shape[0]
    middle, near, far = weights
    smoothed = np.zeros((5, n))  # the last five rows, along their columns
    out[:] = 0.0
    for row in range(n):
        here, across = safe[row], smoothed[row % 5]
        for column in range(2, n - 2):
            total = middle * here[column] + near * (here[column - 1] + here[column + 1])
            across[column] = total + far * (here[column - 2] + here[column + 2])
        if row < 4:
            continue
        south, second, third = smoothed[(row - 4) % 5], smoothed[(row - 3) % 5], smoothed[(row - 2) % 5]
        fourth, north, mean = smoothed[(row - 1) % 5], smoothed[row % 5], out[row - 2]
        for column in range(n):
            total = middle * third[column] + near * (second[column] + fourth[column])
            mean[column] = total + far * (south[column] + north[column])


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


@compile_vector_kernel
def _sum_by_likelihood(
    safe: NDArray[np.float32], next_look: NextLook, known: Array, unknown: Array
) -> None:
    """Integral images of what is probably safe, and of what the next look may show among the rest."""
    n = safe.shape[0]
    below_known, below_unknown = np.zeros(n), np.zeros(n)
    radius_squared, nothing = next_look.nadir_radius**2, np.float32(0.0)
    for row in range(n):
        here, north = safe[row], (row + 0.5 - next_look.north) ** 2
        for column in range(n):
            across = north + (column + 0.5 - next_look.east) ** 2
            likely, seen = here[column] > 0.5, across <= radius_squared
            below_known[column] += here[column] if likely else nothing
            below_unknown[column] += here[column] if not likely and seen else nothing
        add_two_rows((below_known, below_unknown), (known[row + 1], unknown[row + 1]))


class _Outlook(NamedTuple):
    """The next look, and integral images of the known and of the unknown safe ground."""

    look: NextLook
    known: Array
    unknown: Array


class _Lattice(NamedTuple):
    """Propellant [kg] between a lattice's points: its rows, at the cells along them, and where cells lie.

    Attributes:
        rows: shape (m, n), at the centre of each column of cells on each row of the lattice.
        point: shape (n,), the lattice's row before each row of cells.
        beyond: shape (n,), share of the way from there to the next.
    """

    rows: Array
    point: NDArray[np.int64]
    beyond: Array


def _between_points(propellant: Array, cells: int) -> _Lattice:
    place = (np.arange(cells) + 0.5) / LATTICE
    point = place.astype(np.int64)
    beyond = place - point
    rows = (1.0 - beyond) * propellant[:, point] + beyond * propellant[:, point + 1]
    return _Lattice(rows, point, beyond)


@compile_vector_kernel
def _price_blindly(
    landing: NDArray[np.float32],
    lattice: _Lattice,
    prices: _Prices,
    share: float,
    out: Array,
) -> float:
    """Fill J as if no later look, or each with a share of the failures left, helped; the least J without."""
    n = landing.shape[0]
    least = np.full(n, np.inf)
    averted, all_failures = prices.divert + prices.failure * share, prices.divert + prices.failure
    for row in range(n):
        i, s = lattice.point[row], lattice.beyond[row]
        south, north, chance, priced = lattice.rows[i], lattice.rows[i + 1], landing[row], out[row]
        for column in range(n):
            price, risk = (1.0 - s) * south[column] + s * north[column], 1.0 - chance[column]
            priced[column] = price + risk * averted
            least[column] = min(least[column], price + risk * all_failures)
    return least.min()


@compile_vector_kernel
def _price_cells(
    landing: NDArray[np.float32],
    outlook: _Outlook,
    lattice: _Lattice,
    prices: _Prices,
    most: float,
    out: Array,
) -> None:
    """Raise to J what is priced at no more than `most` where every failure is averted."""
    next_look, n = outlook.look, landing.shape[0]
    height = next_look.height
    divert_distance = max(prices.divert_slope * height, 1.0)
    for row in range(n):
        i, s = lattice.point[row], lattice.beyond[row]
        for column in range(n):
            if out[row, column] > most:
                continue
            price = (1.0 - s) * lattice.rows[i, column] + s * lattice.rows[i + 1, column]
            risk = 1.0 - landing[row, column]
            across = (column + 0.5 - next_look.east) ** 2 + (row + 0.5 - next_look.north) ** 2
            half_width = next_look.half_width_slope * math.sqrt(across + height * height)
            exponent = sum_box(outlook.known, row, column, divert_distance) / prices.surprise_area
            exponent += sum_box(outlook.unknown, row, column, half_width) / prices.island_area
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
    lattice = _between_points(propellant, n)
    prices = _Prices(
        weights.failure_cost,
        weights.divert_cost,
        weights.surprise_area,
        weights.island_area,
        weights.divert_slope,
    )
    out, landing = np.empty((n, n)), landing_probability(safe, weights.dispersion)
    least = _price_blindly(landing, lattice, prices, 0.0 if next_look.useful else 1.0, out)
    if next_look.useful:
        known, unknown = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        _sum_by_likelihood(safe, next_look, known, unknown)
        _price_cells(landing, _Outlook(next_look, known, unknown), lattice, prices, least + within, out)
    return out
