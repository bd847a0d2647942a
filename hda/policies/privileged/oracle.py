"""The nearest truly safe ground with clearance: a site selection that sees the true map."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from guidance.state import State
from hda.ground.tile import Tile
from hda.policies.beliefs.surroundings import squared_distance
from hda.safety.touchdown_stance import Footing, set_down
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import Scenario, frame_point

ON_MAP = np.zeros(3)
"""Frame of policies that is the map's own."""


@lru_cache(maxsize=32)
def safe_clearance(tile: Tile) -> NDArray[np.float32]:
    """[m] from each cell's centre to the nearest unsafe cell's edge along an axis; shape of the tile.

    Zero or less on unsafe cells; the outside of the map is unsafe.
    """
    unsafe = np.pad(~tile.deterministic, 1, constant_values=True)
    distance = np.sqrt(squared_distance(unsafe, limit=sum(unsafe.shape)))
    return (distance[1:-1, 1:-1] - 0.5).astype(np.float32)


def nearest_clear_site(tile: Tile, target: Site, clearance: float) -> Site:
    """Centre of the truly safe cell nearest to `target` with at least `clearance` [m] of safe ground around.

    Where no cell has that much, the one with most is given.
    """
    room = safe_clearance(tile)
    rows, columns = np.nonzero(room >= clearance)
    if rows.size == 0:
        rows, columns = (np.array([index]) for index in np.unravel_index(int(np.argmax(room)), room.shape))
    square = (columns + 0.5 - target[0]) ** 2 + (rows + 0.5 - target[1]) ** 2
    best = int(np.argmin(square))
    return np.array([columns[best] + 0.5, rows[best] + 0.5, target[2]])


def frame_offset(truth: Scenario) -> Array:
    """[m] shape (3,), by which the policies' frame stands off the map where a filter makes that frame.

    It is zero without a filter: the constant error of `partial` is one that no policy is told, these neither.
    """
    return ON_MAP if truth.preset.navigation is None else frame_point(truth, np.zeros(3))


def put_on_map(observation: Observation, offset: Array) -> Observation:
    """An observation whose state and target are told by the map: taken back by the frame's offset [m]."""
    seen = observation.state
    state = State(seen.position - offset, seen.velocity, seen.mass)
    return replace(observation, state=state, target=observation.target - offset)


@dataclass(frozen=True, eq=False)
class OracleSite:
    """Privileged: the truly safe cell nearest to the first target with some clearance.

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
    def informed(cls, truth: Scenario) -> OracleSite:
        """Make the selection that knows the tile of this scenario."""
        return cls(truth.tile, footing=truth.footing, offset=frame_offset(truth))

    def begin(self, view: ScenarioView) -> None:
        """No site yet."""

    def select(self, observation: Observation, memory: Site | None) -> tuple[Site, Site]:
        """Choose once, then stay."""
        if memory is None:
            site = nearest_clear_site(self.truth, observation.target - self.offset, self.clearance)
            memory = set_down(self.footing, site) + self.offset
        return memory, memory
