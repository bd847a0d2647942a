"""Table and picture of the study of memory."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from studies.compare.figures import COLORS
from studies.memory.answer import MEASURES, GroupRow
from studies.memory.scores import AgentScore
from studies.statistics.ratios import Interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INTERVALS = ("interquartile_mean", "improvement", "difference")


def write_csv(path: Path, rows: Sequence[GroupRow]) -> None:
    """Write every row; an interval takes three columns, and is empty where there is none."""
    names = [f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high")]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["preset", "agent", "measure", "seeds", "episodes", *names, "verdict"])
        for row in rows:
            cells: list[str] = []
            for name in _INTERVALS:
                interval: Interval = getattr(row, name)
                values = (interval.estimate, interval.low, interval.high)
                cells += ["" if math.isnan(value) else f"{value:.6g}" for value in values]
            writer.writerow(
                [row.preset, row.agent, row.measure, row.seeds, row.episodes, *cells, row.verdict]
            )


def _shown(interval: Interval, form: str) -> str:
    if math.isnan(interval.estimate):
        return ""
    if math.isnan(interval.low) or math.isinf(interval.low):
        return format(interval.estimate, form)
    return f"{interval.estimate:{form}} ({interval.low:{form}} to {interval.high:{form}})"


def markdown(rows: Sequence[GroupRow], sentences: Sequence[str]) -> str:
    """Table and answer as Markdown."""
    lines = [
        "| preset | agent | measure | seeds | interquartile mean, % | better than without memory | points |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            row.preset,
            row.agent,
            row.measure.removesuffix("_percent").replace("_", " "),
            str(row.seeds),
        ]
        cells += [
            _shown(row.interquartile_mean, ".1f"),
            _shown(row.improvement, ".2f"),
            _shown(row.difference, "+.1f"),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *(f"- {sentence}" for sentence in sentences)]) + "\n"


def draw_memory(rows: Sequence[GroupRow], scores: Sequence[AgentScore]) -> Figure:
    """Draw each preset's agents: every seed, the interquartile mean and its interval."""
    from matplotlib.figure import Figure

    presets = list(dict.fromkeys(row.preset for row in rows))
    agents = list(dict.fromkeys(row.agent for row in rows))
    figure = Figure(figsize=(4.5 * len(presets) + 1.0, 4.2), layout="constrained")
    grid = figure.subplots(1, len(presets), sharey=True, squeeze=False)
    for axis, preset in zip(grid[0], presets, strict=True):
        for row in rows:
            if row.preset != preset or row.measure != MEASURES[0]:
                continue
            place, color = agents.index(row.agent), COLORS[agents.index(row.agent) % len(COLORS)]
            seeds = [s.safe_site_percent for s in scores if (s.preset, s.agent) == (preset, row.agent)]
            axis.plot([place - 0.15] * len(seeds), seeds, "o", color=color, alpha=0.5, markersize=5)
            mean = row.interquartile_mean
            ends = [[0.0], [0.0]]
            if not math.isnan(mean.low):
                ends = [[mean.estimate - mean.low], [mean.high - mean.estimate]]
            axis.errorbar([place], [mean.estimate], yerr=ends, fmt="D", color=color, capsize=4)
        axis.set_xticks(range(len(agents)), agents)
        axis.set_xlim(-0.6, len(agents) - 0.4)
        axis.set_title(preset)
        axis.grid(axis="y", alpha=0.25)
    grid[0, 0].set_ylabel("safe site [%]")
    figure.suptitle("every seed, and the interquartile mean with its 95 % interval")
    return figure
