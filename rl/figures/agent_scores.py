"""How agents and other policies flew, from tables of studies, cards of weights and folders of runs."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rl.inference.artefacts import read_card
from rl.policies.actor import weights_name
from rl.training.run_folder import read_rows, read_run

_SUCCESS = "success_percent", "success_tile_low", "success_tile_high"
_BURNT = "propellant_percent", "propellant_percent_tile_low", "propellant_percent_tile_high"
_PLAIN = "safe_site_percent", "touchdown_speed_mps"
_SCORES = "success_percent", "propellant_percent", *_PLAIN


@dataclass(frozen=True)
class Estimate:
    """A mean over episodes, and its interval clustered by tile.

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
        episodes: that it flew.
        success: [%].
        propellant: [%].
        safe_site: [%]; nan where the table has none.
        touchdown_speed: [m/s]; likewise.
    """

    preset: str
    policy: str
    episodes: int
    success: Estimate
    propellant: Estimate
    safe_site: float
    touchdown_speed: float


@dataclass(frozen=True)
class SeedScore:
    """How the agent of one training seed flew the preset that it was trained on.

    Attributes:
        preset: setting.
        agent: name of its weights without that of the preset; of a run its recipe.
        seed: of the training.
        judged: split that it was flown on: "validation", or "tuning" where the run has no exported weights.
        episodes: that it flew there.
        shipped: it is the seed whose weights lie beside the card.
        success: [%].
        propellant: [%].
        safe_site: [%].
        touchdown_speed: [m/s].
    """

    preset: str
    agent: str
    seed: int
    judged: str
    episodes: int
    shipped: bool
    success: float
    propellant: float
    safe_site: float
    touchdown_speed: float


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
                    plain = [float(row.get(name) or math.nan) for name in _PLAIN]
                    rows[key] = FlownPolicy(*key, int(row["episodes"]), success, burnt, *plain)
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
            flown = int(float(rows[-1]["episodes"]))
            numbers = [float(rows[-1][name]) for name in _SCORES]
            scores.setdefault(key, SeedScore(*key, "tuning", flown, False, *numbers))
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
        agent = path.stem if preset == "paper" else path.stem.removesuffix(f"-{preset}")  # as `weights_name`
        for entry in training["seeds"]:
            flown = entry["validation"]
            numbers = [float(flown[name]) for name in _SCORES]
            key, shipped = (preset, agent, entry["seed"]), entry["seed"] == training["seed"]
            scores[key] = SeedScore(*key, "validation", int(flown["episodes"]), shipped, *numbers)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{path} is not a card of exported weights: {error!r}") from error
    return scores


def weights_row(flown: dict[str, FlownPolicy], agent: str, learnt: bool) -> FlownPolicy | None:
    """An agent's row among those of one preset, by policy.

    Args:
        flown: the rows.
        agent: recipe.
        learnt: of the weights that learnt on the preset, or of those of `paper` flown elsewhere.
    """
    preset = next(iter(flown.values())).preset if flown else ""
    name = weights_name(agent, preset)
    return flown.get(name) if learnt else flown.get(agent) if name != agent else None


def find_cards(folder: Path) -> list[Path]:
    """Cards of agents in a folder of weights; encoders lie there too."""
    return [path for path in sorted(folder.glob("*.json")) if not path.stem.startswith("autoencoder")]
