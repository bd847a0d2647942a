"""How far hazard-aware is from the best possible, and where the difference lies.

For each episode whoever knows the whole map and every engine error in advance is bounded: no flight to any
safe cell undercuts it, by proof, so no policy loses less on average (an information relaxation). A loss is
the propellant in percent; a failure counts a whole tank. The first bound holds for every policy, the others
for those that keep one restriction more each. Then come flights on the same episodes: oracle-fuel, and
hazard-aware that is told the true map at its first, second, ... look, or never. The picture shows them all.
"""

from __future__ import annotations

from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.ground.library import Ground, tile_numbers
from hda.task.presets import find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.command_line import choose_policies, open_folder, resumable
from studies.campaign.executor import local_processes
from studies.campaign.journal import Journal, open_journal
from studies.campaign.monte_carlo import Study
from studies.campaign.points import Point, fly_points
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.information_bound.restrictions import FloorRow, bound_episode, list_restrictions
from studies.information_bound.table import (
    COLUMNS,
    StepRow,
    list_steps,
    read_steps,
    tell_recognition,
    tell_sight,
)
from studies.information_bound.told import check_frame, told_name, told_path

_FIRST, _LAST = "oracle-fuel", "hazard-aware"


@dataclass(frozen=True, kw_only=True)
class InformationBound(FolderOptions):
    """Command line.

    Attributes:
        preset: the setting; point masses that know where they are must fly, to the target plane.
        episodes: episodes that are bounded, and flown by each policy; for the picture over two tiles or more.
        looks: numbers of the looks at which hazard-aware is told the map, rising.
        study_seed: seed of the study; equal seeds give equal tables.
        split: tile split: validation or fresh.
        workers: processes; changes nothing but the time.
        figures: draw the picture.
        redraw: draw the picture of the table that stands in the folder, and fly nothing.
    """

    preset: str = "paper"
    episodes: int = 1000
    looks: Annotated[tuple[int, ...], tyro.conf.arg(metavar="NUMBER ...")] = (0, 1, 2, 3, 4)
    study_seed: int = 0
    split: str = "validation"
    workers: int = 2
    figures: bool = True
    redraw: bool = False
    out: Path = Path("results/information_bound")

    def __post_init__(self) -> None:
        """Check every number, and that no option contradicts another."""
        for name in ("episodes", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)
        if list(self.looks) != sorted({*self.looks}) or min(self.looks, default=0) < 0:
            given = " ".join(map(str, self.looks))
            raise ValueError(f"looks must be numbers of at least 0, rising, each once, got {given}")
        if self.redraw and not self.figures:
            raise ValueError("redraw must not stand beside --no-figures: it draws the picture and no more")


def plan_study(options: InformationBound) -> Study:
    """The policies, setting and split that are flown.

    Raises:
        ValueError: an option names something unknown, or a setting that cannot be bounded.
    """
    preset = find_preset(options.preset)
    list_restrictions(preset)
    check_frame(preset)
    tile_numbers(options.split, Ground(preset.terrain, preset.criteria))
    _, paths = choose_policies((_FIRST, *map(told_path, options.looks), _LAST), preset.name)
    names = (_FIRST, *map(told_name, options.looks), _LAST)
    return Study(preset, names, options.episodes, options.study_seed, options.split, paths)


def check_tiles(study: Study) -> None:
    """Refuse episodes over one tile: the picture shows intervals clustered by tile, which then have no ends.

    Raises:
        ValueError: all episodes lie on one tile.
    """
    tiles: set[int] = set()
    for episode in range(study.episodes):
        tiles.add(sample_scenario(study.preset, study.study_seed, episode, study.split).tile.number)
        if len(tiles) > 1:
            return
    raise ValueError(
        f"episodes must lie on at least two tiles for the picture, got {study.episodes} on one:"
        " ask for more, or give --no-figures"
    )


def bound_all(study: Study, journal: Journal[FloorRow], workers: int) -> list[FloorRow]:
    """The bounds of every episode; each is kept as it is finished."""
    lacking = [k for k in range(study.episodes) if journal.find((k,)) is None]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, transient=True) as progress, local_processes(workers) as executor:
        task = progress.add_task("bounds", total=study.episodes, completed=study.episodes - len(lacking))
        if executor is None:
            for episode in lacking:
                journal.keep((episode,), bound_episode(study, episode))
                progress.advance(task)
        else:
            futures = {executor.submit(bound_episode, study, episode): episode for episode in lacking}
            for future in as_completed(futures):
                journal.keep((futures[future],), future.result())
                progress.advance(task)
    return [row for k in range(study.episodes) if (row := journal.find((k,))) is not None]


def run_information_bound(options: InformationBound) -> list[StepRow]:
    """Fly, bound, write the table and provenance.json, and print the table.

    Raises:
        ValueError: an option is out of range or names something unknown, all episodes lie on one tile where
            figures are asked for, a folder holds another study, or a policy or a worker failed.
        OSError: the folder cannot be written.
    """
    study = plan_study(options)
    if options.figures:
        check_tiles(study)
    out = open_folder(options.out)
    flown = fly_points(out, [Point("flights", study)], options.existing, options.workers)["flights"]
    decided = {name: getattr(options, name) for name in ("preset", "study_seed", "split")}
    identity = identify_run(Path(__file__).parent, decided)
    with open_journal(out / "bounds", FloorRow, (), identity, options.existing) as journal:
        floors = bound_all(study, journal, options.workers)
    names = [restriction.name for restriction in list_restrictions(study.preset)]
    lines = list_steps(names, floors, {name: flown[name] for name in study.policies})
    write_csv(out / "table.csv", COLUMNS, lines)
    write_markdown(out / "table.md", COLUMNS, lines)
    if options.figures:
        draw_picture(out, lines)
    write_provenance(out / "provenance.json", describe_run(options))
    console = Console(width=max(Console().width, 130))
    title = f"{study.preset.name}, {study.split}: {study.episodes} episodes"
    console.print(console_table(COLUMNS, lines, title, "* sees the true map, or is told it"))
    for words in (
        tell_gap(lines),
        tell_recognition(floors),
        tell_sight(floors, flown[_FIRST], flown[_LAST]),
    ):
        console.print(words, highlight=False, markup=False)
    return lines


def draw_picture(out: Path, lines: list[StepRow]) -> None:
    """Draw the steps into the folder.

    Raises:
        OSError: it cannot be written.
    """
    from studies.information_bound.picture import draw_steps

    draw_steps(lines).savefig(out / "information-bound.png", dpi=90)


def tell_gap(lines: list[StepRow]) -> str:
    """How far the last step is from every policy, in words."""
    first, last = lines[0], lines[-1]
    below = first.below
    return (
        f"{last.step} loses {last.loss.estimate:.2f} %, no policy less than {first.loss.estimate:.2f} %:"
        f" it is within {below.estimate:.2f} points ({below.low:.2f} to {below.high:.2f}) of every policy"
    )


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        options = tyro.cli(InformationBound, description=__doc__)
        if options.redraw:
            draw_picture(options.out, read_steps(options.out / "table.csv"))
        else:
            run_information_bound(options)
        Console().print(f"results in {options.out}")
