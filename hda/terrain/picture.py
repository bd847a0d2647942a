"""Pictures of a tile: shaded relief, slope and safety map, side by side."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console

from hda.terrain.base_surface import rms_slope
from hda.task.presets import PAPER_TERRAIN
from hda.safety.safety_map import DEFAULT_CRITERIA, SafetyCriteria, SafetyMap, assess_safety
from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUN_AZIMUTH = 315.0  # [deg] clockwise from north
SUN_ELEVATION = 30.0  # [deg]
STEEPEST_SHOWN = 30.0  # [deg] upper end of the slope's colours


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


def draw_terrain(
    dem: NDArray[np.floating], safety: SafetyMap, pixel_size: float = 1.0, max_slope: float | None = None
) -> Figure:
    """Draw a tile: relief lit from the north-west, worst slope of the lander, probability of a safe landing.

    Args:
        dem: (m, n) elevation [m].
        safety: its safety map.
        pixel_size: [m] side of a cell.
        max_slope: [rad] slope limit, marked on the slope's colour bar.

    Returns:
        The figure, not tied to any window. Its colours keep their order in grey and for colour-blind readers.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LightSource
    from matplotlib.figure import Figure

    figure = Figure(figsize=(17.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    relief_axes, slope_axes, safety_axes = figure.subplots(1, 3, sharex=True, sharey=True)
    sun = LightSource(azdeg=SUN_AZIMUTH, altdeg=SUN_ELEVATION)
    # LightSource takes row 0 for the north edge unless told otherwise by the sign of dy.
    shade = sun.hillshade(np.asarray(dem, dtype=np.float64), dx=pixel_size, dy=-pixel_size)
    _show_map(relief_axes, shade, pixel_size, "shaded relief", cmap="gray")
    steepness = np.degrees(safety.slope)
    image = _show_map(
        slope_axes, steepness, pixel_size, "worst slope", cmap="viridis", vmin=0.0, vmax=STEEPEST_SHOWN
    )
    bar = figure.colorbar(image, ax=slope_axes, label="slope [deg]", extend="max")
    if max_slope is not None:
        bar.ax.axhline(math.degrees(max_slope), color="white", linewidth=2.0)
    image = _show_map(
        safety_axes, safety.probability, pixel_size, "safety map", cmap="cividis", vmin=0.0, vmax=1.0
    )
    figure.colorbar(image, ax=safety_axes, label="probability of safe ground [-]")
    relief_axes.set_ylabel("north [m]")
    return figure


def _show_map(axes: Axes, values: NDArray[np.floating], pixel_size: float, title: str, **style: object):
    rows, columns = values.shape
    axes.set_title(title)
    axes.set_xlabel("east [m]")
    extent = (0.0, columns * pixel_size, 0.0, rows * pixel_size)
    return axes.imshow(values, origin="lower", extent=extent, interpolation="nearest", **style)  # pyright: ignore[reportArgumentType]
