"""Reachability steering: fly to where the ground that can be reached and will be seen is safest on average.

After Tomita and Ho ("Powered descent decision making: a reachability-steering approach", AIAA SciTech, 2026),
whose lander maximises the safety of what lies both within its reach and within its field of view. While there
is a look to come, each target on a lattice is judged by the mean probability of safety over the cells that
the look from there would show (its square, and its cone about the vertical) and that could still be reached
from there with the propellant left. The best is steered to. Near the end the site itself is chosen: the
nearest within reach that is likely to be safe, else the likeliest.

Deviations. The paper on this law could not be read; what it maximises is from the summary in the abstract of
Ou and Ozaki (ISSFD, 2026). Safety is the belief from all looks of `hazard_aware`, which is not theirs (they
process a Gaussian elevation map, arXiv 2409.09309). Reach is by the propellant of the two-impulse estimate,
with a share kept in reserve, and not by a learnt or convex set. The lander is taken to fly ZEM/ZEV 6/2 to the
target until the next look, undisturbed, whichever law it is composed with. When to choose the site is not
known; it is set on tuning episodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.polynomial.descent_polynomial import Arrival, meet_arrival
from guidance.state import State
from guidance.two_impulse import divert_cost
from guidance.upright_time import upright_time_to_go
from guidance.validation import finite_number, whole_number
from hda.policies.beliefs.belief import GroundBelief
from hda.policies.hazard_aware import (
    HazardAwareMemory,
    fuse_look,
    judge_ground,
    landing_spread,
    load_kernels,
)
from hda.policies.rivals.map_smoothing import smooth_map
from hda.sensing.ranging import RangingLidar
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True)
class SteeringOptions:
    """How targets and the site are chosen; tuned on tuning episodes of `paper` (docs/explanation/rivals.md).

    Attributes:
        selection_time: [s] with less time to go than this the landing site is chosen.
        commit_time: [s] with less than this it is kept whatever is seen.
        reserve: share of the propellant on board that reach leaves.
        targets: along each side of the lattice of targets, over the present look.
        samples: along each side of the square of a look, at which safety is averaged.
        dispersion: [m] standard deviation of the touchdown about the site, along each axis.
        likely: a landing this likely to be safe is as good as a safer one that lies further.

    Raises:
        ValueError: an option means nothing.
    """

    selection_time: float = 22.5
    commit_time: float = 2.5
    reserve: float = 0.2
    targets: int = 9
    samples: int = 32
    dispersion: float = 0.3
    likely: float = 0.99

    def __post_init__(self) -> None:
        """Refuse options that mean nothing."""
        finite_number("selection_time", self.selection_time, at_least=0.0)
        finite_number("commit_time", self.commit_time, at_least=0.0)
        for name in ("reserve", "likely"):
            finite_number(name, getattr(self, name), at_least=0.0, at_most=1.0)
        for name in ("targets", "samples"):
            whole_number(name, getattr(self, name), at_least=2)
        finite_number("dispersion", self.dispersion, above=0.0)


@dataclass(frozen=True)
class ReachabilitySteeringSite:
    """Site selection by the mean safety of what can be reached and will be seen.

    Attributes:
        options: how targets and the site are chosen.
    """

    options: SteeringOptions = SteeringOptions()

    def begin(self, view: ScenarioView) -> HazardAwareMemory:
        """Nothing seen yet."""
        load_kernels(ranging=isinstance(view.lidar, RangingLidar))
        return HazardAwareMemory(view)

    def select(self, observation: Observation, memory: HazardAwareMemory) -> tuple[Array, HazardAwareMemory]:
        """Steer while there is a look to come, then choose the site."""
        view, left, options = memory.view, observation.time_to_go, self.options
        first = memory.belief is None
        belief = fuse_look(observation, view, memory.belief)
        memory = HazardAwareMemory(view, belief)
        low = observation.state.position[2] <= observation.target[2]
        if low or not belief.seen.any() or (not first and left <= options.commit_time):
            return observation.target, memory
        safe = judge_ground(belief)
        if left - view.decision_interval <= options.commit_time or left <= options.selection_time:
            return self.landing_site(safe, observation, view, belief), memory
        targets = self._lattice(observation)
        worth = [self.mean_safety(target, safe, observation, view, belief) for target in targets]
        return observation.settled(targets[int(np.argmax(worth))]), memory

    def _lattice(self, observation: Observation) -> Array:
        """[m] shape (k, 3): the present target, first so that it wins ties, and the lattice's others."""
        offset = np.linspace(-0.5, 0.5, self.options.targets) * observation.width
        north, east = (part.ravel() for part in np.meshgrid(offset, offset, indexing="ij"))
        across = np.stack([east, north, np.zeros(east.size)], axis=1)
        return observation.target + np.vstack([np.zeros((1, 3)), across[across.any(axis=1)]])

    def mean_safety(
        self,
        target: Array,
        safe: NDArray[np.float32],
        observation: Observation,
        view: ScenarioView,
        belief: GroundBelief,
    ) -> float:
        """Mean probability of safety over what the next look would show and leave in reach; 0 if nothing.

        Args:
            target: [m] shape (3,), steered to until then.
            safe: shape (n, n), probability that each cell of the belief's square is safe; ground beyond the
                square is not counted.
            observation: the present look.
            view: the scenario.
            belief: whose square it is.
        """
        state, lidar = self._next_state(target, observation, view), view.lidar
        if state.position[2] <= target[2]:
            return 0.0
        half = 0.5 * lidar.width(state.position, target)
        offset = np.linspace(-half, half, self.options.samples)
        x, y = target[0] + offset, target[1] + offset
        height = float(state.position[2] - target[2])
        across = (y[:, None] - state.position[1]) ** 2 + (x - state.position[0]) ** 2
        counted = across <= (np.tan(lidar.off_nadir_limit) * height) ** 2
        counted &= self._within_reach(state, x, y, float(target[2]), view)
        (rows, north), (columns, east) = (
            _cells_of(place, belief.corner[axis], belief.side) for axis, place in ((1, y), (0, x))
        )
        counted &= north[:, None] & east
        return float(safe[np.ix_(rows, columns)][counted].mean()) if counted.any() else 0.0

    def _next_state(self, target: Array, observation: Observation, view: ScenarioView) -> State:
        """At the next look, after an undisturbed flight towards a target; the mass by the thrust's mean."""
        state, interval = observation.state, np.array([view.decision_interval])
        seconds = max(upright_time_to_go(state, target, view.lander, view.gravity), 2.0 * interval[0])
        flight = meet_arrival(state, Arrival(target), seconds)
        ends = np.array([0.0, interval[0]])
        thrust = np.linalg.norm(flight.acceleration_at(ends) - view.gravity, axis=1).mean()
        mass = state.mass * np.exp(-thrust * interval[0] / view.lander.exhaust_velocity)
        return State(flight.position_at(interval)[0], flight.velocity_at(interval)[0], float(mass))

    def _within_reach(
        self, state: State, x: Array, y: Array, plane: float, view: ScenarioView
    ) -> NDArray[np.bool_]:
        """Shape (len(y), len(x)), where a landing leaves the reserve: estimated at nine points."""
        east, north = (knots[[0, (knots.size - 1) // 2, -1]] for knots in (x, y))
        cost = divert_cost(state, east, north, plane, view.lander, view.gravity)
        across = np.array([np.interp(x, east, row) for row in cost])
        whole = np.array([np.interp(y, north, column) for column in across.T]).T
        on_board = max(state.mass - view.lander.dry_mass, 0.0)
        return whole <= (1.0 - self.options.reserve) * on_board

    def landing_site(
        self, safe: NDArray[np.float32], observation: Observation, view: ScenarioView, belief: GroundBelief
    ) -> Array:
        """[m] shape (3,): the reachable cell most likely to be landed on safely, of several the nearest."""
        options, target, plane = self.options, observation.target, float(observation.target[2])
        reach = int(np.ceil(observation.width))
        middle = np.floor(target[:2]).astype(np.int64) - np.array(belief.corner)
        first, last = np.maximum(middle - reach, 0), np.minimum(middle + reach + 1, belief.side)
        if (first >= last).any():
            return target
        near = np.s_[first[1] : last[1], first[0] : last[0]]
        x, y = (np.arange(first[axis], last[axis]) + belief.corner[axis] + 0.5 for axis in (0, 1))
        landing = smooth_map(safe[near].astype(np.float64), landing_spread(observation, options.dispersion))
        landing[~self._within_reach(observation.state, x, y, plane, view)] = 0.0
        distance = (y[:, None] - target[1]) ** 2 + (x - target[0]) ** 2
        likely = landing >= min(options.likely, float(landing.max()))
        if not landing.any():
            return target
        row, column = divmod(int(np.argmin(np.where(likely, distance, np.inf))), x.size)
        if distance[row, column] < 0.5:
            return target
        return observation.settled(np.array([x[column], y[row], plane]))


def _cells_of(place: Array, corner: int, side: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Cells along an axis of the square at some places [m], and whether each lies within the square."""
    cells = np.floor(place).astype(np.int64) - corner
    return np.clip(cells, 0, side - 1), (cells >= 0) & (cells < side)
