"""Safe landings against propellant: every policy, and what the weights of hazard-aware trade.

Policies fly the validation tiles. The weights of hazard-aware's objective are varied one at a time on the
tuning tiles, as changing them is tuning. The front holds the policies that see no truth and that no other of
them beats in both. The ceiling and the floor are `hindsight`'s: the ratio of episodes in which any policy
could have known safe ground, and the propellant without which none can land there softly. Where the sensor
measures ranges there is no ceiling: it sees ground past the square of the look, so the proof does not hold.
With a reference every policy is held against it on the same episodes: whether it fails more, and where both
land, whether it burns more. Ahead is who is known to do less of one, and not known to do more of the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number, unknown_name
from hda.policies.privileged.knowable_ground import could_have_landed, least_propellant
from hda.registry import policy_entry
from hda.sensing.ranging import RangingLidar
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, Rows, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import RunOptions
from studies.campaign.score import score_rows
from studies.columns import write_csv, write_markdown
from studies.statistics.moments import collect_moments, mean_intervals
from studies.statistics.ratios import wilson_interval
from studies.trade_off.standings import COLUMNS as STANDING_COLUMNS
from studies.trade_off.standings import compare_to, tell_standings
from studies.trade_off.table import BOUNDS_COLUMNS, COLUMNS, Bounds, TradeOffRow, print_trade_off
from studies.trade_off.weights import SWEEP, sweep_name, sweep_path

BASE = "hazard-aware"


@dataclass(frozen=True, kw_only=True)
class TradeOff(RunOptions):
    """Command line of the trade-off study.

    Attributes:
        presets: names of settings.
        weights: weights of hazard-aware to vary; `all` is every one, `none` leaves the sweeps out.
        sweep_episodes: episodes per value of a weight.
        split: tile split of the policies: validation or fresh. Weights are always flown on tuning.
        ratio: what is set against propellant: safe-site, the paper's, or success, which asks for a soft
            touchdown too.
        reference: policy that the others are held against, on every preset; none by default.
        bounds: work out the ceiling and the floor.
    """

    presets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("paper", "hard")
    weights: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("all",)
    episodes: int = 1000
    sweep_episodes: int = 300
    ratio: Literal["safe-site", "success"] = "safe-site"
    reference: str | None = None
    bounds: bool = True
    out: Path = Path("results/trade_off")

    def __post_init__(self) -> None:
        """Check every number."""
        super().__post_init__()
        finite_number("sweep_episodes", self.sweep_episodes, at_least=1)


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
    pairs = choose_weights(options.weights)
    points = []
    for name in options.presets:
        preset = find_preset(name)
        policies, paths = choose_policies(options.policies, preset.name)
        if options.reference not in (None, *policies):
            raise ValueError(unknown_name(f"reference on {name}: policy", options.reference, policies))
        study = Study(preset, policies, options.episodes, options.study_seed, options.split, paths)
        points.append(Point(f"{preset.name}/policies", study))
        if pairs:
            ways = tuple(sweep_path(*pair) for pair in pairs)
            names = (BASE, *(sweep_name(*pair) for pair in pairs))
            study = Study(preset, names, options.sweep_episodes, options.study_seed, "tuning", ways)
            points.append(Point(f"{preset.name}/weights", study))
    return points


def score_point(study: Study, rows: Rows, ratio: str = "safe_site") -> list[TradeOffRow]:
    """Score every policy of a study, and say which are on the front of a ratio and the propellant."""
    changed = {sweep_name(weight, value): (weight, value) for weight, value in choose_weights(("all",))}
    for path in study.paths:
        policy_entry(path)  # registers what is known by path
    scored = []
    for name in study.policies:
        weight, value = changed.get(name, ("", float("nan")))
        score = score_rows(rows[name])
        privileged = policy_entry(name).privileged
        where = study.preset.name, study.split, name
        scored.append(TradeOffRow(*where, weight, value, privileged, score, ratio=ratio))
    front = find_front(scored)
    return [replace(row, on_front=row.policy in front) for row in scored]


def find_front(rows: Sequence[TradeOffRow]) -> set[str]:
    """Policies that see no truth and that none of them beats: as safe on less, or safer on as little."""
    places = {
        row.policy: (row.landed.estimate, row.score.propellant.estimate) for row in rows if not row.privileged
    }
    return {
        policy
        for policy, (safe, burnt) in places.items()
        if not any(
            other != (safe, burnt) and other[0] >= safe and other[1] <= burnt for other in places.values()
        )
    }


def bound_preset(preset: Preset, options: TradeOff) -> Bounds:
    """Ceiling and floor over the episodes that the policies flew; no ceiling where ranges are measured."""
    known, least, tiles = [], [], []
    bounded = not isinstance(preset.lidar, RangingLidar)
    for episode in track(range(options.episodes), f"bounds, {preset.name}", transient=True):
        scenario = sample_scenario(preset, options.study_seed, episode, options.split)
        if bounded:
            known.append(could_have_landed(scenario))
        least.append(100.0 * least_propellant(scenario))
        tiles.append(scenario.tile.number)
    floor, _ = mean_intervals(collect_moments(least, tiles), 0)
    ceiling = wilson_interval(sum(known), len(known)) if bounded else None
    return Bounds(preset.name, len(least), ceiling, floor)


def run_trade_off(options: TradeOff) -> tuple[list[TradeOffRow], list[Bounds]]:
    """Fly the study and write its folder; what an earlier run left there and this one does not write goes.

    Raises:
        ValueError: an option is out of range or names something unknown, a folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    points = plan_points(options)
    out = open_folder(options.out)
    flown = fly_points(out, points, options.existing, options.workers)
    ratio = options.ratio.replace("-", "_")
    rows = [row for point in points for row in score_point(point.study, flown[point.label], ratio)]
    bounds = [bound_preset(find_preset(name), options) for name in options.presets if options.bounds]
    write_csv(out / "table.csv", COLUMNS, rows)
    write_markdown(out / "table.md", COLUMNS, rows)
    for product in list_stale(options):
        (out / product).unlink(missing_ok=True)
    if options.bounds:
        write_csv(out / "bounds.csv", BOUNDS_COLUMNS, bounds)
    if options.reference is not None:
        write_standings(options, options.reference, flown)
    if options.figures:
        from studies.trade_off.picture import draw_trade_off

        draw_trade_off(rows, bounds).savefig(out / "trade-off.png", dpi=85)
    write_provenance(out / "provenance.json", describe_run(options))
    return rows, bounds


def list_stale(options: TradeOff) -> list[str]:
    """Names of the products that a run with these options does not write."""
    products = {
        "bounds.csv": options.bounds,
        "standings.csv": options.reference is not None,
        "standings.md": options.reference is not None,
        "trade-off.png": options.figures,
    }
    return [name for name, written in products.items() if not written]


def write_standings(options: TradeOff, reference: str, flown: Mapping[str, Rows]) -> None:
    """Hold the policies of each preset against the reference, write that table, and print what it says."""
    presets = [
        compare_to(name, flown[f"{find_preset(name).name}/policies"], reference) for name in options.presets
    ]
    lines = [line for preset in presets for line in preset]
    write_csv(options.out / "standings.csv", STANDING_COLUMNS, lines)
    write_markdown(options.out / "standings.md", STANDING_COLUMNS, lines)
    console = Console(width=max(Console().width, 130))
    for preset in presets:
        console.print(tell_standings(preset), highlight=False, markup=False)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(TradeOff, description=__doc__)
        print_trade_off(*run_trade_off(options))
        Console().print(f"results in {options.out}")
