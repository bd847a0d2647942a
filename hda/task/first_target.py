"""First targets: places around which enough of the ground is unsafe, and tiles that have them."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from guidance.arrays import Array
from hda.ground.tile import Tile
from hda.task.rules import StartConditions

_DRAWS = 10_000
_FOUND = 20
"""A tile on which so few of the draws are first targets is not flown: an episode that makes as many draws of
its own would then find none with a probability of 2e-9 and more."""

_offers: WeakKeyDictionary[Tile, dict[StartConditions, bool]] = WeakKeyDictionary()


def draw_target(tile: Tile, start: StartConditions, plane: float, rng: np.random.Generator) -> Array:
    """Draw the first target: uniform over the target area, where enough of the ground around is unsafe.

    Returns:
        [m] shape (3,).

    Raises:
        ValueError: no such place was found on the tile in 10 000 draws; the message says what the best was.
    """
    area, best = start.target_area, 0.0
    for _ in range(_DRAWS):
        target = np.array([area.draw(rng), area.draw(rng), plane])
        share = tile.hazard_share(target, start.hazard_radius)
        if share >= start.hazard_share:
            return target
        best = max(best, share)
    raise ValueError(
        f"tile {tile.number}: no target with at least {start.hazard_share:.0%} hazard"
        f" within {start.hazard_radius:g} m found in {_DRAWS} draws (the most was {best:.1%});"
        " a smaller start.hazard_share allows safer ground"
    )


def probe_tile(tile: Tile, start: StartConditions) -> tuple[bool, float]:
    """Whether enough of 10 000 draws are first targets, and the most hazard that was seen around one.

    The draws are keyed by the tile's number, so that the answer is always the same.
    """
    rng, area = np.random.default_rng(max(tile.number, 0)), start.target_area
    found, most = 0, 0.0
    for _ in range(_DRAWS):
        share = tile.hazard_share(np.array([area.draw(rng), area.draw(rng)]), start.hazard_radius)
        most = max(most, share)
        found += share >= start.hazard_share
        if found == _FOUND:
            return True, most
    return False, most


def offers_targets(tile: Tile, start: StartConditions) -> bool:
    """Whether episodes begin over a tile; `probe_tile`, once for each tile in memory."""
    known = _offers.setdefault(tile, {})
    if start not in known:
        known[start] = probe_tile(tile, start)[0]
    return known[start]


def describe_lack(start: StartConditions) -> str:
    """What a tile that is not flown over lacks, in words that follow "not enough"."""
    return (
        f"first targets with at least {start.hazard_share:.0%} hazard within {start.hazard_radius:g} m: fewer"
        f" than {_FOUND} found in {_DRAWS} draws"
    )
