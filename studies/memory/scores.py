"""Scores of trained agents: from runs, whose chosen actor flies once, and from cards of weights."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from io import StringIO
from pathlib import Path
from typing import Any

from rl.policies.actor import weights_name
from rl.recipes import RECIPES
from rl.training.candidates import Choice, best_of_run
from rl.training.run_folder import read_rows, read_run
from studies.campaign.shards import write_durably

VALIDATION_SEED = 0
"""Study seed of the one flight over the validation tiles, as of the cards of shipped weights."""


@dataclass(frozen=True)
class AgentScore:
    """How one trained agent flew the validation tiles.

    Attributes:
        agent: recipe that it was trained with.
        preset: setting that it was trained on and flew.
        seed: of the training.
        source: run folder or card.
        settings: digest of what was learnt and how; the same within a group.
        trained_steps: environment steps at the run's last validation.
        planned_steps: where the last one is due.
        chosen_steps: steps of the actors that were averaged, joined by "+".
        episodes: flown.
        safe_site_percent: landed on safe ground.
        success_percent: safe ground, soft, propellant left.
        reward: mean of the undiscounted sum.
    """

    agent: str
    preset: str
    seed: int
    source: str
    settings: str
    trained_steps: int
    planned_steps: int
    chosen_steps: str
    episodes: int
    safe_site_percent: float
    success_percent: float
    reward: float

    @property
    def unfinished(self) -> bool:
        """The run was asked for more steps than it has."""
        return self.trained_steps < self.planned_steps


def score_run(folder: Path, episodes: int, choice: Choice, workers: int) -> AgentScore:
    """Choose a run's actor on the tuning tiles, in processes, and fly it over the validation tiles.

    Raises:
        ValueError: the folder holds no run, or none of its actors was validated.
    """
    from hda.ground.library import Ground, prepare_tiles
    from hda.task.presets import find_preset
    from rl.settings import settings_from_json
    from rl.training.actor_export import policy_of
    from rl.training.scoring import score_policy

    card = read_run(folder)
    preset, settings = find_preset(card["preset"]), settings_from_json(card["settings"])
    for split in ("tuning", "validation"):
        prepare_tiles(Ground(preset.terrain, preset.criteria), split)
    best = best_of_run(folder, choice, workers)
    score = score_policy(policy_of(best.tensors, settings), preset, "validation", VALIDATION_SEED, episodes)
    return AgentScore(
        **_identity(folder, card),
        chosen_steps="+".join(str(step) for step in best.steps),
        episodes=score.episodes,
        safe_site_percent=score.safe_site_percent,
        success_percent=score.success_percent,
        reward=score.reward,
    )


def _identity(folder: Path, card: dict[str, Any]) -> dict[str, Any]:
    trained, planned = read_progress(folder)
    return {
        "agent": card["recipe"],
        "preset": card["preset"],
        "seed": int(card["seed"]),
        "source": str(folder),
        "settings": _settings_digest(card["settings"]),
        "trained_steps": trained,
        "planned_steps": planned,
    }


def read_progress(folder: Path) -> tuple[int, int]:
    """Steps at which a run was validated last, and at which it will be.

    Raises:
        ValueError: the folder holds no run, or its log is damaged.
    """
    plan, rows = read_run(folder)["plan"], read_rows(folder / "validation.csv")
    return int(rows[-1]["step"]) if rows else 0, plan["steps"] - plan["steps"] % plan["validate_every"]


def _settings_digest(settings: dict[str, Any]) -> str:
    from hashlib import sha256

    return sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:12]


def scores_of_card(path: Path) -> list[AgentScore]:
    """Scores of every seed that stands in the card of shipped weights.

    Raises:
        ValueError: the file is not such a card.
    """
    try:
        training = json.loads(path.read_text())["training"]
        agent, steps = _recipe_and_steps(path, training)
        settings = _settings_digest(training["settings"])
        return [
            AgentScore(
                agent=agent,
                preset=training["preset"],
                seed=int(entry["seed"]),
                source=str(path),
                settings=settings,
                trained_steps=steps,
                planned_steps=steps,
                chosen_steps="+".join(str(step) for step in entry["steps"]),
                episodes=int(entry["validation"]["episodes"]),
                safe_site_percent=float(entry["validation"]["safe_site_percent"]),
                success_percent=float(entry["validation"]["success_percent"]),
                reward=float(entry["validation"]["reward"]),
            )
            for entry in training["seeds"]
        ]
    except (KeyError, TypeError, IndexError, AttributeError, ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not a card of exported weights: {error!r}") from error


def _recipe_and_steps(path: Path, training: dict[str, Any]) -> tuple[str, int]:
    """What a card's agents were trained with, and for how long.

    The first cards do not say: they go by the name of their recipe and preset, and their curve ends with the
    training.

    Raises:
        ValueError: neither tells the recipe.
    """
    if "recipe" in training:
        return str(training["recipe"]), int(training["planned_steps"])
    for recipe in RECIPES:
        if path.stem == weights_name(recipe, training["preset"]):
            return recipe, int(training["curve"][-1]["step"])
    raise ValueError("it does not name its recipe, nor does its file name")


def collect_scores(
    sources: Sequence[Path], kept: Path, episodes: int, choice: Choice, workers: int = 1
) -> tuple[AgentScore, ...]:
    """Scores of runs (folders) and cards (.json); what stands in the file of kept scores is not flown again.

    Args:
        sources: run folders and cards.
        kept: CSV of scores; what is flown is added at once, so that a stopped study goes on.
        episodes: that each run's actor flies over the validation tiles.
        choice: how the actor is chosen on the tuning tiles.
        workers: processes that fly the candidates of a run.

    Raises:
        ValueError: a source is neither, or two of them are the same agent, preset and seed.
    """
    known = {(s.source, s.settings, s.trained_steps, s.episodes): s for s in read_scores(kept)}
    scores: list[AgentScore] = []
    for source in sources:
        if source.suffix == ".json":
            scores += scores_of_card(source)
            continue
        identity = _identity(source, read_run(source))
        key = (identity["source"], identity["settings"], identity["trained_steps"], episodes)
        if key not in known:
            known[key] = score_run(source, episodes, choice, workers)
            write_scores(kept, list(known.values()))
        scores.append(known[key])
    write_scores(kept, scores)
    _check_distinct(scores)
    return tuple(scores)


def _check_distinct(scores: Iterable[AgentScore]) -> None:
    seen: dict[tuple[str, str, int], AgentScore] = {}
    for score in scores:
        before = seen.setdefault((score.agent, score.preset, score.seed), score)
        if before is not score:
            raise ValueError(
                f"{before.source} and {score.source} are both {score.agent} on {score.preset},"
                f" seed {score.seed}"
            )


def write_scores(path: Path, scores: Sequence[AgentScore]) -> None:
    """Write scores as CSV, a line per agent; a crash leaves the file as it was."""
    text = StringIO(newline="")
    writer = csv.DictWriter(text, [field.name for field in fields(AgentScore)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(score) for score in scores)
    write_durably(path, text.getvalue().encode())


def read_scores(path: Path) -> list[AgentScore]:
    """Read what `write_scores` wrote; nothing if there is no such file.

    Raises:
        ValueError: the file is damaged.
    """
    if not path.exists():
        return []
    kinds = {"int": int, "float": float, "str": str}
    try:
        with path.open(newline="") as stream:
            return [
                AgentScore(**{f.name: kinds[str(f.type)](row[f.name]) for f in fields(AgentScore)})
                for row in csv.DictReader(stream)
            ]
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ValueError(f"{path} is damaged ({error!r}); delete it to fly the agents again") from error
