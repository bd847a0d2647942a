"""The shipped map encoder, loaded once per process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from rl.inference.artefacts import WEIGHTS_FOLDER, Artefact, load_artefact, require
from rl.inference.networks import MapEncoder

ENCODER_PATH = WEIGHTS_FOLDER / "autoencoder"


@cache
def load_autoencoder(path: Path = ENCODER_PATH) -> Artefact:
    """Read and verify the autoencoder's weights.

    Raises:
        ArtefactError: they are missing, damaged, or of another latent size.
    """
    artefact = load_artefact(path, "autoencoder")
    require(artefact.card, "latent_size", LATENT_SIZE, path)
    return artefact


@cache
def load_encoder(path: Path = ENCODER_PATH) -> MapEncoder:
    """Make the encoder from the shipped weights.

    Raises:
        ArtefactError: the weights are missing or damaged.
    """
    return MapEncoder.from_tensors(load_autoencoder(path).tensors)


LATENT_SIZE = 32
