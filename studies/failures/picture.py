"""Picture of one failed episode: the flight, its last looks, and the ground where it ended."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.episode import ground_point
from hda.flight.look_picture import draw_elevation, draw_verdict
from hda.flight.palette import COLORS
from hda.flight.picture import draw_ground_track
from hda.flight.record import EpisodeRecord
from hda.task.observation import Observation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LOOKS = 4  # last looks that are shown
_NEAR = 15.0  # [m] around the touchdown that is shown


def draw_failure(record: EpisodeRecord, words: str) -> Figure:
    """Draw the ground track, speed and height, the ground at the touchdown, and the last looks.

    Where the sensor measures heights, they stand below the looks.
    """
    from matplotlib.figure import Figure

    measured = record.observations[0].ground is not None
    figure = Figure(figsize=(13.5, 8.0 + 3.4 * measured), layout="constrained")
    grid = figure.add_gridspec(2 + measured, 12, height_ratios=(1.35, 1.0, 1.0)[: 2 + measured])
    draw_ground_track(figure.add_subplot(grid[0, :5]), record)
    _draw_descent(figure.add_subplot(grid[0, 5:8]), record)
    _draw_touchdown(figure.add_subplot(grid[0, 8:]), record)
    looks = record.observations[-_LOOKS:]
    for k, observation in enumerate(looks):
        _draw_look(figure.add_subplot(grid[1, 3 * k : 3 * k + 3]), record, observation)
        if measured:
            heights = figure.add_subplot(grid[2, 3 * k : 3 * k + 3])
            draw_elevation(heights, observation)
            heights.set_title("its measured heights; orange: holes", fontsize="small")
    episode = f"{record.policy}, {record.scenario.preset.name}, episode {record.scenario.streams.episode}: "
    figure.suptitle("\n".join(textwrap.wrap(episode + words, 150)), fontsize="medium")
    return figure


def _draw_descent(axis: Axes, record: EpisodeRecord) -> None:
    ground = float(record.decisions[-1].site[2])
    axis.plot(record.time, record.position[:, 2] - ground, color=COLORS[0], label="height [m]")
    axis.set_xlabel("time [s]")
    axis.set_yscale("symlog", linthresh=10.0)
    axis.set_ylim(bottom=0.0)
    speed = np.linalg.norm(record.velocity, axis=1)
    axis.plot(record.time, speed, color=COLORS[1], label="speed [m/s]")
    tenths = 10.0 * np.linalg.norm(record.thrust, axis=1) / record.scenario.preset.lander.max_thrust
    axis.stairs(tenths, record.time, baseline=None, color="0.6", label="thrust [tenths of the greatest]")
    for observation in record.observations:
        axis.axvline(observation.time, color="0.85", linewidth=0.7, zorder=0)
    axis.legend(loc="lower left", fontsize="x-small", framealpha=0.9)
    axis.grid(alpha=0.25)


def _draw_touchdown(axis: Axes, record: EpisodeRecord) -> None:
    truth = record.scenario.tile.deterministic
    rows, columns = truth.shape
    axis.imshow(truth, origin="lower", extent=(0, columns, 0, rows), cmap="gray", vmin=-0.6, vmax=1.2)
    site = ground_point(record.scenario, record.decisions[-1].site)
    touchdown = record.outcome.touchdown
    axis.plot(record.position[:, 0], record.position[:, 1], color=COLORS[1], linewidth=1.0)
    axis.plot(*site[:2], "o", color=COLORS[0], fillstyle="none", markersize=10, label="site")
    axis.plot(*touchdown[:2], "*", color=COLORS[3], markersize=12, label="touchdown")
    axis.set_xlim(touchdown[0] - _NEAR, touchdown[0] + _NEAR)
    axis.set_ylim(touchdown[1] - _NEAR, touchdown[1] + _NEAR)
    axis.set_title("true map at the touchdown, 30 m wide; light: safe", fontsize="small")
    axis.legend(loc="upper left", fontsize="x-small", framealpha=0.9)


def _draw_look(axis: Axes, record: EpisodeRecord, observation: Observation) -> None:
    draw_verdict(axis, observation)
    site = record.decisions[observation.index].site
    last = record.decisions[-1].site
    axis.plot(*last[:2], "o", color=COLORS[3], fillstyle="none", markersize=9, label="last site")
    axis.plot(*site[:2], "+", color=COLORS[0], markersize=11, markeredgewidth=1.8, label="chosen here")
    before_end = float(record.time[-1]) - observation.time
    axis.set_title(f"look {observation.index}, {before_end:.1f} s before the end", fontsize="small")
    if observation.index == record.observations[-1].index:
        axis.legend(loc="upper left", fontsize="x-small", framealpha=0.9)
