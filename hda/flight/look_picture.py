"""Pictures of measured looks: the heights that the lander saw, their holes, its verdict, and the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from guidance.arrays import Array
from hda.flight.palette import COLORS
from hda.flight.picture import draw_true_safety
from hda.flight.record import EpisodeRecord
from hda.task.observation import Observation
from hda.task.scenario import Scenario, ground_point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HOLE_COLOR = COLORS[1]
_PERCENTILES = (2.0, 98.0)  # of the heights, between which the colours lie


def draw_elevation(axis: Axes, observation: Observation, colors: str = "cividis") -> None:
    """Draw the measured heights, holes in a colour of their own, over the look's square.

    Args:
        axis: where.
        observation: of a ranging LIDAR.
        colors: matplotlib's name of the heights' colour map.

    Raises:
        ValueError: the sensor gave no heights.
    """
    height, grid = observation.elevation, observation.elevation_grid
    if height is None or grid is None:
        raise ValueError("observation must have measured heights; its sensor gives the map alone")
    if height.size > 0:
        from matplotlib import colormaps

        west, south = grid.corner
        side = grid.pixel_size
        low, high = np.nanpercentile(height, _PERCENTILES) if np.isfinite(height).any() else (0.0, 1.0)
        axis.imshow(
            np.ma.masked_invalid(height),
            origin="lower",
            extent=(west, west + grid.columns * side, south, south + grid.rows * side),
            cmap=colormaps[colors].with_extremes(bad=HOLE_COLOR),
            vmin=float(low),
            vmax=max(float(high), float(low) + 0.1),
        )
    _frame(axis, observation.target, observation.width)


def draw_verdict(axis: Axes, observation: Observation) -> None:
    """Draw the observed probability of safety over the look's square; safe ground is light."""
    half = 0.5 * observation.width
    x, y = (float(value) for value in observation.target[:2])
    axis.imshow(
        observation.safety_map,
        origin="lower",
        extent=(x - half, x + half, y - half, y + half),
        cmap="gray",
        vmin=-0.6,
        vmax=1.2,
    )
    _frame(axis, observation.target, observation.width)


def draw_truth(axis: Axes, observation: Observation, scenario: Scenario) -> None:
    """Draw the true safety over the look's square, where it really lies; safe ground is light."""
    draw_true_safety(axis, scenario.tile)
    axis.set_xlabel("")
    axis.set_ylabel("")
    _frame(axis, ground_point(scenario, observation.target), observation.width)


def draw_looks(record: EpisodeRecord, most: int = 6) -> Figure:
    """Draw a flight look by look: measured heights, verdict, and true safety side by side, a row for each.

    Args:
        record: a flight with a ranging LIDAR.
        most: looks that are shown, spread over the flight, the first and the last among them.

    Raises:
        ValueError: its sensor gave no heights, or `most` is below 1.
    """
    from matplotlib.figure import Figure

    if most < 1:
        raise ValueError(f"most must be at least 1, got {most}")
    looks = len(record.observations)
    numbers = sorted({round(k) for k in np.linspace(0, looks - 1, min(most, looks))})
    figure = Figure(figsize=(10.5, 0.6 + 3.3 * len(numbers)), layout="constrained")
    axes = figure.subplots(len(numbers), 3, squeeze=False)
    for row, number in zip(axes, numbers, strict=True):
        observation, site = record.observations[number], record.decisions[number].site
        grid = observation.elevation_grid
        draw_elevation(row[0], observation)
        draw_verdict(row[1], observation)
        draw_truth(row[2], observation, record.scenario)
        for axis, place in zip(row, (site, site, ground_point(record.scenario, site)), strict=True):
            axis.plot(*place[:2], "+", color=COLORS[0], markersize=11, markeredgewidth=1.8)
        height = observation.state.position[2] - observation.target[2]
        cells = 0.0 if grid is None else grid.pixel_size
        row[0].set_title(f"look {number}, {height:.0f} m above the target: heights in cells of {cells:g} m")
        row[1].set_title("verdict on board")
        row[2].set_title("true safety")
        for axis in row:
            axis.title.set_fontsize("small")
    figure.suptitle(
        f"{record.policy}, {record.scenario.preset.name}, episode {record.scenario.streams.episode}:"
        f" {record.outcome.ending}; light: safe, orange: holes, cross: site chosen"
    )
    return figure


def _frame(axis: Axes, target: Array, width: float) -> None:
    """Show the look's square alone."""
    half = 0.5 * width
    x, y = (float(value) for value in target[:2])
    axis.set_xlim(x - half, x + half)
    axis.set_ylim(y - half, y + half)
    axis.tick_params(labelsize="x-small")
    axis.ticklabel_format(useOffset=False)
