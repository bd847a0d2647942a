"""The table: failure probability of each way to count, its interval and its cost."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from studies.columns import Column, Output, percent_interval
from studies.rare_events.batches import Batch
from studies.rare_events.flights import RootRow
from studies.statistics.ratios import Interval
from studies.statistics.weighted_events import relative_error, weighted_interval


@dataclass(frozen=True)
class EstimateRow:
    """One way to count failures.

    Attributes:
        way: its name.
        policy: name.
        failure: probability, with its 95 % interval over independent tiles.
        episodes: roots: independent draws of ground, start and noise.
        tiles: that they lie on.
        failing: roots of which something failed.
        weight: mean weight of what came to its end; 1 in expectation.
        steps: decision intervals flown.
        flights: whole flights that take as many.
        total: the same with those of the pilot.
        error: relative standard error of the probability, roots taken as independent.
        gain: flights that whole flights would take for that error, over `flights`.
    """

    way: str
    policy: str
    failure: Interval
    episodes: int
    tiles: int
    failing: int
    weight: float
    steps: int
    flights: float
    total: float
    error: float
    gain: float


def collect_roots(batches: Sequence[Batch]) -> list[RootRow]:
    """The roots of batches, in their order."""
    return [root for batch in batches for root in batch.roots]


def estimate(
    way: str, policy: str, roots: Sequence[RootRow], flight_steps: float, pilot: int = 0
) -> EstimateRow:
    """Failure probability from the trees of a run.

    Args:
        way: name of the way to count.
        policy: its name.
        roots: of independent episodes.
        flight_steps: mean number of decision intervals of a whole flight.
        pilot: flights of the pilot that it took.
    """
    events, weights = [root.failing for root in roots], [root.weight for root in roots]
    tiles = [root.tile for root in roots]
    failure = weighted_interval(events, weights, tiles)
    steps, error = sum(root.steps for root in roots), relative_error(events)
    flights = steps / flight_steps
    share = failure.estimate
    gain = (1.0 - share) / (share * error**2 * flights) if share > 0.0 and error > 0.0 else math.nan
    return EstimateRow(
        way=way,
        policy=policy,
        failure=failure,
        episodes=len(roots),
        tiles=len(set(tiles)),
        failing=sum(event > 0.0 for event in events),
        weight=sum(weights) / len(roots),
        steps=steps,
        flights=flights,
        total=flights + pilot,
        error=error,
        gain=gain,
    )


_WRITTEN = Output.FILE | Output.DOCUMENT
COLUMNS: tuple[Column[EstimateRow], ...] = (
    Column("way", "counted by", lambda row: row.way, words=True),
    Column("policy", "policy", lambda row: row.policy, words=True, outputs=_WRITTEN),
    percent_interval("failure_percent", "failure", lambda row: row.failure, digits=3, stem="failure"),
    Column("episodes", "episodes", lambda row: row.episodes),
    Column("tiles", "tiles", lambda row: row.tiles, outputs=_WRITTEN),
    Column("failing", "failing", lambda row: row.failing, label="episodes of which something failed"),
    Column("weight", "weight", lambda row: row.weight, digits=3, outputs=_WRITTEN),
    Column("steps", "intervals", lambda row: row.steps, outputs=_WRITTEN),
    Column("flights", "as flights", lambda row: row.flights, digits=0),
    Column("total", "with the pilot", lambda row: row.total, digits=0),
    Column("relative_error_percent", "error", lambda row: 100.0 * row.error, digits=0, unit="%"),
    Column("gain", "gain", lambda row: row.gain, digits=2),
)
"""The table: its file, document and console read this list."""


@dataclass(frozen=True)
class CostRow:
    """What a part of the run took.

    Attributes:
        part: its name.
        episodes: flown.
        steps: decision intervals.
        seconds: [s] of processor time, scenarios and levels included; not reproducible.
    """

    part: str
    episodes: int
    steps: int
    seconds: float


def sum_costs(part: str, batches: Sequence[Batch]) -> CostRow:
    """The cost of a part of the run."""
    episodes = sum(len(batch.roots) + len(batch.passages) for batch in batches)
    steps, seconds = sum(batch.steps for batch in batches), sum(batch.seconds for batch in batches)
    return CostRow(part, episodes, steps, seconds)


COST_COLUMNS: tuple[Column[CostRow], ...] = (
    Column("part", "part", lambda row: row.part, words=True),
    Column("episodes", "episodes", lambda row: row.episodes),
    Column("steps", "intervals", lambda row: row.steps),
    Column("processor_s", "processor", lambda row: row.seconds, digits=1, unit="s"),
)
"""Costs of the parts."""


@dataclass(frozen=True)
class CauseRow:
    """A cause of failure.

    Attributes:
        cause: in words.
        share: of the failure probability.
        leaves: flights and branches that failed so.
        roots: episodes that they belong to.
        chosen: mean number of the look at which the last site was chosen.
        divert_m: mean distance from the first target to the last site.
        off_nadir_deg: mean of the greatest angle from the vertical under which a target was seen.
        safe_share: mean safe share of the ground about the last site.
    """

    cause: str
    share: float
    leaves: int
    roots: int
    chosen: float
    divert_m: float
    off_nadir_deg: float
    safe_share: float


def count_causes(roots: Sequence[RootRow]) -> list[CauseRow]:
    """The causes by their share of the failure probability, the greatest first."""
    found = defaultdict(list)
    for root in roots:
        for leaf in root.leaves:
            if leaf.failed:
                found[leaf.cause].append((root.episode, leaf))
    total = sum(root.failing for root in roots)
    rows = []
    for cause, failed in found.items():
        weight = sum(leaf.weight for _, leaf in failed)
        means = [
            sum(leaf.weight * getattr(leaf, name) for _, leaf in failed) / weight
            for name in ("chosen", "divert_m", "off_nadir_deg", "safe_share")
        ]
        episodes = len({episode for episode, _ in failed})
        rows.append(CauseRow(cause, weight / total, len(failed), episodes, *means))
    return sorted(rows, key=lambda row: (-row.share, row.cause))


CAUSE_COLUMNS: tuple[Column[CauseRow], ...] = (
    Column("cause", "cause", lambda row: row.cause, words=True),
    Column("share_percent", "share", lambda row: 100.0 * row.share, digits=1, unit="%"),
    Column("leaves", "flights", lambda row: row.leaves, label="flights and branches"),
    Column("episodes", "episodes", lambda row: row.roots),
    Column("chosen", "last choice at look", lambda row: row.chosen, digits=1),
    Column("divert_m", "from first target", lambda row: row.divert_m, digits=0, unit="m"),
    Column("off_nadir_deg", "off the vertical", lambda row: row.off_nadir_deg, digits=0, unit="deg"),
    Column("safe_share_percent", "safe around", lambda row: 100.0 * row.safe_share, digits=0, unit="%"),
)
"""The table of causes."""
