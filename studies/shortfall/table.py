"""Tables of what was seen: landings and failures, islands of safe ground and hazards by height."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from studies.columns import Column, percent_interval
from studies.failures.causes import SAFE_READING
from studies.shortfall.encoded_sight import (
    AREAS,
    DEPTHS,
    HEIGHTS,
    Loss,
)
from studies.shortfall.flights import FlownEpisode
from studies.statistics.ratios import Interval, clustered_count_interval

SHOWN = (0.0, 100.0, 300.0)
"""[m^2] of safe ground near the target: between the bands of flights that are counted apart."""
FAILED = "every failure"
EARLY = 400.0
"""[m] above the target from which a look or a move counts as early."""


@dataclass(frozen=True)
class LossRow:
    """Flights of a policy with one end: those that landed are the base rate of the others.

    Attributes:
        policy: name.
        seen: `Loss` in words, or `FAILED`.
        flights: how many.
        episodes: that it flew.
        tiles: on how many tiles they fell.
        depth: [m] median distance of the touchdowns from safe ground, of those with some near; else nan.
        read: [m^2] median of the most safe ground within a shift of the target in a look of the flight.
        encoded: [m^2] the same of what an encoding showed.
        chosen: how many chose their last site on a look that read it.
        refused: of these, those where that look read it as a hazard.
        warned: of these, those where the encoding of that look showed it as one.
    """

    policy: str
    seen: str
    flights: int
    episodes: int
    tiles: int
    depth: float
    read: float
    encoded: float
    chosen: int
    refused: int
    warned: int


@dataclass(frozen=True)
class ShownRow:
    """Flights of a policy by how much safe ground near the target the encodings of its early looks showed.

    Attributes:
        policy: name.
        shown: number of the band in `SHOWN` of the most safe ground that one encoding showed within a shift
            of the target, from at least `EARLY` above it.
        flights: how many.
        failed: how many of them failed.
    """

    policy: str
    shown: int
    flights: int
    failed: int


@dataclass(frozen=True)
class IslandRow:
    """Islands of safe ground in a policy's looks, of one band of heights and areas.

    Attributes:
        policy: name.
        height: number of the band of heights.
        area: number of the band of areas.
        islands: how many.
        shown: share of which the encodings show a pixel, clustered by tile.
    """

    policy: str
    height: int
    area: int
    islands: int
    shown: Interval


@dataclass(frozen=True)
class HazardRow:
    """Pixels of one band of heights and depths that a policy could have moved its target to.

    Attributes:
        policy: name.
        height: number of the band of heights.
        depth: number of the band of depths.
        pixels: how many.
        read: share that the looks read as hazard, clustered by tile.
        encoded: share that their encodings show as hazard, clustered by tile.
    """

    policy: str
    height: int
    depth: int
    pixels: int
    read: Interval
    encoded: Interval


def count_losses(policy: str, flown: Sequence[FlownEpisode]) -> list[LossRow]:
    """Flights by what was seen, in the order of `Loss`, then all that failed; what none is of is left out."""
    kinds = {loss.value: [flight for flight in flown if flight.loss is loss] for loss in Loss}
    kinds[FAILED] = [flight for flight in flown if flight.loss is not Loss.NONE]
    return [_count_loss(policy, seen, some, len(flown)) for seen, some in kinds.items() if some]


def _count_loss(policy: str, seen: str, flights: Sequence[FlownEpisode], episodes: int) -> LossRow:
    depths = [flight.depth for flight in flights if math.isfinite(flight.depth)]
    chosen = [sight for flight in flights for sight in flight.chosen]
    return LossRow(
        policy,
        seen,
        len(flights),
        episodes,
        len({flight.tile for flight in flights}),
        median(depths) if depths else math.nan,
        median(max(sight.read for sight in flight.near) for flight in flights),
        median(max(sight.encoded for sight in flight.near) for flight in flights),
        len(chosen),
        sum(sight.read < SAFE_READING for sight in chosen),
        sum(sight.encoded < SAFE_READING for sight in chosen),
    )


def count_shown(policy: str, flown: Sequence[FlownEpisode]) -> list[ShownRow]:
    """Flights and failures by what the encodings of early looks showed of safe ground, the least first."""
    most = [
        max(
            (
                sight.encoded
                for sight, move in zip(flight.near, flight.parts.moves, strict=True)
                if move.height >= EARLY
            ),
            default=0.0,
        )
        for flight in flown
    ]
    bands = np.searchsorted(SHOWN, most)
    failed = np.array([flight.loss is not Loss.NONE for flight in flown])
    return [
        ShownRow(policy, band, int((bands == band).sum()), int(failed[bands == band].sum()))
        for band in range(len(SHOWN) + 1)
        if (bands == band).any()
    ]


def share_islands(policy: str, flown: Sequence[FlownEpisode]) -> list[IslandRow]:
    """Shares of islands that encodings show, by height, the greatest first, and area."""
    counts = [
        (flight.tile, (seen.height, seen.area), (seen.islands, seen.shown))
        for flight in flown
        for seen in flight.islands
    ]
    return [
        IslandRow(policy, *band, int(islands.sum()), clustered_count_interval(shown, islands))
        for band, (islands, shown) in _sum_bands(counts)
    ]


def share_hazards(policy: str, flown: Sequence[FlownEpisode]) -> list[HazardRow]:
    """Shares of hazards that looks and encodings show, by height, the greatest first, and depth."""
    counts = [
        (flight.tile, (seen.height, seen.depth), (seen.pixels, seen.read, seen.encoded))
        for flight in flown
        for seen in flight.hazards
    ]
    return [
        HazardRow(
            policy,
            *band,
            int(pixels.sum()),
            clustered_count_interval(read, pixels),
            clustered_count_interval(encoded, pixels),
        )
        for band, (pixels, read, encoded) in _sum_bands(counts)
    ]


def _sum_bands(
    counts: Iterable[tuple[int, tuple[int, int], tuple[int, ...]]],
) -> list[tuple[tuple[int, int], NDArray[np.int_]]]:
    """Sums by band, the greatest height first: each of shape (counts, tiles)."""
    sums: dict[tuple[int, int], dict[int, NDArray[np.int_]]] = {}
    for tile, band, numbers in counts:
        tiles = sums.setdefault(band, {})
        tiles[tile] = tiles.get(tile, np.zeros(len(numbers), dtype=int)) + numbers
    ordered = sorted(sums, key=lambda band: (-band[0], band[1]))
    return [(band, np.array(list(sums[band].values())).T) for band in ordered]


def _band(edges: Sequence[float], number: int) -> str:
    """A band in words."""
    if number == 0:
        return f"below {edges[0]:g}"
    return f"{edges[number - 1]:g} to {edges[number]:g}" if number < len(edges) else f"above {edges[-1]:g}"


LOSS_COLUMNS: tuple[Column[LossRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("seen", "what was seen", lambda row: row.seen, words=True),
    Column("flights", "flights", lambda row: row.flights),
    Column("episodes", "of", lambda row: row.episodes),
    Column("tiles", "tiles", lambda row: row.tiles),
    Column("depth_m", "from safe ground", lambda row: row.depth, digits=1, unit="m"),
    Column("read_m2", "safe ground read", lambda row: row.read, digits=0, unit="m²"),
    Column("encoded_m2", "encoded", lambda row: row.encoded, digits=0, unit="m²"),
    Column("chosen", "last site chosen on a look of it", lambda row: row.chosen),
    Column("refused", "look read a hazard", lambda row: row.refused),
    Column("warned", "encoding showed one", lambda row: row.warned),
)
"""losses.csv, losses.md and the console read this list."""

SHOWN_COLUMNS: tuple[Column[ShownRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column(
        "shown_m2",
        f"safe ground that encodings show within a shift, from above {EARLY:g} m; m²",
        lambda row: _band(SHOWN, row.shown) if row.shown else "none",
        words=True,
    ),
    Column("flights", "flights", lambda row: row.flights),
    Column("failed", "failed", lambda row: row.failed),
)
"""shown.csv, shown.md and the console read this list."""

ISLAND_COLUMNS: tuple[Column[IslandRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("height_m", "height m", lambda row: _band(HEIGHTS, row.height), words=True),
    Column("area_m2", "island m²", lambda row: _band(AREAS, row.area), words=True),
    Column("islands", "islands read", lambda row: row.islands),
    percent_interval("shown_percent", "encoding shows", lambda row: row.shown),
)
"""islands.csv, islands.md and the console read this list."""

HAZARD_COLUMNS: tuple[Column[HazardRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("height_m", "height m", lambda row: _band(HEIGHTS, row.height), words=True),
    Column(
        "depth_m",
        "from safe ground m",
        lambda row: _band(DEPTHS, row.depth) if row.depth else "safe ground",
        words=True,
    ),
    Column("pixels", "pixels", lambda row: row.pixels),
    percent_interval("read_percent", "look reads a hazard", lambda row: row.read),
    percent_interval("encoded_percent", "encoding shows one", lambda row: row.encoded),
)
"""hazards.csv, hazards.md and the console read this list."""
