"""The objective of `hda.policies.site_price` over all cells of a square, in compiled code.

Whole rows of cells are priced at once, so that they run on the vector units. Only the cells that may yet be
the cheapest are priced with what the next look may show.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_vector_kernel
from hda.policies.landing_dispersion import landing_chance, smooth_across, smooth_row
from hda.policies.summed_area import SummedArea, add_two_rows, sum_box


class Prices(NamedTuple):
    """What the kernel needs of `HazardAwareWeights`."""

    failure: float
    divert: float
    surprise_area: float
    island_area: float
    divert_slope: float
    dispersion: tuple[float, float, float]


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


class Lattice(NamedTuple):
    """Propellant [kg] between a lattice's points: its rows, at the cells along them, and where cells lie.

    Attributes:
        rows: shape (m, n), at the centre of each column of cells on each row of the lattice.
        point: shape (n,), the lattice's row before each row of cells.
        beyond: shape (n,), share of the way from there to the next.
    """

    rows: Array
    point: NDArray[np.int64]
    beyond: Array


class SafeGround(NamedTuple):
    """Safe ground [m^2] in reach of a cell: what is known, and what the next look may show besides."""

    known: float
    unknown: float


class Bound(NamedTuple):
    """What the cheapest cells cost at most.

    Attributes:
        most: [kg] not less than the least J and `within` together.
        within: [kg] so much above the least J is priced in full.
    """

    most: float
    within: float


class Outlook(NamedTuple):
    """The next look, and integral images of the known and of the unknown safe ground."""

    look: NextLook
    known: SummedArea
    unknown: SummedArea


@compile_vector_kernel
def sum_by_likelihood(
    safe: NDArray[np.float32], next_look: NextLook, known: SummedArea, unknown: SummedArea
) -> None:
    """Fill integral images of what is probably safe, and of what the next look may show among the rest."""
    rows, columns = known.sums.shape[0], known.sums.shape[1] - 1
    below_known, below_unknown = np.zeros(columns), np.zeros(columns)
    radius_squared, nothing = next_look.nadir_radius**2, np.float32(0.0)
    for row in range(known.first + rows):
        if row >= known.first:
            k = row - known.first
            add_two_rows((below_known, below_unknown), (known.sums[k], unknown.sums[k]))
        if row == known.cells:
            break
        here, north = safe[row], (row + 0.5 - next_look.north) ** 2
        for column in range(columns):
            across = north + (column + 0.5 - next_look.east) ** 2
            likely, seen = here[column] > 0.5, across <= radius_squared
            below_known[column] += here[column] if likely else nothing
            below_unknown[column] += here[column] if not likely and seen else nothing


@compile_vector_kernel
def price_blindly(
    safe: NDArray[np.float32],
    lattice: Lattice,
    prices: Prices,
    share: float,
    out: Array,
) -> int:
    """Fill J as if no later look, or each with a share of the failures left, helped.

    Returns:
        The column of the least J without any help.
    """
    n = safe.shape[0]
    least = np.empty(n)
    for column in range(n):
        least[column] = np.inf
    chance = np.empty(n, dtype=np.float32)
    smoothed = np.zeros((5, n))  # along their columns, of the rows about the one that is priced
    averted, all_failures = prices.divert + prices.failure * share, prices.divert + prices.failure
    for row in range(min(2, n)):
        smooth_row(safe[row], prices.dispersion, smoothed[row])
    for row in range(n):
        if row + 2 < n:
            smooth_row(safe[row + 2], prices.dispersion, smoothed[(row + 2) % 5])
        if 2 <= row < n - 2:
            smooth_across(smoothed, row, prices.dispersion, chance)
        else:
            chance[:] = 0.0
        i, s = lattice.point[row], lattice.beyond[row]
        south, north, priced = lattice.rows[i], lattice.rows[i + 1], out[row]
        for column in range(n):
            price, risk = (1.0 - s) * south[column] + s * north[column], 1.0 - chance[column]
            priced[column] = price + risk * averted
            least[column] = min(least[column], price + risk * all_failures)
    return int(least.argmin())


@compile_vector_kernel
def _divert_widths(next_look: NextLook, prices: Prices, row: int, column: int) -> tuple[float, float]:
    """[m] from a cell, along each axis, to the end of late diverts and of the next look."""
    across = (column + 0.5 - next_look.east) ** 2 + (row + 0.5 - next_look.north) ** 2
    half_width = next_look.half_width_slope * math.sqrt(across + next_look.height**2)
    return max(prices.divert_slope * next_look.height, 1.0), half_width


@compile_vector_kernel
def read_part(out: Array, most: float, next_look: NextLook, prices: Prices) -> tuple[int, int, int]:
    """First and last row, and last column, of the integral images that the cells up to `most` read."""
    n = out.shape[0]
    first, last, widest = n, 0, 0
    for row in range(n):
        for column in range(n):
            if out[row, column] <= most:
                half = int(max(*_divert_widths(next_look, prices, row, column)))
                first, last = min(first, max(row - half, 0)), max(last, min(row + half + 1, n))
                widest = max(widest, min(column + half + 1, n))
    return first, last, widest


@compile_vector_kernel
def _weigh(
    safe: NDArray[np.float32],
    lattice: Lattice,
    prices: Prices,
    cell: tuple[int, int],
    ground: SafeGround,
) -> float:
    """J of one cell (row, column) with so much safe ground in reach."""
    row, column = cell
    i, s = lattice.point[row], lattice.beyond[row]
    price = (1.0 - s) * lattice.rows[i, column] + s * lattice.rows[i + 1, column]
    risk = 1.0 - landing_chance(safe, prices.dispersion, row, column)
    exponent = ground.known / prices.surprise_area
    exponent += ground.unknown / prices.island_area
    return price + risk * (prices.divert + prices.failure * math.exp(-exponent))


@compile_vector_kernel
def price_best(
    safe: NDArray[np.float32], next_look: NextLook, lattice: Lattice, prices: Prices, column: int
) -> float:
    """J of one good cell, which the least J does not exceed.

    It is the cell of a column whose J would be the least if no later look helped. Its safe ground is summed
    cell by cell, as the integral images are made only after it: for the rows that this bound leaves.
    """
    n, least, row = safe.shape[0], np.inf, 0
    for k in range(n):
        price = _weigh(safe, lattice, prices, (k, column), SafeGround(0.0, 0.0))
        if price < least:
            least, row = price, k
    divert, half_width = _divert_widths(next_look, prices, row, column)
    half = int(max(divert, half_width))
    known, unknown, radius_squared = 0.0, 0.0, next_look.nadir_radius**2
    for i in range(max(row - half, 0), min(row + half + 1, n)):
        for j in range(max(column - half, 0), min(column + half + 1, n)):
            away = max(abs(i - row), abs(j - column))
            if safe[i, j] > 0.5:
                known += safe[i, j] if away <= int(divert) else 0.0
            elif (
                away <= int(half_width)
                and (j + 0.5 - next_look.east) ** 2 + (i + 0.5 - next_look.north) ** 2 <= radius_squared
            ):
                unknown += safe[i, j]
    return _weigh(safe, lattice, prices, (row, column), SafeGround(known, unknown))


@compile_vector_kernel
def price_cells(
    safe: NDArray[np.float32],
    outlook: Outlook,
    lattice: Lattice,
    prices: Prices,
    bound: Bound,
    out: Array,
) -> None:
    """Fill in J of every cell that may cost no more than the bound; the others keep their lower price.

    Each cell that is priced tightens the bound for those after it.

    Args:
        safe: shape (n, n).
        outlook: the next look.
        lattice: propellant.
        prices: of the objective.
        bound: on what is worth pricing.
        out: [kg] shape (n, n); on entry J if every failure were averted.
    """
    most, within = bound
    look, n = outlook.look, safe.shape[0]
    for row in range(n):
        for column in range(n):
            if out[row, column] > most:
                continue
            divert, half_width = _divert_widths(look, prices, row, column)
            known = sum_box(outlook.known, row, column, divert)
            unknown = sum_box(outlook.unknown, row, column, half_width)
            price = _weigh(safe, lattice, prices, (row, column), SafeGround(known, unknown))
            out[row, column] = price
            most = min(most, price + within)
