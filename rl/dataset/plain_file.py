"""The plain form of a dataset: one compressed file of arrays, and a card in JSON.

It is numpy's `.npz` (a zip of `.npy` files), without pickles: `numpy.load(path, allow_pickle=False)` reads it
too. Equal arrays and cards give equal bytes. Reading it runs nothing and makes no environment.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rl.dataset.transitions import KINDS, Transitions

FORMAT_VERSION = 1
_CARD = "card"
_LONGEST_CARD = 1_000_000  # characters
_LONGEST_HEADER = 100_000  # bytes
MOST_BYTES = 4 * 1024**3
"""What the arrays of a file may come to unpacked, unless its reader allows more."""


class DatasetError(ValueError):
    """A file is no dataset, or is damaged."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Episodes and what is known of them.

    Attributes:
        card: command, versions, policies, scores; JSON.
        transitions: the episodes.
    """

    card: dict[str, Any]
    transitions: Transitions


def write_dataset(path: Path, dataset: Dataset) -> None:
    """Write the file; what was there is replaced as a whole."""
    card = json.dumps({"format": FORMAT_VERSION, **dataset.card}, sort_keys=True)
    arrays = {name: np.ascontiguousarray(getattr(dataset.transitions, name)) for name in KINDS}
    draft = path.with_name(f".{path.name}.draft")
    with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in [(_CARD, np.array(card)), *arrays.items()]:
            entry = zipfile.ZipInfo(f"{name}.npy")  # dated 1980, so that equal data give equal bytes
            entry.compress_type = zipfile.ZIP_DEFLATED
            with file.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    draft.replace(path)


def read_dataset(path: Path, most_bytes: int = MOST_BYTES) -> Dataset:
    """Read a file that `write_dataset` wrote, whoever gave it to you.

    Args:
        path: the file.
        most_bytes: what its arrays may come to unpacked; a small file may unpack to very much.

    Raises:
        DatasetError: it is missing, damaged, too large or no such file; the message names it.
    """
    try:
        with zipfile.ZipFile(path) as file:
            _refuse_members(file.infolist(), most_bytes)
            card = _read_card(_read_member(file, _CARD))
            transitions = Transitions(**{name: _read_member(file, name) for name in KINDS})
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from error
    except (
        OSError, ValueError, EOFError, KeyError, TypeError, AttributeError, RuntimeError, SyntaxError,
        NotImplementedError, OverflowError, MemoryError, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        raise DatasetError(f"{path}: damaged, or not a dataset ({error!r})") from error
    known = len(card["policies"])
    if transitions.policy.size and not 0 <= transitions.policy.min() <= transitions.policy.max() < known:
        raise DatasetError(f"{path}: names a policy that its card does not list")
    return Dataset(card, transitions)


def _refuse_members(members: Sequence[zipfile.ZipInfo], most_bytes: int) -> None:
    """Judge by the directory, before anything is unpacked; no more is unpacked than it says.

    Raises:
        DatasetError: other members than those of a dataset, or too large ones.
    """
    if sorted(member.filename for member in members) != sorted(f"{name}.npy" for name in (_CARD, *KINDS)):
        raise DatasetError("is not a dataset of this program")
    sizes = {member.filename: member.file_size for member in members}
    if sizes.pop(f"{_CARD}.npy") > 4 * _LONGEST_CARD + _LONGEST_HEADER:
        raise DatasetError("the card is no text")
    if (size := sum(sizes.values())) > most_bytes:
        raise DatasetError(
            f"its arrays unpack to {size} bytes, more than {most_bytes}: pass most_bytes if you trust it"
        )


def _read_member(file: zipfile.ZipFile, name: str) -> Any:
    with file.open(f"{name}.npy") as member:
        return np.load(member, allow_pickle=False)


def _read_card(member: Any) -> dict[str, Any]:
    """What the card says.

    Raises:
        DatasetError: it is no card, or one of another format.
    """
    if member.dtype.kind != "U" or member.ndim or member.dtype.itemsize > 4 * _LONGEST_CARD:
        raise DatasetError("the card is no text")
    try:
        card = json.loads(str(member))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"the card is damaged ({error})") from error
    if not isinstance(card, dict) or not isinstance(card.get("policies"), list):
        raise DatasetError("the card lists no policies")
    if card.get("format") != FORMAT_VERSION:
        raise DatasetError(f"has format {card.get('format')!r}, but this program reads {FORMAT_VERSION}")
    return card
