"""hazard-aware that is told the true map at a look, by path: `studies.information_bound.told:look=2`.

What each further look of ignorance costs is the price of not knowing the map until then.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from hda.ground.tile import Tile
from hda.policies.beliefs.belief import GroundBelief
from hda.policies.composition import PrivilegedComposition
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.waiting_descent import WaitingDescent
from hda.task.observation import Observation, ScenarioView
from hda.task.presets import Preset
from hda.task.scenario import Scenario


@dataclass(frozen=True)
class ToldSite(HazardAwareSite):
    """Privileged: the site of hazard-aware, with the true map for its belief from a look on.

    Attributes:
        truth: the tile that is being flown.
        look: number of the look, from 0.
    """

    truth: Tile = field(kw_only=True, repr=False)
    look: int = field(kw_only=True)

    def price(
        self, observation: Observation, view: ScenarioView, belief: GroundBelief, within: float = math.inf
    ) -> Array:
        """[kg] J of every cell, shape (n, n); `within` as in `price_sites`."""
        if observation.index < self.look:
            return super().price(observation, view, belief, within)
        return self.price_by(true_square(self.truth, belief), observation, view, belief, within)


def true_square(tile: Tile, belief: GroundBelief) -> NDArray[np.float32]:
    """Shape (n, n): 1 where a cell of the belief's square is safe, else 0; nothing beside the map is safe."""
    out = np.zeros((belief.side, belief.side), dtype=np.float32)
    column, row = belief.corner
    rows, columns = tile.deterministic.shape
    south, west = max(-row, 0), max(-column, 0)
    north, east = min(belief.side, rows - row), min(belief.side, columns - column)
    if south < north and west < east:
        out[south:north, west:east] = tile.deterministic[
            row + south : row + north, column + west : column + east
        ]
    return out


def check_frame(preset: Preset) -> None:
    """Refuse a preset on which the lander errs about where it is: the map it is told would lie aside.

    Raises:
        ValueError: it does.
    """
    if preset.rules.navigation_position_error or preset.navigation is not None:
        raise ValueError(f"preset: the lander must know where it is on the map; on {preset.name!r} it errs")


def told_name(look: int) -> str:
    """Name in tables of hazard-aware that is told the map at a look."""
    return f"hazard-aware.told-{look}"


def told_path(look: int) -> str:
    """Path of it."""
    return f"{__name__}:look={look}"


def tell_map(look: int) -> PrivilegedComposition:
    """hazard-aware that is told the map at a look; on presets whose frame is the map's.

    Raises:
        ValueError: the number of the look is negative.
    """
    if look < 0:
        raise ValueError(f"look must be at least 0, got {look}")

    def select(scenario: Scenario) -> ToldSite:
        check_frame(scenario.preset)
        return ToldSite(truth=scenario.tile, look=look)

    return PrivilegedComposition(told_name(look), select, WaitingDescent())


def __getattr__(name: str) -> PrivilegedComposition:
    """Give the policy of an attribute `look=number`."""
    key, equals, value = name.partition("=")
    try:
        if key == "look" and equals:
            return tell_map(int(value))
    except ValueError as error:
        raise AttributeError(str(error)) from error
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
