"""What the options of fuel-optimal guidance are worth in closed loop, on the tuning tiles.

Fuel-optimal flight is fast and falls freely until late: fewer looks, each from lower, little altitude left to
divert in. Each line changes one option of the default: the thrust that the plan leaves to the feedback, the
length of the gentle terminal phase, a limit on speed. The same sites, the same episodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.flight.episode_row import EpisodeRow
from hda.registry import policy_entry
from hda.task.presets import find_preset
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.campaign.score import FALLBACKS_COLUMN, PROPELLANT_COLUMN, RATIO_COLUMNS, Score, score_rows
from studies.closed_loop.laws import law_name, law_path
from studies.columns import Column, console_table, write_csv, write_markdown

_FLIGHTS = "flights"


@dataclass(frozen=True, kw_only=True)
class ClosedLoop(FolderOptions):
    """Command line of the sweep.

    Attributes:
        sites: which site selection flies.
        preset: the setting.
        episodes: episodes for each line.
        margins: thrust margins.
        terminal_periods: control periods of the terminal phase.
        speed_limits: [m/s] greatest speeds.
        workers: processes; changes nothing but the time.
    """

    sites: Literal["single-divert", "nearest-safe"] = "single-divert"
    preset: str = "paper"
    episodes: int = 500
    margins: tuple[float, ...] = (0.0, 0.05, 0.2)
    terminal_periods: tuple[int, ...] = (1, 2, 8)
    speed_limits: tuple[float, ...] = (50.0, 40.0, 35.0, 30.0)
    workers: int = 2
    out: Path = Path("results/closed_loop")

    def __post_init__(self) -> None:
        """Check every number."""
        finite_number("episodes", self.episodes, at_least=1)
        finite_number("workers", self.workers, at_least=1)


@dataclass(frozen=True)
class GuidanceRow:
    """One line of the table.

    Attributes:
        policy: name of what flew.
        guidance: its law in words.
        score: every figure with its intervals.
        touchdown_speed: [m/s] median, 99 % quantile and greatest.
        looks: mean number of them.
    """

    policy: str
    guidance: str
    score: Score
    touchdown_speed: tuple[float, float, float]
    looks: float


COLUMNS: tuple[Column[GuidanceRow], ...] = (
    Column("policy", "policy", lambda row: row.policy, words=True),
    Column("guidance", "guidance", lambda row: row.guidance, words=True),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, PROPELLANT_COLUMN)),
    Column("speed_mps_p50", "speed p50", lambda row: row.touchdown_speed[0], digits=2, unit="m/s"),
    Column("speed_mps_p99", "p99", lambda row: row.touchdown_speed[1], digits=2, unit="m/s"),
    Column("speed_mps_max", "max", lambda row: row.touchdown_speed[2], digits=2, unit="m/s"),
    Column("looks", "looks", lambda row: row.looks, digits=2),
    FALLBACKS_COLUMN.through(lambda row: row.score),
)
"""The table: its file, document and console read this list."""


def list_laws(options: ClosedLoop) -> dict[str, str]:
    """Name of each line's policy -> its guidance in words; paths are registered on the way.

    Raises:
        ValueError: an option is out of range.
    """
    laws = {options.sites: "ZEM/ZEV 6/2", f"{options.sites}+convex": "default"}
    for option, value, words in _changes(options):
        policy_entry(law_path(options.sites, option, value))
        laws[law_name(options.sites, option, value)] = words
    return laws


def _changes(options: ClosedLoop) -> list[tuple[str, float, str]]:
    """(option, value, words) of every line beside ZEM/ZEV and the default."""
    changes = [("thrust_margin", value, f"thrust margin {value:.0%}") for value in options.margins]
    changes += [
        ("terminal_periods", periods, f"terminal phase of {periods} periods")
        for periods in options.terminal_periods
    ]
    return changes + [("speed_limit", value, f"speed limit {value:g} m/s") for value in options.speed_limits]


def plan_study(options: ClosedLoop) -> tuple[Study, dict[str, str]]:
    """The study of every line, and the words for each policy.

    Raises:
        ValueError: an option is out of range or names something unknown.
    """
    laws = list_laws(options)
    paths = tuple(law_path(options.sites, option, value) for option, value, _ in _changes(options))
    study = Study(find_preset(options.preset), tuple(laws), options.episodes, split="tuning", paths=paths)
    return study, laws


def summarize_guidance(policy: str, guidance: str, rows: Sequence[EpisodeRow]) -> GuidanceRow:
    """The line of one policy."""
    middle, high, most = np.quantile([row.touchdown_speed_mps for row in rows], (0.5, 0.99, 1.0))
    return GuidanceRow(
        policy,
        guidance,
        score_rows(rows),
        (float(middle), float(high), float(most)),
        float(np.mean([row.decisions for row in rows])),
    )


def run_closed_loop(options: ClosedLoop) -> list[GuidanceRow]:
    """Fly every line, write table.csv, table.md and provenance.json, and print the table.

    Raises:
        ValueError: an option is out of range or names something unknown, the folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    study, laws = plan_study(options)
    out = open_folder(options.out)
    flown = fly_points(out, [Point(_FLIGHTS, study)], options.existing, options.workers)[_FLIGHTS]
    lines = [summarize_guidance(name, words, flown[name]) for name, words in laws.items()]
    write_csv(out / "table.csv", COLUMNS, lines)
    write_markdown(out / "table.md", COLUMNS, lines)
    write_provenance(out / "provenance.json", describe_run(options))
    title = f"{options.sites} on {study.preset.name}, {options.episodes} tuning episodes"
    Console(width=max(Console().width, 170)).print(console_table(COLUMNS, lines, title))
    Console().print(f"results in {out}")
    return lines


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        run_closed_loop(tyro.cli(ClosedLoop, description=__doc__))
