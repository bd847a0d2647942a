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

Sight is that of a look at the target plane. A ranging LIDAR sees the ground below it, some metres past the
square and the cone: there fact 2 and what needs it are no bound, fact 1 (`least_propellant`) holds as ever.

Not ruled out is luck: a policy may land, unseeing, on safe ground outside the set within reach, or crash on
it. The times of flight and p are searched on a grid refined by golden sections, with `_ALLOWANCE` to spare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.golden_section import divide, keep_lower, keep_upper
from guidance.kernel import compile_kernel
from guidance.state import State
from hda.sensing.ranging import RangingLidar
from hda.site_selection import Site
from hda.task.observation import ScenarioView
from hda.task.scenario import Scenario, ground_point

_SECTIONS = 18  # of each golden section
_TIMES = 96  # times of flight tried
_HEIGHTS = 16  # heights at the look tried before the golden section
_CELL = math.sqrt(0.5)  # [m] from a cell's centre to its corner
_ALLOWANCE = 1.0  # [m/s] for the grids, and for a touchdown elsewhere in the cell than at its centre


class _LookTimes(NamedTuple):
    """[s] from the start to the look, and from there to the landing."""

    before: float
    after: float


class _FactNumbers(NamedTuple):
    """What the facts need beside the geometry.

    Attributes:
        gravity: [m/s^2] downward.
        budget: [m/s] D + w_s, and the allowance.
        interval: [s] between looks.
        slope: tangent of the off-nadir limit.
    """

    gravity: float
    budget: float
    interval: float
    slope: float


@compile_kernel
def _two_impulses(offset: Array, velocity: Array, gravity: float, time: float) -> float:
    """[m/s] of fact 1 for rest at `offset` from the lander; gravity points down the third axis."""
    first, last = 0.0, 0.0
    for axis in range(3):
        fall = 0.5 * gravity * time if axis == 2 else 0.0
        first += (offset[axis] / time - velocity[axis] + fall) ** 2
        last += (offset[axis] / time - fall) ** 2
    return math.sqrt(first) + math.sqrt(last)


@compile_kernel
def _three_impulses(
    point: tuple[float, float, float], offset: Array, velocity: Array, gravity: float, times: _LookTimes
) -> float:
    """[m/s] of fact 3; `point`, the lander's place at the look, and `offset` count from the start."""
    before, after = times
    first, middle, last = 0.0, 0.0, 0.0
    for axis in range(3):
        g = -gravity if axis == 2 else 0.0
        outward, onward = point[axis] / before, (offset[axis] - point[axis]) / after
        first += (outward - velocity[axis] - 0.5 * g * before) ** 2
        middle += (onward - outward - 0.5 * g * (before + after)) ** 2
        last += (onward + 0.5 * g * after) ** 2
    return math.sqrt(first) + math.sqrt(middle) + math.sqrt(last)


@compile_kernel
def _bearing_cost(
    angle: float, height: float, offset: Array, velocity: Array, numbers: _FactNumbers, times: _LookTimes
) -> float:
    """[m/s] of fact 3 for a look from the rim of the cone above the site, at one height and bearing."""
    radius = numbers.slope * height + _CELL
    point = (offset[0] + radius * math.cos(angle), offset[1] + radius * math.sin(angle), offset[2] + height)
    return _three_impulses(point, offset, velocity, numbers.gravity, times)


@compile_kernel
def _best_bearing(
    height: float, offset: Array, velocity: Array, numbers: _FactNumbers, times: _LookTimes
) -> float:
    """Least cost over the rim of the cone above the site, at one height."""
    middle = math.atan2(-offset[1], -offset[0])
    bracket = divide(middle - 0.5 * math.pi, middle + 0.5 * math.pi)
    at_first = _bearing_cost(bracket.first, height, offset, velocity, numbers, times)
    at_second = _bearing_cost(bracket.second, height, offset, velocity, numbers, times)
    best = min(at_first, at_second)
    for _ in range(_SECTIONS - 1):
        if at_first < at_second:
            bracket, at_second = keep_lower(bracket), at_first
            at_first = _bearing_cost(bracket.first, height, offset, velocity, numbers, times)
        else:
            bracket, at_first = keep_upper(bracket), at_second
            at_second = _bearing_cost(bracket.second, height, offset, velocity, numbers, times)
        best = min(best, at_first, at_second)
    return best


@compile_kernel
def _sees(offset: Array, velocity: Array, numbers: _FactNumbers, times: _LookTimes) -> bool:
    """Whether fact 3 holds for a look and a landing at these times."""
    before, after = times
    gravity, budget = numbers.gravity, numbers.budget
    across = math.sqrt(offset[0] ** 2 + offset[1] ** 2)
    # on the flight of two impulses the lander stands this far from the site's vertical:
    if (
        across * after / (before + after)
        <= numbers.slope * after * (-offset[2] / (before + after) + 0.5 * gravity * before) + _CELL
    ):
        return _two_impulses(offset, velocity, gravity, before + after) <= budget
    top = -offset[2] + 0.5 * velocity[2] ** 2 / gravity + 0.5 * gravity * (before + after) ** 2
    best, cheapest = 0, np.inf
    for k in range(_HEIGHTS + 1):
        cost = _best_bearing(top * k / _HEIGHTS, offset, velocity, numbers, times)
        if cost < cheapest:
            best, cheapest = k, cost
    bracket = divide(top * max(best - 1, 0) / _HEIGHTS, top * min(best + 1, _HEIGHTS) / _HEIGHTS)
    at_first = _best_bearing(bracket.first, offset, velocity, numbers, times)
    at_second = _best_bearing(bracket.second, offset, velocity, numbers, times)
    for _ in range(_SECTIONS):
        cheapest = min(cheapest, at_first, at_second)
        if cheapest <= budget:
            return True
        if at_first < at_second:
            bracket, at_second = keep_lower(bracket), at_first
            at_first = _best_bearing(bracket.first, offset, velocity, numbers, times)
        else:
            bracket, at_first = keep_upper(bracket), at_second
            at_second = _best_bearing(bracket.second, offset, velocity, numbers, times)
    return False


@compile_kernel
def _is_knowable(
    offset: Array, velocity: Array, numbers: _FactNumbers, seen_at_first: bool, looks: bool
) -> bool:
    """Facts 1 to 3; without `looks` fact 1 alone."""
    gravity, budget = numbers.gravity, numbers.budget
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    longest = (budget + speed) / gravity  # |V| alone costs more beyond
    for k in range(1, _TIMES + 1):
        time = longest * k / _TIMES
        if _two_impulses(offset, velocity, gravity, time) > budget:
            continue
        if seen_at_first or not looks:
            return True
        look = numbers.interval
        while look < time - 1e-9:
            if _sees(offset, velocity, numbers, _LookTimes(look, time - look)):
                return True
            look += numbers.interval
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
        gravity = -float(self.view.gravity[2])
        numbers = _FactNumbers(gravity, self.budget, self.view.decision_interval, slope)
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
def _least_two_impulses(offsets: Array, velocity: Array, gravity: float, longest: float) -> float:
    """[m/s] of fact 1 at the offset, shape (n, 3), and the time of flight that cost least."""
    best = np.inf
    for row in range(offsets.shape[0]):
        bracket = divide(longest / _TIMES, longest)
        at_first = _two_impulses(offsets[row], velocity, gravity, bracket.first)
        at_second = _two_impulses(offsets[row], velocity, gravity, bracket.second)
        for _ in range(_SECTIONS):
            if at_first < at_second:
                bracket, at_second = keep_lower(bracket), at_first
                at_first = _two_impulses(offsets[row], velocity, gravity, bracket.first)
            else:
                bracket, at_first = keep_upper(bracket), at_second
                at_second = _two_impulses(offsets[row], velocity, gravity, bracket.second)
        best = min(best, at_first, at_second)
    return best


def first_ground(scenario: Scenario) -> KnowableGround:
    """The knowable ground of an episode, at its start."""
    preset, state = scenario.preset, scenario.initial_state
    target = ground_point(scenario, scenario.nominal_target)
    width = preset.lidar.width(state.position, target)
    return KnowableGround(state, target, width, scenario.view, preset.rules.soft_speed)


def true_heights(scenario: Scenario, rows: NDArray[np.int_], columns: NDArray[np.int_]) -> Array:
    """[m] shape (n,), where a landing on each cell ends: on the target plane, or on the true ground."""
    if scenario.preset.stance is None:
        return np.full(rows.size, float(scenario.nominal_target[2]))
    return scenario.tile.elevation[rows, columns].astype(np.float64)


def could_have_landed(scenario: Scenario) -> bool:
    """Whether the episode's knowable ground holds truly safe ground: the ceiling of any policy that looks.

    Raises:
        ValueError: the sensor measures ranges, so that the set is no bound.
    """
    preset = scenario.preset
    if isinstance(preset.lidar, RangingLidar):
        raise ValueError(f"preset must not measure ranges, by which looks see too far; {preset.name!r} does")
    return nearest_known_site(first_ground(scenario), scenario.tile.deterministic) is not None


def least_propellant(scenario: Scenario) -> float:
    """Share of the propellant without which no soft landing on truly safe ground is possible (fact 1).

    Infinite where the tile has no safe ground.
    """
    ground = first_ground(scenario)
    row, column = np.nonzero(scenario.tile.deterministic)
    if row.size == 0:
        return math.inf
    sites = np.column_stack([column + 0.5, row + 0.5, true_heights(scenario, row, column)])
    state, view, gravity = ground.state, ground.view, -float(ground.view.gravity[2])
    longest = (ground.budget + float(np.linalg.norm(state.velocity))) / gravity
    cost = _least_two_impulses(sites - state.position, state.velocity, gravity, longest)
    spared = math.sqrt(2.0) * ground.soft_speed + _ALLOWANCE
    burnt = state.mass * -math.expm1(-max(cost - spared, 0.0) / view.lander.exhaust_velocity)
    return burnt / (state.mass - view.lander.dry_mass)
