"""Fly policies over the same episodes and print the table that compares them.

Every policy meets the same ground, starts, map noise and thrust errors. Beside each ratio stands Wilson's
interval, beside each mean Student's, and in brackets the interval clustered by tile; p is the exact McNemar
test of safe landings against single-divert. Privileged policies see the true map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.ground.detail import GroundDetail
from hda.ground.own_terrain import OWN_SPLIT
from hda.registry import policy_entry
from hda.task.own_ground import place_preset
from hda.task.presets import Preset, find_preset
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.episode_files import write_episodes
from studies.campaign.executor import OpenExecutor, local_processes
from studies.campaign.monte_carlo import Study
from studies.campaign.provenance import describe_study, write_checksums, write_provenance
from studies.campaign.run_options import KeepingOptions
from studies.campaign.study_folder import StudyFolder, open_study_folder
from studies.compare.differences import compare_pairs, write_paired
from studies.compare.display import Phase, show_phase
from studies.compare.flights import choose_flights, fly_pictures
from studies.compare.flying import fly_comparison
from studies.compare.quick import QUICK_EPISODES, QUICK_FOLDER, QUICK_POLICIES, show_report
from studies.compare.report import ReportContent, write_report
from studies.compare.scores import StudyScores, score_study
from studies.compare.table import (
    REFERENCE_POLICY,
    PolicySummary,
    print_table,
    summarize_policy,
    write_markdown,
    write_table,
    write_timings,
)
from studies.contract import check_contract


@dataclass(frozen=True)
class Comparison(KeepingOptions):
    """Command line of the comparison.

    Attributes:
        episodes: episodes per policy, at least 1.
        policies: names of policies; `default` is every one that is not slow, not made for another
            preset and no rival, `rivals` those rebuilt from the papers of others, `all` every one;
            `package.module:Name` is a policy of your own, checked against the contract first.
        preset: the setting: paper, hard, partial, lidar, lidar-coarse or navigated.
        study_seed: seed of the study; equal seeds give equal episodes.csv and table.csv.
        split: tile split: validation or fresh to evaluate, tuning for choices.
        terrain: ground of your own in place of the preset's, GeoTIFF or .npy (1 m a cell, row 0 south); the
            split is then `own`.
        band: of your terrain's GeoTIFF, counted from 1; needed where there are several.
        nodata: numbers in your terrain's file that mean unknown ground, besides that which it declares.
        flat_is_ground: areas of one exact height on your terrain are ground, not a value for unknown
            ground.
        detail: seed of the hazards that are added to your terrain, whose pixels of more than 1 m cannot show
            them: small craters, rocks, relief; nothing is added by default.
        rock_abundance: of those rocks: sparse, medium or dense; medium by default.
        hazard_share: least share of unsafe ground around a first target on your terrain, 0 to 1; the preset's
            by default.
        workers: processes of this machine; changes nothing but the time.
        scheduler: address of a Dask scheduler, such as tcp://host:8786; its workers fly the episodes.
        slurm: fly on workers in Slurm jobs; jobqueue.slurm in Dask's configuration describes a job.
        slurm_jobs: jobs to submit.
        out: folder for results; results/PRESET by default.
        resume: go on with the study in the folder, which must be the same; begins it where there is none.
        figures: draw the histograms and trajectories.
        report: write report.html, and keep the flights that it shows.
        quick: a first result: 100 episodes of six policies, without figures, in results/quick, where it
            replaces the study that is there unless you give --resume or --out. An option that you give
            counts, such as --episodes or --figures. The report is opened on a terminal with a screen.
    """

    episodes: int = 1000
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("default",)
    preset: str = "paper"
    study_seed: int = 0
    split: str = "validation"
    terrain: Path | None = None
    band: int | None = None
    nodata: tuple[float, ...] = ()
    flat_is_ground: bool = False
    detail: int | None = None
    rock_abundance: str | None = None
    hazard_share: float | None = None
    workers: int = 2
    scheduler: str | None = None
    slurm: bool = False
    slurm_jobs: int = 1
    out: Path | None = None
    figures: bool = True
    report: bool = True
    quick: bool = False


QUICK = Comparison(
    episodes=QUICK_EPISODES, policies=QUICK_POLICIES, out=QUICK_FOLDER, figures=False, quick=True
)
"""What `--quick` stands for; an option that the user gives takes the place of the value here."""


def read_options(arguments: Sequence[str] | None = None) -> Comparison:
    """Read the command line.

    Args:
        arguments: words of it; those of the process by default.
    """
    read = partial(tyro.cli, Comparison, description=__doc__, args=arguments)
    options = read()
    if not options.quick:
        return options
    replaced = options.overwrite or (options.out is None and not options.resume)
    return replace(read(default=QUICK), overwrite=replaced)


def plan_study(options: Comparison) -> Study:
    """Check the options and make the study: policies in the order of the registry, each once.

    Raises:
        ValueError: an option is out of range or names something unknown.
    """
    for name in ("episodes", "workers", "slurm_jobs"):
        finite_number(name, getattr(options, name), at_least=1)
    finite_number("study_seed", options.study_seed, at_least=0)
    policies, paths = choose_policies(options.policies, options.preset)
    preset, split = choose_ground(options)
    return Study(preset, policies, options.episodes, options.study_seed, split, paths)


def choose_ground(options: Comparison) -> tuple[Preset, str]:
    """The setting, on the user's own terrain where one is given, and the split.

    Raises:
        ValueError: the preset is unknown, or the terrain cannot be flown over.
    """
    if options.terrain is None:
        for name in ("hazard_share", "band", "nodata", "flat_is_ground", "detail", "rock_abundance"):
            if getattr(options, name) != getattr(Comparison, name):
                raise ValueError(f"{name} is for a terrain of your own: give --terrain too")
        return find_preset(options.preset), options.split
    if options.split not in (Comparison.split, OWN_SPLIT):
        raise ValueError(f"split must be {OWN_SPLIT!r} with a terrain of your own, got {options.split!r}")
    if options.detail is None and options.rock_abundance is not None:
        raise ValueError("rock_abundance is for rocks that are added: give --detail SEED too")
    abundance = {} if options.rock_abundance is None else {"rock_abundance": options.rock_abundance}
    preset = place_preset(
        options.preset,
        options.terrain,
        band=options.band,
        nodata=options.nodata,
        flat_is_ground=options.flat_is_ground,
        detail=None if options.detail is None else GroundDetail(options.detail, **abundance),
        hazard_share=options.hazard_share,
        workers=options.workers,
    )
    return preset, OWN_SPLIT


def choose_executor(options: Comparison) -> tuple[OpenExecutor, bool]:
    """What flies the episodes, and whether it is this machine.

    Raises:
        ValueError: two were asked for.
    """
    if options.scheduler is None and not options.slurm:
        return partial(local_processes, options.workers), True
    if options.scheduler is not None and options.slurm:
        raise ValueError("scheduler and slurm exclude each other")
    from studies.campaign.cluster import dask_scheduler, slurm_jobs

    paths = tuple(entry for entry in options.policies if ":" in entry)
    if options.scheduler is not None:
        return partial(dask_scheduler, options.scheduler, paths), False
    return partial(slurm_jobs, options.slurm_jobs, paths), False


def with_reference(study: Study) -> Study:
    """The study with the reference policy in it, so that a policy's line never depends on the others."""
    missing = REFERENCE_POLICY not in study.policies
    return replace(study, policies=(*study.policies, REFERENCE_POLICY)) if missing else study


def summarize_study(study: Study, scores: StudyScores) -> list[PolicySummary]:
    """The line of every policy of the study."""
    return [
        summarize_policy(
            scores.policies[name],
            study.preset.name,
            policy_entry(name).privileged,
            is_reference=name == scores.reference,
        )
        for name in study.policies
    ]


def compare(options: Comparison) -> list[PolicySummary]:
    """Fly the comparison and write its folder: tables, provenance, figures, trajectories.

    Raises:
        ValueError: an option is out of range or names something unknown, the folder holds another study or is
            being written, or a policy or a worker failed.
        OSError: the folder cannot be written.
    """
    existing = options.existing
    study = plan_study(options)
    choose_executor(options)
    for path in study.paths:
        check_contract(policy_entry(path).make, study.preset)
    out = open_folder(options.out or Path("results") / study.preset.name)
    with open_study_folder(out, with_reference(study), existing) as folder:
        fly_comparison(folder, *choose_executor(options), options.workers)
        summaries = write_results(folder, study, options)
    print_table(summaries)
    Console().print(f"results in {out}")
    if options.quick and options.report and not show_report(out / "report.html"):
        Console().print(f"open {out / 'report.html'}", soft_wrap=True)
    return summaries


def write_results(folder: StudyFolder, study: Study, options: Comparison) -> list[PolicySummary]:
    """Write every product of a flown study, reading its chunks one at a time; their checksums last."""
    out = folder.path
    scores = score_study(study.policies, REFERENCE_POLICY, folder.read_chunks())
    summaries = summarize_study(study, scores)
    differences = compare_pairs(scores, study.policies)
    provenance = describe_study(folder.study, folder.describe_flight())
    write_episodes(
        out,
        (
            row
            for name in study.policies
            for chunk in folder.read_chunks((name,), checked=True)  # by the scores
            for row in chunk.rows[name]
        ),
    )
    write_table(out / "table.csv", summaries)
    write_markdown(out / "table.md", summaries)
    write_paired(out / "paired.csv", differences)
    write_timings(out / "timings.csv", {name: scores.policies[name].decision_time for name in study.policies})
    if options.figures:
        from studies.compare.figures import draw_figures

        with show_phase(Console(), Phase("figures", 1)) as display:
            draw_figures(out, study, scores)
            display.advance(1)
    if options.report:
        report_study(out, ReportContent(study, scores, summaries, differences, provenance), options.workers)
    write_provenance(out / "provenance.json", provenance)
    write_checksums(out)
    return summaries


def report_study(out: Path, content: ReportContent, workers: int) -> None:
    """Fly again what the report shows, and write it."""
    chosen = choose_flights(content.scores, content.study.policies)
    with show_phase(Console(), Phase("report", len(chosen))) as display, local_processes(workers) as executor:
        flights = fly_pictures(
            content.study, chosen, executor, out / "trajectories", lambda: display.advance(1)
        )
    write_report(out / "report.html", content, flights)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = read_options()
    with resumable():
        compare(options)
