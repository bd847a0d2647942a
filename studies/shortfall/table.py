"""The tables of the study: failed landings by what was seen, hazards by height, parts of propellant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from studies.campaign.score import scaled
from studies.columns import Column
from studies.shortfall.encoded_sight import DEPTHS, HEIGHTS, Loss, SeenHazards, SiteSight
from studies.shortfall.propellant_parts import PropellantParts
from studies.statistics.moments import collect_moments, mean_intervals
from studies.statistics.ratios import Interval, clustered_count_interval

_HIGH = 400.0  # [m] from which a move counts as early


@dataclass(frozen=True)
class FlownEpisode:
    """What is kept of one flight.

    Attributes:
        tile: number of the tile.
        loss: what was seen of the ground that it failed on, or that it did not fail.
        depth: [m] from the cell of the touchdown to the nearest safe one; 0 on safe ground.
        sights: of the last site, of a failure.
        time: [s] of the touchdown.
        seen: hazards in its looks.
        parts: of its propellant.
    """

    tile: int
    loss: Loss
    depth: float
    sights: tuple[SiteSight, ...]
    time: float
    seen: tuple[SeenHazards, ...]
    parts: PropellantParts


@dataclass(frozen=True)
class LossRow:
    """Failed flights of a policy with one cause.

    Attributes:
        policy: name.
        loss: what was seen.
        failed: how many.
        episodes: that it flew.
        tiles: on how many tiles they fell.
        depth: [m] median distance of the touchdowns from safe ground.
        warned: [s] median time from the first look that read the site as a hazard to the touchdown; nan
            where none did.
    """

    policy: str
    loss: Loss
    failed: int
    episodes: int
    tiles: int
    depth: float
    warned: float


@dataclass(frozen=True)
class SeenRow:
    """Pixels of one band of heights and depths that the policies could have moved their target to.

    Attributes:
        height: number of the band of heights.
        depth: number of the band of depths.
        pixels: how many.
        read: share that the looks read as hazard, clustered by tile.
        encoded: share that their encodings show as hazard, clustered by tile.
    """

    height: int
    depth: int
    pixels: int
    read: Interval
    encoded: Interval


@dataclass(frozen=True)
class PartRow:
    """Means over the flights of a policy, or of its differences from another's on the same episodes.

    Attributes:
        policy: name, or both.
        whole: [%] propellant, clustered by tile, as are the other three parts of it.
        direct: [%] with the last site known from the start.
        early: [%] for sites that were not the last, above `_HIGH`.
        late: [%] below.
        guidance: [%] for another guidance law.
        moves: decisions that moved the target by a metre at least.
        moved: [m] by which all of them moved it.
        offset: [m] from the first target to the last site.
        time: [s] of the flight.
    """

    policy: str
    whole: Interval
    direct: Interval
    early: Interval
    late: Interval
    guidance: Interval
    moves: float
    moved: float
    offset: float
    time: float


def count_losses(policy: str, flown: Sequence[FlownEpisode]) -> list[LossRow]:
    """Failed flights by cause, in the order of `Loss`; causes without any are left out."""
    rows = []
    for loss in Loss:
        failed = [flight for flight in flown if flight.loss is loss]
        if failed and loss is not Loss.NONE:
            warned = [
                flight.time - next(sight.time for sight in flight.sights if sight.read < 0.5)
                for flight in failed
                if any(sight.read < 0.5 for sight in flight.sights)
            ]
            rows.append(
                LossRow(
                    policy,
                    loss,
                    len(failed),
                    len(flown),
                    len({flight.tile for flight in failed}),
                    median(flight.depth for flight in failed),
                    median(warned) if warned else math.nan,
                )
            )
    return rows


def share_seen(flown: Sequence[FlownEpisode]) -> list[SeenRow]:
    """Shares of hazards that looks and encodings show, by height, the greatest first, and depth."""
    rows = []
    for height in reversed(range(len(HEIGHTS) + 1)):
        for depth in range(len(DEPTHS) + 1):
            tiles: dict[int, list[int]] = {}
            for flight in flown:
                for seen in flight.seen:
                    if (seen.height, seen.depth) == (height, depth):
                        sums = tiles.setdefault(flight.tile, [0, 0, 0])
                        for k, count in enumerate((seen.pixels, seen.read, seen.encoded)):
                            sums[k] += count
            if tiles:
                pixels, read, encoded = np.array(list(tiles.values())).T
                shares = [clustered_count_interval(found, pixels) for found in (read, encoded)]
                rows.append(SeenRow(height, depth, int(pixels.sum()), *shares))
    return rows


def average_parts(
    policy: str, flown: Sequence[FlownEpisode], beside: Sequence[FlownEpisode] | None = None
) -> PartRow:
    """Means of the parts over flights, less those of `beside`, another policy's on the same episodes."""
    tiles = [flight.tile for flight in flown]
    values = np.array([_numbers(flight.parts) for flight in flown])
    if beside is not None:
        values -= np.array([_numbers(flight.parts) for flight in beside])
    intervals = [mean_intervals(collect_moments(part, tiles), 0)[1] for part in values.T[:5]]
    whole, direct, early, late, guidance = intervals
    moves, moved, offset, time = values[:, 5:].mean(axis=0).tolist()
    return PartRow(policy, whole, direct, early, late, guidance, moves, moved, offset, time)


def _numbers(parts: PropellantParts) -> list[float]:
    early = sum(move.cost for move in parts.moves if move.height >= _HIGH)
    late = sum(move.cost for move in parts.moves if move.height < _HIGH)
    lengths = [move.length for move in parts.moves if move.length >= 1.0]
    spent = [parts.whole, parts.direct, early, late, parts.guidance]
    return [*spent, len(lengths), sum(lengths), parts.offset, parts.time]


def _band(edges: Sequence[float], number: int) -> str:
    """A band in words."""
    if number == 0:
        return f"below {edges[0]:g}"
    return f"{edges[number - 1]:g} to {edges[number]:g}" if number < len(edges) else f"above {edges[-1]:g}"


LOSS_COLUMNS: tuple[Column[LossRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("seen", "what was seen of the last site", lambda row: row.loss.value, words=True),
    Column("failed", "failed", lambda row: row.failed),
    Column("episodes", "of", lambda row: row.episodes),
    Column("tiles", "tiles", lambda row: row.tiles),
    Column("depth_m", "from safe ground", lambda row: row.depth, digits=1, unit="m"),
    Column("warned_s", "first read as hazard, before touchdown", lambda row: row.warned, digits=1, unit="s"),
)
"""losses.csv, losses.md and the console read this list."""

SEEN_COLUMNS: tuple[Column[SeenRow], ...] = (
    Column("height_m", "height m", lambda row: _band(HEIGHTS, row.height), words=True),
    Column(
        "depth_m",
        "from safe ground m",
        lambda row: _band(DEPTHS, row.depth) if row.depth else "safe ground",
        words=True,
    ),
    Column("pixels", "pixels", lambda row: row.pixels),
    Column(
        "read_percent",
        "look reads a hazard",
        lambda row: scaled(row.read, 100.0),
        digits=1,
        unit="%",
        interval=True,
    ),
    Column(
        "encoded_percent",
        "encoding shows one",
        lambda row: scaled(row.encoded, 100.0),
        digits=1,
        unit="%",
        interval=True,
    ),
)
"""seen.csv, seen.md and the console read this list."""

PART_COLUMNS: tuple[Column[PartRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("propellant_percent", "propellant", lambda row: row.whole, digits=2, unit="%", interval=True),
    Column(
        "direct_percent",
        "last site known from the start",
        lambda row: row.direct,
        digits=2,
        unit="%",
        interval=True,
    ),
    Column(
        "early_percent",
        f"other sites above {_HIGH:g} m",
        lambda row: row.early,
        digits=2,
        unit="%",
        interval=True,
    ),
    Column("late_percent", "below", lambda row: row.late, digits=2, unit="%", interval=True),
    Column("guidance_percent", "guidance", lambda row: row.guidance, digits=2, unit="%", interval=True),
    Column("moves", "moves", lambda row: row.moves, digits=1),
    Column("moved_m", "moved", lambda row: row.moved, digits=1, unit="m"),
    Column("offset_m", "last from first target", lambda row: row.offset, digits=1, unit="m"),
    Column("time_s", "time", lambda row: row.time, digits=1, unit="s"),
)
"""parts.csv, parts.md and the console read this list."""
