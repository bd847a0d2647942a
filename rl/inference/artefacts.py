"""Weights on disk: numbers as safetensors, everything else as a JSON card beside them. Nothing is unpickled.

A card names the kind of artefact, the versions it was made with and the SHA-256 of every tensor and of
itself. A file that is missing, damaged, foreign or changed after it was written is refused before any number
of it is used.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT_VERSION = 2
READABLE_FORMATS = (1, 2)
"""Cards of format 1 do not hold their own checksum."""
WEIGHTS_FOLDER = Path(__file__).parents[1] / "weights"

ENCODER = "autoencoder"
"""The encoder of maps with noise; one that learnt on another preset is named `autoencoder-PRESET`."""

Tensors = dict[str, NDArray[Any]]


class ArtefactError(ValueError):
    """A weight file is missing, damaged, or not what it should be."""


@dataclass(frozen=True, eq=False)
class Artefact:
    """Verified weights.

    Attributes:
        kind: what the weights are for ("autoencoder", "actor", "checkpoint").
        tensors: name -> array.
        card: how they were made.
    """

    kind: str
    tensors: Tensors
    card: dict[str, Any]

    @property
    def digest(self) -> str:
        """SHA-256 over all tensors: the identity of the weights."""
        return combined_digest(self.card["tensors"])


def tensor_digest(tensor: NDArray[Any]) -> str:
    """SHA-256 over type, shape and bytes of an array."""
    header = f"{tensor.dtype.str}{tensor.shape}".encode()
    return hashlib.sha256(header + np.ascontiguousarray(tensor).tobytes()).hexdigest()


def combined_digest(digests: Mapping[str, str]) -> str:
    """SHA-256 over the digests of all tensors, by name."""
    return hashlib.sha256(json.dumps(dict(digests), sort_keys=True).encode()).hexdigest()


def card_digest(card: Mapping[str, Any]) -> str:
    """SHA-256 over what a card says, its own checksum aside."""
    said = {name: value for name, value in card.items() if name != "card_sha256"}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def library_versions() -> dict[str, str]:
    """Versions of what the numbers depend on; a library for training that is not installed is left out."""
    from importlib.metadata import PackageNotFoundError, version

    versions = {"python": platform.python_version()}
    for name in ("numpy", "torch", "stable_baselines3", "gymnasium", "numba"):
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


def save_artefact(path: Path, kind: str, tensors: Tensors, card: Mapping[str, Any]) -> Artefact:
    """Write `path`.safetensors and `path`.json; each is replaced as a whole.

    Args:
        path: file name without suffix; its folder is made.
        kind: what the weights are for.
        tensors: name -> array.
        card: how they were made; must be JSON.
    """
    from safetensors.numpy import save

    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {name: np.ascontiguousarray(tensor) for name, tensor in sorted(tensors.items())}
    full = {
        "format": FORMAT_VERSION,
        "kind": kind,
        **card,
        "tensors": {name: tensor_digest(tensor) for name, tensor in arrays.items()},
    }
    full = json.loads(json.dumps(full))  # as it will be read
    full["card_sha256"] = card_digest(full)
    _replace(path.with_suffix(".safetensors"), save(arrays))
    _replace(path.with_suffix(".json"), (json.dumps(full, indent=1, sort_keys=True) + "\n").encode())
    return Artefact(kind, arrays, full)


def load_artefact(path: Path, kind: str) -> Artefact:
    """Read and verify `path`.safetensors and `path`.json.

    Raises:
        ArtefactError: a file is missing, cannot be read, is of another kind or format, or does not match
            its card.
    """
    from safetensors import SafetensorError
    from safetensors.numpy import load

    card_path, tensor_path = path.with_suffix(".json"), path.with_suffix(".safetensors")
    card = read_card(card_path, kind)
    try:
        tensors = load(tensor_path.read_bytes())
    except OSError as error:
        raise ArtefactError(f"cannot read the weights {tensor_path}: {error}") from error
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise ArtefactError(f"{tensor_path} is damaged or not a safetensors file: {error}") from error
    expected = card["tensors"]
    if set(tensors) != set(expected):
        odd = ", ".join(sorted(set(tensors) ^ set(expected)))
        raise ArtefactError(
            f"{tensor_path} does not belong to its card {card_path.name}; they differ in: {odd}"
        )
    for name, tensor in tensors.items():
        if tensor_digest(tensor) != expected[name]:
            raise ArtefactError(
                f"{tensor_path}: tensor {name!r} does not match its card; the file was changed or mixed up"
            )
        if tensor.dtype.kind == "f" and not np.isfinite(tensor).all():
            raise ArtefactError(f"{tensor_path}: tensor {name!r} holds numbers that are not finite")
    return Artefact(kind, tensors, card)


def read_card(card_path: Path, kind: str) -> dict[str, Any]:
    """Read a card and check its format and kind.

    Raises:
        ArtefactError: it is missing, is not JSON, or is of another kind or format.
    """
    try:
        card = json.loads(card_path.read_text())
    except OSError as error:
        raise ArtefactError(f"cannot read the weight card {card_path}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise ArtefactError(f"{card_path} is damaged or not a JSON card: {error}") from error
    if not isinstance(card, dict) or not isinstance(card.get("tensors"), dict):
        raise ArtefactError(f"{card_path} is not a weight card")
    if card.get("format") not in READABLE_FORMATS:
        raise ArtefactError(f"{card_path}: format {card.get('format')!r}, expected {FORMAT_VERSION}")
    if ("card_sha256" in card or card["format"] > 1) and card.get("card_sha256") != card_digest(card):
        raise ArtefactError(f"{card_path} was changed or damaged: its checksum does not hold")
    if card.get("kind") != kind:
        raise ArtefactError(f"{card_path}: kind {card.get('kind')!r}, expected {kind!r}")
    return card


def require(card: Mapping[str, Any], name: str, expected: object, path: Path) -> None:
    """Raise ArtefactError unless the card says `expected` under `name`."""
    if card.get(name) != expected:
        raise ArtefactError(f"{path}: made for {name} {card.get(name)!r}, but this program has {expected!r}")


def _replace(path: Path, content: bytes) -> None:
    draft = path.with_name(f".{path.name}.draft")
    draft.write_bytes(content)
    draft.replace(path)
