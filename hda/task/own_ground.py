"""A setting of the benchmark on a user's own ground: the tiles over which an episode can begin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from hda.ground.elevation_file import NoData
from hda.ground.library import Ground, load_tile, prepare_tiles
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain, open_own_terrain
from hda.ground.tile import Tile
from hda.ground.undeclared_voids import name_tiles
from hda.task.presets import Preset, find_preset
from hda.task.rules import StartConditions

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


def place_preset(
    preset: str | Preset,
    file: Path,
    *,
    pixel_size: float | None = None,
    band: int | None = None,
    nodata: NoData = None,
    flat_is_ground: bool = False,
    hazard_share: float | None = None,
    workers: int = 2,
) -> Preset:
    """Put a setting on a user's own ground: the same rules, starts, sensor and lander on their terrain.

    Every tile is built, cached, and tried for first targets, so that what cannot be flown fails here. A tile
    with too few of them is left out and named on stderr; `preset.terrain.too_safe` holds its number.
    Scenarios are then drawn with `split="own"`.

    Args:
        preset: name of a preset, or a Preset.
        file: GeoTIFF or .npy, see `hda.ground.own_terrain.open_own_terrain`.
        pixel_size: [m] of an .npy file; 1 if left out.
        band: of a GeoTIFF, counted from 1; needed where there are several.
        nodata: numbers in the file that mean unknown ground, one or several, besides that which it declares.
        flat_is_ground: an area of one exact height is ground, though it looks like a value that stands for
            unknown ground.
        hazard_share: in place of the preset's; a smaller one lets episodes begin over safer ground.
        workers: processes that build tiles.

    Returns:
        The preset, named after both.

    Raises:
        ValueError: an argument is out of range, the file cannot be used, or no tile has enough places for a
            first target.
    """
    setting = find_preset(preset)
    if hazard_share is not None:
        setting = replace(setting, start=replace(setting.start, hazard_share=hazard_share))
    terrain = open_own_terrain(file, pixel_size, band=band, nodata=nodata, flat_is_ground=flat_is_ground)
    return place_on_terrain(setting, terrain, workers)
