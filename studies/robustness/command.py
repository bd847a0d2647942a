"""How policies stand up to what their design did not assume: one factor at a time, on the same episodes.

Each factor is one number of the preset: engine, sensor, ground, navigation, start; with a navigation filter
also each of its sensors. At each level every policy flies the same episodes; a figure and a table per factor
show safe sites, successes and propellant, and breaks.md tells which policy breaks first and why: the ending
that became more frequent, and the causes that `studies.failures` computes for those episodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.ground.library import FRESH_SPLIT, Ground, load_tile, tile_numbers
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import RunOptions
from studies.columns import write_csv, write_markdown
from studies.failures.causes import count_causes, explain_failure
from studies.robustness.breaks import Break, find_breaks
from studies.robustness.factor import Factor
from studies.robustness.factors import choose_factors
from studies.robustness.table import (
    BREAK_COLUMNS,
    LEVEL_COLUMNS,
    Sweep,
    list_levels,
    write_level_markdown,
)

_NOMINAL = "nominal"
_MOST_TILES = 400  # whose hazard is measured
_MOST_FRESH_TILES = 40  # they are built for it and dropped
_EXPLAINED = 12  # failures of a break that are flown again


@dataclass(frozen=True, kw_only=True)
class Robustness(RunOptions):
    """Command line of the robustness sweep.

    Attributes:
        factors: names of factors; `all` is every one that the preset has, `navigation` every sensor of a
            navigation filter and what is known at the start.
        episodes: episodes per policy and level.
        levels: levels per factor beside the preset's own value, at most.
        preset: the setting that is varied.
        study_seed: seed of the study; equal seeds give equal episodes at every level.
        resume: keep finished episodes of the same sweep in the folder, and fly what is missing.
        figures: draw a figure per factor.
    """

    factors: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("all",)
    episodes: int = 200
    levels: int = 4
    preset: str = "paper"
    out: Path = Path("results/robustness")

    def __post_init__(self) -> None:
        """Check every number."""
        super().__post_init__()
        finite_number("levels", self.levels, at_least=1)


def plan_points(options: Robustness) -> tuple[Study, list[Point]]:
    """The study at the preset's own values, and every point of the sweep, that one first.

    Raises:
        ValueError: an option names something unknown.
    """
    preset = find_preset(options.preset)
    policies, paths = choose_policies(options.policies, preset.name)
    own = Study(preset, policies, options.episodes, options.study_seed, options.split, paths)
    points = [Point(_NOMINAL, own)]
    for factor in choose_factors(options.factors, preset):
        for level in factor.chosen(preset, options.levels):
            points.append(Point(_label(factor, level), replace(own, preset=factor.vary(preset, level))))
    return own, points


def _label(factor: Factor, level: float) -> str:
    return f"{factor.name}/{level:g}"


def measure_hazard(preset: Preset, split: str) -> float:
    """Share of unsafe cells on the tiles of a split; on the first of them, where there are many."""
    return _measure_ground(Ground(preset.terrain, preset.criteria), split)


@lru_cache(maxsize=64)
def _measure_ground(ground: Ground, split: str) -> float:
    """`measure_hazard`; most levels of a sweep share one ground."""
    most = _MOST_FRESH_TILES if split == FRESH_SPLIT else _MOST_TILES
    unsafe = [
        1.0 - float(load_tile(ground, number, split).deterministic.mean())
        for number in tile_numbers(split, ground)[:most]
    ]
    return float(np.mean(unsafe))


def run_robustness(options: Robustness) -> list[Sweep]:
    """Fly the sweep and write its folder.

    Raises:
        ValueError: an option is out of range or names something unknown, a folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    own, points = plan_points(options)
    out = open_folder(options.out)
    flown = fly_points(out, points, options.existing, options.workers)
    studies = {point.label: point.study for point in points}
    sweeps = []
    for factor in choose_factors(options.factors, own.preset):
        value = factor.nominal(own.preset)
        varied = {level: _label(factor, level) for level in factor.chosen(own.preset, options.levels)}
        levels = dict(sorted({value: flown[_NOMINAL], **{k: flown[n] for k, n in varied.items()}}.items()))
        presets = {k: studies[varied[k]].preset if k in varied else own.preset for k in levels}
        hazard = {k: measure_hazard(preset, options.split) for k, preset in presets.items()}
        others = {k: rows for k, rows in levels.items() if k in varied}
        found = find_breaks(factor.name, value, flown[_NOMINAL], others)
        breaks = [
            replace(b, causes=explain_break(b, studies[_label(factor, b.level)]))
            for b in track(found, f"explaining breaks: {factor.name}", transient=True)
        ]
        sweeps.append(Sweep(factor, value, levels, hazard, breaks))
    write_sweeps(out, sweeps, options)
    write_provenance(out / "provenance.json", describe_run(options))
    return sweeps


def explain_break(found: Break, study: Study) -> str:
    """Causes of the failures that a break brought, each flown again, the most frequent first."""
    pilot = study.make_policy(found.policy)
    scenarios = (
        sample_scenario(study.preset, study.study_seed, episode, study.split)
        for episode in found.episodes[:_EXPLAINED]
    )
    return "; ".join(count_causes(explain_failure(fly(pilot, scenario)) for scenario in scenarios))


def write_sweeps(out: Path, sweeps: Sequence[Sweep], options: Robustness) -> None:
    """Write a table and a figure per factor, and the breaks."""
    for sweep in sweeps:
        write_csv(out / f"{sweep.factor.name}.csv", LEVEL_COLUMNS, list_levels(sweep))
        write_level_markdown(out / f"{sweep.factor.name}.md", sweep)
        if options.figures:
            from studies.robustness.picture import draw_sweep

            figure = draw_sweep(sweep.factor.label, sweep.own, sweep.levels)
            figure.savefig(out / f"{sweep.factor.name}.png", dpi=90)
    breaks = [found for sweep in sweeps for found in sweep.breaks]
    write_csv(out / "breaks.csv", BREAK_COLUMNS, breaks)
    write_markdown(out / "breaks.md", BREAK_COLUMNS, breaks)


def print_sweeps(sweeps: Sequence[Sweep]) -> None:
    """Say in words who breaks first along each factor, and why."""
    console = Console()
    for sweep in sweeps:
        if not sweep.breaks:
            console.print(f"{sweep.factor.name}: no policy breaks", highlight=False, markup=False)
            continue
        first = sweep.breaks[0]
        same = [b.policy for b in sweep.breaks[1:] if (b.step, b.side) == (first.step, first.side)]
        causes = f" ({first.causes})" if first.causes else ""
        tail = f"; also {', '.join(same)}" if same else ""
        console.print(
            f"{sweep.factor.name}: {first.policy} breaks first, at {first.level:g} ({sweep.factor.label}):"
            f" success falls by {100.0 * first.drop.estimate:.1f} points, mostly {first.ending}"
            f"{causes}{tail}",
            highlight=False,
            markup=False,
        )


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(Robustness, description=__doc__)
        print_sweeps(run_robustness(options))
        Console().print(f"results in {options.out}")
