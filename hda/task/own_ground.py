"""A setting of the benchmark on a user's own ground: the tiles over which an episode can begin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rich.console import Console

from hda.ground.library import Ground, load_tile, prepare_tiles
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain
from hda.task.scenario import Preset, StartConditions
from hda.ground.tile import Tile
from hda.ground.undeclared_voids import name_tiles

_DRAWS = 10_000
_FOUND = 20
"""A tile on which so few of the draws are first targets is not flown: an episode that makes as many draws of
its own would then find none with a probability of 2e-9 and more."""


def place_on_terrain(setting: Preset, terrain: OwnTerrain, workers: int) -> Preset:
    """Put a setting on a terrain, without the tiles that have too little hazard; those are named on stderr.

    Args:
        setting: with the start conditions that are to hold there.
        terrain: the user's own.
        workers: processes that build tiles.

    Raises:
        ValueError: no tile has enough hazard.
    """
    placed = replace(setting, name=f"{setting.name}-{terrain.file.stem}", terrain=terrain)
    ground = Ground(terrain, placed.criteria)
    prepare_tiles(ground, OWN_SPLIT, workers)
    probes = {
        number: _probe_tile(load_tile(ground, number, OWN_SPLIT), setting.start) for number in terrain.tiles
    }
    too_safe = tuple(number for number, (enough, _) in probes.items() if not enough)
    if not too_safe:
        return placed
    start = setting.start
    lacking = (
        f"first targets with at least {start.hazard_share:.0%} hazard within {start.hazard_radius:g} m: fewer"
        f" than {_FOUND} found in {_DRAWS} draws (the most was"
        f" {max(probes[number][1] for number in too_safe):.1%}); a smaller hazard_share (--hazard-share)"
        " allows safer ground"
    )
    if len(too_safe) == len(terrain.tiles):
        raise ValueError(f"{terrain.file}: no tile has enough {lacking}")
    Console(stderr=True).print(
        f"{terrain.file.name}: {len(too_safe)} of {len(terrain.tiles)} tiles are not flown over,"
        f" {name_tiles(too_safe)}: not enough {lacking}",
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    return replace(placed, terrain=replace(terrain, too_safe=too_safe))


def _probe_tile(tile: Tile, start: StartConditions) -> tuple[bool, float]:
    """Whether enough draws are first targets, and the most hazard that was seen around one."""
    rng, area = np.random.default_rng(tile.number), start.target_area
    found, most = 0, 0.0
    for _ in range(_DRAWS):
        share = tile.hazard_share(np.array([area.draw(rng), area.draw(rng)]), start.hazard_radius)
        most = max(most, share)
        found += share >= start.hazard_share
        if found == _FOUND:
            return True, most
    return False, most
