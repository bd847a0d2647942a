"""Pictures of learning: a run, and what an encoder keeps of looks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from guidance.arrays import Array
from rl.figures.options import ReconstructionFigure, TrainingFigure
from rl.figures.sheet import open_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def moving_average(values: Array, window: int) -> Array:
    """Mean of the last `window` values, or of as many as there are."""
    total = np.cumsum(np.insert(values, 0, 0.0))
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(ends - window, 0)
    return (total[ends] - total[starts]) / (ends - starts)


def draw_training(options: TrainingFigure) -> Figure:
    """Four panels as in the paper's training log; the deterministic policy's tuning score is added.

    Raises:
        ValueError: the folder holds no log.
    """
    from rl.training.run_folder import read_rows

    rows = read_rows(options.run / "training.csv")
    if not rows:
        raise ValueError(f"{options.run} holds no training.csv with rows")
    figure = open_figure(9.0, 6.0)
    panels: Any = figure.subplots(2, 2)
    names = ("critic_loss", "actor_loss", "reward", "safe_ratio")
    for panel, name in zip(panels.flat, names, strict=True):
        kept = [row for row in rows if row[name]]
        steps = np.array([int(row["step"]) for row in kept])
        values = np.array([float(row[name]) for row in kept])
        panel.plot(steps, values, color="0.8")
        panel.plot(steps, moving_average(values, options.window), label="while exploring")
        panel.set_title(name.replace("_", " "))
        panel.set_xlabel("environment steps")
    panels[0, 0].set_yscale("log")
    scores = read_rows(options.run / "validation.csv")
    steps = [int(row["step"]) for row in scores]
    panels[1, 0].plot(steps, [float(row["reward"]) for row in scores], ".-", label="policy, tuning tiles")
    safe = [float(row["safe_site_percent"]) / 100.0 for row in scores]
    panels[1, 1].plot(steps, safe, ".-", label="policy, tuning tiles")
    panels[1, 1].legend()
    return figure


def draw_reconstruction(options: ReconstructionFigure) -> Figure:
    """Original looks above, reconstructions below, from the validation tiles."""
    from hda.task.presets import find_preset
    from rl.inference.latent import load_autoencoder
    from rl.learning.autoencoder import autoencoder_from_tensors, collect_maps, reconstruct

    maps = collect_maps(find_preset(options.preset), "validation", options.columns, options.seed)
    maps = maps[(maps > 127).mean((1, 2)) > 0.02]  # some ground to see
    chosen = maps[np.linspace(0, len(maps) - 1, options.columns).astype(int)]
    images = reconstruct(autoencoder_from_tensors(load_autoencoder().tensors), chosen)
    figure = open_figure(1.3 * options.columns, 3.0)
    panels: Any = figure.subplots(2, options.columns)
    for k in range(options.columns):
        panels[0, k].imshow(chosen[k], cmap="gray", origin="lower", vmin=0, vmax=255)
        panels[1, k].imshow(images[k], cmap="gray", origin="lower", vmin=0, vmax=1)
    for panel in panels.flat:
        panel.set_xticks([])
        panel.set_yticks([])
    panels[0, 0].set_ylabel("observed")
    panels[1, 0].set_ylabel("reconstructed")
    return figure
