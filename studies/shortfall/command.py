"""Where policies fall short: what was seen of safe ground before landings that failed, and what moves cost.

Every landing is held against the looks before it and against what the agents' encoder keeps of them, which is
all that an agent sees. Over a policy's flights it counts which islands of safe ground the encodings show, by
height and area, and which hazards, by height and distance from safe ground; safe reads 0.5 or more. The
propellant is parted by flying each episode again with the last site known ever later. A policy is a name, or
the card (.json) of weights; agents must see looks, through one encoder:

python -m studies.shortfall --policies td3 nearest-safe+convex
python -m studies.shortfall --policies runs/weights/td3-convex.json nearest-safe+convex --split tuning
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.ground.library import Ground, prepare_tiles
from hda.task.presets import find_preset
from hda.task.scenario import sample_scenario
from rl.inference.artefacts import load_artefact
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.shortfall.encoded_sight import load_decoder
from studies.shortfall.flights import FlownEpisode, find_encoder, fly_episode, open_policy
from studies.shortfall.propellant_table import PART_COLUMNS, PartRow, average_parts
from studies.shortfall.table import (
    HAZARD_COLUMNS,
    ISLAND_COLUMNS,
    LOSS_COLUMNS,
    SHOWN_COLUMNS,
    HazardRow,
    IslandRow,
    LossRow,
    ShownRow,
    count_losses,
    count_shown,
    share_hazards,
    share_islands,
)

_TABLES = ("losses", "shown", "islands", "hazards", "parts")
_PRODUCTS = (*(f"{name}.{kind}" for name in _TABLES for kind in ("csv", "md")), "provenance.json")


@dataclass(frozen=True, kw_only=True)
class Shortfall(FolderOptions):
    """Command line of the shortfall study.

    Attributes:
        policies: names of policies, or cards (.json) of agents' weights; the propellant of the others is
            held against the last one's.
        preset: the setting.
        episodes: per policy.
        study_seed: seed of the study; equal seeds give equal episodes.
        split: tile split.
        workers: processes that build tiles.
    """

    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("td3", "nearest-safe+convex")
    preset: str = "paper"
    episodes: int = 1000
    study_seed: int = 0
    split: str = "validation"
    workers: int = 2
    out: Path = Path("results/shortfall")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)
        if not self.policies:
            raise ValueError("policies must name at least one policy")
        named: dict[str, str] = {}
        for policy in self.policies:
            name = Path(policy).stem if policy.endswith(".json") else policy
            if name in named:
                raise ValueError(
                    f"policies must have different names, got {named[name]!r} and {policy!r}: rename a card"
                )
            named[name] = policy


@dataclass(frozen=True)
class Shortfalls:
    """The tables.

    Attributes:
        losses: landings and failures.
        shown: flights by what encodings showed of safe ground near the target.
        islands: of safe ground that encodings show.
        hazards: that looks and encodings show.
        parts: of the propellant.
    """

    losses: tuple[LossRow, ...]
    shown: tuple[ShownRow, ...]
    islands: tuple[IslandRow, ...]
    hazards: tuple[HazardRow, ...]
    parts: tuple[PartRow, ...]


def score_flights(flown: dict[str, list[FlownEpisode]]) -> Shortfalls:
    """The tables of what was flown, by policy; the last one is what the others are held against."""
    *others, last = flown
    losses = [row for name, flights in flown.items() for row in count_losses(name, flights)]
    shown = [row for name, flights in flown.items() for row in count_shown(name, flights)]
    islands = [row for name, flights in flown.items() for row in share_islands(name, flights)]
    hazards = [row for name, flights in flown.items() for row in share_hazards(name, flights)]
    parts = [average_parts(name, flights) for name, flights in flown.items()]
    parts += [average_parts(f"{name} less {last}", flown[name], flown[last]) for name in others]
    return Shortfalls(tuple(losses), tuple(shown), tuple(islands), tuple(hazards), tuple(parts))


def study_shortfall(options: Shortfall) -> Shortfalls:
    """Fly, write the tables as .csv and .md with their provenance, and print the tables.

    Raises:
        ValueError: an option names something unknown, or the folder holds another study.
        ArtefactError: an agent's weights are missing or damaged.
        OSError: the folder cannot be written.
    """
    preset, policies = find_preset(options.preset), [open_policy(name) for name in options.policies]
    encoder = find_encoder(policies)
    decode = load_decoder(encoder)
    weights = {name: load_artefact(Path(name).with_suffix(""), "actor").digest for name in _cards(options)}
    asked = {name: getattr(options, name) for name in ("preset", "study_seed", "split")}
    identity = identify_run(Path(__file__).parent, {**asked, "encoder": encoder.name, "weights": weights})
    out = open_folder(options.out)
    flown: dict[str, list[FlownEpisode]] = {}
    with open_journal(out, FlownEpisode, _PRODUCTS, identity, options.existing) as journal:
        prepare_tiles(Ground(preset.terrain, preset.criteria), options.split, options.workers)
        for policy in policies:
            flights = flown[policy.name] = []
            for number in track(range(options.episodes), policy.name, transient=True):
                scenario = sample_scenario(preset, options.study_seed, number, options.split)
                flights.append(
                    journal.finish(
                        (policy.name, number),
                        lambda policy=policy, scenario=scenario: fly_episode(policy, scenario, decode),
                    )
                )
        scored = score_flights(flown)
        for name, columns, rows, _ in _list_tables(scored):
            write_csv(out / f"{name}.csv", columns, rows)
            write_markdown(out / f"{name}.md", columns, rows)
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    console = Console(width=max(Console().width, 150))
    where = f"{preset.name}, {options.episodes} {options.split} episodes each; intervals clustered by tile"
    for _, columns, rows, title in _list_tables(scored):
        console.print(console_table(columns, rows, f"{title}; {where}"))
    console.print(f"results in {out}")
    return scored


def _list_tables(scored: Shortfalls) -> tuple[tuple[str, Any, Any, str], ...]:
    """(name, columns, rows, title) of each."""
    return (
        ("losses", LOSS_COLUMNS, scored.losses, "landings and failures"),
        ("shown", SHOWN_COLUMNS, scored.shown, "flights by what encodings showed near the target"),
        ("islands", ISLAND_COLUMNS, scored.islands, "islands of safe ground in looks"),
        ("hazards", HAZARD_COLUMNS, scored.hazards, "hazards within a shift of the target"),
        ("parts", PART_COLUMNS, scored.parts, "where the propellant goes"),
    )


def _cards(options: Shortfall) -> list[str]:
    return [name for name in options.policies if name.endswith(".json")]


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_shortfall(tyro.cli(Shortfall, description=__doc__))
