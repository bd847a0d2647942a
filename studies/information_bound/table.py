"""The steps from what no policy undercuts to what hazard-aware loses, paired, as a table."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from guidance.arrays import Array
from guidance.validation import unknown_name
from hda.flight.episode_row import EpisodeRow
from hda.registry import policy_entry
from studies.columns import Column, points_interval
from studies.information_bound.restrictions import FAILURE, FloorRow
from studies.statistics.moments import collect_moments, mean_intervals
from studies.statistics.ratios import NO_INTERVAL, Interval

_TOLD = 1000  # to one
_KINDS = _BOUND, _FLOWN = "bound", "flown"


@dataclass(frozen=True)
class StepRow:
    """One step: a class of policies and its bound, or a policy and its flights.

    Attributes:
        step: the class in words, or the policy's name.
        proved: it is a bound.
        loss: [%] mean of the propellant, a failure counting a whole tank; clustered by tile.
        rise: [points] above the step before, paired; nan in the first.
        below: [points] by which it lies below the last step, paired.
        failures: episodes without success; nan for a bound.
    """

    step: str
    proved: bool
    loss: Interval
    rise: Interval
    below: Interval
    failures: float


def flown_losses(rows: Sequence[EpisodeRow]) -> Array:
    """[%] shape (n,): the propellant of each flight, and a whole tank more where it failed."""
    return np.array([row.propellant_percent + FAILURE * (not row.success) for row in rows])


def list_steps(
    names: Sequence[str], floors: Sequence[FloorRow], flights: dict[str, Sequence[EpisodeRow]]
) -> list[StepRow]:
    """The steps in order: the bounds, from the weakest on, then the flights, as they are given.

    Args:
        names: of the bounds.
        floors: of each episode.
        flights: policy -> its rows over the same episodes; the last one is what all are held against.
    """
    tiles = [row.tile for row in floors]
    found = [(name, True, math.nan) for name in names]
    losses = [np.array([row.floors[k] for row in floors]) for k in range(len(names))]
    for name, rows in flights.items():
        found.append((name, False, float(sum(not row.success for row in rows))))
        losses.append(flown_losses(rows))

    def tiled(values: Array) -> Interval:
        return mean_intervals(collect_moments(values, tiles), 0)[1]

    rises = [NO_INTERVAL, *(tiled(after - before) for before, after in pairwise(losses))]
    return [
        StepRow(name, proved, tiled(loss), rise, tiled(losses[-1] - loss), failures)
        for (name, proved, failures), loss, rise in zip(found, losses, rises, strict=True)
    ]


def _mark(row: StepRow) -> str:
    return " *" if not row.proved and policy_entry(row.step).privileged else ""


COLUMNS: tuple[Column[StepRow], ...] = (
    Column("step", "step", lambda row: row.step, words=True, mark=_mark),
    Column("kind", "", lambda row: _BOUND if row.proved else _FLOWN, words=True, label="kind"),
    Column("loss_percent", "loss", lambda row: row.loss, 2, "%", interval=True, stem="loss"),
    points_interval("rise_points", "above the step before", lambda row: row.rise, digits=2, stem="rise"),
    points_interval("below_points", "below the last step", lambda row: row.below, digits=2, stem="below"),
    Column("failures", "failures", lambda row: row.failures, 0),
)
"""A line a step; intervals are clustered by tile."""


def read_steps(path: Path) -> list[StepRow]:
    """The steps of a table that a run has written.

    Raises:
        ValueError: it is no such table, or a loss or an end of its interval is not finite.
        OSError: it cannot be read.
    """
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    try:
        lines = [_read_step(row) for row in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} must hold the table of a finished run of this study") from error
    kinds = [line.proved for line in lines]
    if not any(kinds) or all(kinds) or kinds != sorted(kinds, reverse=True):
        raise ValueError(f"{path} must hold the table of a finished run of this study")
    for line in lines:
        if not all(math.isfinite(end) for end in vars(line.loss).values()):
            raise ValueError(f"{path} must hold finite losses and intervals, over at least two tiles")
    return lines


def _read_step(row: dict[str, str]) -> StepRow:
    if row["kind"] not in _KINDS:
        raise ValueError(unknown_name("kind", row["kind"], _KINDS))

    def number(key: str) -> float:
        return float(row[key] or math.nan)

    def interval(key: str, stem: str) -> Interval:
        return Interval(number(key), number(f"{stem}_low"), number(f"{stem}_high"))

    return StepRow(
        step=row["step"],
        proved=row["kind"] == _BOUND,
        loss=interval("loss_percent", "loss"),
        rise=interval("rise_points", "rise"),
        below=interval("below_points", "below"),
        failures=number("failures"),
    )


def tell_recognition(floors: Sequence[FloorRow]) -> str:
    """What the first looks tell of the map, in words; empty where it was not worked out."""
    odds = np.array([row.log_odds for row in floors])
    if np.isnan(odds).any():
        return ""
    told = int((odds > math.log(_TOLD)).sum())
    rise = float(np.mean([row.penalised - row.floors[0] for row in floors]))
    way = "rises" if rise >= 0.0 else "falls"
    return (
        f"the first look tells the tile, by {_TOLD} to 1 or more, in {told} of {odds.size} episodes;"
        f" for policies that settle their cell by it, the first bound {way} by {abs(rise):.2g} points"
    )


def tell_sight(floors: Sequence[FloorRow], best: Sequence[EpisodeRow], last: Sequence[EpisodeRow]) -> str:
    """What the square of the first look costs, in words: by how much `last` loses more than `best`."""
    more, seen = flown_losses(last) - flown_losses(best), np.array([row.in_view for row in floors])
    parts = [
        f"by {more[group].mean():.2f} points {where}, in {group.sum()} of {seen.size} episodes"
        for group, where in ((seen, "where the first look shows the cheapest ground"), (~seen, "elsewhere"))
        if group.any()
    ]
    return f"{last[0].policy} loses more than {best[0].policy} " + ", and ".join(parts)
