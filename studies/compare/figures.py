"""Pictures of a comparison: the paper's histograms, and one flight per policy over the safety map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.task.scenario import sample_scenario
from studies.campaign.monte_carlo import Study
from studies.campaign.score import label_measure
from studies.compare.histograms import MeasureHistograms
from studies.compare.scores import StudyScores

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
"""Okabe and Ito's palette, told apart by colour-blind readers."""

_PANELS = (
    "reward",
    "miss_distance_m",
    "touchdown_speed_mps",
    "maximum_thrust_n",
    "minimum_slant_angle_deg",
)
"""Measures whose distributions the paper shows."""


def draw_figures(out: Path, study: Study, scores: StudyScores) -> None:
    """Draw histograms into out/figures, one flight per policy too, and keep its path in out/trajectories."""
    figures, trajectories = out / "figures", out / "trajectories"
    figures.mkdir(exist_ok=True)
    trajectories.mkdir(exist_ok=True)
    draw_histograms(study, scores.histograms).savefig(figures / "histograms.png", dpi=110)
    scenario = sample_scenario(study.preset, study.study_seed, scores.hardest, study.split)
    for name in study.policies:
        record = fly(study.make_policy(name), scenario)
        stem = f"{name}-{scenario.streams.episode:06d}"
        draw_flight(figures / f"trajectory-{stem}.png", record)
        save_flight(trajectories / f"{stem}.npz", record)


def save_flight(path: Path, record: EpisodeRecord) -> None:
    """Keep a flight as NPZ without pickle: time, path (n, 7), thrust (n - 1, 3), sites (decisions, 3)."""
    sites = np.array([decision.site for decision in record.decisions])
    np.savez_compressed(path, time=record.time, path=record.path, thrust=record.thrust, sites=sites)


def draw_histograms(study: Study, histograms: MeasureHistograms) -> Figure:
    """Draw the distributions that the paper shows, as step histograms of equal bins."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 7), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for axis, name in zip(axes, _PANELS, strict=False):
        for k, policy in enumerate(study.policies):
            counts, color = histograms.count(name, policy), COLORS[k % len(COLORS)]
            axis.stairs(counts, histograms.edges[name], label=policy, color=color, linewidth=1.6)
        axis.set_xlabel(label_measure(name))
        axis.set_ylabel("episodes")
        axis.grid(alpha=0.25)
    handles, labels = axes[0].get_legend_handles_labels()
    axes[-1].axis("off")
    axes[-1].legend(handles, labels, loc="center", frameon=False)
    figure.suptitle(f"preset {study.preset.name}, {study.episodes} episodes; end bins hold what lies beyond")
    return figure


def draw_flight(path: Path, record: EpisodeRecord) -> None:
    """Draw one flight: over the true safety map with the shrinking field of view, and against time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 6.5), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.1, 1.0))
    draw_ground_track(figure.add_subplot(grid[:, 0]), record)
    altitude = figure.add_subplot(grid[0, 1])
    speed = figure.add_subplot(grid[1, 1], sharex=altitude)
    thrust = figure.add_subplot(grid[2, 1], sharex=altitude)
    altitude.plot(record.time, record.position[:, 2], color=COLORS[0])
    altitude.set_ylabel("altitude [m]")
    for k, name in enumerate(("east", "north", "up")):
        speed.plot(record.time, record.velocity[:, k], color=COLORS[k], label=name)
    speed.set_ylabel("velocity [m/s]")
    speed.legend(loc="lower right", frameon=False, ncols=3)
    magnitude = np.linalg.norm(record.thrust, axis=1)
    thrust.stairs(magnitude, record.time, baseline=None, color=COLORS[1])
    thrust.set_ylabel("thrust [N]")
    thrust.set_xlabel("time [s]")
    for axis in (altitude, speed, thrust):
        axis.grid(alpha=0.25)
        for observation in record.observations:
            axis.axvline(observation.time, color="0.8", linewidth=0.7, zorder=0)
    outcome = record.outcome
    figure.suptitle(
        f"{record.policy}, episode {record.scenario.streams.episode}: {outcome.ending},"
        f" {outcome.touchdown_speed:.2f} m/s, {100.0 * outcome.propellant_fraction:.1f} % propellant"
    )
    figure.savefig(path, dpi=110)


def draw_ground_track(axis: Axes, record: EpisodeRecord) -> None:
    """Draw a flight over the true safety map, with its targets and its field of view at each look."""
    from matplotlib.patches import Rectangle

    tile = record.scenario.tile
    rows, columns = tile.deterministic.shape
    axis.imshow(
        tile.deterministic, origin="lower", extent=(0, columns, 0, rows), cmap="gray", vmin=-0.6, vmax=1.2
    )
    for observation in record.observations:
        corner = observation.target[:2] - observation.width / 2.0
        square = Rectangle(
            (float(corner[0]), float(corner[1])),
            observation.width,
            observation.width,
            fill=False,
            color=COLORS[4],
        )
        axis.add_patch(square)
    sites = np.array([record.scenario.nominal_target, *(decision.site for decision in record.decisions)])
    axis.plot(record.position[:, 0], record.position[:, 1], color=COLORS[1], label="flight")
    axis.plot(sites[:, 0], sites[:, 1], "o-", color=COLORS[0], markersize=4, linewidth=0.8, label="targets")
    axis.plot(*record.outcome.touchdown[:2], "*", color=COLORS[3], markersize=14, label="touchdown")
    shown = np.vstack([record.position[:, :2], sites[:, :2]])
    middle = (shown.min(axis=0) + shown.max(axis=0)) / 2.0
    reach = max(float((shown.max(axis=0) - shown.min(axis=0)).max()) / 2.0 + 40.0, 130.0)
    axis.set_xlim(middle[0] - reach, middle[0] + reach)
    axis.set_ylim(middle[1] - reach, middle[1] + reach)
    axis.set_xlabel("east [m]")
    axis.set_ylabel("north [m]")
    axis.set_title("light: safe; squares: field of view at each look", fontsize="medium")
    axis.legend(loc="upper left", framealpha=0.9)
