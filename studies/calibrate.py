"""Calibrating a preset: make Single Divert land as often as the target says, on the tuning tiles.

Single Divert needs no learning, and the paper gives its row, so a terrain on which it does what it did in the
paper makes the paper's other figures a fair bar. It fails where no safe pixel lies in its one view, so what
is searched is the islands of clear ground: their size for `paper`, their number (the threshold of the field)
for `hard`. The control period is swept beside it, because the final speed depends on it and on little else.
Only tuning tiles are flown.

    python -m studies.calibrate                      # the preset as it is frozen, beside the paper's row
    python -m studies.calibrate --search             # find the islands for the preset's target again
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.ground.library import Ground, remove_tiles
from hda.task.presets import PRESETS, Preset, find_preset
from hda.task.scenario import sample_scenario
from hda.terrain.generator import TerrainParameters
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.campaign.score import MEASURE_COLUMNS, RATIO_COLUMNS, Score, score_rows
from studies.columns import Column, Output, console_table, standing_in, write_csv, write_markdown
from studies.ground_statistics import GroundStatistics, measure_ground
from studies.paper import PAPER_ROWS


@dataclass(frozen=True)
class Search:
    """What is searched for a preset.

    Attributes:
        target: [%] safe-landing percentage that Single Divert shall reach.
        parameter: field of the terrain's `islands` that is swept.
        values: values of the sweep, in order.
        digits: decimals to which the interpolated value is rounded.
    """

    target: float
    parameter: str
    values: tuple[float, ...]
    digits: int


SEARCHES = {
    "paper": Search(89.7, "smoothing_scale", (12.0, 16.0, 20.0, 24.0, 30.0, 40.0), digits=0),
    "hard": Search(60.0, "threshold", (-0.8, -1.0, -1.2, -1.4), digits=1),
}
"""The search that each preset was made by."""
_POLICY = "single-divert"


@dataclass(frozen=True, kw_only=True)
class Calibration(FolderOptions):
    """Command line of the calibration.

    Attributes:
        preset: which preset to calibrate or to show.
        search: sweep the islands for the preset's target instead of showing the frozen preset.
        control_periods: [s] control periods to sweep at the value found.
        episodes: episodes for the final row.
        sweep_episodes: episodes for each point of a sweep.
        ground_episodes: episodes whose ground is described.
        workers: processes; changes nothing but the time.
    """

    preset: str = "paper"
    search: bool = False
    control_periods: Annotated[tuple[float, ...], tyro.conf.arg(metavar="S ...")] = (0.25, 0.5, 0.625, 1.0)
    episodes: int = 6000
    sweep_episodes: int = 2000
    ground_episodes: int = 600
    workers: int = 2
    out: Path = Path("results/calibrate")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "sweep_episodes", "ground_episodes", "workers"):
            finite_number(name, getattr(self, name), at_least=1)


@dataclass(frozen=True)
class SingleDivertRow:
    """Single Divert on one setting.

    Attributes:
        label: what the setting is.
        score: every figure with its intervals.
    """

    label: str
    score: Score


COLUMNS: tuple[Column[SingleDivertRow], ...] = (
    Column("setting", "setting", lambda row: row.label, words=True),
    Column("episodes", "episodes", lambda row: row.score.episodes, outputs=Output.FILE),
    *(column.through(lambda row: row.score) for column in (*RATIO_COLUMNS, *MEASURE_COLUMNS)),
)
"""The table: its file, document and console read this list."""


def fly_single_divert(preset: Preset, episodes: int, options: Calibration, label: str) -> SingleDivertRow:
    """Fly Single Divert over the tuning tiles of a setting, in a folder of its own below that of the options.

    Raises:
        ValueError: the folder holds another study, or a worker failed.
        OSError: the folder cannot be written.
    """
    name = f"{preset.name}/{label.replace(',', '').replace(' ', '-')}-{episodes}-episodes"
    study = Study(preset, (_POLICY,), episodes, split="tuning")
    flown = fly_points(options.out, [Point(name, study)], options.existing, options.workers)
    return SingleDivertRow(label, score_rows(flown[name][_POLICY]))


def with_islands(preset: Preset, parameter: str, value: float) -> Preset:
    """The same setting with one field of the islands changed."""
    assert isinstance(preset.terrain, TerrainParameters)
    islands = replace(preset.terrain.islands, **{parameter: value})
    return replace(preset, terrain=replace(preset.terrain, islands=islands))


def with_control_period(preset: Preset, period: float) -> Preset:
    """The same setting with another control period."""
    return replace(preset, rules=replace(preset.rules, control_period=period))


def sweep_islands(preset: Preset, search: Search, options: Calibration) -> list[SingleDivertRow]:
    """Fly Single Divert at each value of the sweep; terrain that no preset uses is removed again."""
    kept = {Ground(p.terrain, p.criteria) for p in PRESETS.values()}
    rows = []
    for value in search.values:
        setting = with_islands(preset, search.parameter, value)
        label = f"{search.parameter} {value:g}"
        rows.append(fly_single_divert(setting, options.sweep_episodes, options, label))
        ground = Ground(setting.terrain, setting.criteria)
        if ground not in kept:
            remove_tiles(ground)
    return rows


def interpolate_crossing(values: Sequence[float], safe_percent: Sequence[float], target: float) -> float:
    """Value at which the safe percentage first passes `target`, linear between the points of a sweep.

    Raises:
        ValueError: the sweep does not bracket the target.
    """
    for k in range(len(values) - 1):
        before, after = safe_percent[k] - target, safe_percent[k + 1] - target
        if before * after <= 0.0 and before != after:
            return values[k] + before / (before - after) * (values[k + 1] - values[k])
    raise ValueError(f"values must bracket {target:g} % safe, got {list(safe_percent)} at {list(values)}")


def describe_ground(preset: Preset, episodes: int) -> dict[str, tuple[float, float, float]]:
    """10, 50 and 90 % quantiles (and for the nearest safe ground 10, 50, 97 %) of the ground statistics."""
    ground = [measure_ground(sample_scenario(preset, 0, k, "tuning")) for k in range(episodes)]

    def quantiles(name: str, last: float = 0.9) -> tuple[float, float, float]:
        values = [getattr(g, name) for g in ground]
        low, middle, high = np.nanquantile(values, (0.1, 0.5, last))
        return float(low), float(middle), float(high)

    last = {"nearest_safe": 0.97}
    return {name: quantiles(name, last.get(name, 0.9)) for name in GroundStatistics.__dataclass_fields__}


def write_rows(path: Path, rows: Sequence[SingleDivertRow]) -> None:
    """Write rows as CSV, and beside it for a document."""
    write_csv(path, COLUMNS, rows)
    write_markdown(path.with_suffix(".md"), COLUMNS, rows)


def print_rows(title: str, rows: Sequence[SingleDivertRow]) -> None:
    """Print rows, and the paper's below them."""
    from rich.console import Console

    table = console_table(COLUMNS, rows, title)
    table.add_section()
    paper = PAPER_ROWS["Single Divert"]
    _, *others = standing_in(COLUMNS, Output.CONSOLE)
    table.add_row("the paper", *(c.show(paper[c.key]) if c.key in paper else "" for c in others))
    Console(width=max(Console().width, 150)).print(table)


def calibrate(options: Calibration) -> SingleDivertRow:
    """Run the calibration that the command line asks for; return the final row.

    Raises:
        ValueError: an option names something unknown, a sweep does not bracket its target, a folder holds
            another study, or a worker failed.
        OSError: the folder cannot be written.
    """
    preset = find_preset(options.preset)
    open_folder(options.out)
    if options.search:
        preset = search_islands(preset, options)
    assert isinstance(preset.terrain, TerrainParameters)
    islands = preset.terrain.islands
    label = f"islands {islands.smoothing_scale:g} m, {islands.threshold:g} sigma"
    row = fly_single_divert(preset, options.episodes, options, label)
    print_rows(f"{preset.name}: single-divert on the tuning tiles, {options.episodes} episodes", [row])
    write_rows(options.out / f"{preset.name}.csv", [row])
    write_provenance(options.out / f"{preset.name}-provenance.json", describe_run(options))
    print_ground(preset, options.ground_episodes)
    return row


def search_islands(preset: Preset, options: Calibration) -> Preset:
    """Sweep the islands, print and write the sweep, and give the preset with the value that meets the target.

    Raises:
        ValueError: there is no search for this preset, or its sweep does not bracket the target.
    """
    if preset.name not in SEARCHES:
        raise ValueError(f"preset must be one of {', '.join(SEARCHES)} to be searched, got {preset.name!r}")
    search = SEARCHES[preset.name]
    sweep = sweep_islands(preset, search, options)
    print_rows(f"{preset.name}: islands, {options.sweep_episodes} episodes each", sweep)
    crossing = interpolate_crossing(
        search.values, [100.0 * row.score.safe_site.estimate for row in sweep], search.target
    )
    value = round(crossing, search.digits)
    chosen = with_islands(preset, search.parameter, value)
    periods = []
    for period in options.control_periods:
        setting = with_control_period(chosen, period)
        label = f"control period {period:g} s"
        periods.append(fly_single_divert(setting, options.sweep_episodes, options, label))
    print_rows(f"{preset.name}: control period at {search.parameter} {value:g}", periods)
    write_rows(options.out / f"{preset.name}-sweep.csv", [*sweep, *periods])
    return chosen


def print_ground(preset: Preset, episodes: int) -> None:
    """Print how safe ground lies around the first targets."""
    from rich.console import Console

    console = Console(width=150)
    console.print(f"ground within {preset.start.hazard_radius:g} m of the first target, {episodes} episodes:")
    for name, values in describe_ground(preset, episodes).items():
        last = "97" if name == "nearest_safe" else "90"
        console.print(f"  {name}: " + ", ".join(f"{v:.3g}" for v in values) + f" (10, 50, {last} %)")


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(Calibration, description=__doc__)
    with resumable():
        calibrate(options)


if __name__ == "__main__":
    main()
