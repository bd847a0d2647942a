"""From runs to shipped weights: choose seed and checkpoint on the tuning tiles, then fly validation once."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from rl.artefacts import WEIGHTS_FOLDER, Tensors

if TYPE_CHECKING:
    from hda.scenario import Preset
    from rl.algorithms import AgentSettings
    from rl.scoring import Score

CHOICE_SEED = 900_001
"""Study seed of the choice, on the tuning tiles; not that of the periodic validation."""


@dataclass(frozen=True)
class ExportWeights:
    """Make shipped weights from runs: the best checkpoint of the best seed, judged on the tuning tiles.

    Attributes:
        runs: folders of runs with equal settings and different seeds.
        name: of the weights: NAME.safetensors and NAME.json.
        candidates: best checkpoints of each run, by its own validation, that are flown again.
        episodes: tuning episodes that each candidate flies.
        validation_episodes: episodes on the validation tiles, flown once, for the card.
        out: folder.
    """

    runs: tuple[Path, ...]
    name: str
    candidates: int = 5
    episodes: int = 1000
    validation_episodes: int = 1000
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = field(default=WEIGHTS_FOLDER)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A checkpoint's actor and how it flew the tuning tiles."""

    run: Path
    seed: int
    step: int
    tensors: Tensors
    score: Score


def settings_from_json(values: dict[str, Any]) -> AgentSettings:
    """Undo `dataclasses.asdict` and JSON on AgentSettings."""
    from rl.algorithms import WITH_MEMORY, AgentSettings, RecurrentSettings

    kind = RecurrentSettings if values.get("algorithm") in WITH_MEMORY else AgentSettings
    return kind(**{**values, **{k: tuple(v) for k, v in values.items() if isinstance(v, list)}})


def training_command(card: dict[str, Any], seed: int) -> str:
    """The command that trains a run as its card says: settings that differ from the recipe's become flags."""
    from rl.algorithms import RECIPES

    recipe = json.loads(json.dumps(asdict(RECIPES[card["recipe"]])))
    parts = ["python -m rl.train", card["recipe"], f"--seed {seed}", f"--preset {card['preset']}"]
    parts.append(f"--steps {card['plan']['steps']}")
    for name, value in card["settings"].items():
        if value != recipe[name]:
            values = value if isinstance(value, list) else [value]
            parts.append(" ".join([f"--{name.replace('_', '-')}", *(str(v) for v in values)]))
    return " ".join(parts)


def best_of_run(
    run: Path, preset: Preset, settings: AgentSettings, options: ExportWeights, seed: int
) -> Candidate:
    """Fly the most promising checkpoints of one run again, on more tuning episodes; give the best.

    Raises:
        ValueError: the run has no validated checkpoint.
    """
    from rl.actor_export import policy_of
    from rl.artefacts import load_artefact
    from rl.scoring import score_policy
    from rl.training import read_rows

    rows = read_rows(run / "validation.csv")
    if not rows:
        raise ValueError(f"{run} has no validated checkpoint")
    rows.sort(key=lambda row: (float(row["success_percent"]), float(row["reward"])), reverse=True)
    found = []
    for row in rows[: options.candidates]:
        step = int(row["step"])
        tensors = load_artefact(run / "actors" / f"step-{step:09d}", "actor").tensors
        score = score_policy(policy_of(tensors, settings), preset, "tuning", CHOICE_SEED, options.episodes)
        found.append(Candidate(run, seed, step, tensors, score))
    return max(found, key=lambda candidate: candidate.score.rank)


def validate(
    candidate: Candidate, preset: Preset, settings: AgentSettings, options: ExportWeights
) -> dict[str, Any]:
    """Fly a chosen checkpoint on the validation tiles; give its scores for the card."""
    from rl.actor_export import policy_of
    from rl.scoring import score_policy

    policy = policy_of(candidate.tensors, settings, options.name)
    score = score_policy(policy, preset, "validation", 0, options.validation_episodes)
    return {
        "seed": candidate.seed,
        "step": candidate.step,
        "tuning": candidate.score.as_dict(),
        "validation": score.as_dict(),
    }


def run_export(options: ExportWeights) -> None:
    """Run the command.

    Raises:
        ValueError: a folder is not a run, or the runs have different settings.
    """
    from rich.console import Console

    from hda.dtm_library import Ground, prepare_tiles
    from hda.presets import find_preset
    from rl.actor_export import actor_card
    from rl.artefacts import library_versions, save_artefact
    from rl.training import TUNING_SEED, read_rows, read_run

    console = Console()
    cards = [read_run(run) for run in options.runs]
    first = cards[0]
    if any((card["settings"], card["preset"]) != (first["settings"], first["preset"]) for card in cards):
        raise ValueError("runs must have the same settings and preset")
    settings, preset = settings_from_json(first["settings"]), find_preset(first["preset"])
    for split in ("tuning", "validation"):
        prepare_tiles(Ground(preset.terrain, preset.criteria), split)
    best = []
    for run, card in zip(options.runs, cards, strict=True):
        best.append(best_of_run(run, preset, settings, options, card["seed"]))
        console.print(f"{run}: step {best[-1].step}, {best[-1].score.as_dict()}")
    chosen = max(best, key=lambda candidate: candidate.score.rank)
    seeds = [validate(candidate, preset, settings, options) for candidate in best]
    for scores in seeds:
        console.print(f"seed {scores['seed']} on validation: {scores['validation']}")
    curve = [
        {"step": int(row["step"]), "safe_site_percent": float(row["safe_site_percent"])}
        for row in read_rows(chosen.run / "validation.csv")
    ]
    training = {
        "command": training_command(first, chosen.seed),
        "settings": asdict(settings),
        "preset": preset.name,
        "ground": Ground(preset.terrain, preset.criteria).key,
        "splits": {"learning": "train", "choice": "tuning", "report": "validation"},
        "tuning_seeds": [TUNING_SEED, CHOICE_SEED],
        "seed": chosen.seed,
        "step": chosen.step,
        "seeds": seeds,
        "curve": curve,
        "versions": library_versions(),
    }
    card = {**actor_card(settings), "training": training}
    artefact = save_artefact(options.out / options.name, "actor", chosen.tensors, card)
    console.print(f"wrote {options.out / options.name}.safetensors ({artefact.digest[:12]})")
