"""What the options of fuel-optimal guidance are worth in closed loop, on the tuning tiles.

Fuel-optimal flight is fast and falls freely until late: fewer looks, each from lower, little altitude left to
divert in. Each line changes one option of the default: the thrust that the plan leaves to the feedback, the
length of the gentle terminal phase, a limit on speed. The same sites, the same episodes.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.tracking.soft_landing import DEFAULT_OPTIONS, SoftLandingOptions
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.policies.composition import ComposedPolicy, GuidanceLaw
from hda.policies.planned_descent import PlannedDescent
from hda.policies.zem_zev import FixedGainZemZev
from hda.site_selection import NearestSafeSite, SingleDivertSite, SiteSelection
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import one_line_errors
from studies.campaign.executor import local_processes
from studies.campaign.monte_carlo import Study, chunk_bounds, prepare_study
from studies.campaign.rows import EpisodeRow, summarize_episode
from studies.statistics.ratios import wilson_interval

SITES: dict[str, Callable[[], SiteSelection]] = {
    "single-divert": SingleDivertSite,
    "nearest-safe": NearestSafeSite,
}


@dataclass(frozen=True)
class Sweep:
    """Command line of the sweep.

    Attributes:
        sites: which site selection flies.
        preset: the setting.
        episodes: episodes for each line.
        margins: thrust margins.
        terminal_periods: control periods of the terminal phase.
        speed_limits: [m/s] greatest speeds.
        workers: processes.
        out: CSV to write.
    """

    sites: Literal["single-divert", "nearest-safe"] = "single-divert"
    preset: str = "paper"
    episodes: int = 500
    margins: tuple[float, ...] = (0.0, 0.05, 0.2)
    terminal_periods: tuple[int, ...] = (1, 2, 8)
    speed_limits: tuple[float, ...] = (50.0, 40.0, 35.0, 30.0)
    workers: int = 2
    out: Path | None = None


def list_laws(options: Sweep) -> dict[str, GuidanceLaw]:
    """Guidance laws of the lines: ZEM/ZEV, the default, and the default with one option changed."""
    laws: dict[str, GuidanceLaw] = {"ZEM/ZEV 6/2": FixedGainZemZev(), "default": PlannedDescent()}

    def add(label: str, changed: SoftLandingOptions) -> None:
        laws[label] = PlannedDescent(changed)

    for margin in options.margins:
        add(f"thrust margin {margin:.0%}", replace(DEFAULT_OPTIONS, thrust_margin=margin))
    for periods in options.terminal_periods:
        add(f"terminal phase of {periods} periods", replace(DEFAULT_OPTIONS, terminal_periods=periods))
    for limit in options.speed_limits:
        add(f"speed limit {limit:g} m/s", replace(DEFAULT_OPTIONS, speed_limit=limit))
    return laws


def fly_law(preset: Preset, sites: str, law: GuidanceLaw, first: int, last: int) -> list[EpisodeRow]:
    """Fly episodes first to last - 1 of study seed 0 on the tuning tiles."""
    policy = ComposedPolicy(sites, SITES[sites](), law)
    return [
        summarize_episode(fly(policy, sample_scenario(preset, 0, episode, "tuning")))
        for episode in range(first, last)
    ]


def fly_all(study: Study, sites: str, law: GuidanceLaw, executor: Executor | None) -> list[EpisodeRow]:
    """Fly every episode of one line."""
    bounds = chunk_bounds(study)
    if executor is None:
        return [row for ends in bounds for row in fly_law(study.preset, sites, law, *ends)]
    futures = [executor.submit(fly_law, study.preset, sites, law, *ends) for ends in bounds]
    return [row for future in futures for row in future.result()]


def describe(rows: list[EpisodeRow]) -> list[str]:
    """Cells of one line of the table."""
    safe = wilson_interval(sum(row.safe_site for row in rows), len(rows))
    success = wilson_interval(sum(row.success for row in rows), len(rows))
    speed = np.quantile([row.touchdown_speed_mps for row in rows], (0.5, 0.99, 1.0))
    looks = np.mean([row.decisions for row in rows])
    propellant = np.mean([row.propellant_percent for row in rows])
    ratios = [f"{100 * r.estimate:.1f} ({100 * r.low:.1f}-{100 * r.high:.1f})" for r in (safe, success)]
    fallbacks = sum(row.fallbacks for row in rows)
    return [*ratios, f"{propellant:.1f}", *(f"{v:.2f}" for v in speed), f"{looks:.2f}", str(fallbacks)]


def sweep(options: Sweep) -> dict[str, list[str]]:
    """Fly every line; print and write the table."""
    finite_number("episodes", options.episodes, at_least=1)
    finite_number("workers", options.workers, at_least=1)
    preset = find_preset(options.preset)
    study = Study(preset, (), options.episodes, split="tuning")
    prepare_study(study, options.workers)
    lines: dict[str, list[str]] = {}
    with local_processes(options.workers) as executor:
        for label, law in track(list(list_laws(options).items()), "options", transient=True):
            lines[label] = describe(fly_all(study, options.sites, law, executor))
    heads = ("safe site %", "success %", "propellant %", "speed p50 m/s", "p99", "max", "looks", "fallbacks")
    table = Table(title=f"{options.sites} on {preset.name}, {options.episodes} tuning episodes")
    for head in ("guidance", *heads):
        table.add_column(head, justify="left" if head == "guidance" else "right")
    for label, cells in lines.items():
        table.add_row(label, *cells)
    Console(width=130).print(table)
    if options.out is not None:
        text = [",".join(("guidance", *heads)), *(",".join((k, *v)) for k, v in lines.items())]
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text("\n".join(text) + "\n")
    return lines


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(Sweep, description=__doc__)
    with one_line_errors():
        sweep(options)


if __name__ == "__main__":
    main()
