"""The table of the looks study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.columns import Column, percent_interval
from studies.looks.counts import PixelCounts
from studies.statistics.ratios import NO_INTERVAL, Interval, clustered_count_interval


@dataclass(frozen=True)
class LookRow:
    """What looks from one range with one number of rays are worth.

    Attributes:
        rays: along each side of a scan.
        slant_range: [m] from the vehicle to the target.
        looks: number of looks.
        spacing: [m] of the rays on the target plane.
        safe: share of the pixels that are truly safe.
        known: share of the pixels that have a verdict.
        precision: share of the pixels called safe that are safe, clustered by tile; nan where none is.
        recall: share of the safe pixels that are called safe, clustered by tile; nan where none is.
    """

    rays: int
    slant_range: float
    looks: int
    spacing: float
    safe: float
    known: float
    precision: Interval
    recall: Interval


def _clustered(hits: Sequence[int], trials: Sequence[int]) -> Interval:
    """Ratio over all tiles that had a trial."""
    some = np.asarray(trials) > 0
    if not some.any():
        return NO_INTERVAL
    return clustered_count_interval(np.asarray(hits)[some], np.asarray(trials)[some])


def score_looks(
    rays: int, slant_range: float, spacing: float, looks: int, counts: Sequence[PixelCounts]
) -> LookRow:
    """Score the counts of all tiles, `looks` looks on each."""
    pixels = sum(tile.pixels for tile in counts)
    right = [tile.right for tile in counts]
    return LookRow(
        rays=rays,
        slant_range=slant_range,
        looks=looks * len(counts),
        spacing=spacing,
        safe=sum(tile.safe for tile in counts) / pixels,
        known=sum(tile.known for tile in counts) / pixels,
        precision=_clustered(right, [tile.called for tile in counts]),
        recall=_clustered(right, [tile.safe for tile in counts]),
    )


COLUMNS: tuple[Column[LookRow], ...] = (
    Column("rays", "rays a side", lambda row: row.rays),
    Column("range_m", "range", lambda row: row.slant_range, digits=0, unit="m"),
    Column("looks", "looks", lambda row: row.looks),
    Column("ray_spacing_m", "spacing", lambda row: row.spacing, digits=2, unit="m"),
    Column("safe_percent", "safe ground", lambda row: 100.0 * row.safe, digits=1, unit="%"),
    Column("known_percent", "known", lambda row: 100.0 * row.known, digits=1, unit="%"),
    percent_interval(
        "precision_percent",
        "precision",
        lambda row: row.precision,
        label="share of the ground called safe that is safe",
    ),
    percent_interval(
        "recall_percent",
        "recall",
        lambda row: row.recall,
        label="share of the safe ground that is called safe",
    ),
)
"""Precision and recall: table.csv, table.md and the console read this list."""
