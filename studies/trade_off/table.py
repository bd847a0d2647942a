"""The table of the trade-off study: its points and bounds as CSV, for a document and on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console

from studies.campaign.score import PROPELLANT_COLUMN, RATIO_COLUMNS, Score
from studies.columns import Column, Output, console_table
from studies.statistics.ratios import NO_INTERVAL, Interval, scaled


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
        score: every figure with its intervals.
        on_front: no policy of the same preset and split that sees no truth beats it in both.
        ratio: what is set against the propellant: safe_site or success.
    """

    preset: str
    split: str
    policy: str
    weight: str
    value: float
    privileged: bool
    score: Score
    on_front: bool = False
    ratio: str = "safe_site"

    @property
    def landed_name(self) -> str:
        """The ratio that is set against the propellant, in words."""
        return self.ratio.replace("_", " ")

    @property
    def landed(self) -> Interval:
        """The ratio that is set against the propellant, with Wilson's interval."""
        return getattr(self.score, self.ratio)

    @property
    def landed_by_tile(self) -> Interval:
        """The same ratio with the interval clustered by tile."""
        return getattr(self.score, f"{self.ratio}_by_tile")


@dataclass(frozen=True)
class Bounds:
    """What no policy can beat on a preset.

    Attributes:
        preset: name.
        episodes: number of episodes.
        ceiling: ratio of episodes in which safe ground could have been known, with Wilson's interval;
            None where the sensor measures ranges, as the proof does not hold there.
        floor: mean least propellant [%] with Student's interval.
    """

    preset: str
    episodes: int
    ceiling: Interval | None
    floor: Interval


def _ceiling_percent(bounds: Bounds) -> Interval:
    return NO_INTERVAL if bounds.ceiling is None else scaled(bounds.ceiling, 100.0)


def _mark(row: TradeOffRow) -> str:
    return " *" if row.privileged else ""


COLUMNS: tuple[Column[TradeOffRow], ...] = (
    Column("preset", "preset", lambda row: row.preset, words=True),
    Column("split", "tiles", lambda row: row.split, words=True),
    Column("policy", "policy", lambda row: row.policy, mark=_mark, words=True),
    Column("weight", "weight", lambda row: row.weight, outputs=Output.FILE),
    Column("value", "value", lambda row: row.value, outputs=Output.FILE),
    Column("privileged", "privileged", lambda row: row.privileged, outputs=Output.FILE),
    Column("episodes", "episodes", lambda row: row.score.episodes, outputs=Output.FILE),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, PROPELLANT_COLUMN)),
    Column("ratio", "front by", lambda row: row.landed_name, words=True),
    Column("on_front", "front", lambda row: row.on_front, form=lambda on: "yes" if on else ""),
)
"""The points: table.csv, table.md and the console read this list."""

BOUNDS_COLUMNS: tuple[Column[Bounds], ...] = (
    Column("preset", "preset", lambda bounds: bounds.preset),
    Column("episodes", "episodes", lambda bounds: bounds.episodes),
    Column("ceiling_percent", "ceiling", _ceiling_percent, interval=True),
    Column("floor_percent", "floor", lambda bounds: bounds.floor, interval=True),
)
"""Ceilings and floors in percent, as bounds.csv has them."""


def print_trade_off(rows: Sequence[TradeOffRow], bounds: Sequence[Bounds]) -> None:
    """Print the points and the bounds."""
    ratios = " and ".join(dict.fromkeys(row.landed_name for row in rows))
    table = console_table(COLUMNS, rows, f"{ratios} against propellant", "* sees the true map")
    console = Console(width=max(Console().width, 130))
    console.print(table)
    for b in bounds:
        console.print(describe_bounds(b), highlight=False)


def describe_bounds(bounds: Bounds) -> str:
    """The ceiling, or why there is none, and the floor in a sentence."""
    floor = f"less than {bounds.floor.estimate:.1f} % (mean)"
    if bounds.ceiling is None:
        return (
            f"{bounds.preset}: no ceiling, as a sensor that measures ranges sees ground past the square of"
            f" its look; no soft landing on safe ground on {floor}, over {bounds.episodes} episodes"
        )
    known = f"safe ground could have been known in {100.0 * bounds.ceiling.estimate:.1f} %"
    return f"{bounds.preset}: {known} of {bounds.episodes} episodes; no soft landing there on {floor}"
