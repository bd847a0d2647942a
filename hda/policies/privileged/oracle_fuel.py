"""The floor on propellant: the truly safe site that is cheapest to reach, by the true map."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from guidance.arrays import Array
from guidance.two_impulse import divert_cost
from hda.ground.tile import Tile
from hda.policies.hazard_aware import load_kernels
from hda.policies.privileged.oracle import ON_MAP, frame_offset, put_on_map, safe_clearance
from hda.safety.touchdown_stance import Footing, set_down
from hda.sensing.ranging import RangingLidar
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import Scenario

_BLOCK = 8  # [m] side of the blocks that are priced by their middle first


def cheapest_clear_site(tile: Tile, observation: Observation, view: ScenarioView, clearance: float) -> Site:
    """Centre of the truly safe cell that is cheapest to reach with `clearance` [m] of safe ground around.

    Where no cell has that much, of those with most the cheapest is given. Blocks of ground are searched from
    the cheapest middle on, until none that is left can hold a cheaper cell: propellant bends over hundreds of
    metres, so within a block it falls by little more than the steepest step between two middles. Observation
    and site are told by the map.
    """
    room = safe_clearance(tile)
    clear = room >= min(clearance, float(room.max()))
    plane = float(observation.target[2])

    def price(south: float, west: float, count: tuple[int, ...], step: float) -> Array:
        rows, columns = (np.arange(number, dtype=np.float64) for number in count)
        east, north = west + step * columns, south + step * rows
        return divert_cost(observation.state, east, north, plane, view.lander, view.gravity)

    blocks = tuple(-(-size // _BLOCK) for size in clear.shape)
    middle = price(0.5 * _BLOCK, 0.5 * _BLOCK, blocks, _BLOCK)
    fall = sum(float(np.abs(np.diff(middle, axis=axis)).max(initial=0.0)) for axis in (0, 1))
    best, site = np.inf, np.empty(0)
    for index in np.argsort(middle, axis=None, kind="stable").tolist():
        block = divmod(index, middle.shape[1])
        if middle[block] - fall > best:
            break
        first_row, first_column = (k * _BLOCK for k in block)
        rows, columns = np.nonzero(
            clear[first_row : first_row + _BLOCK, first_column : first_column + _BLOCK]
        )
        if rows.size == 0:
            continue
        cost = price(first_row + 0.5, first_column + 0.5, (_BLOCK, _BLOCK), 1.0)[rows, columns]
        least = int(np.argmin(cost))
        if cost[least] < best:
            best = float(cost[least])
            site = np.array([first_column + columns[least] + 0.5, first_row + rows[least] + 0.5, plane])
    return site


@dataclass(frozen=True, eq=False)
class CheapestSafeSite:
    """Privileged: the truly safe site of least propellant.

    Attributes:
        truth: the tile that is being flown.
        clearance: [m] of safe ground around the site.
        footing: the lander over the true ground, for the height of the site; None on the target plane.
        offset: [m] shape (3,), of the frame that sites are given in from the map.
    """

    truth: Tile = field(repr=False)
    clearance: float = 2.0
    footing: Footing | None = field(default=None, repr=False)
    offset: Array = field(default_factory=lambda: ON_MAP, repr=False)

    @classmethod
    def informed(cls, truth: Scenario) -> CheapestSafeSite:
        """Make the selection that knows the tile of this scenario."""
        return cls(truth.tile, footing=truth.footing, offset=frame_offset(truth))

    def begin(self, view: ScenarioView) -> tuple[ScenarioView, Site | None]:
        """No site yet; the map of clearances is made here, once per tile."""
        load_kernels(ranging=isinstance(view.lidar, RangingLidar))
        safe_clearance(self.truth)
        return view, None

    def select(
        self, observation: Observation, memory: tuple[ScenarioView, Site | None]
    ) -> tuple[Site, tuple[ScenarioView, Site]]:
        """Choose at the first look, then stay."""
        view, site = memory
        if site is None:
            chosen = self.choose(put_on_map(observation, self.offset), view)
            site = set_down(self.footing, chosen) + self.offset
        return site, (view, site)

    def choose(self, observation: Observation, view: ScenarioView) -> Site:
        """The cheapest site, from the first look's state; observation and site are told by the map."""
        return cheapest_clear_site(self.truth, observation, view, self.clearance)
