"""Pictures of flights: over the true safety map, and against time; and a flight as arrays on the disk."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from guidance.arrays import Array
from hda.flight.palette import COLORS
from hda.flight.record import EpisodeRecord
from hda.ground.tile import Tile
from hda.task.observation import Observation
from hda.task.scenario import Scenario, ground_point

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARGIN = 40.0  # [m] around a flight's ground track
_LEAST_SHOWN = 130.0  # [m] half side of the ground that is shown, at least


def save_flight(path: Path, record: EpisodeRecord) -> None:
    """Keep a flight as NPZ without pickle: time, path (n, 7), thrust (n - 1, 3), sites (decisions, 3).

    Of a rigid body `body_path` (n, 17) is kept too.
    """
    arrays: dict[str, Any] = {"time": record.time, "path": record.path, "thrust": record.thrust}
    arrays["sites"] = np.array([decision.site for decision in record.decisions])
    if record.body_path is not None:
        arrays["body_path"] = record.body_path
    np.savez_compressed(path, **arrays)


def draw_flight(record: EpisodeRecord) -> Figure:
    """Draw one flight: over the true safety map with the shrinking field of view, and against time.

    Returns:
        The figure, not tied to any window.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 6.5), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.1, 1.0))
    draw_ground_track(figure.add_subplot(grid[:, 0]), record)
    altitude = figure.add_subplot(grid[0, 1])
    speed = figure.add_subplot(grid[1, 1], sharex=altitude)
    thrust = figure.add_subplot(grid[2, 1], sharex=altitude)
    altitude.plot(record.time, record.position[:, 2], color=COLORS[0])
    altitude.set_ylabel("altitude [m]")
    draw_velocity(speed, record)
    draw_thrust(thrust, record)
    for axis in (altitude, speed, thrust):
        axis.grid(alpha=0.25)
        for observation in record.observations:
            axis.axvline(observation.time, color="0.8", linewidth=0.7, zorder=0)
    outcome = record.outcome
    figure.suptitle(
        f"{record.policy}, episode {record.scenario.streams.episode}: {outcome.ending},"
        f" {outcome.touchdown_speed:.2f} m/s, {100.0 * outcome.propellant_fraction:.1f} % propellant"
    )
    return figure


def draw_velocity(axis: Axes, record: EpisodeRecord) -> None:
    """Draw the components of the velocity against time."""
    for k, name in enumerate(("east", "north", "up")):
        axis.plot(record.time, record.velocity[:, k], color=COLORS[k], label=name)
    axis.set_ylabel("velocity [m/s]")
    axis.legend(loc="lower right", frameon=False, ncols=3)


def draw_thrust(axis: Axes, record: EpisodeRecord) -> None:
    """Draw the size of the applied thrust, as it is held, against time."""
    magnitude = np.linalg.norm(record.thrust, axis=1)
    axis.stairs(magnitude, record.time, baseline=None, color=COLORS[1])
    axis.set_ylabel("thrust [N]")
    axis.set_xlabel("time [s]")


def draw_ground_track(axis: Axes, record: EpisodeRecord) -> None:
    """Draw a flight over the true safety map, with its targets and its field of view at each look."""
    draw_true_safety(axis, record.scenario.tile)
    for observation in record.observations:
        draw_field_of_view(axis, observation, record.scenario)
    sites = flown_sites(record)
    axis.plot(record.position[:, 0], record.position[:, 1], color=COLORS[1], label="flight")
    axis.plot(sites[:, 0], sites[:, 1], "o-", color=COLORS[0], markersize=4, linewidth=0.8, label="targets")
    axis.plot(*record.outcome.touchdown[:2], "*", color=COLORS[3], markersize=14, label="touchdown")
    west, east, south, north = shown_ground(record)
    axis.set_xlim(west, east)
    axis.set_ylim(south, north)
    axis.set_title("light: safe; squares: field of view at each look", fontsize="medium")
    axis.legend(loc="upper left", framealpha=0.9)


def flown_sites(record: EpisodeRecord) -> Array:
    """[m] shape (decisions + 1, 3), first target and the site of each decision, on the true ground."""
    sites = [record.scenario.nominal_target, *(decision.site for decision in record.decisions)]
    return np.array([ground_point(record.scenario, site) for site in sites])


def shown_ground(record: EpisodeRecord) -> tuple[float, float, float, float]:
    """[m] west, east, south and north end of the square of ground that a flight is shown on."""
    shown = np.vstack([record.position[:, :2], flown_sites(record)[:, :2]])
    east, north = (shown.min(axis=0) + shown.max(axis=0)) / 2.0
    half = max(float((shown.max(axis=0) - shown.min(axis=0)).max()) / 2.0 + _MARGIN, _LEAST_SHOWN)
    return east - half, east + half, north - half, north + half


def draw_true_safety(axis: Axes, tile: Tile) -> None:
    """Draw the true safety map of a tile, in metres; safe ground is light."""
    rows, columns = tile.deterministic.shape
    extent = (0, columns, 0, rows)
    axis.imshow(tile.deterministic, origin="lower", extent=extent, cmap="gray", vmin=-0.6, vmax=1.2)
    axis.set_xlabel("east [m]")
    axis.set_ylabel("north [m]")


def draw_field_of_view(axis: Axes, observation: Observation, scenario: Scenario) -> None:
    """Draw the square that a look covers, about its target, on the true ground."""
    from matplotlib.patches import Rectangle

    east, north = (float(value) for value in ground_point(scenario, observation.target)[:2])
    side = observation.width
    corner = (east - 0.5 * side, north - 0.5 * side)
    axis.add_patch(Rectangle(corner, side, side, fill=False, color=COLORS[4]))
