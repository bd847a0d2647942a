"""A setting of the benchmark on a user's own ground: the tiles over which an episode can begin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich.console import Console

from hda.ground.detail import GroundDetail
from hda.ground.elevation_file import NoData
from hda.ground.library import Ground, load_tile, prepare_tiles
from hda.ground.own_terrain import OWN_SPLIT, OwnTerrain, open_own_terrain
from hda.ground.undeclared_voids import name_tiles
from hda.task.first_target import describe_lack, probe_tile
from hda.task.presets import Preset, find_preset


def place_on_terrain(setting: Preset, terrain: OwnTerrain, workers: int) -> Preset:
    """Put a setting on a terrain, without the tiles that have too little hazard; those are named on stderr.

    Args:
        setting: with the start conditions that are to hold there.
        terrain: the user's own.
        workers: processes that build tiles.

    Raises:
        ValueError: no tile has enough hazard.
    """
    words = [setting.name, terrain.file.stem]
    if terrain.detail is not None:
        words.append(terrain.detail.rock_abundance)
    placed = replace(setting, name="-".join(words), terrain=terrain)
    ground = Ground(terrain, placed.criteria)
    prepare_tiles(ground, OWN_SPLIT, workers)
    probes = {
        number: probe_tile(load_tile(ground, number, OWN_SPLIT), setting.start) for number in terrain.tiles
    }
    too_safe = tuple(number for number, (enough, _) in probes.items() if not enough)
    if not too_safe:
        return placed
    most = max(probes[number][1] for number in too_safe)
    lacking = (
        f"{describe_lack(setting.start)} (the most was {most:.1%}); a smaller hazard_share (--hazard-share)"
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


def place_preset(
    preset: str | Preset,
    file: Path,
    *,
    pixel_size: float | None = None,
    band: int | None = None,
    nodata: NoData = None,
    flat_is_ground: bool = False,
    detail: GroundDetail | None = None,
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
        detail: hazards that are added to a model with posts of more than 1 m, which cannot show them.
        hazard_share: in place of the preset's; a smaller one lets episodes begin over safer ground.
        workers: processes that build tiles.

    Returns:
        The preset, named after both, and after the abundance of rocks where detail is added.

    Raises:
        ValueError: an argument is out of range, the file cannot be used, or no tile has enough places for a
            first target.
    """
    setting = find_preset(preset)
    if hazard_share is not None:
        setting = replace(setting, start=replace(setting.start, hazard_share=hazard_share))
    terrain = open_own_terrain(
        file, pixel_size, band=band, nodata=nodata, flat_is_ground=flat_is_ground, detail=detail
    )
    return place_on_terrain(setting, terrain, workers)
