"""Safe landings against propellant: every policy, and what the weights of hazard-aware trade.

Policies fly the validation tiles. The weights of hazard-aware's objective are varied one at a time on the
tuning tiles, as changing them is tuning. The front holds the policies that see no truth and that no other of
them beats in both. The ceiling and the floor are `hindsight`'s: the share of episodes in which any policy
could have known safe ground, and the propellant without which none can land there softly.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from guidance.validation import finite_number
from hda.policies.hindsight import could_have_landed, least_propellant
from hda.presets import find_preset, sample_scenario, unknown_name
from hda.registry import policy_entry
from hda.scenario import Preset
from studies.command_line import one_line_errors
from studies.compare import choose_policies, open_folder
from studies.monte_carlo import Study
from studies.point_score import SCORE_COLUMNS, PointScore, score_rows
from studies.points import Point, Rows, fly_points
from studies.provenance import describe_study, write_provenance
from studies.statistics import Interval, bootstrap_mean, wilson_interval
from studies.study_folder import Existing
from studies.weight_sweep import SWEEP, sweep_name, sweep_path

BASE = "hazard-aware"


@dataclass(frozen=True)
class TradeOff:
    """Command line of the trade-off study.

    Attributes:
        presets: names of settings.
        policies: names of policies; `default` is every one that is not slow; `package.module:Name` is your
            own.
        weights: weights of hazard-aware to vary; `all` is every one, `none` leaves the sweeps out.
        episodes: episodes per policy.
        sweep_episodes: episodes per value of a weight.
        study_seed: seed of the study; equal seeds give equal episodes.
        split: tile split of the policies: validation or fresh. Weights are always flown on tuning.
        workers: processes; changes nothing but the time.
        out: folder for results.
        resume: keep finished episodes of the same study in the folder, and fly what is missing.
        figures: draw the figure.
    """

    presets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("paper", "hard")
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("default",)
    weights: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("all",)
    episodes: int = 1000
    sweep_episodes: int = 300
    study_seed: int = 0
    split: str = "validation"
    workers: int = 2
    out: Path = Path("results/trade_off")
    resume: bool = False
    figures: bool = True

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "sweep_episodes", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)


@dataclass(frozen=True)
class TradeOffRow:
    """One point of the picture.

    Attributes:
        preset: name of the setting.
        split: tile split that it was flown on.
        policy: name.
        weight: weight that was changed; empty for a registered policy.
        value: of that weight; nan for a registered policy.
        privileged: it sees the true map.
        score: ratios and propellant with their intervals.
        on_front: no policy of the same preset and split that sees no truth beats it in both.
    """

    preset: str
    split: str
    policy: str
    weight: str
    value: float
    privileged: bool
    score: PointScore
    on_front: bool = False


@dataclass(frozen=True)
class Bounds:
    """What no policy can beat on a preset.

    Attributes:
        preset: name.
        episodes: number of episodes.
        ceiling: share of episodes in which safe ground could have been known, with Wilson's interval.
        floor: mean least propellant [%] with its bootstrap interval.
    """

    preset: str
    episodes: int
    ceiling: Interval
    floor: Interval


def choose_weights(wanted: Sequence[str]) -> tuple[tuple[str, float], ...]:
    """(weight, value) pairs to fly, the default of each left out.

    Raises:
        ValueError: there is no such weight, or none was given.
    """
    if not wanted:
        raise ValueError("weights must name at least one weight, or none")
    for name in wanted:
        if name not in ("all", "none", *SWEEP):
            raise ValueError(unknown_name("weight", name, ("all", "none", *SWEEP)))
    chosen = SWEEP if "all" in wanted else {name: SWEEP[name] for name in SWEEP if name in wanted}
    return tuple((weight, value) for weight, values in chosen.items() for value in values)


def plan_points(options: TradeOff) -> list[Point]:
    """The studies of every preset: its policies, and its weights.

    Raises:
        ValueError: an option names something unknown.
    """
    policies, paths = choose_policies(options.policies)
    pairs = choose_weights(options.weights)
    points = []
    for name in options.presets:
        preset = find_preset(name)
        study = Study(preset, policies, options.episodes, options.study_seed, options.split, paths)
        points.append(Point(f"{preset.name}/policies", study))
        if pairs:
            ways = tuple(sweep_path(*pair) for pair in pairs)
            names = (BASE, *(sweep_name(*pair) for pair in pairs))
            study = Study(preset, names, options.sweep_episodes, options.study_seed, "tuning", ways)
            points.append(Point(f"{preset.name}/weights", study))
    return points


def score_point(study: Study, rows: Rows) -> list[TradeOffRow]:
    """Score every policy of a study, and say which are on the front."""
    changed = {sweep_name(weight, value): (weight, value) for weight, value in choose_weights(("all",))}
    for path in study.paths:
        policy_entry(path)  # registers what is known by path
    scored = []
    for name in study.policies:
        weight, value = changed.get(name, ("", float("nan")))
        score = score_rows(rows[name], study.study_seed)
        privileged = policy_entry(name).privileged
        scored.append(TradeOffRow(study.preset.name, study.split, name, weight, value, privileged, score))
    front = find_front(scored)
    return [replace(row, on_front=row.policy in front) for row in scored]


def find_front(rows: Sequence[TradeOffRow]) -> set[str]:
    """Policies that see no truth and that none of them beats: as safe on less, or safer on as little."""
    places = {
        row.policy: (row.score.safe_site.estimate, row.score.propellant.estimate)
        for row in rows
        if not row.privileged
    }
    return {
        policy
        for policy, (safe, burnt) in places.items()
        if not any(
            other != (safe, burnt) and other[0] >= safe and other[1] <= burnt for other in places.values()
        )
    }


def bound_preset(preset: Preset, options: TradeOff) -> Bounds:
    """Ceiling and floor over the episodes that the policies flew."""
    known, least = [], []
    for episode in track(range(options.episodes), f"bounds, {preset.name}", transient=True):
        scenario = sample_scenario(preset, options.study_seed, episode, options.split)
        known.append(could_have_landed(scenario))
        least.append(100.0 * least_propellant(scenario))
    floor = bootstrap_mean(least, np.random.default_rng([options.study_seed, 0]))
    return Bounds(preset.name, len(known), wilson_interval(sum(known), len(known)), floor)


def run_trade_off(options: TradeOff) -> tuple[list[TradeOffRow], list[Bounds]]:
    """Fly the study and write its folder.

    Raises:
        ValueError: an option is out of range or names something unknown, a folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    points = plan_points(options)
    out = open_folder(options.out)
    existing = Existing.RESUME if options.resume else Existing.REFUSE
    flown = fly_points(out, points, existing, options.workers)
    rows = [row for point in points for row in score_point(point.study, flown[point.label])]
    bounds = [bound_preset(find_preset(name), options) for name in options.presets]
    write_rows(out / "table.csv", rows)
    write_markdown(out / "table.md", rows)
    write_bounds(out / "bounds.csv", bounds)
    if options.figures:
        from studies.trade_off_figure import draw_trade_off

        draw_trade_off(out / "trade-off.png", rows, bounds)
    labels = [point.label for point in points]
    write_provenance(out / "provenance.json", describe_study(points[0].study, {"points": labels}))
    return rows, bounds


def write_rows(path: Path, rows: Sequence[TradeOffRow]) -> None:
    """Write every point as CSV; ratios and propellant in percent."""
    header = ["preset", "split", "policy", "weight", "value", "privileged", "on_front", "episodes"]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([*header, *SCORE_COLUMNS])
        for row in rows:
            value = "" if np.isnan(row.value) else f"{row.value:g}"
            cells = [row.preset, row.split, row.policy, row.weight, value, row.privileged, row.on_front]
            writer.writerow([*cells, row.score.episodes, *row.score.cells()])


def _cells(row: TradeOffRow) -> list[str]:
    safe, tiled, burnt = row.score.safe_site, row.score.safe_site_by_tile, row.score.propellant
    ends = (safe.estimate, safe.low, safe.high, tiled.low, tiled.high)
    return [
        row.policy + (" *" if row.privileged else ""),
        "{:.1f} ({:.1f}-{:.1f}) [{:.1f}-{:.1f}]".format(*(100.0 * value for value in ends)),
        f"{100.0 * row.score.success.estimate:.1f}",
        f"{burnt.estimate:.2f} ({burnt.low:.2f}-{burnt.high:.2f})",
        "yes" if row.on_front else "",
    ]


_HEADINGS = ("preset", "tiles", "policy", "safe site %", "success %", "propellant %", "front")


def write_markdown(path: Path, rows: Sequence[TradeOffRow]) -> None:
    """Write the points for a document."""
    lines = ["| " + " | ".join(_HEADINGS) + " |", "|---|---|---|---:|---:|---:|---|"]
    lines += ["| " + " | ".join([row.preset, row.split, *_cells(row)]) + " |" for row in rows]
    path.write_text("\n".join(lines) + "\n")


def write_bounds(path: Path, bounds: Sequence[Bounds]) -> None:
    """Write ceilings and floors as CSV, in percent."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        names = [
            f"{name}{end}" for name in ("ceiling_percent", "floor_percent") for end in ("", "_low", "_high")
        ]
        writer.writerow(["preset", "episodes", *names])
        for b in bounds:
            top = [100.0 * value for value in (b.ceiling.estimate, b.ceiling.low, b.ceiling.high)]
            ends = (*top, b.floor.estimate, b.floor.low, b.floor.high)
            writer.writerow([b.preset, b.episodes, *(f"{value:.9g}" for value in ends)])


def print_trade_off(rows: Sequence[TradeOffRow], bounds: Sequence[Bounds]) -> None:
    """Print the points and the bounds."""
    table = Table(title="safe landings against propellant", caption="* sees the true map")
    for heading in _HEADINGS:
        table.add_column(heading, no_wrap=heading == "policy")
    for row in rows:
        table.add_row(row.preset, row.split, *(cell.replace("[", "\\[") for cell in _cells(row)))
    console = Console(width=max(Console().width, 130))
    console.print(table)
    for b in bounds:
        console.print(
            f"{b.preset}: safe ground could have been known in {100.0 * b.ceiling.estimate:.1f} % of"
            f" {b.episodes} episodes; no soft landing there on less than {b.floor.estimate:.1f} % (mean)",
            highlight=False,
        )


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    try:
        with one_line_errors():
            options = tyro.cli(TradeOff, description=__doc__)
            print_trade_off(*run_trade_off(options))
            Console().print(f"results in {options.out}")
    except KeyboardInterrupt:
        Console(stderr=True).print("stopped; finished episodes are kept, --resume goes on", style="yellow")
        sys.exit(130)


if __name__ == "__main__":
    main()
