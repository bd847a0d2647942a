"""The folder of a training run: what was asked for, and its logs.

A run's folder holds

- `run.json`: what was asked for, and the device that its last session learnt on;
- `training.csv`: losses, reward and safe ratio over windows of steps;
- `validation.csv`: the deterministic policy on the tuning tiles, every so many steps;
- `actors/`: the actor at each validation;
- `checkpoint-*.safetensors/.json`: where `--resume` goes on;
- `tensorboard/`.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class TrainingPlan:
    """How long, how often, how seeded.

    Attributes:
        steps: environment steps; how many of them an update takes is a setting.
        seed: of weights, exploration and episodes.
        recipe: name of the command that trains it.
        validate_every: steps between validations.
        validation_episodes: episodes of each.
        checkpoint_every: least steps between checkpoints.
        log_every: steps in one row of `training.csv`.
    """

    steps: int
    seed: int
    recipe: str = "td3"
    validate_every: int = 10_000
    validation_episodes: int = 200
    checkpoint_every: int = 10_000
    log_every: int = 1_000


def read_run(folder: Path) -> dict[str, Any]:
    """What a run was begun with, from its `run.json`.

    Raises:
        ValueError: the folder holds no run, or its record is damaged.
    """
    try:
        card = json.loads((folder / "run.json").read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{folder} is not a run: {error}") from error
    if not isinstance(card, dict) or not {"settings", "preset", "seed", "plan", "recipe"} <= set(card):
        raise ValueError(f"{folder / 'run.json'} is not the record of a run")
    return card


def append_row(path: Path, row: Mapping[str, Any]) -> None:
    """Write one more line of a log; the first one after a header."""
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(row))
        if fresh:
            writer.writeheader()
        writer.writerow(row)


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a log, all numbers; empty if there is none. A last line that was never finished is left out.

    Raises:
        ValueError: the log is damaged; the message names the line.
    """
    if not path.exists():
        return []
    rows: list[dict[str, str]] = []
    try:
        with path.open(newline="") as file:
            lines = file.read().splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):
            lines.pop()  # a killed process was writing it
        for row in csv.DictReader(lines, strict=True):
            int(row["step"])
            for value in row.values():
                float("nan" if value == "" else value)  # no loss yet: left empty
            rows.append(row)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ValueError(f"{path}, line {len(rows) + 2}: damaged, or not a log ({error!r})") from error
    return rows


def truncate_rows(path: Path, last_step: int) -> None:
    """Drop the rows of a log beyond a step."""
    rows: Sequence[Mapping[str, str]] = [row for row in read_rows(path) if int(row["step"]) <= last_step]
    path.unlink(missing_ok=True)
    for row in rows:
        append_row(path, row)
