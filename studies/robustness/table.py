"""Tables of the robustness sweep: a line per level and policy, successes for a document, and the breaks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from hda.registry import policy_entry
from studies.campaign.points import Rows
from studies.campaign.score import (
    DROP_COLUMN,
    PROPELLANT_COLUMN,
    RATIO_COLUMNS,
    Score,
    score_rows,
    success_drop,
)
from studies.columns import Column, Output
from studies.robustness.breaks import Break
from studies.robustness.factor import Factor
from studies.statistics.ratios import Interval, wilson_interval

_FAILURES = ("hard-landing", "unsafe-site", "crash", "tank-empty", "timed-out")


@dataclass(frozen=True)
class Sweep:
    """One flown factor.

    Attributes:
        factor: what was varied.
        own: the preset's own value.
        levels: value -> rows, the own value among them, rising.
        hazard: value -> measured share of unsafe ground on the tiles.
        breaks: where policies break, the earliest first.
    """

    factor: Factor
    own: float
    levels: dict[float, Rows]
    hazard: dict[float, float]
    breaks: list[Break]


@dataclass(frozen=True)
class LevelRow:
    """One policy at one level.

    Attributes:
        factor: name.
        level: value that was flown.
        own_value: whether it is the preset's own.
        hazard: measured share of unsafe ground on the tiles.
        policy: name.
        score: every figure with its intervals.
        drop: fall of the ratio of successes against the preset's own value, paired.
        endings: ending -> episodes.
    """

    factor: str
    level: float
    own_value: bool
    hazard: float
    policy: str
    score: Score
    drop: Interval
    endings: Counter[str]


def list_levels(sweep: Sweep) -> Iterator[LevelRow]:
    """Every level and policy of a factor, levels rising."""
    nominal = sweep.levels[sweep.own]
    for level, policies in sweep.levels.items():
        for policy, rows in policies.items():
            yield LevelRow(
                sweep.factor.name,
                level,
                level == sweep.own,
                sweep.hazard[level],
                policy,
                score_rows(rows),
                success_drop(nominal[policy], rows),
                Counter(row.outcome for row in rows),
            )


def _ending_column(ending: str) -> Column[LevelRow]:
    return Column(ending.replace("-", "_"), ending, lambda row: row.endings[ending])


LEVEL_COLUMNS: tuple[Column[LevelRow], ...] = (
    Column("factor", "factor", lambda row: row.factor),
    Column("level", "level", lambda row: row.level),
    Column("own_value", "own value", lambda row: row.own_value),
    Column("hazard_percent", "hazard", lambda row: 100.0 * row.hazard),
    Column("policy", "policy", lambda row: row.policy),
    Column("privileged", "privileged", lambda row: policy_entry(row.policy).privileged),
    Column("episodes", "episodes", lambda row: row.score.episodes),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, PROPELLANT_COLUMN)),
    DROP_COLUMN.through(lambda row: row.drop),
    *(_ending_column(ending) for ending in _FAILURES),
)
"""A factor's file: every level and policy, ratios in percent."""

BREAK_COLUMNS: tuple[Column[Break], ...] = (
    Column("factor", "factor", lambda row: row.factor, words=True),
    Column("side", "side", lambda row: row.side, outputs=Output.FILE),
    Column("step", "step", lambda row: row.step, outputs=Output.FILE),
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("level", "breaks at", lambda row: row.level, form="{:g}".format),
    Column("success_percent", "success", lambda row: 100.0 * row.success, digits=1, unit="%"),
    replace(DROP_COLUMN.through(lambda row: row.drop), key="drop_points"),
    Column("ending", "by", lambda row: row.ending, words=True),
    Column("more_failures", "more failures", lambda row: row.more, outputs=Output.FILE),
    Column("causes", "causes", lambda row: row.causes, words=True),
)
"""Where policies break; the first to break leads its factor."""


def write_level_markdown(path: Path, sweep: Sweep) -> None:
    """Write the successes of a factor for a document: a line per policy, a column per level."""
    levels = [f"**{level:.4g}**" if level == sweep.own else f"{level:.4g}" for level in sweep.levels]
    lines = [f"{sweep.factor.label}: success %, Wilson's 95 % interval; the preset's own value is bold", ""]
    lines += ["| policy | " + " | ".join(levels) + " |", "|---|" + "---:|" * len(levels)]
    for policy in sweep.levels[sweep.own]:
        cells = []
        for rows in sweep.levels.values():
            low_high = wilson_interval(sum(row.success for row in rows[policy]), len(rows[policy]))
            ends = (low_high.estimate, low_high.low, low_high.high)
            cells.append("{:.1f} ({:.1f}-{:.1f})".format(*(100.0 * value for value in ends)))
        star = " *" if policy_entry(policy).privileged else ""
        lines.append(f"| {policy}{star} | " + " | ".join(cells) + " |")
    path.write_text("\n".join(lines) + "\n")
