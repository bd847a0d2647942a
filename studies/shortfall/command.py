"""Where policies fall short: which ground their landings fail on, what was seen of it, and what moves cost.

Every failed landing is held against the looks before it and against what an encoder keeps of them, which is
all that an agent sees. Over all flights it counts which hazards looks and encodings show, by height and by
distance from safe ground. The propellant is parted by flying each episode again with the last site known
ever later. A policy is a name, or the card (.json) of an agent's weights:

python -m studies.shortfall --policies td3 nearest-safe+convex
python -m studies.shortfall --policies runs/weights/td3-convex.json nearest-safe+convex --split tuning
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.flight.episode import fly
from hda.ground.library import Ground, prepare_tiles
from hda.policies.entry import AnyPolicy
from hda.registry import make_policy
from hda.task.presets import Preset, find_preset
from hda.task.scenario import sample_scenario
from rl.inference.artefacts import load_artefact
from rl.policies.actor import AgentPolicy
from rl.policies.recurrent_actor import RecurrentAgentPolicy
from rl.settings import WITH_MEMORY
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.shortfall.encoded_sight import (
    Decoder,
    count_seen,
    explain_loss,
    load_decoder,
    measure_depth,
    trace_site,
)
from studies.shortfall.propellant_parts import part_propellant
from studies.shortfall.table import (
    LOSS_COLUMNS,
    PART_COLUMNS,
    SEEN_COLUMNS,
    FlownEpisode,
    LossRow,
    PartRow,
    SeenRow,
    average_parts,
    count_losses,
    share_seen,
)

_PRODUCTS = ("losses.csv", "losses.md", "seen.csv", "seen.md", "parts.csv", "parts.md", "provenance.json")


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
        encoder: name of the encoder that is asked what it keeps of a look.
        workers: processes that build tiles.
    """

    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("td3", "nearest-safe+convex")
    preset: str = "paper"
    episodes: int = 1000
    study_seed: int = 0
    split: str = "validation"
    encoder: str = "autoencoder"
    workers: int = 2
    out: Path = Path("results/shortfall")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "workers"):
            finite_number(name, getattr(self, name), at_least=1)
        finite_number("study_seed", self.study_seed, at_least=0)
        if not self.policies:
            raise ValueError("policies must name at least one policy")
        if len({name.removesuffix(".json") for name in self.policies}) < len(self.policies):
            raise ValueError("policies must be different ones")


@dataclass(frozen=True)
class Shortfalls:
    """The tables.

    Attributes:
        losses: failed landings.
        seen: hazards that looks and encodings show.
        parts: of the propellant.
    """

    losses: tuple[LossRow, ...]
    seen: tuple[SeenRow, ...]
    parts: tuple[PartRow, ...]


def open_policy(name: str) -> AnyPolicy:
    """A policy by its name or by the card of its weights.

    Raises:
        ValueError: the name is unknown.
        ArtefactError: the weights are missing or damaged.
    """
    import rl  # noqa: F401 - registers the agents

    if not name.endswith(".json"):
        return make_policy(name)
    weights = Path(name).with_suffix("")
    remembers = load_artefact(weights, "actor").card.get("algorithm") in WITH_MEMORY
    return (RecurrentAgentPolicy if remembers else AgentPolicy)(weights.name, weights)


def fly_episode(
    policy: AnyPolicy, preset: Preset, options: Shortfall, episode: int, decode: Decoder
) -> FlownEpisode:
    """Fly an episode, and the ones that part its propellant."""
    scenario = sample_scenario(preset, options.study_seed, episode, options.split)
    record = fly(policy, scenario)
    decoded = decode(np.stack([observation.safety_map for observation in record.observations]))
    depth = measure_depth(scenario.tile.deterministic, scenario.view.nominal_target)
    outcome = record.outcome
    sights = () if outcome.success else tuple(trace_site(record, decoded))
    row, column = (np.floor(outcome.touchdown[axis : axis + 1]).astype(int) for axis in (1, 0))
    return FlownEpisode(
        tile=scenario.tile.number,
        loss=explain_loss(record, sights),
        depth=float(depth.read(row, column)[0]),
        sights=sights,
        time=float(record.time[-1]),
        seen=tuple(count_seen(record, decoded, depth)),
        parts=part_propellant(record),
    )


def score_flights(flown: dict[str, list[FlownEpisode]]) -> Shortfalls:
    """The tables of what was flown, by policy; the last one is what the others are held against."""
    *others, last = flown
    losses = [row for name, flights in flown.items() for row in count_losses(name, flights)]
    seen = share_seen([flight for flights in flown.values() for flight in flights])
    parts = [average_parts(name, flights) for name, flights in flown.items()]
    parts += [average_parts(f"{name} less {last}", flown[name], flown[last]) for name in others]
    return Shortfalls(tuple(losses), tuple(seen), tuple(parts))


def study_shortfall(options: Shortfall) -> Shortfalls:
    """Fly, write losses, seen and parts as .csv and .md with their provenance, and print the tables.

    Raises:
        ValueError: an option names something unknown, or the folder holds another study.
        ArtefactError: an agent's weights are missing or damaged.
        OSError: the folder cannot be written.
    """
    preset, decode = find_preset(options.preset), load_decoder(options.encoder)
    policies = [open_policy(name) for name in options.policies]
    weights = {name: load_artefact(Path(name).with_suffix(""), "actor").digest for name in _cards(options)}
    names = ("preset", "study_seed", "split", "encoder")
    identity = identify_run(
        Path(__file__).parent, {**{name: getattr(options, name) for name in names}, "weights": weights}
    )
    out, flown = open_folder(options.out), {}
    with open_journal(out, FlownEpisode, _PRODUCTS, identity, options.existing) as journal:
        prepare_tiles(Ground(preset.terrain, preset.criteria), options.split, options.workers)
        for policy in policies:
            numbers = track(range(options.episodes), policy.name, transient=True)
            flown[policy.name] = [
                journal.finish(
                    (policy.name, number),
                    lambda policy=policy, number=number: fly_episode(policy, preset, options, number, decode),
                )
                for number in numbers
            ]
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
        ("losses", LOSS_COLUMNS, scored.losses, "failed landings"),
        ("seen", SEEN_COLUMNS, scored.seen, "hazards within a move of the target"),
        ("parts", PART_COLUMNS, scored.parts, "where the propellant goes"),
    )


def _cards(options: Shortfall) -> list[str]:
    return [name for name in options.policies if name.endswith(".json")]


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_shortfall(tyro.cli(Shortfall, description=__doc__))
