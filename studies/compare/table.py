"""The table of a study: one line per policy, every figure with its interval."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

from studies.campaign.score import (
    AT_LEAST_BY_TILE_COLUMN,
    AT_LEAST_COLUMN,
    AT_LEAST_CONFIDENCE,
    FALLBACKS_COLUMN,
    MEASURE_COLUMNS,
    RATIO_COLUMNS,
    Score,
)
from studies.columns import (
    Column,
    Output,
    console_table,
    format_p,
    markdown_lines,
    standing_in,
    write_csv,
)
from studies.compare.histograms import DecisionTimes
from studies.compare.scores import PolicyScore
from studies.paper import PAPER_ROWS
from studies.statistics.ratios import mcnemar_count_p_value

if TYPE_CHECKING:
    from rich.table import Table

REFERENCE_POLICY = "single-divert"
"""Every policy is compared with this one, on the same episodes."""


@dataclass(frozen=True, kw_only=True)
class PolicySummary(Score):
    """One line of the table: the score of a policy, and whose it is.

    Attributes:
        policy: name.
        preset: name of the setting.
        mcnemar_p: exact McNemar test of `safe_site` against the reference policy; nan for itself.
        privileged: it sees the true map.
    """

    policy: str
    preset: str
    mcnemar_p: float
    privileged: bool


_UNSHOWN = Output.FILE

COLUMNS: tuple[Column[PolicySummary], ...] = (
    Column("policy", "policy", lambda s: s.policy, mark=lambda s: " *" if s.privileged else "", words=True),
    Column("preset", "preset", lambda s: s.preset, outputs=_UNSHOWN),
    Column("episodes", "episodes", lambda s: s.episodes, outputs=_UNSHOWN),
    *RATIO_COLUMNS,
    AT_LEAST_COLUMN,
    AT_LEAST_BY_TILE_COLUMN,
    Column("mcnemar_p", "p", lambda s: s.mcnemar_p, form=format_p, outputs=Output.ALL & ~Output.DOCUMENT),
    *MEASURE_COLUMNS,
    FALLBACKS_COLUMN,
    Column("privileged", "privileged", lambda s: s.privileged, outputs=_UNSHOWN),
)
"""The table, from left to right: table.csv, table.md, the console and the report read this list alone."""

_NARROW = (
    "policy",
    "safe_site_percent",
    "success_percent",
    "success_at_least_by_tile",
    "touchdown_speed_mps",
    "propellant_percent",
)
"""Columns of a terminal that is too narrow for all."""


def summarize_policy(score: PolicyScore, preset: str, privileged: bool, is_reference: bool) -> PolicySummary:
    """The line of one policy."""
    own = score.running.collect()
    return PolicySummary(
        **{field.name: getattr(own, field.name) for field in fields(Score)},
        policy=score.policy,
        preset=preset,
        mcnemar_p=float("nan") if is_reference else mcnemar_count_p_value(score.pairs["safe_site"]),
        privileged=privileged,
    )


def write_timings(path: Path, decision_time: dict[str, DecisionTimes]) -> None:
    """Write how long decisions took; the only table that is not reproducible."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["policy", *(f"decision_time_ms_{q}" for q in ("p50", "p99", "max"))])
        for policy, times in decision_time.items():
            quantiles = [1000.0 * times.quantile(level) for level in (0.5, 0.99, 1.0)]
            writer.writerow([policy, *(f"{value:.4g}" for value in quantiles)])


def paper_line(name: str, columns: Sequence[Column[PolicySummary]]) -> list[str]:
    """A row of the paper's table under some of our columns; empty where the paper says nothing."""
    row = PAPER_ROWS[name]
    numbers = [column.show(row[column.key]) if column.key in row else "" for column in columns[1:]]
    return [f"the paper: {name}", *numbers]


def write_table(path: Path, summaries: Sequence[PolicySummary]) -> None:
    """Write the table as CSV; equal summaries give equal bytes."""
    write_csv(path, COLUMNS, summaries)


def write_markdown(path: Path, summaries: Sequence[PolicySummary]) -> None:
    """Write the table for a document: ratios with their intervals, means without."""
    lines = markdown_lines(COLUMNS, summaries)
    for name in PAPER_ROWS:
        first, *cells = paper_line(name, standing_in(COLUMNS, Output.DOCUMENT))
        lines.append("| " + " | ".join([f"*{first}*", *cells]) + " |")
    path.write_text("\n".join(lines) + "\n")


def print_table(summaries: Sequence[PolicySummary]) -> None:
    """Print the table, with the paper's rows below ours."""
    from rich.console import Console

    console, first = Console(), summaries[0]
    title = f"preset {first.preset}, {first.episodes} episodes (mean, 95 % interval; [] clustered by tile)"
    caption = (
        "* sees the true map; p: exact McNemar against single-divert;"
        f" at least: success, exact bound at {AT_LEAST_CONFIDENCE:.0%}, over episodes and over tiles"
    )
    table = _with_the_paper(COLUMNS, summaries, title, caption)
    endless = console.options.update(width=1000)
    needed = console.measure(table, options=endless).maximum
    if console.is_terminal and needed > console.width:
        chosen = [column for column in COLUMNS if column.key in _NARROW]
        narrow = f"* sees the true map; by tile: exact bound at {AT_LEAST_CONFIDENCE:.0%}; more in table.md"
        table = _with_the_paper(chosen, summaries, title, narrow)
        needed = console.measure(table, options=endless).maximum
    Console(width=max(console.width, needed)).print(table)


def _with_the_paper(
    columns: Sequence[Column[PolicySummary]], summaries: Sequence[PolicySummary], title: str, caption: str
) -> Table:
    """The console's table, with the paper's rows below ours."""
    table = console_table(columns, summaries, title, caption)
    table.add_section()
    for name in PAPER_ROWS:
        table.add_row(*paper_line(name, standing_in(columns, Output.CONSOLE)), style="dim")
    return table
