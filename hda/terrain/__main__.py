"""Command line of `python -m hda.terrain`: draw a generated tile, its slopes and its safety map."""

from __future__ import annotations

import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from guidance.console import one_line_errors, tolerate_encoding
from hda.safety.criteria import DEFAULT_CRITERIA, SafetyCriteria
from hda.safety.safety_map import assess_safety
from hda.terrain.base_surface import rms_slope
from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng
from hda.terrain.picture import draw_terrain
from hda.terrain.settings import PAPER_TERRAIN

if TYPE_CHECKING:
    pass


def show_terrain(
    seed: int = 0,
    show: Annotated[Path | None, tyro.conf.arg(metavar="PATH")] = None,
    parameters: Annotated[TerrainParameters, tyro.conf.arg(name="")] = PAPER_TERRAIN,
    criteria: SafetyCriteria = DEFAULT_CRITERIA,
) -> None:
    """Make one tile, print what it is like and draw it.

    Args:
        seed: number of the tile; the same number gives the same tile.
        show: picture to write (PNG, PDF or SVG by its suffix); none is written by default.
        parameters: what the ground is like; by default that of the preset `paper`.
        criteria: what counts as safe.
    """
    if seed < 0:
        raise ValueError(f"seed must not be negative, got {seed}")
    if show is not None:
        show.parent.mkdir(parents=True, exist_ok=True)
    generate_terrain(parameters, terrain_rng(seed))  # compiles, so that the time below is that of the work
    started = time.perf_counter()
    dem = generate_terrain(parameters, terrain_rng(seed))
    elapsed = time.perf_counter() - started
    safety = assess_safety(
        dem,
        parameters.pixel_size,
        footprint_diameter=criteria.footprint_diameter,
        pad_diameter=criteria.pad_diameter,
        max_slope=criteria.max_slope,
        max_roughness=criteria.max_roughness,
        range_noise=criteria.range_noise,
    )
    console = Console(highlight=False)
    console.print(f"tile {seed}: {parameters.size} x {parameters.size} cells of {parameters.pixel_size:g} m")
    console.print(f"generation time   {elapsed:.3f} s (compiled)")
    console.print(f"hazard share      {1.0 - safety.deterministic.mean():.3f}")
    slope = math.degrees(rms_slope(dem, parameters.pixel_size))
    console.print(f"RMS slope         {slope:.2f} deg over {parameters.pixel_size:g} m, rocks included")
    console.print(f"elevation         {dem.min():.1f} to {dem.max():.1f} m")
    if show is not None:
        draw_terrain(dem, safety, parameters.pixel_size, criteria.max_slope).savefig(show, dpi=150)
        console.print(f"picture           {show}")


def main() -> None:
    """Run the command; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        tyro.cli(show_terrain)


if __name__ == "__main__":
    sys.argv[0] = "python -m hda.terrain"  # what --help says
    main()
