"""The named settings of the benchmark, and scenarios drawn from them.

The numbers of `paper` and `hard` come from `python -m studies.calibrate` on the tuning tiles; the README
shows what they give beside the paper's row. `partial` is the ground of `paper` seen badly, so that one look
is not enough: five times its map noise, two looks of five without a map, and errors of the estimated state.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from hda.ground.library import Ground, load_tile, tile_numbers
from hda.ground.elevation_file import NoData
from hda.terrain.islands import IslandField
from hda.sensing.lidar import Lidar
from hda.task.own_ground import place_on_terrain
from hda.ground.own_terrain import open_own_terrain
from hda.task.random_streams import EpisodeStreams
from hda.terrain.rocks import RockPopulation
from hda.task.scenario import Preset, Rules, Scenario, draw_scenario
from hda.terrain.generator import TerrainParameters

BLOCKY_ROCKS = RockPopulation(area_fraction=0.3, decay_constant=0.6, decay_slope=0.0)
"""Dense large blocks, of which almost no pin-hole of safe ground is left between the islands. The Mars fit's
q (2.55 at k = 0.2) leaves 1.5 % of the rocky ground safe in specks, this 0.04 %; an engineering choice, not a
site."""

BOULDERS = RockPopulation(
    area_fraction=0.5, decay_constant=0.8, decay_slope=0.0, minimum_diameter=0.8, maximum_diameter=4.0
)
"""Boulders of 0.8 m and more over a quarter of the ground: 0.008 % of it is left safe between the islands."""

PAPER_TERRAIN = TerrainParameters(rocks=BLOCKY_ROCKS, islands=IslandField(20.0, threshold=-0.8))

PRESETS: dict[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(name="paper", terrain=PAPER_TERRAIN),
        Preset(
            name="hard",
            terrain=TerrainParameters(rocks=BOULDERS, islands=IslandField(25.0, threshold=-1.0)),
        ),
        Preset(
            name="partial",
            terrain=PAPER_TERRAIN,
            lidar=Lidar(noise=0.25, dropout=0.4),
            rules=Rules(navigation_position_error=0.5, navigation_velocity_error=0.1),
        ),
    )
}
"""The presets by name."""


def find_preset(preset: str | Preset) -> Preset:
    """Give the preset of a name (a Preset passes through).

    Raises:
        ValueError: there is no such preset; the nearest valid names are given.
    """
    if isinstance(preset, Preset):
        return preset
    if preset not in PRESETS:
        raise ValueError(unknown_name("preset", preset, PRESETS))
    return PRESETS[preset]


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


def unknown_name(kind: str, name: object, valid: Iterable[str]) -> str:
    """Say that a name is unknown, with the nearest valid names first."""
    names = sorted(valid)
    near = difflib.get_close_matches(str(name), names, n=3, cutoff=0.4)
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    return f"unknown {kind} {name!r}{hint} (valid: {', '.join(names)})"


def sample_scenario(
    preset: str | Preset = "paper", study_seed: int = 0, episode: int = 0, split: str = "validation"
) -> Scenario:
    """Draw episode `episode` of the study `study_seed`: always the same, whatever else is drawn.

    Args:
        preset: name of a preset, or a Preset.
        study_seed: seed of the study, at least zero.
        episode: number of the episode, at least zero.
        split: train, tuning, validation or fresh; evaluation belongs on the last two. `own` on a preset
            from `place_preset`.

    Returns:
        The scenario. Its tile is built on first use and cached.

    Raises:
        ValueError: unknown preset or split, or a negative seed or episode.
    """
    setting = find_preset(preset)
    ground = Ground(setting.terrain, setting.criteria)
    return draw_scenario(
        setting,
        EpisodeStreams(study_seed, episode),
        split,
        tile_numbers(split, ground),
        lambda number: load_tile(ground, number, split),
    )
