"""A results folder as it was handed in: what it says of itself, and its episodes line by line."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hda.flight.episode_row import ROW_COLUMNS, EpisodeRow
from hda.ground.own_terrain import OWN_SPLIT
from hda.task.presets import find_preset
from studies.campaign.monte_carlo import Study
from studies.campaign.provenance import restore_study
from studies.compare.table import REFERENCE_POLICY

PROVENANCE = "provenance.json"
EPISODES = "episodes.csv"


class HeldResultsError(ValueError):
    """The folder cannot be read, or holds results that cannot fly again."""


@dataclass(frozen=True, eq=False)
class HeldResults:
    """What a folder says.

    Attributes:
        folder: where it is.
        provenance: of `provenance.json`.
        study: what was flown, with the named preset as it is today.
        lines: (policy, episode) -> its line of `episodes.csv`, without the line's end.
        rows: the same as numbers.
    """

    folder: Path
    provenance: dict[str, Any]
    study: Study
    lines: dict[tuple[str, int], str]
    rows: dict[tuple[str, int], EpisodeRow]

    @property
    def policies(self) -> tuple[str, ...]:
        """The policies of `episodes.csv`, in its order."""
        return tuple(dict.fromkeys(policy for policy, _ in self.rows))


def read_results(folder: Path) -> HeldResults:
    """Read a folder of `studies.compare`, or of a point of another study.

    Raises:
        HeldResultsError: a file is missing or damaged, episodes are missing or there twice, the preset is
            unknown, or the ground is a terrain of the user's own.
    """
    provenance = read_provenance(folder)
    study = read_study(provenance)
    head, *lines = _read_text(folder / EPISODES).split("\n")
    if lines[-1:] != [""]:
        raise HeldResultsError(f"{EPISODES} is damaged: its last line has no end")
    lines.pop()
    if head != ",".join(ROW_COLUMNS):
        raise HeldResultsError(f"{EPISODES} has other columns than this version: {head[:80]}")
    rows = [_parse_row(number, line) for number, line in enumerate(lines, start=2)]
    keys = [(row.policy, row.episode) for row in rows]
    flown = tuple(dict.fromkeys(policy for policy, _ in keys))
    if flown != study.policies and (*flown, REFERENCE_POLICY) != study.policies:
        raise HeldResultsError(f"{EPISODES} holds other policies than {PROVENANCE}: {', '.join(flown)}")
    if keys != [(policy, episode) for policy in flown for episode in range(study.episodes)]:
        raise HeldResultsError(
            f"{EPISODES} must hold the episodes 0 to {study.episodes - 1} of each policy once, in order"
        )
    return HeldResults(
        folder, provenance, study, dict(zip(keys, lines, strict=True)), dict(zip(keys, rows, strict=True))
    )


def read_provenance(folder: Path) -> dict[str, Any]:
    """What the folder says of its making.

    Raises:
        HeldResultsError: it is missing or no JSON object.
    """
    try:
        held = json.loads(_read_text(folder / PROVENANCE))
    except (ValueError, RecursionError) as error:
        raise HeldResultsError(f"{PROVENANCE} is damaged: {error}") from error
    if not isinstance(held, dict):
        raise HeldResultsError(f"{PROVENANCE} is damaged: it holds no object")
    return held


def read_study(provenance: dict[str, Any]) -> Study:
    """The study that a provenance describes, on the named preset as it is today.

    Raises:
        HeldResultsError: fields are missing, the preset is unknown, or the ground is the user's own.
    """
    try:
        study = restore_study(provenance["study"], find_preset(str(provenance["preset"]["name"])))
    except (KeyError, TypeError, ValueError) as error:
        raise HeldResultsError(f"{PROVENANCE} tells no study: {error}") from error
    if study.split == OWN_SPLIT:
        raise HeldResultsError("it was flown on a terrain of its own, which the folder does not hold")
    if study.episodes < 1:
        raise HeldResultsError(f"{PROVENANCE} tells no study: it has no episode")
    return study


def _read_text(path: Path) -> str:
    try:
        return path.read_bytes().decode()
    except FileNotFoundError:
        raise HeldResultsError(f"{path.name} is missing in {path.parent}") from None
    except UnicodeDecodeError as error:
        raise HeldResultsError(f"{path.name} is damaged: {error}") from error


def _parse_row(number: int, line: str) -> EpisodeRow:
    """A line of episodes.csv as numbers."""
    kinds = {"str": str, "int": int, "float": _parse_float, "bool": _parse_bool}
    try:
        (cells,) = csv.reader([line])
        named = zip(ROW_COLUMNS, cells, strict=True)
        return EpisodeRow(**{name: kinds[EpisodeRow.__annotations__[name]](cell) for name, cell in named})
    except (ValueError, csv.Error) as error:
        raise HeldResultsError(f"line {number} of {EPISODES} is damaged: {error}") from error


def _parse_float(cell: str) -> float:
    return math.nan if cell == "" else float(cell)


def _parse_bool(cell: str) -> bool:
    if cell not in ("True", "False"):
        raise ValueError(f"{cell!r} is neither True nor False")
    return cell == "True"
