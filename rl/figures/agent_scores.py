"""How agents and other policies flew, from tables of studies, cards of weights and folders of runs."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rl.inference.artefacts import read_card
from rl.training.run_folder import read_rows, read_run

_SUCCESS = "success_percent", "success_low", "success_high"
_BURNT = "propellant_percent", "propellant_percent_low", "propellant_percent_high"


@dataclass(frozen=True)
class Estimate:
    """A mean over episodes, and its interval.

    Attributes:
        value: of all episodes.
        low: lower end of the interval; nan where the table has none.
        high: its upper end; likewise.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class FlownPolicy:
    """A row of a study's table.

    Attributes:
        preset: setting that was flown.
        policy: name.
        success: [%].
        propellant: [%].
    """

    preset: str
    policy: str
    success: Estimate
    propellant: Estimate


@dataclass(frozen=True)
class SeedScore:
    """How the agent of one training seed flew the preset that it was trained on.

    Attributes:
        preset: setting.
        agent: recipe.
        seed: of the training.
        judged: split that it was flown on: "validation", or "tuning" where the run has no exported weights.
        success: [%].
        propellant: [%].
    """

    preset: str
    agent: str
    seed: int
    judged: str
    success: float
    propellant: float


def read_tables(folders: Sequence[Path]) -> list[FlownPolicy]:
    """Rows of `table.csv` in the folders of `studies.compare` and `studies.realism`; a later one replaces.

    Raises:
        ValueError: a folder has no such table.
    """
    rows: dict[tuple[str, str], FlownPolicy] = {}
    for folder in folders:
        try:
            with (folder / "table.csv").open(newline="", encoding="utf-8") as file:
                for row in csv.DictReader(file):
                    key = row["preset"], row["policy"].removesuffix(" *")
                    success = Estimate(*(float(row[name]) for name in _SUCCESS))
                    burnt = Estimate(*(float(row.get(name) or math.nan) for name in _BURNT))
                    rows[key] = FlownPolicy(*key, success, burnt)
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{folder} holds no table of policies on presets: {error!r}") from error
    return list(rows.values())


def read_seeds(cards: Sequence[Path], runs: Sequence[Path]) -> list[SeedScore]:
    """Scores of seeds: of the cards on the validation tiles, of runs as last judged on the tuning tiles.

    Args:
        cards: of exported weights.
        runs: run folders; one whose seed stands on a card of its recipe and preset is left out.

    Raises:
        ValueError: a file is no such card, or a folder no validated run.
        ArtefactError: a card is damaged.
    """
    scores: dict[tuple[str, str, int], SeedScore] = {}
    for path in cards:
        scores.update(_read_card_seeds(path))
    for folder in runs:
        card, rows = read_run(folder), read_rows(folder / "validation.csv")
        if not rows:
            raise ValueError(f"{folder} has no validated actor")
        key = card["preset"], card["recipe"], card["seed"]
        try:
            numbers = float(rows[-1]["success_percent"]), float(rows[-1]["propellant_percent"])
            scores.setdefault(key, SeedScore(*key, "tuning", *numbers))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{folder} has no validated actor: {error!r}") from error
    return list(scores.values())


def _read_card_seeds(path: Path) -> dict[tuple[str, str, int], SeedScore]:
    """Scores of a card's seeds, by preset, agent and seed.

    Raises:
        ValueError: as of `read_seeds`.
        ArtefactError: likewise.
    """
    card, scores = read_card(path, "actor"), {}
    try:
        training = card["training"]
        preset = training["preset"]
        agent = training.get("recipe", path.stem.removesuffix(f"-{preset}"))
        for entry in training["seeds"]:
            flown = entry["validation"]
            numbers = float(flown["success_percent"]), float(flown["propellant_percent"])
            key = preset, agent, entry["seed"]
            scores[key] = SeedScore(*key, "validation", *numbers)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{path} is not a card of exported weights: {error!r}") from error
    return scores


def find_cards(folder: Path) -> list[Path]:
    """Cards of agents in a folder of weights; encoders lie there too."""
    return [path for path in sorted(folder.glob("*.json")) if not path.stem.startswith("autoencoder")]
