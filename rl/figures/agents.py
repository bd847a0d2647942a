"""Every learnt agent beside a rule and an optimiser, on each preset, by training seed."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hda.flight.palette import COLORS, MATPLOTLIB_DASHES, line_style
from hda.task.presets import PRESETS
from rl.figures.agent_scores import (
    Estimate,
    FlownPolicy,
    SeedScore,
    find_cards,
    read_seeds,
    read_tables,
    weights_row,
)
from rl.figures.options import AgentsFigure
from rl.figures.sheet import open_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURES = {"success": "success [%]", "propellant": "propellant burnt [%]"}
"""What the panels of a preset show, from above."""


def draw_agents(options: AgentsFigure) -> Figure:
    """Draw success above and propellant below, one column a preset: seeds as dots, tables with intervals.

    Prints the numbers as a table for a document.

    Raises:
        ValueError: there is nothing to draw, or a folder or card is none.
    """
    seeds, tables = read_seeds(find_cards(options.weights), options.runs), read_tables(options.results)
    presets = _choose_presets(seeds, tables, options.presets)
    agents = list(dict.fromkeys(score.agent for score in seeds if score.preset in presets))
    if not agents:
        raise ValueError(
            f"nothing to draw: weights {options.weights}, runs and results name no agent and preset"
        )
    sys.stdout.write("\n".join(describe_agents(presets, seeds, tables, options.beside)) + "\n")
    figure = open_figure((0.42 * len(agents) + 1.0) * len(presets) + 1.6, 7.0)
    grid: Any = figure.subplots(len(MEASURES), len(presets), sharex=True, sharey="row", squeeze=False)
    for column, preset in enumerate(presets):
        flown = {row.policy: row for row in tables if row.preset == preset}
        own = [score for score in seeds if score.preset == preset]
        for axes, measure in zip(grid[:, column], MEASURES, strict=True):
            _draw_lines(axes, flown, options.beside, measure)
            _draw_agents(axes, agents, flown, own, measure)
        grid[0, column].set_title(preset)
        grid[-1, column].set_xticks(range(len(agents)), agents, rotation=90)
    for axes, label in zip(grid[:, 0], MEASURES.values(), strict=True):
        axes.set_ylabel(label)
    named = {
        label: handle
        for axes in grid.flat
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(named.values()), list(named), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _choose_presets(
    seeds: Sequence[SeedScore], tables: Sequence[FlownPolicy], wanted: Sequence[str]
) -> list[str]:
    """Settings on which an agent has learnt or a table was flown, in the order of the presets."""
    named = {score.preset for score in seeds} | {row.preset for row in tables}
    ordered = [name for name in PRESETS if name in named] + sorted(named - set(PRESETS))
    return [name for name in ordered if not wanted or name in wanted]


def describe_agents(
    presets: Sequence[str], seeds: Sequence[SeedScore], tables: Sequence[FlownPolicy], beside: Sequence[str]
) -> list[str]:
    """The table for a document, in Markdown: on each preset the policies beside, then agents by seed.

    Args:
        presets: in their order.
        seeds: scores of training seeds.
        tables: rows of studies.
        beside: policies that are not learnt.
    """
    lines = [
        "| preset | policy | seed | episodes | safe site % | success % | propellant % | touchdown m/s |",
        "|---|---|---:|---|---:|---:|---:|---:|",
    ]
    for preset in presets:
        flown = {row.policy: row for row in tables if row.preset == preset}
        own = sorted((s for s in seeds if s.preset == preset), key=lambda s: (_order(seeds, s.agent), s.seed))
        lines += [_line(preset, f"`{name}`", "", flown[name]) for name in beside if name in flown]
        lines += [
            _line(preset, f"`{score.agent}`", f"{score.seed}{', shipped' if score.shipped else ''}", score)
            for score in own
        ]
        lines += [
            _line(preset, f"`{agent}`, learnt on `paper`", "", row)
            for agent in dict.fromkeys(score.agent for score in seeds)
            if (row := weights_row(flown, agent, learnt=False))
        ]
    return lines


def _order(seeds: Sequence[SeedScore], agent: str) -> int:
    return list(dict.fromkeys(score.agent for score in seeds)).index(agent)


def _line(preset: str, name: str, seed: str, row: FlownPolicy | SeedScore) -> str:
    """A row of the table; a policy of a study's table has an interval."""
    split = row.judged if isinstance(row, SeedScore) else ""
    values = []
    for value, digits in ((row.success, 1), (row.propellant, 1)):
        middle = value.value if isinstance(value, Estimate) else value
        values.append(f"{middle:.{digits}f}")
    if isinstance(row.success, Estimate):
        values[0] += f" ({row.success.low:.1f}-{row.success.high:.1f})"
    safe, speed = (
        "" if math.isnan(x) else f"{x:.{d}f}" for x, d in ((row.safe_site, 1), (row.touchdown_speed, 2))
    )
    cells = [preset, name, seed, f"{row.episodes} {split}".strip(), safe, *values, speed]
    return f"| {' | '.join(cells)} |"


def _draw_lines(axes: Axes, flown: dict[str, FlownPolicy], names: Sequence[str], measure: str) -> None:
    """The policies that are not learnt, as lines with their intervals as bands."""
    for k, name in enumerate(names):
        if name not in flown:
            continue
        style = line_style(len(COLORS) - 1 - k)
        found: Estimate = getattr(flown[name], measure)
        axes.axhline(
            found.value, color=style["color"], linestyle=MATPLOTLIB_DASHES["dash"], linewidth=1.2, label=name
        )
        if not math.isnan(found.low):
            axes.axhspan(found.low, found.high, color=style["color"], alpha=0.12, linewidth=0.0)


def _draw_agents(
    axes: Axes, agents: Sequence[str], flown: dict[str, FlownPolicy], seeds: Sequence[SeedScore], measure: str
) -> None:
    """Each agent at its place: what the table says of it, and its seeds."""
    for judged, face in (("validation", COLORS[0]), ("tuning", "none")):
        kept = [score for score in seeds if score.judged == judged]
        if kept:
            places = [agents.index(score.agent) - 0.15 for score in kept]
            values = [getattr(score, measure) for score in kept]
            label = f"a seed, {judged} tiles"
            axes.plot(
                places,
                values,
                "o",
                color=COLORS[0],
                markerfacecolor=face,
                markersize=4.5,
                linestyle="",
                label=label,
            )
    for learnt, color, label in (
        (True, COLORS[1], "weights learnt there, and 95 % interval"),
        (False, COLORS[2], "weights learnt on paper"),
    ):
        rows = [
            (place, row) for place, agent in enumerate(agents) if (row := weights_row(flown, agent, learnt))
        ]
        if rows:
            found: list[Estimate] = [getattr(row, measure) for _, row in rows]
            middles = [each.value for each in found]
            ends = [
                [abs(each.low - each.value) for each in found],
                [abs(each.high - each.value) for each in found],
            ]
            ends = [[0.0 if math.isnan(end) else end for end in side] for side in ends]
            places = [place + (0.1 if learnt else 0.25) for place, _ in rows]
            axes.errorbar(
                places, middles, yerr=ends, fmt="D", color=color, markersize=4, capsize=2, label=label
            )
    axes.grid(axis="y", alpha=0.25)
    axes.set_xlim(-0.6, len(agents) - 0.4)
