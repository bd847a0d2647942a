"""Each named fault of the navigation sensors, flown by policies on the same episodes; why they failed.

The faults are those of `hda.navigation.NAVIGATION_FAULTS`; the filter knows of each. On a preset with a rigid
body its harder variants, `hda.task.BODY_VARIANTS`, are flown too. Beside the ratios stands
the fall of success against the same episodes without a fault, with its paired 95 % interval, and what
`studies.failures` finds in the first failures, each flown again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number, unknown_name
from hda.navigation.system import NAVIGATION_FAULTS, add_fault
from hda.task.body_variants import BODY_VARIANTS, vary_body
from hda.task.presets import Preset, find_preset
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.journal import Journal
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, Rows, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import FlyingOptions
from studies.campaign.score import (
    DROP_COLUMN,
    PROPELLANT_COLUMN,
    RATIO_COLUMNS,
    Score,
    score_rows,
    success_drop,
)
from studies.columns import Column, Output, console_table, write_csv, write_markdown
from studies.failures.causes import Failure
from studies.failures.explained import explain_episodes, open_causes, print_causes
from studies.statistics.ratios import Interval

NO_FAULT = "no-fault"
"""The preset as it is."""


@dataclass(frozen=True, kw_only=True)
class Faults(FlyingOptions):
    """Command line.

    Attributes:
        faults: names of faults; `all` is every one.
        episodes: episodes per policy and fault.
        preset: the setting, with a navigation filter.
        study_seed: seed of the study; equal seeds give equal episodes with every fault.
        explained: failures of each policy and fault that are flown again for their cause, the first ones.
    """

    faults: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("all",)
    episodes: int = 200
    preset: str = "navigated"
    explained: int = 12
    out: Path = Path("results/faults")

    def __post_init__(self) -> None:
        """Check every number."""
        super().__post_init__()
        finite_number("explained", self.explained, at_least=0)


@dataclass(frozen=True)
class FaultRow:
    """One policy with one fault.

    Attributes:
        fault: name.
        policy: name.
        score: every figure with its intervals.
        drop: fall of the ratio of successes against the flights without a fault, paired.
        causes: of the failures that were explained, the most frequent first.
    """

    fault: str
    policy: str
    score: Score
    drop: Interval
    causes: str


COLUMNS: tuple[Column[FaultRow], ...] = (
    Column("fault", "fault", lambda row: row.fault, words=True),
    Column("policy", "policy", lambda row: row.policy, words=True),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, PROPELLANT_COLUMN)),
    DROP_COLUMN.through(lambda row: row.drop),
    Column("causes", "causes", lambda row: row.causes, words=True, outputs=Output.FILE | Output.DOCUMENT),
)
"""The table: its file, document and console read this list; the console tells the causes below it."""


def fault_presets(preset: Preset, wanted: Sequence[str]) -> dict[str, Preset]:
    """The preset as it is, and with each fault of the given names, in the order of the faults.

    Raises:
        ValueError: the preset has no filter, there is no such fault, or none was given.
    """
    if preset.navigation is None:
        raise ValueError(f"preset {preset.name!r} has no navigation filter: fly the faults on `navigated`")
    if not wanted:
        raise ValueError("faults must name at least one fault")
    names = (*NAVIGATION_FAULTS, *(() if preset.body is None else BODY_VARIANTS))
    for name in wanted:
        if name != "all" and name not in names:
            raise ValueError(unknown_name("navigation fault", name, ("all", *names)))
    chosen = [name for name in names if name in wanted or "all" in wanted]
    faulty = {}
    for name in chosen:
        if name in BODY_VARIANTS:
            faulty[name] = vary_body(preset, name)
        else:
            faulty[name] = replace(preset, navigation=add_fault(preset.navigation, name))
    return {NO_FAULT: preset, **faulty}


def plan_points(options: Faults) -> list[Point]:
    """Every point of the study, that without a fault first.

    Raises:
        ValueError: an option names something unknown.
    """
    preset = find_preset(options.preset)
    policies, paths = choose_policies(options.policies, preset.name)
    return [
        Point(name, Study(world, policies, options.episodes, options.study_seed, options.split, paths))
        for name, world in fault_presets(preset, options.faults).items()
    ]


def tabulate(
    points: Sequence[Point], flown: Mapping[str, Rows], most: int, journal: Journal[Failure]
) -> list[FaultRow]:
    """A line for each fault and policy."""
    own, lines = flown[NO_FAULT], []
    pairs = [(point, policy) for point in points for policy in point.study.policies]
    for point, policy in track(pairs, "explaining failures", transient=True):
        rows = flown[point.label][policy]
        drop = success_drop(own[policy], rows)
        failed = [row.episode for row in rows if not row.success][:most]
        causes = explain_episodes(point, policy, failed, journal)
        lines.append(FaultRow(point.label, policy, score_rows(rows), drop, causes))
    return lines


def run_faults(options: Faults) -> list[FaultRow]:
    """Fly every fault, write table.csv, table.md and provenance.json, and print the table.

    Raises:
        ValueError: an option is out of range or names something unknown, a folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    points = plan_points(options)
    out = open_folder(options.out)
    flown = fly_points(out, points, options.existing, options.workers)
    study = points[0].study
    decided = {"preset": study.preset.name, "study_seed": study.study_seed, "split": study.split}
    with open_causes(out, decided, study.paths, options.existing) as journal:
        lines = tabulate(points, flown, options.explained, journal)
    write_csv(out / "table.csv", COLUMNS, lines)
    write_markdown(out / "table.md", COLUMNS, lines)
    write_provenance(out / "provenance.json", describe_run(options))
    title = f"faults of navigation on {study.preset.name}, {options.episodes} episodes"
    console = Console(width=max(Console().width, 120))
    console.print(console_table(COLUMNS, lines, title))
    print_causes(console, ((line.fault, line.policy, line.causes) for line in lines))
    return lines


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(Faults, description=__doc__)
        run_faults(options)
        Console().print(f"results in {options.out}")


if __name__ == "__main__":
    main()
