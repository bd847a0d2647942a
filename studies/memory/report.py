"""Table and picture of the study of memory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hda.flight.palette import COLORS
from studies.columns import Column, Output, markdown_lines
from studies.memory.answer import MEASURES, GroupRow
from studies.memory.scores import AgentScore

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TO = " to "


def _name_measure(row: GroupRow) -> str:
    return row.measure.removesuffix("_percent").replace("_", " ")


COLUMNS: tuple[Column[GroupRow], ...] = (
    Column("preset", "preset", lambda row: row.preset, words=True),
    Column("agent", "agent", lambda row: row.agent, words=True),
    Column("measure", "measure", lambda row: row.measure, outputs=Output.FILE),
    Column("measure", "measure", _name_measure, words=True, outputs=Output.DOCUMENT),
    Column("seeds", "seeds", lambda row: row.seeds),
    Column("episodes", "episodes", lambda row: row.episodes, outputs=Output.FILE),
    Column(
        "interquartile_mean",
        "interquartile mean",
        lambda row: row.interquartile_mean,
        digits=1,
        unit="%",
        interval=True,
        between=_TO,
    ),
    Column(
        "improvement",
        "better than without memory",
        lambda row: row.improvement,
        digits=2,
        interval=True,
        between=_TO,
    ),
    Column(
        "difference",
        "points",
        lambda row: row.difference,
        form="{:+.1f}".format,
        interval=True,
        between=_TO,
    ),
    Column("verdict", "verdict", lambda row: row.verdict, outputs=Output.FILE),
)
"""The table: memory.csv and memory.md read this list."""


def markdown(rows: Sequence[GroupRow], sentences: Sequence[str]) -> str:
    """Table and answer as Markdown."""
    lines = markdown_lines(COLUMNS, rows)
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
