"""Pictures of a comparison: the paper's histograms, and one flight per policy over the safety map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hda.flight.episode import fly
from hda.flight.palette import COLORS
from hda.flight.picture import draw_flight, save_flight
from hda.task.scenario import sample_scenario
from studies.campaign.monte_carlo import Study
from studies.campaign.score import label_measure
from studies.compare.histograms import MeasureHistograms
from studies.compare.scores import StudyScores

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
        draw_flight(record).savefig(figures / f"trajectory-{stem}.png", dpi=110)
        save_flight(trajectories / f"{stem}.npz", record)


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
