"""The best that a policy limited to the true field of view could have known: an upper bound, by the true map.

`KnowableGround` is the set of cells that some flight could both have seen and reached softly; no policy that
looks before it lands can do better than its best truly safe cell. It is an outer bound, from three facts:

1. Reach. Let R = s - r - v T - g T^2/2 and V = w - v - g T be what thrust must add to reach s with velocity w
   after T seconds. Thrust acceleration u has int u = V and int (1 - t/T) u = R/T, hence int (t/T) u = V - R/T
   and |R/T| + |V - R/T| <= int |u| <= D = v_e ln(m/m_dry), whatever the engine's error (the flow follows the
   applied thrust) and the thrust limit (left out, which only enlarges the set). A landing no faster than w_s
   lessens the left side by at most w_s against w = 0.
2. Sight. A look shows a cell only if the lander stands within the off-nadir limit of its vertical. At the
   first look the square is given; later the policy chooses the centre, so the square excludes nothing.
3. Both. A flight that is at p at the time t_1 of a look and lands T - t_1 = t_2 later meets fact 1 twice; the
   velocity at p cancels by the triangle inequality, and the sum of three impulses
   |(p - r)/t_1 - v - g t_1/2| + |(s - p)/t_2 - (p - r)/t_1 - g T/2| + |(s - p)/t_2 + g t_2/2| <= D + w_s
   must hold for some look and some p in the cone above s. It is convex in p.

Not ruled out is luck: a policy may land, unseeing, on safe ground outside the set within reach, or crash on
it. The times of flight and p are searched on a grid refined by golden sections, with `_ALLOWANCE` to spare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.kernel import compile_kernel
from guidance.state import State
from hda.site_selection import Site
from hda.task.observation import ScenarioView
from hda.task.scenario import Scenario, ground_point

_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_SECTIONS = 18  # of each golden section
_TIMES = 96  # times of flight tried
_HEIGHTS = 16  # heights at the look tried before the golden section
_CELL = math.sqrt(0.5)  # [m] from a cell's centre to its corner
_ALLOWANCE = 1.0  # [m/s] for the grids, and for a touchdown elsewhere in the cell than at its centre


@compile_kernel
def _two_impulses(offset: Array, velocity: Array, pull: float, time: float) -> float:
    """[m/s] of fact 1 for rest at `offset` from the lander; gravity points down the third axis."""
    first, last = 0.0, 0.0
    for axis in range(3):
        fall = 0.5 * pull * time if axis == 2 else 0.0
        first += (offset[axis] / time - velocity[axis] + fall) ** 2
        last += (offset[axis] / time - fall) ** 2
    return math.sqrt(first) + math.sqrt(last)


@compile_kernel
def _three_impulses(
    point: Array, offset: Array, velocity: Array, pull: float, before: float, after: float
) -> float:
    """[m/s] of fact 3; `point`, the lander's place at the look, and `offset` count from the start."""
    first, middle, last = 0.0, 0.0, 0.0
    for axis in range(3):
        g = -pull if axis == 2 else 0.0
        outward, onward = point[axis] / before, (offset[axis] - point[axis]) / after
        first += (outward - velocity[axis] - 0.5 * g * before) ** 2
        middle += (onward - outward - 0.5 * g * (before + after)) ** 2
        last += (onward + 0.5 * g * after) ** 2
    return math.sqrt(first) + math.sqrt(middle) + math.sqrt(last)


@compile_kernel
def _best_bearing(
    height: float, offset: Array, velocity: Array, pull: float, times: tuple[float, float], slope: float
) -> float:
    """Least cost over the rim of the cone above the site, at one height."""
    point = np.empty(3)
    point[2] = offset[2] + height
    radius = slope * height + _CELL
    middle = math.atan2(-offset[1], -offset[0])
    low, high = middle - 0.5 * math.pi, middle + 0.5 * math.pi
    best = np.inf
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    costs = np.empty(2)
    for _ in range(_SECTIONS):
        for side in range(2):
            angle = left if side == 0 else right
            point[0] = offset[0] + radius * math.cos(angle)
            point[1] = offset[1] + radius * math.sin(angle)
            costs[side] = _three_impulses(point, offset, velocity, pull, times[0], times[1])
            best = min(best, costs[side])
        if costs[0] < costs[1]:
            high, right = right, left
            left = high - _GOLDEN * (high - low)
        else:
            low, left = left, right
            right = low + _GOLDEN * (high - low)
    return best


@compile_kernel
def _sees(
    offset: Array, velocity: Array, pull: float, times: tuple[float, float], slope: float, budget: float
) -> bool:
    """Whether fact 3 holds for a look `times[0]` seconds from now and a landing `times[1]` after it."""
    before, after = times
    across = math.sqrt(offset[0] ** 2 + offset[1] ** 2)
    # on the flight of two impulses the lander stands this far from the site's vertical:
    if (
        across * after / (before + after)
        <= slope * after * (-offset[2] / (before + after) + 0.5 * pull * before) + _CELL
    ):
        return _two_impulses(offset, velocity, pull, before + after) <= budget
    top = -offset[2] + 0.5 * velocity[2] ** 2 / pull + 0.5 * pull * (before + after) ** 2
    best, cheapest = 0, np.inf
    for k in range(_HEIGHTS + 1):
        cost = _best_bearing(top * k / _HEIGHTS, offset, velocity, pull, times, slope)
        if cost < cheapest:
            best, cheapest = k, cost
    low, high = top * max(best - 1, 0) / _HEIGHTS, top * min(best + 1, _HEIGHTS) / _HEIGHTS
    for _ in range(_SECTIONS):
        if cheapest <= budget:
            return True
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        at_left = _best_bearing(left, offset, velocity, pull, times, slope)
        at_right = _best_bearing(right, offset, velocity, pull, times, slope)
        cheapest = min(cheapest, at_left, at_right)
        low, high = (low, right) if at_left < at_right else (left, high)
    return cheapest <= budget


@compile_kernel
def _is_knowable(
    offset: Array,
    velocity: Array,
    numbers: tuple[float, float, float, float],
    seen_at_first: bool,
    looks: bool,
) -> bool:
    """Facts 1 to 3; `numbers` = (pull, budget, interval, slope); without `looks` fact 1 alone."""
    pull, budget, interval, slope = numbers
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    longest = (budget + speed) / pull  # |V| alone costs more beyond
    for k in range(1, _TIMES + 1):
        time = longest * k / _TIMES
        if _two_impulses(offset, velocity, pull, time) > budget:
            continue
        if seen_at_first or not looks:
            return True
        look = interval
        while look < time - 1e-9:
            if _sees(offset, velocity, pull, (look, time - look), slope, budget):
                return True
            look += interval
    return False


@dataclass(frozen=True, eq=False)
class KnowableGround:
    """Where a flight could have landed softly on ground that it had seen; an outer bound.

    Attributes:
        state: the true one at the first look.
        target: [m] shape (3,), where the centre of the first look truly lies on the target plane.
        width: [m] side of the first look.
        view: vehicle and sensor.
        soft_speed: [m/s] greatest vertical and horizontal speed of a soft touchdown.
    """

    state: State
    target: Array
    width: float
    view: ScenarioView
    soft_speed: float

    @property
    def budget(self) -> float:
        """[m/s] D + w_s of the facts, and the allowance."""
        lander = self.view.lander
        velocity_change = lander.exhaust_velocity * math.log(self.state.mass / lander.dry_mass)
        return velocity_change + math.sqrt(2.0) * self.soft_speed + _ALLOWANCE

    def contains(self, site: Array) -> bool:
        """Whether a flight could have seen `site`, shape (3,) on the plane, and landed softly there."""
        return self._holds(site, looks=True)

    def within_reach(self, site: Array) -> bool:
        """Whether a flight could have landed softly at `site`, seen or not."""
        return self._holds(site, looks=False)

    def _holds(self, site: Array, looks: bool) -> bool:
        offset = np.asarray(site, dtype=np.float64) - self.state.position
        slope = math.tan(self.view.lidar.off_nadir_limit)
        in_square = bool(np.abs(site[:2] - self.target[:2]).max() <= 0.5 * self.width + _CELL)
        near = math.hypot(offset[0], offset[1]) <= slope * -offset[2] + _CELL
        numbers = (-float(self.view.gravity[2]), self.budget, self.view.decision_interval, slope)
        return _is_knowable(offset, self.state.velocity, numbers, in_square and near, looks)


def nearest_known_site(ground: KnowableGround, safe: NDArray[np.bool_]) -> Site | None:
    """Centre of the wanted cell of the set that is nearest to the first look's, or None if there is none.

    Args:
        ground: the set.
        safe: shape (rows, columns), the wanted cells of the tile.
    """
    row, column = np.nonzero(safe)
    square = (column + 0.5 - ground.target[0]) ** 2 + (row + 0.5 - ground.target[1]) ** 2
    for k in np.argsort(square, kind="stable"):
        site: Site = np.array([column[k] + 0.5, row[k] + 0.5, float(ground.target[2])])
        if ground.contains(site):
            return site
    return None


@compile_kernel
def _least_two_impulses(offsets: Array, velocity: Array, pull: float, longest: float) -> float:
    """[m/s] of fact 1 at the offset, shape (n, 3), and the time of flight that cost least."""
    best = np.inf
    for row in range(offsets.shape[0]):
        low, high = longest / _TIMES, longest
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        at_left = _two_impulses(offsets[row], velocity, pull, left)
        at_right = _two_impulses(offsets[row], velocity, pull, right)
        for _ in range(_SECTIONS):
            if at_left < at_right:
                high, right, at_right = right, left, at_left
                left = high - _GOLDEN * (high - low)
                at_left = _two_impulses(offsets[row], velocity, pull, left)
            else:
                low, left, at_left = left, right, at_right
                right = low + _GOLDEN * (high - low)
                at_right = _two_impulses(offsets[row], velocity, pull, right)
        best = min(best, at_left, at_right)
    return best


def first_ground(scenario: Scenario) -> KnowableGround:
    """The knowable ground of an episode, at its start."""
    preset, state = scenario.preset, scenario.initial_state
    target = ground_point(scenario, scenario.nominal_target)
    width = preset.lidar.width(state.position, target)
    return KnowableGround(state, target, width, scenario.view, preset.rules.soft_speed)


def could_have_landed(scenario: Scenario) -> bool:
    """Whether the episode's knowable ground holds truly safe ground: the ceiling of any policy that looks."""
    return nearest_known_site(first_ground(scenario), scenario.tile.deterministic) is not None


def least_propellant(scenario: Scenario) -> float:
    """Share of the propellant without which no soft landing on truly safe ground is possible (fact 1).

    Infinite where the tile has no safe ground.
    """
    ground = first_ground(scenario)
    row, column = np.nonzero(scenario.tile.deterministic)
    if row.size == 0:
        return math.inf
    sites = np.column_stack([column + 0.5, row + 0.5, np.full(row.size, ground.target[2])])
    state, view = ground.state, ground.view
    pull = -float(view.gravity[2])
    longest = (ground.budget + float(np.linalg.norm(state.velocity))) / pull
    cost = _least_two_impulses(sites - state.position, state.velocity, pull, longest)
    spared = math.sqrt(2.0) * ground.soft_speed + _ALLOWANCE
    burnt = state.mass * -math.expm1(-max(cost - spared, 0.0) / view.lander.exhaust_velocity)
    return burnt / (state.mass - view.lander.dry_mass)
