"""The table of the trade-off study: its points and bounds as CSV, for a document and on the screen."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from studies.campaign.point_score import SCORE_COLUMNS, PointScore
from studies.statistics.ratios import Interval


@dataclass(frozen=True)
class TradeOffRow:
    """One point of the picture.

    Attributes:
        preset: name of the setting.
        split: tile split that it was flown on.
        policy: name.
        weight: weight that was changed; empty for a registered policy.
        value: of that weight; nan for a registered policy.
        privileged: it sees the true map.
        score: ratios and propellant with their intervals.
        on_front: no policy of the same preset and split that sees no truth beats it in both.
    """

    preset: str
    split: str
    policy: str
    weight: str
    value: float
    privileged: bool
    score: PointScore
    on_front: bool = False


@dataclass(frozen=True)
class Bounds:
    """What no policy can beat on a preset.

    Attributes:
        preset: name.
        episodes: number of episodes.
        ceiling: share of episodes in which safe ground could have been known, with Wilson's interval.
        floor: mean least propellant [%] with its bootstrap interval.
    """

    preset: str
    episodes: int
    ceiling: Interval
    floor: Interval


def write_rows(path: Path, rows: Sequence[TradeOffRow]) -> None:
    """Write every point as CSV; ratios and propellant in percent."""
    header = ["preset", "split", "policy", "weight", "value", "privileged", "on_front", "episodes"]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([*header, *SCORE_COLUMNS])
        for row in rows:
            value = "" if np.isnan(row.value) else f"{row.value:g}"
            cells = [row.preset, row.split, row.policy, row.weight, value, row.privileged, row.on_front]
            writer.writerow([*cells, row.score.episodes, *row.score.cells()])


def _cells(row: TradeOffRow) -> list[str]:
    safe, tiled, burnt = row.score.safe_site, row.score.safe_site_by_tile, row.score.propellant
    ends = (safe.estimate, safe.low, safe.high, tiled.low, tiled.high)
    return [
        row.policy + (" *" if row.privileged else ""),
        "{:.1f} ({:.1f}-{:.1f}) [{:.1f}-{:.1f}]".format(*(100.0 * value for value in ends)),
        f"{100.0 * row.score.success.estimate:.1f}",
        f"{burnt.estimate:.2f} ({burnt.low:.2f}-{burnt.high:.2f})",
        "yes" if row.on_front else "",
    ]


_HEADINGS = ("preset", "tiles", "policy", "safe site %", "success %", "propellant %", "front")


def write_markdown(path: Path, rows: Sequence[TradeOffRow]) -> None:
    """Write the points for a document."""
    lines = ["| " + " | ".join(_HEADINGS) + " |", "|---|---|---|---:|---:|---:|---|"]
    lines += ["| " + " | ".join([row.preset, row.split, *_cells(row)]) + " |" for row in rows]
    path.write_text("\n".join(lines) + "\n")


def write_bounds(path: Path, bounds: Sequence[Bounds]) -> None:
    """Write ceilings and floors as CSV, in percent."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        names = [
            f"{name}{end}" for name in ("ceiling_percent", "floor_percent") for end in ("", "_low", "_high")
        ]
        writer.writerow(["preset", "episodes", *names])
        for b in bounds:
            top = [100.0 * value for value in (b.ceiling.estimate, b.ceiling.low, b.ceiling.high)]
            ends = (*top, b.floor.estimate, b.floor.low, b.floor.high)
            writer.writerow([b.preset, b.episodes, *(f"{value:.9g}" for value in ends)])


def print_trade_off(rows: Sequence[TradeOffRow], bounds: Sequence[Bounds]) -> None:
    """Print the points and the bounds."""
    table = Table(title="safe landings against propellant", caption="* sees the true map")
    for heading in _HEADINGS:
        table.add_column(heading, no_wrap=heading == "policy")
    for row in rows:
        table.add_row(row.preset, row.split, *(cell.replace("[", "\\[") for cell in _cells(row)))
    console = Console(width=max(Console().width, 130))
    console.print(table)
    for b in bounds:
        console.print(
            f"{b.preset}: safe ground could have been known in {100.0 * b.ceiling.estimate:.1f} % of"
            f" {b.episodes} episodes; no soft landing there on less than {b.floor.estimate:.1f} % (mean)",
            highlight=False,
        )
