"""Shipped networks without torch: artefacts on the disk, and their forward passes in compiled code.

Weights are safetensors beside a JSON card with its own checksum. The encoder of the safety map, perceptrons
and recurrent networks give the same numbers as torch to rounding. Environments and policies import it; it
imports nothing of `rl`.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.inference.artefacts import Artefact, ArtefactError, load_artefact
    from rl.inference.latent import LATENT_SIZE, load_encoder
    from rl.inference.networks import MapEncoder, Perceptron
    from rl.inference.recurrent_network import RecurrentNetwork

_HOMES = {
    "rl.inference.artefacts": (
        "Artefact",
        "ArtefactError",
        "load_artefact",
    ),
    "rl.inference.latent": (
        "LATENT_SIZE",
        "load_encoder",
    ),
    "rl.inference.networks": (
        "MapEncoder",
        "Perceptron",
    ),
    "rl.inference.recurrent_network": ("RecurrentNetwork",),
}

__all__ = [
    "LATENT_SIZE",
    "Artefact",
    "ArtefactError",
    "MapEncoder",
    "Perceptron",
    "RecurrentNetwork",
    "load_artefact",
    "load_encoder",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
