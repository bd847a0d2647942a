"""What a layer of reality costs: the paired fall of success from setting to setting, and the policies' order.

Settings share ground and starts, so an episode of a number is the same descent in each; what differs is what
the lander knows and how it flies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hda.flight.episode_row import EpisodeRow
from hda.registry import policy_entry
from studies.campaign.points import Rows
from studies.campaign.score import (
    DROP_COLUMN,
    PROPELLANT_COLUMN,
    RATIO_COLUMNS,
    Score,
    propellant_rise,
    score_rows,
    success_drop,
)
from studies.columns import Column, Output, points_interval
from studies.statistics.moments import tiled_mean
from studies.statistics.paired import decide_leads, paired_ratio_interval
from studies.statistics.ratios import NO_INTERVAL, Interval, scaled


@dataclass(frozen=True)
class LayerRow:
    """One policy in one setting.

    Attributes:
        preset: name of the setting.
        policy: name.
        score: every figure with its intervals.
        step: fall of the ratio of successes against the setting before, paired; nan in the first.
        fall: the same against the first setting.
        price: rise of the propellant against the first setting [%], over the episodes that succeed in both,
            clustered by tile; nan in it.
        lost: episodes that succeed in the setting before and fail here; in the first, those that fail.
        causes: of the first of these, in words.
    """

    preset: str
    policy: str
    score: Score
    step: Interval
    fall: Interval
    price: Interval
    lost: int
    causes: str


def lost_episodes(before: Sequence[EpisodeRow] | None, rows: Sequence[EpisodeRow]) -> list[int]:
    """Episodes that fail here and not in the setting before; without one, those that fail."""
    fine = [True] * len(rows) if before is None else [row.success for row in before]
    return [row.episode for row, was in zip(rows, fine, strict=True) if was and not row.success]


def describe_layer(
    flown: Mapping[str, Rows], preset: str, policy: str, explain: Callable[[list[int]], str]
) -> LayerRow:
    """The line of a policy in a setting.

    Args:
        flown: setting -> rows of each policy, from the first setting to the last.
        preset: name of the setting.
        policy: its name.
        explain: gives the causes of failed episodes in words.
    """
    layers, rows = list(flown), flown[preset][policy]
    place, score = layers.index(preset), score_rows(rows)
    if place == 0:
        lost = lost_episodes(None, rows)
        return LayerRow(
            preset, policy, score, NO_INTERVAL, NO_INTERVAL, NO_INTERVAL, len(lost), explain(lost)
        )
    first, before = flown[layers[0]][policy], flown[layers[place - 1]][policy]
    lost, step, fall = lost_episodes(before, rows), success_drop(before, rows), success_drop(first, rows)
    price = propellant_rise(first, rows)
    return LayerRow(preset, policy, score, step, fall, price, len(lost), explain(lost))


class Verdict(StrEnum):
    """What becomes of the order of two policies from the first setting to the last."""

    KEPT = "kept"
    REVERSED = "reversed"
    LOST = "no longer decided"
    TURNED = "decided only at the end, the other way"
    CONFIRMED = "decided only at the end"
    NONE = "never decided"


@dataclass(frozen=True)
class PairRow:
    """Two policies in every setting, on the same episodes.

    Attributes:
        better: the one with more successes in the first setting; the registry's order decides equal numbers.
        other: the other.
        leads: by how much `better` leads in each setting, a ratio with its paired 95 % interval.
        fall: by how much more `better` falls than `other` from the first setting to the last: a ratio with
            its 95 % interval, clustered by tile. nan where the first setting does not decide their order:
            the luckier of two equal policies stands as `better`, and falls for no other reason.
        verdict: what becomes of their order.
    """

    better: str
    other: str
    leads: tuple[Interval, ...]
    fall: Interval
    verdict: Verdict


def judge_order(first: int, last: int) -> Verdict:
    """What becomes of an order: 1 where `better` leads, -1 where `other` does, 0 where nothing is decided."""
    if first == 0:
        return {1: Verdict.CONFIRMED, -1: Verdict.TURNED, 0: Verdict.NONE}[last]
    return {1: Verdict.KEPT, -1: Verdict.REVERSED, 0: Verdict.LOST}[first * last]


def decide_order(rows: Rows, pairs: Sequence[tuple[str, str]]) -> list[int]:
    """Who leads in each pair of policies: 1 for the first, -1 for the second, 0 where chance explains it."""
    tiles = [row.tile for row in next(iter(rows.values()))]
    leads = decide_leads([(_successes(rows[a]), _successes(rows[b])) for a, b in pairs], tiles)
    return [lead.sign for lead in leads]


def compare_order(flown: Mapping[str, Rows]) -> list[PairRow]:
    """Every pair of policies that may be compared: those that see the true map are left out.

    Args:
        flown: setting -> rows of each policy, from the first setting to the last.
    """
    layers = list(flown.values())
    names = [name for name in layers[0] if not policy_entry(name).privileged]
    hits = {name: sum(row.success for row in layers[0][name]) for name in names}
    pairs = [(a, b) if hits[a] >= hits[b] else (b, a) for a, b in combinations(names, 2)]
    if not pairs:
        return []
    first, last = decide_order(layers[0], pairs), decide_order(layers[-1], pairs)
    found = []
    for (better, other), was, stays in zip(pairs, first, last, strict=True):
        leads = tuple(_lead(layer[better], layer[other]) for layer in layers)
        fall = NO_INTERVAL if was == 0 else extra_fall(layers[0], layers[-1], better, other)
        found.append(PairRow(better, other, leads, fall, judge_order(was, stays)))
    return found


def _successes(rows: Sequence[EpisodeRow]) -> NDArray[np.int_]:
    return np.array([row.success for row in rows], dtype=int)


def _lead(better: Sequence[EpisodeRow], other: Sequence[EpisodeRow]) -> Interval:
    return paired_ratio_interval(_successes(better), _successes(other))


def extra_fall(first: Rows, last: Rows, policy: str, other: str) -> Interval:
    """By how much more a policy falls than another from one setting to another, episode by episode.

    Returns:
        A ratio with its 95 % interval, clustered by tile; without ends where it is the same on all episodes.
    """
    falls = [_successes(first[name]) - _successes(last[name]) for name in (policy, other)]
    return tiled_mean(falls[0] - falls[1], [row.tile for row in last[policy]])


LAYER_COLUMNS: tuple[Column[LayerRow], ...] = (
    Column("preset", "preset", lambda row: row.preset, words=True),
    Column(
        "policy",
        "policy",
        lambda row: row.policy,
        words=True,
        mark=lambda row: " *" if policy_entry(row.policy).privileged else "",
    ),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, PROPELLANT_COLUMN)),
    replace(DROP_COLUMN.through(lambda row: row.step), key="step_points", heading="step", stem="step"),
    DROP_COLUMN.through(lambda row: row.fall),
    points_interval("price_points", "price", lambda row: row.price, digits=2, stem="price"),
    Column("lost", "lost", lambda row: row.lost),
    Column("causes", "causes", lambda row: row.causes, words=True, outputs=Output.FILE | Output.DOCUMENT),
)
"""A line for each setting and policy: `step` against the one before, `drop`, `price` against the first."""


def pair_columns(presets: Sequence[str]) -> tuple[Column[PairRow], ...]:
    """Columns of the pairs: their leads in each setting, and what becomes of them."""
    return (
        Column("better", "better", lambda row: row.better, words=True),
        Column("other", "other", lambda row: row.other, words=True),
        *(
            points_interval(
                f"{preset.replace('-', '_')}_points",
                f"lead on {preset}",
                lambda row, k=k: scaled(row.leads[k], 100.0),
                stem=preset.replace("-", "_"),
            )
            for k, preset in enumerate(presets)
        ),
        points_interval(
            "extra_fall_points", "falls more by", lambda row: scaled(row.fall, 100.0), stem="extra_fall"
        ),
        Column("verdict", "order", lambda row: row.verdict.value, words=True),
    )
