"""The shipped map encoders, each loaded once per process."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from guidance.validation import unknown_name
from rl.inference.artefacts import (
    ENCODER,
    WEIGHTS_FOLDER,
    Artefact,
    ArtefactError,
    load_artefact,
    require,
)
from rl.inference.networks import MapEncoder

ENCODER_PATH = WEIGHTS_FOLDER / ENCODER


def encoder_names() -> tuple[str, ...]:
    """Names of the shipped encoders, the usual one first."""
    return tuple(sorted(card.stem for card in WEIGHTS_FOLDER.glob(f"{ENCODER}*.json")))


def encoder_path(name: str) -> Path:
    """Where the weights of a shipped encoder stand, without suffix.

    Raises:
        ValueError: there is no encoder of that name.
    """
    if name not in encoder_names():
        raise ValueError(unknown_name("encoder", name, encoder_names()))
    return WEIGHTS_FOLDER / name


def encoder_of_card(card: Mapping[str, Any], path: Path) -> Path:
    """The shipped encoder that an actor was trained with, by the digest that its card gives.

    Args:
        card: of the actor.
        path: of the card, for messages.

    Raises:
        ArtefactError: no shipped encoder has that digest.
    """
    paths = [encoder_path(name) for name in encoder_names()]
    for encoder in paths:
        if load_autoencoder(encoder).digest == card.get("autoencoder"):
            return encoder
    digests = ", ".join(load_autoencoder(encoder).digest for encoder in paths)
    raise ArtefactError(
        f"{path}: made for autoencoder {card.get('autoencoder')!r}, but this program has {digests}"
    )


@cache
def load_autoencoder(path: Path = ENCODER_PATH) -> Artefact:
    """Read and verify an autoencoder's weights.

    Raises:
        ArtefactError: they are missing, damaged, or of another latent size.
    """
    artefact = load_artefact(path, "autoencoder")
    require(artefact.card, "latent_size", LATENT_SIZE, path)
    return artefact


@cache
def load_encoder(path: Path = ENCODER_PATH) -> MapEncoder:
    """Make an encoder from its weights.

    Raises:
        ArtefactError: the weights are missing or damaged.
    """
    return MapEncoder.from_tensors(load_autoencoder(path).tensors)


LATENT_SIZE = 32
