"""The floor on propellant: the truly safe site that is cheapest to reach, by the true map."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.two_impulse import divert_cost
from hda.observation import Observation, ScenarioView
from hda.site_selection import Site, safe_clearance
from hda.tile import Tile


def cheapest_clear_site(tile: Tile, observation: Observation, view: ScenarioView, clearance: float) -> Site:
    """Centre of the truly safe cell that is cheapest to reach with `clearance` [m] of safe ground around.

    Where no cell has that much, of those with most the cheapest is given.
    """
    room = safe_clearance(tile)
    rows, columns = room.shape
    plane = float(observation.target[2])
    cost = divert_cost(
        observation.state, np.arange(columns) + 0.5, np.arange(rows) + 0.5, plane, view.lander, view.gravity
    )
    clear = room >= min(clearance, float(room.max()))
    row, column = divmod(int(np.argmin(np.where(clear, cost, np.inf))), columns)
    return np.array([column + 0.5, row + 0.5, plane])


@dataclass(frozen=True, eq=False)
class CheapestSafeSite:
    """Privileged: the truly safe site of least propellant.

    Attributes:
        truth: the tile that is being flown.
        clearance: [m] of safe ground around the site.
    """

    truth: Tile = field(repr=False)
    clearance: float = 2.0

    def begin(self, view: ScenarioView) -> tuple[ScenarioView, NDArray[np.float64] | None]:
        """No site yet."""
        return view, None

    def select(
        self, observation: Observation, memory: tuple[ScenarioView, Site | None]
    ) -> tuple[Site, tuple[ScenarioView, Site]]:
        """Choose at the first look, then stay."""
        view, site = memory
        if site is None:
            site = cheapest_clear_site(self.truth, observation, view, self.clearance)
        return site, (view, site)
