"""Training of the autoencoder as a command: collect maps, train, measure, write the weights."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from guidance.validation import finite_number
from rl.inference.artefacts import ENCODER, WEIGHTS_FOLDER

VALIDATION_ROLLOUTS = 300
_SEED_OFFSET = 770_000


@dataclass(frozen=True)
class TrainAutoencoder:
    """Train the autoencoder on the maps of random rollouts over training ground.

    Attributes:
        seed: seed of the rollouts, of the first weights and of the order of the maps.
        preset: setting to fly.
        rollouts: episodes with random actions.
        epochs: passes over their maps.
        out: where the weights and their card are written (no suffix); the shipped encoder of the preset by
            default: `autoencoder`, or `autoencoder-PRESET` of another than paper.
    """

    seed: int = 0
    preset: str = "paper"
    rollouts: int = 5000
    epochs: int = 15
    out: Annotated[Path | None, tyro.conf.arg(metavar="PATH")] = None

    @property
    def weights(self) -> Path:
        """Where the weights are written."""
        own = "" if self.preset == TrainAutoencoder.preset else f"-{self.preset}"
        return self.out or WEIGHTS_FOLDER / f"{ENCODER}{own}"


def run_autoencoder_training(options: TrainAutoencoder) -> None:
    """Run the command.

    Raises:
        ValueError: an option is out of range.
    """
    import torch
    from rich.console import Console
    from rich.progress import Progress

    from hda.ground.library import Ground, prepare_tiles
    from hda.task.presets import find_preset
    from rl.inference.artefacts import library_versions, save_artefact
    from rl.inference.latent import LATENT_SIZE
    from rl.learning import autoencoder

    finite_number("rollouts", options.rollouts, at_least=1)
    finite_number("epochs", options.epochs, at_least=1)
    torch.set_num_threads(1)
    preset = find_preset(options.preset)
    for split in ("train", "validation"):
        prepare_tiles(Ground(preset.terrain, preset.criteria), split)
    settings = autoencoder.AutoencoderSettings(epochs=options.epochs)
    with Progress() as progress:
        task = progress.add_task("random rollouts", total=options.rollouts)
        seed = _SEED_OFFSET + options.seed
        maps = autoencoder.collect_maps(
            preset, "train", options.rollouts, seed, lambda n: progress.advance(task, n)
        )
        task = progress.add_task("epochs", total=options.epochs)
        curve = []
        network = autoencoder.Autoencoder()
        for epoch, loss, trained in autoencoder.train_autoencoder(maps, settings, options.seed):
            network = trained
            progress.console.print(f"epoch {epoch + 1}: cross entropy {loss:.5f}")
            progress.advance(task)
            curve.append(round(loss, 6))
    autoencoder.normalize_latents(network, maps)
    unseen = autoencoder.collect_maps(preset, "validation", VALIDATION_ROLLOUTS, seed)
    error = {
        "train": asdict(autoencoder.measure_reconstruction(network, maps[: len(unseen)])),
        "validation": asdict(autoencoder.measure_reconstruction(network, unseen)),
    }
    card = {
        "command": f"python -m rl.train autoencoder --seed {options.seed} --preset {options.preset}"
        f" --rollouts {options.rollouts} --epochs {options.epochs}",
        "preset": options.preset,
        "ground": Ground(preset.terrain, preset.criteria).key,
        "maps": len(maps),
        "latent_size": LATENT_SIZE,
        "settings": asdict(settings),
        "training_loss": curve,
        "reconstruction_error": error,
        "versions": library_versions(),
    }
    artefact = save_artefact(options.weights, ENCODER, autoencoder.autoencoder_tensors(network), card)
    Console().print(
        f"wrote {options.weights}.safetensors ({artefact.digest[:12]}); reconstruction error {error}"
    )
