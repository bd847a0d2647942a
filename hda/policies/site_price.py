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

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.two_impulse import divert_cost
from guidance.validation import finite_number
from hda.policies.beliefs.belief import GroundBelief
from hda.policies.cell_prices import (
    Bound,
    Lattice,
    NextLook,
    Outlook,
    Prices,
    price_best,
    price_blindly,
    price_cells,
    read_part,
    sum_by_likelihood,
)
from hda.policies.landing_dispersion import dispersion_weights
from hda.policies.summed_area import SummedArea
from hda.sensing.sensor_axis import is_fixed
from hda.task.observation import Observation, ScenarioView

LATTICE = 8
"""[m] spacing at which propellant is estimated; it bends over hundreds of metres."""
_ROUNDING = 1e-6  # [kg] between a price by integral images and by plain sums


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


def predict_next_look(
    observation: Observation, view: ScenarioView, corner: tuple[int, int], commit_time: float
) -> NextLook:
    """Coast for one decision interval; a sensor fixed to a body sees ground about its easiest landing.

    Steadily braked, the lander stops v t / 2 from where it is. Such a flight leans little, its axis points
    to about there all the way. To land elsewhere it leans, and its sensor looks elsewhere. The ground that
    is seen is taken as the circle of a sensor straight above that point, which lies up to 150 m off the
    nadir; the true one is an ellipse, longer along the way.
    """
    interval, state = view.decision_interval, observation.state
    position = state.position + interval * (state.velocity + 0.5 * interval * view.gravity)
    if view.body is not None and is_fixed(view.lidar):
        position[:2] = state.position[:2] + 0.5 * observation.time_to_go * state.velocity[:2]
    height = float(position[2] - observation.target[2])
    return NextLook(
        east=float(position[0]) - corner[0],
        north=float(position[1]) - corner[1],
        height=height,
        half_width_slope=0.5 * math.tan(view.lidar.field_of_view),
        nadir_radius=max(height, 0.0) * math.tan(view.lidar.off_nadir_limit),
        useful=observation.time_to_go - interval > commit_time and height > 0.0,
    )


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


def _between_points(propellant: Array, cells: int) -> Lattice:
    place = (np.arange(cells) + 0.5) / LATTICE
    point = place.astype(np.int64)
    beyond = place - point
    before, after = (propellant.take(point + step, axis=1) for step in (0, 1))  # C order, for the kernels
    rows = (1.0 - beyond) * before + beyond * after
    return Lattice(rows, point, beyond)


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
    lattice, out = _between_points(propellant, n), np.empty((n, n))
    prices = Prices(
        weights.failure_cost,
        weights.divert_cost,
        weights.surprise_area,
        weights.island_area,
        weights.divert_slope,
        dispersion_weights(weights.dispersion),
    )
    column = price_blindly(safe, lattice, prices, 0.0 if next_look.useful else 1.0, out)
    if next_look.useful:
        most = price_best(safe, next_look, lattice, prices, column) + within + _ROUNDING
        first, last, widest = read_part(out, most, next_look, prices)
        known, unknown = (SummedArea(np.empty((last - first + 1, widest + 1)), first, n) for _ in range(2))
        sum_by_likelihood(safe, next_look, known, unknown)
        price_cells(safe, Outlook(next_look, known, unknown), lattice, prices, Bound(most, within), out)
    return out
