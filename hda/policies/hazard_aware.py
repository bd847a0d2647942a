"""Hazard-aware choice of the landing site: fuse every look, price every cell, fly to the cheapest.

The objective stands in `hda.policies.site_price`. The site of least J is flown to; the present one is kept
unless another gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.constants import MOON_GRAVITY
from guidance.lander import Lander
from guidance.state import State
from hda.policies.beliefs.belief import GroundBelief, SafetyBelief
from hda.policies.beliefs.measured_belief import MeasuredBelief
from hda.policies.beliefs.placement_error import placement_variance
from hda.policies.beliefs.surroundings import infer_unseen
from hda.policies.site_price import (
    LATTICE,
    HazardAwareWeights,
    predict_next_look,
    price_sites,
    propellant_map,
)
from hda.policies.turning_law import reversal_time
from hda.sensing.gridding import PIXEL_SIZES, ElevationMap, PixelGrid
from hda.sensing.lidar import Lidar
from hda.sensing.measured_look import MeasuredGround, assess_elevation
from hda.sensing.ranging import RangingLidar
from hda.task.observation import Observation, ScenarioView
from hda.task.rules import Rules

_WIDEST_SPREAD = 1.0  # [m] 2.5 of it are the half width over which the price averages
_TURN_PRICE = 0.5  # [kg] that a change of site costs a body, which must turn again; chosen
_SQUARE = 1.25  # half side of the belief's square in widths of the first look


@dataclass(frozen=True, eq=False)
class HazardAwareMemory:
    """What the selection remembers between looks.

    Attributes:
        view: the scenario.
        belief: from all looks so far; None before the first.
    """

    view: ScenarioView
    belief: GroundBelief | None = None


def fuse_look(observation: Observation, view: ScenarioView, belief: GroundBelief | None) -> GroundBelief:
    """The belief after a look; the first look fixes the square, the sensor the kind of belief."""
    lidar, half_side = view.lidar, math.ceil(_SQUARE * observation.width / LATTICE) * LATTICE
    if isinstance(lidar, RangingLidar):
        if not isinstance(belief, MeasuredBelief):
            belief = MeasuredBelief.blank(observation.target, half_side)
        if observation.ground is None:
            return belief
        misplaced = placement_variance(observation)
        return belief.fused(observation.ground, view.criteria, lidar.gridding.percentile, misplaced)
    if not isinstance(belief, SafetyBelief):
        belief = SafetyBelief.blank(observation.target, half_side)
    return belief.fused(observation, lidar)


def judge_ground(belief: GroundBelief) -> NDArray[np.float32]:
    """Shape (n, n), probability that each cell is safe, seen or not, with looks that may be misplaced."""
    safe = infer_unseen(belief.probability(), belief.seen)
    return safe if belief.placement is None else belief.placement.blurred(safe)


def landing_spread(observation: Observation, control: float) -> float:
    """[m] standard deviation of the touchdown about the site along each horizontal axis.

    Args:
        observation: its covariance is the filter's, of position less site: of the relative error, as a look
            is placed by the lander's own estimate and moves with its absolute one. None without a filter.
        control: [m] the part of guidance and control.

    Returns:
        The root of the sum of both squares, at most 1 m with a filter: the price reads five cells.
    """
    if observation.covariance is None:
        return control
    variance = placement_variance(observation)
    return max(control, min(math.sqrt(control**2 + variance), _WIDEST_SPREAD))


@dataclass(frozen=True)
class HazardAwareSite:
    """Site selection by the least J.

    Attributes:
        weights: of the objective.
    """

    weights: HazardAwareWeights = field(default_factory=HazardAwareWeights)

    def weights_for(self, view: ScenarioView) -> HazardAwareWeights:
        """The weights; a rigid body changes its site for the price of a turn, and no later than it can."""
        own = self.weights
        if view.body is None:
            return own
        commit_time = max(own.commit_time, reversal_time(view.body))
        return replace(own, commit_time=commit_time, switch_gain=max(own.switch_gain, _TURN_PRICE))

    def begin(self, view: ScenarioView) -> HazardAwareMemory:
        """Nothing seen yet."""
        load_kernels(ranging=isinstance(view.lidar, RangingLidar))
        return HazardAwareMemory(view)

    def price(
        self, observation: Observation, view: ScenarioView, belief: GroundBelief, within: float = math.inf
    ) -> Array:
        """[kg] J of every cell of the belief's square, shape (n, n); `within` as in `price_sites`."""
        safe = judge_ground(belief)
        return self.price_by(safe, observation, view, belief, within)

    def price_by(
        self,
        safe: NDArray[np.float32],
        observation: Observation,
        view: ScenarioView,
        belief: GroundBelief,
        within: float = math.inf,
    ) -> Array:
        """The same where the probability that each cell is safe, shape (n, n), is known."""
        commit_time = self.weights_for(view).commit_time
        next_look = predict_next_look(observation, view, belief.corner, commit_time)
        propellant = propellant_map(observation, view, belief)
        spread = landing_spread(observation, self.weights.dispersion)
        return price_sites(safe, propellant, next_look, replace(self.weights, dispersion=spread), within)

    def select(self, observation: Observation, memory: HazardAwareMemory) -> tuple[Array, HazardAwareMemory]:
        """Fuse the look, price every cell, and move if another gains enough."""
        view = memory.view
        first = memory.belief is None
        belief = fuse_look(observation, view, memory.belief)
        memory = HazardAwareMemory(view, belief)
        height = float(observation.state.position[2] - observation.target[2])
        if height <= 0.0 or (not first and observation.time_to_go <= self.weights_for(view).commit_time):
            return observation.target, memory
        gain = self.weights_for(view).switch_gain
        price = self.price(observation, view, belief, gain)
        best = divmod(int(np.argmin(price)), price.shape[1])
        present = belief.cell(observation.target)
        if present is not None and price[present] <= price[best] + gain:
            return observation.target, memory
        return observation.settled(belief.site(*best, float(observation.target[2]))), memory


@lru_cache(maxsize=2)
def load_kernels(*, ranging: bool) -> None:
    """Fuse and price a small look once per process: the first decision must not wait for compiled code.

    Args:
        ranging: the looks to come measure ranges.
    """
    gravity, plane = np.array(MOON_GRAVITY), np.zeros(3)
    lidar, lander = RangingLidar() if ranging else Lidar(), Lander()
    view = ScenarioView(lander, gravity, plane, Rules(), lidar)
    state = State(np.array([0.0, 0.0, 100.0]), np.zeros(3), 1200.0)
    reading = np.ones((lidar.pixels, lidar.pixels), dtype=np.float32)
    ground = _level_ground(view) if ranging else None
    unsure = np.eye(6) if ranging else None  # a filter may come with such a sensor
    observation = Observation(0, 0.0, state, plane, reading, 16.0, 20.0, ground, covariance=unsure)
    belief = fuse_look(observation, view, None)
    if unsure is not None:
        observation = replace(observation, covariance=0.25 * unsure)
    HazardAwareSite().price(observation, view, fuse_look(observation, view, belief))


def _level_ground(view: ScenarioView) -> MeasuredGround:
    """A measured look at a square just larger than the lander."""
    side = 2 * math.ceil(view.criteria.footprint_diameter)
    grid = PixelGrid(-side // 2, -side // 2, PIXEL_SIZES[0], side, side)
    height, spread = np.zeros(grid.shape), np.full(grid.shape, 0.01)
    elevation = ElevationMap(grid, height, spread, np.ones(grid.shape, dtype=np.int32))
    return assess_elevation(elevation, view.criteria)
