"""What each layer of reality costs each policy, and whether their order is still the order at the end.

The same episodes are flown in setting after setting: maps with noise, looks that are measured, a navigation
filter, a body that must turn. table.md has the fall of success from setting to setting, paired, the
propellant that it costs, and what `studies.failures` finds in the first episodes that a setting loses, each
flown again. order.md has every pair of policies whose order changes, with the lead in each setting: an order
is decided by McNemar's test with Holm's correction and by tile. order.csv has all pairs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.task.presets import Preset, find_preset
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.journal import Journal
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, Rows, fly_points
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import RunOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.failures.causes import Failure
from studies.failures.explained import explain_episodes, open_causes, print_causes
from studies.realism.layers import (
    LAYER_COLUMNS,
    LayerRow,
    PairRow,
    Verdict,
    compare_order,
    describe_layer,
    pair_columns,
)


@dataclass(frozen=True, kw_only=True)
class Realism(RunOptions):
    """Command line.

    Attributes:
        presets: names of settings, from the plainest on; they share ground and starts.
        policies: names of policies; `default` is every one that is not slow, no rival, and flies on the
            first setting by default.
        episodes: episodes per policy and setting.
        study_seed: seed of the study; equal seeds give equal episodes in every setting.
        explained: lost episodes of each policy and setting that are flown again for their cause, the first
            ones.
        figures: draw the figure.
    """

    presets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = (
        "paper",
        "lidar",
        "navigated",
        "rigid-body",
    )
    episodes: int = 200
    explained: int = 12
    out: Path = Path("results/realism")

    def __post_init__(self) -> None:
        """Check every number."""
        super().__post_init__()
        finite_number("explained", self.explained, at_least=0)


def find_layers(names: Sequence[str]) -> dict[str, Preset]:
    """The settings by name, in the order given.

    Raises:
        ValueError: fewer than two are named, one twice, one is unknown, or they differ in ground or start.
    """
    if len(names) < 2 or len(set(names)) < len(names):
        given = " ".join(names) or "none"
        raise ValueError(f"presets must name two or more settings, each once, got {given}")
    layers = {name: find_preset(name) for name in names}
    first = layers[names[0]]
    for name, layer in layers.items():
        if (layer.terrain, layer.criteria, layer.start) != (first.terrain, first.criteria, first.start):
            raise ValueError(
                f"presets: {name!r} has another ground or start than {names[0]!r}: its episodes are others"
            )
    return layers


def plan_points(options: Realism) -> list[Point]:
    """Every setting of the study, in the order given.

    Raises:
        ValueError: an option names something unknown, or settings that cannot be paired.
    """
    layers = find_layers(options.presets)
    policies, paths = choose_policies(options.policies, options.presets[0])
    return [
        Point(name, Study(layer, policies, options.episodes, options.study_seed, options.split, paths))
        for name, layer in layers.items()
    ]


def tabulate(
    points: Sequence[Point], flown: Mapping[str, Rows], most: int, journal: Journal[Failure]
) -> list[LayerRow]:
    """A line for each setting and policy; the first `most` lost episodes of each are explained."""
    pairs = [(point, policy) for point in points for policy in point.study.policies]
    return [
        describe_layer(
            flown,
            point.label,
            policy,
            lambda lost, point=point, policy=policy: explain_episodes(point, policy, lost[:most], journal),
        )
        for point, policy in track(pairs, "explaining what is lost", transient=True)
    ]


def run_realism(options: Realism) -> list[LayerRow]:
    """Fly every setting, write the tables, the figure and provenance.json, and print the table.

    Raises:
        ValueError: an option is out of range or names something unknown, a folder holds another study, or a
            policy or a worker failed.
        OSError: the folder cannot be written.
    """
    points = plan_points(options)
    out = open_folder(options.out)
    flown = fly_points(out, points, options.existing, options.workers)
    study = points[0].study
    decided = {"study_seed": study.study_seed, "split": study.split}
    with open_causes(out, decided, study.paths, options.existing) as journal:
        lines = tabulate(points, flown, options.explained, journal)
    write_csv(out / "table.csv", LAYER_COLUMNS, lines)
    write_markdown(out / "table.md", LAYER_COLUMNS, lines)
    pairs = compare_order(flown)
    columns = pair_columns(options.presets)
    write_csv(out / "order.csv", columns, pairs)
    write_markdown(out / "order.md", columns, list_changes(pairs))
    if options.figures:
        from studies.realism.picture import draw_layers

        draw_layers(flown).savefig(out / "realism.png", dpi=90)
    write_provenance(out / "provenance.json", describe_run(options))
    print_layers(lines, pairs, options)
    return lines


def list_changes(pairs: Sequence[PairRow]) -> list[PairRow]:
    """Pairs whose order at the end is not what it was, those that are reversed first."""
    told = (Verdict.REVERSED, Verdict.TURNED, Verdict.CONFIRMED, Verdict.LOST)
    return sorted((pair for pair in pairs if pair.verdict in told), key=lambda pair: told.index(pair.verdict))


def print_layers(lines: Sequence[LayerRow], pairs: Sequence[PairRow], options: Realism) -> None:
    """Print the table, and in words how many pairs keep their order."""
    console = Console(width=max(Console().width, 120))
    title = f"{', '.join(options.presets)}: {options.episodes} episodes each"
    console.print(console_table(LAYER_COLUMNS, lines, title))
    print_causes(console, ((line.preset, line.policy, line.causes) for line in lines))
    counts = {verdict: sum(pair.verdict is verdict for pair in pairs) for verdict in Verdict}
    words = ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)
    console.print(f"order of {len(pairs)} pairs: {words or 'no pair'}", highlight=False, markup=False)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(Realism, description=__doc__)
        run_realism(options)
        Console().print(f"results in {options.out}")
