"""Tables of what was seen: failed landings, islands of safe ground and hazards by height."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from studies.campaign.score import scaled
from studies.columns import Column
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
EARLY = 400.0
"""[m] above the target from which a look or a move counts as early."""


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
        read: [m^2] median of the most safe ground within a shift of the target in a look of the flight.
        encoded: [m^2] the same of what an encoding showed.
        warned: [s] median time from the first look whose encoding showed the last site as a hazard to the
            touchdown; nan where none did.
    """

    policy: str
    loss: Loss
    failed: int
    episodes: int
    tiles: int
    depth: float
    read: float
    encoded: float
    warned: float


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
    """Islands of safe ground in looks, of one band of heights and areas.

    Attributes:
        height: number of the band of heights.
        area: number of the band of areas.
        islands: how many.
        shown: share of which the encodings show a pixel, clustered by tile.
    """

    height: int
    area: int
    islands: int
    shown: Interval


@dataclass(frozen=True)
class HazardRow:
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


def count_losses(policy: str, flown: Sequence[FlownEpisode]) -> list[LossRow]:
    """Failed flights by cause, in the order of `Loss`; causes without any are left out."""
    rows = []
    for loss in Loss:
        failed = [flight for flight in flown if flight.loss is loss]
        if failed and loss is not Loss.NONE:
            warned = [time for flight in failed if not math.isnan(time := flight.warned)]
            rows.append(
                LossRow(
                    policy,
                    loss,
                    len(failed),
                    len(flown),
                    len({flight.tile for flight in failed}),
                    median(flight.depth for flight in failed),
                    median(max(sight.read for sight in flight.near) for flight in failed),
                    median(max(sight.encoded for sight in flight.near) for flight in failed),
                    median(warned) if warned else math.nan,
                )
            )
    return rows


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


def share_islands(flown: Sequence[FlownEpisode]) -> list[IslandRow]:
    """Shares of islands that encodings show, by height, the greatest first, and area."""
    counts = [
        (flight.tile, (seen.height, seen.area), (seen.islands, seen.shown))
        for flight in flown
        for seen in flight.islands
    ]
    return [
        IslandRow(*band, int(islands.sum()), clustered_count_interval(shown, islands))
        for band, (islands, shown) in _sum_bands(counts)
    ]


def share_hazards(flown: Sequence[FlownEpisode]) -> list[HazardRow]:
    """Shares of hazards that looks and encodings show, by height, the greatest first, and depth."""
    counts = [
        (flight.tile, (seen.height, seen.depth), (seen.pixels, seen.read, seen.encoded))
        for flight in flown
        for seen in flight.hazards
    ]
    return [
        HazardRow(
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
    Column("seen", "what was seen", lambda row: row.loss.value, words=True),
    Column("failed", "failed", lambda row: row.failed),
    Column("episodes", "of", lambda row: row.episodes),
    Column("tiles", "tiles", lambda row: row.tiles),
    Column("depth_m", "from safe ground", lambda row: row.depth, digits=1, unit="m"),
    Column("read_m2", "safe ground read", lambda row: row.read, digits=0, unit="m²"),
    Column("encoded_m2", "encoded", lambda row: row.encoded, digits=0, unit="m²"),
    Column("warned_s", "hazard shown before touchdown", lambda row: row.warned, digits=1, unit="s"),
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
    Column("height_m", "height m", lambda row: _band(HEIGHTS, row.height), words=True),
    Column("area_m2", "island m²", lambda row: _band(AREAS, row.area), words=True),
    Column("islands", "islands read", lambda row: row.islands),
    Column(
        "shown_percent",
        "encoding shows",
        lambda row: scaled(row.shown, 100.0),
        digits=1,
        unit="%",
        interval=True,
    ),
)
"""islands.csv, islands.md and the console read this list."""

HAZARD_COLUMNS: tuple[Column[HazardRow], ...] = (
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
"""hazards.csv, hazards.md and the console read this list."""
