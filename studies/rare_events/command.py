"""How likely one policy fails, where failures are rare: flights are branched where failure is near.

Each episode is a draw of ground, start and noise. Before each look its flight is held against the true map:
where failure is near it is split into branches that meet other noise and other engine errors; where it is far
most flights are given up, and the few that go on stand for them (Russian roulette). Weights keep the estimate
unbiased. A pilot on the tuning tiles says where failure is near. table.md has the probability with its
interval and its cost; causes.md and rare-events.png what the failing flights have in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.ground.library import Ground, tile_numbers
from hda.task.presets import find_preset
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.journal import Journal, open_journal
from studies.campaign.monte_carlo import Study, prepare_study
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.rare_events.batches import Batch, Work, fly_work
from studies.rare_events.level_values import fit_values
from studies.rare_events.table import (
    CAUSE_COLUMNS,
    COLUMNS,
    COST_COLUMNS,
    CostRow,
    EstimateRow,
    collect_roots,
    count_causes,
    estimate,
    sum_costs,
)

SPLITTING, WHOLE, PILOT = "splitting", "whole flights", "pilot"
_TUNING = "tuning"
_PILOT_FIRST, _WHOLE_FIRST = 2**31, 2**30  # first episodes: no part of a run shares noise with another
_PRODUCTS = (
    "table.csv",
    "table.md",
    "causes.csv",
    "causes.md",
    "costs.csv",
    "rare-events.png",
    "provenance.json",
)


@dataclass(frozen=True, kw_only=True)
class RareEvents(FolderOptions):
    """Command line.

    Attributes:
        policy: its name; `package.module:Name` is your own.
        preset: the setting.
        episodes: draws of ground, start and noise.
        effort: whole flights that an episode may cost, in the mean.
        pilot: whole flights over the tuning tiles that say where failure is near.
        whole: whole flights flown beside, over other episodes, to check the estimate.
        study_seed: seed of the study; equal seeds give equal tables.
        split: tile split that is measured: validation or fresh.
        workers: processes; changes nothing but the time.
        figures: draw the figure.
    """

    policy: str = "nearest-safe"
    preset: str = "paper"
    episodes: int = 3000
    effort: float = 0.1
    pilot: int = 300
    whole: int = 0
    study_seed: int = 0
    split: str = "validation"
    workers: int = 2
    figures: bool = True
    out: Path = Path("results/rare_events")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "pilot", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        for name in ("whole", "study_seed"):
            finite_number(name, getattr(self, name), at_least=0)
        finite_number("effort", self.effort, above=0.0)


def plan_study(options: RareEvents) -> Study:
    """The policy, setting and split that are measured.

    Raises:
        ValueError: an option names something unknown, several policies, or the tuning split.
    """
    preset = find_preset(options.preset)
    policies, paths = choose_policies((options.policy,), preset.name)
    if len(policies) != 1:
        raise ValueError(f"policy must be the name of one policy, got {options.policy!r}")
    if options.split == _TUNING:
        raise ValueError("split must not be 'tuning': the pilot flies there, so measure another")
    tile_numbers(options.split, Ground(preset.terrain, preset.criteria))
    return Study(preset, policies, options.episodes, options.study_seed, options.split, paths)


def fly_parts(options: RareEvents, study: Study, journal: Journal[Batch]) -> dict[str, list[Batch]]:
    """Fly the pilot, the trees and the whole flights; name of the part -> its batches."""
    trial = Work(PILOT, replace(study, split=_TUNING), _PILOT_FIRST, options.pilot, pilot=True)
    for each in (trial.study, study):
        prepare_study(each, options.workers)  # before the bar: building terrain shows one of its own
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, transient=True) as progress:

        def fly(work: Work) -> list[Batch]:
            task = progress.add_task(work.name, total=work.count)
            return fly_work(work, journal, options.workers, lambda count: progress.advance(task, count))

        piloted = fly(trial)
        values = fit_values([passage for batch in piloted for passage in batch.passages])
        grown = Work(SPLITTING, study, 0, options.episodes, values, options.effort)
        flown = {PILOT: piloted, SPLITTING: fly(grown)}
        if options.whole:
            flown[WHOLE] = fly(Work(WHOLE, study, _WHOLE_FIRST, options.whole))
    return flown


def run_rare_events(options: RareEvents) -> list[EstimateRow]:
    """Fly, write the tables, the figure and provenance.json, and print the tables.

    Raises:
        ValueError: an option is out of range or names something unknown, the folder holds another study, or
            the policy or a worker failed.
        OSError: the folder cannot be written.
    """
    study, out = plan_study(options), open_folder(options.out)
    decided = {
        name: getattr(options, name)
        for name in ("policy", "preset", "effort", "pilot", "study_seed", "split")
    }
    identity = identify_run(Path(__file__).parent, decided, study.paths)
    with open_journal(out, Batch, _PRODUCTS, identity, options.existing) as journal:
        flown = fly_parts(options, study, journal)
        pilot = sum_costs(PILOT, flown[PILOT])
        each, policy = pilot.steps / pilot.episodes, study.policies[0]
        roots = {name: collect_roots(flown[name]) for name in (SPLITTING, WHOLE) if name in flown}
        lines = [
            estimate(name, policy, own, each, options.pilot if name == SPLITTING else 0)
            for name, own in roots.items()
        ]
        causes = count_causes(roots[SPLITTING])
        costs = [sum_costs(name, batches) for name, batches in flown.items()]
        write_csv(out / "table.csv", COLUMNS, lines)
        write_markdown(out / "table.md", COLUMNS, lines)
        write_csv(out / "causes.csv", CAUSE_COLUMNS, causes)
        write_markdown(out / "causes.md", CAUSE_COLUMNS, causes)
        write_csv(out / "costs.csv", COST_COLUMNS, costs)
        if options.figures:
            from studies.rare_events.picture import draw_failing

            draw_failing(roots[SPLITTING], causes).savefig(out / "rare-events.png", dpi=90)
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    console = Console(width=max(Console().width, 120))
    title = f"{policy} on {study.preset.name}, {study.split}: how likely it fails"
    console.print(console_table(COLUMNS, lines, title))
    if causes:
        console.print(console_table(CAUSE_COLUMNS, causes, "what the failing flights have in common"))
    console.print(console_table(COST_COLUMNS, costs, tell_pilot(pilot, flown[PILOT])))
    return lines


def tell_pilot(cost: CostRow, batches: Sequence[Batch]) -> str:
    """What the pilot found, in words."""
    failed = sum(passage.failed for batch in batches for passage in batch.passages)
    return f"the pilot: {failed} of {cost.episodes} flights failed over the tuning tiles"


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(RareEvents, description=__doc__)
        run_rare_events(options)
        Console().print(f"results in {options.out}")
