"""The nearest truly safe ground with clearance: a site selection that sees the true map."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hda.ground.tile import Tile
from hda.policies.beliefs.surroundings import squared_distance
from hda.safety.touchdown_stance import NO_GROUND, Footing, set_down
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import Scenario


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


@dataclass(frozen=True, eq=False)
class OracleSite:
    """Privileged: the truly safe cell nearest to the first target with some clearance.

    Attributes:
        truth: the tile that is being flown.
        clearance: [m] of safe ground around the site.
        footing: the lander over the true ground, for the height of the site; none on the target plane.
    """

    truth: Tile = field(repr=False)
    clearance: float = 2.0
    footing: Footing = field(default=NO_GROUND, repr=False)

    @classmethod
    def informed(cls, truth: Scenario) -> OracleSite:
        """Make the selection that knows the tile of this scenario."""
        return cls(truth.tile, footing=truth.footing)

    def begin(self, view: ScenarioView) -> None:
        """No site yet."""

    def select(self, observation: Observation, memory: Site | None) -> tuple[Site, Site]:
        """Choose once, then stay."""
        if memory is None:
            site = nearest_clear_site(self.truth, observation.target, self.clearance)
            memory = set_down(self.footing, site)
        return memory, memory
