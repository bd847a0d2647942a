"""From runs to shipped weights: choose seed and weights on the tuning tiles, then fly validation once."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from rl.inference.artefacts import WEIGHTS_FOLDER
from rl.training.candidates import CHOICE_SEED, TUNING_SEED, Candidate, Choice, best_of_run

if TYPE_CHECKING:
    from hda.task.presets import Preset
    from rl.settings import AgentSettings


@dataclass(frozen=True)
class ExportWeights:
    """Make shipped weights from runs: the best of the best seed, judged on the tuning tiles.

    Attributes:
        runs: folders of runs with equal settings and different seeds.
        name: of the weights: NAME.safetensors and NAME.json.
        choice: how the weights are chosen.
        validation_episodes: episodes on the validation tiles, flown once, for the card.
        workers: processes that fly the candidates; the choice does not depend on them.
        out: folder.
    """

    runs: tuple[Path, ...]
    name: str
    choice: Annotated[Choice, tyro.conf.arg(name="")] = field(default_factory=Choice)
    validation_episodes: int = 1000
    workers: int = 2
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = field(default=WEIGHTS_FOLDER)


def training_command(card: dict[str, Any], seed: int) -> str:
    """The command that trains a run as its card says: settings that differ from the recipe's become flags."""
    from rl.recipes import RECIPES

    recipe = json.loads(json.dumps(asdict(RECIPES[card["recipe"]])))
    parts = ["python -m rl.train", card["recipe"], f"--seed {seed}", f"--preset {card['preset']}"]
    parts.append(f"--steps {card['plan']['steps']}")
    for name, value in card["settings"].items():
        if value != recipe[name]:
            values = value if isinstance(value, list) else [value]
            parts.append(" ".join([f"--{name.replace('_', '-')}", *(str(v) for v in values)]))
    return " ".join(parts)


def validate(
    candidate: Candidate, preset: Preset, settings: AgentSettings, options: ExportWeights
) -> dict[str, Any]:
    """Fly chosen weights on the validation tiles; give its scores for the card."""
    from rl.training.actor_export import policy_of
    from rl.training.scoring import score_policy

    policy = policy_of(candidate.tensors, settings, options.name)
    score = score_policy(policy, preset, "validation", 0, options.validation_episodes)
    return {
        "seed": candidate.seed,
        "steps": list(candidate.steps),
        "tuning": candidate.score.as_dict(),
        "validation": score.as_dict(),
    }


def run_export(options: ExportWeights) -> None:
    """Run the command.

    Raises:
        ValueError: an option is out of range, a folder is not a run, or the runs have different settings.
    """
    from rich.console import Console

    from guidance.validation import finite_number
    from hda.ground.library import Ground, prepare_tiles
    from hda.task.presets import find_preset
    from rl.inference.artefacts import library_versions, save_artefact
    from rl.settings import settings_from_json
    from rl.training.actor_export import actor_card
    from rl.training.run_folder import read_rows, read_run

    finite_number("workers", options.workers, at_least=1)
    finite_number("last", options.choice.last, at_least=0)
    console = Console()
    cards = [read_run(run) for run in options.runs]
    first, asked = cards[0], [(settings_from_json(card["settings"]), card["preset"]) for card in cards]
    if any(each != asked[0] for each in asked):
        raise ValueError("runs must have the same settings and preset")
    settings, preset = asked[0][0], find_preset(first["preset"])
    for split in ("tuning", "validation"):
        prepare_tiles(Ground(preset.terrain, preset.criteria), split)
    best = []
    for run in options.runs:
        best.append(best_of_run(run, options.choice, options.workers))
        console.print(f"{run}: steps {best[-1].steps}, {best[-1].score.as_dict()}")
    chosen = max(best, key=lambda candidate: candidate.score.rank)
    seeds = [validate(candidate, preset, settings, options) for candidate in best]
    for scores in seeds:
        console.print(f"seed {scores['seed']} on validation: {scores['validation']}")
    curve = [
        {"step": int(row["step"]), "safe_site_percent": float(row["safe_site_percent"])}
        for row in read_rows(chosen.run / "validation.csv")
    ]
    training = {
        "recipe": first["recipe"],
        "planned_steps": first["plan"]["steps"],
        "command": training_command(first, chosen.seed),
        "settings": asdict(settings),
        "preset": preset.name,
        "ground": Ground(preset.terrain, preset.criteria).key,
        "splits": {"learning": "train", "choice": "tuning", "report": "validation"},
        "tuning_seeds": [TUNING_SEED, CHOICE_SEED],
        "choice": asdict(options.choice),
        "seed": chosen.seed,
        "steps": list(chosen.steps),
        "seeds": seeds,
        "curve": curve,
        "versions": library_versions(),
    }
    card = {**actor_card(settings), "training": training}
    artefact = save_artefact(options.out / options.name, "actor", chosen.tensors, card)
    console.print(f"wrote {options.out / options.name}.safetensors ({artefact.digest[:12]})")
