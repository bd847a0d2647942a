"""The autoencoder that turns a 64 x 64 safety map into 32 numbers (paper, "Observation Data Interpretation").

Trained apart from the agent, on the maps of rollouts with random actions over training ground. The loss is
the cross entropy of each pixel, which for probabilities has its minimum where the reconstruction equals the
map; pixels that the target can be moved to in one decision weigh more. Turned and mirrored maps are as
likely as the map itself, so each batch is turned and mirrored at random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from hda.flight.episode import fly_legs
from hda.policy import Decision
from hda.task.observation import Observation
from hda.task.presets import Preset
from hda.task.scenario import sample_scenario
from rl.environment.action import decide_action
from rl.inference.arrays import Array32
from rl.inference.artefacts import Tensors
from rl.inference.latent import LATENT_SIZE

PIXELS = 64
CHANNELS = (16, 32, 32)
_SMALL = PIXELS >> len(CHANNELS)

Maps = NDArray[np.uint8]


class Autoencoder(nn.Module):
    """64 x 64 -> 32 -> 64 x 64: stride-2 convolutions and their mirror image. `decode` gives logits."""

    def __init__(self) -> None:
        """Make the layers."""
        super().__init__()
        widths = (1, *CHANNELS)
        pairs = list(pairwise(widths))
        self.convolutions = nn.ModuleList(nn.Conv2d(a, b, 4, 2, 1) for a, b in pairs)
        self.latent = nn.Linear(widths[-1] * _SMALL**2, LATENT_SIZE)
        self.expand = nn.Linear(LATENT_SIZE, widths[-1] * _SMALL**2)
        self.deconvolutions = nn.ModuleList(nn.ConvTranspose2d(b, a, 4, 2, 1) for a, b in reversed(pairs))

    def encode(self, maps: torch.Tensor) -> torch.Tensor:
        """Maps (n, 1, 64, 64) -> latents (n, 32)."""
        for layer in self.convolutions:
            maps = torch.relu(layer(maps))
        return self.latent(maps.flatten(1))

    def decode(self, latents: torch.Tensor) -> torch.Tensor:
        """Latents (n, 32) -> logits of the maps (n, 1, 64, 64)."""
        maps = torch.relu(self.expand(latents)).unflatten(1, (CHANNELS[-1], _SMALL, _SMALL))
        for layer in self.deconvolutions[:-1]:
            maps = torch.relu(layer(maps))
        return self.deconvolutions[-1](maps)


@dataclass(frozen=True)
class AutoencoderSettings:
    """How the autoencoder is trained.

    Attributes:
        batch_size: maps per update.
        learning_rate: of Adam, falling to zero along a half cosine.
        epochs: passes over the maps.
        center_weight: weight of a pixel at the centre over that of one at the edge, Gaussian between.
        center_width: share of the look's width that is one standard deviation of that weight.
    """

    batch_size: int = 128
    learning_rate: float = 2e-3
    epochs: int = 12
    center_weight: float = 4.0
    center_width: float = 0.2


def decide_at_random(
    observation: Observation, rng: np.random.Generator
) -> tuple[Decision, np.random.Generator]:
    """A uniform random action, drawn from the stream that is the memory."""
    return decide_action(rng.uniform(-1.0, 1.0, 5), observation), rng


def collect_maps(
    preset: Preset, split: str, rollouts: int, seed: int, on_progress: Callable[[int], None] | None = None
) -> Maps:
    """Fly random actions and keep every look.

    Args:
        preset: the setting.
        split: tile split.
        rollouts: number of episodes.
        seed: study seed of the episodes, and of the actions.
        on_progress: called with 1 after each rollout.

    Returns:
        Shape (looks, 64, 64), the observed safety times 255.
    """
    rng = np.random.default_rng(seed)
    maps = []
    for episode in range(rollouts):
        scenario = sample_scenario(preset, seed, episode, split)
        for leg in fly_legs(scenario, decide_at_random, rng):
            maps.append(np.round(leg.observation.safety_map * 255.0).astype(np.uint8))
        if on_progress is not None:
            on_progress(1)
    return np.stack(maps)


def pixel_weights(settings: AutoencoderSettings) -> torch.Tensor:
    """Weight of each pixel in the loss, shape (64, 64), mean 1."""
    offset = (torch.arange(PIXELS) + 0.5) / PIXELS - 0.5
    square = offset[:, None] ** 2 + offset[None, :] ** 2
    weight = 1.0 + (settings.center_weight - 1.0) * torch.exp(-0.5 * square / settings.center_width**2)
    return weight / weight.mean()


def turned(maps: torch.Tensor, symmetry: int) -> torch.Tensor:
    """One of the eight turns and mirror images of square maps."""
    maps = torch.rot90(maps, symmetry % 4, (2, 3))
    return maps.flip(3) if symmetry >= 4 else maps


def train_autoencoder(
    maps: Maps, settings: AutoencoderSettings, seed: int
) -> Iterator[tuple[int, float, Autoencoder]]:
    """Train; give (epoch, mean loss, network) after each epoch. The network is one object throughout."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = Autoencoder().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer = torch.optim.Adam(network.parameters(), lr=settings.learning_rate, fused=True)
    batches = len(maps) // settings.batch_size
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs * batches)
    weights = pixel_weights(settings)
    for epoch in range(settings.epochs):
        order = rng.permutation(len(maps))
        total = 0.0
        for k in range(batches):
            chosen = maps[order[k * settings.batch_size : (k + 1) * settings.batch_size]]
            truth = turned(torch.from_numpy(chosen)[:, None].float() / 255.0, int(rng.integers(8)))
            with torch.autocast("cpu", torch.bfloat16):
                logits = network.decode(network.encode(truth.contiguous(memory_format=torch.channels_last)))
            loss = nn.functional.binary_cross_entropy_with_logits(logits.float(), truth, weights)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            total += float(loss.detach())
        yield epoch, total / batches, network


@dataclass(frozen=True)
class ReconstructionError:
    """How well maps survive the autoencoder.

    Attributes:
        mean_square: mean squared error of a pixel.
        variance_left: squared error over the variance of the pixels: 0 is perfect, 1 knows only the mean.
        center_mean_square: the same as `mean_square` over the middle quarter, where a target can move at
            once.
    """

    mean_square: float
    variance_left: float
    center_mean_square: float


@torch.no_grad()
def reconstruct(network: Autoencoder, maps: Maps) -> Array32:
    """Reconstructions of the maps, shape (n, 64, 64) in [0, 1]."""
    parts = []
    for first in range(0, len(maps), 512):
        batch = torch.from_numpy(maps[first : first + 512])[:, None].float() / 255.0
        parts.append(torch.sigmoid(network.decode(network.encode(batch)))[:, 0].numpy())
    return np.concatenate(parts)


def measure_reconstruction(network: Autoencoder, maps: Maps) -> ReconstructionError:
    """Measure the loss on maps that were not trained on."""
    truth = maps.astype(np.float32) / 255.0
    square = (reconstruct(network, maps) - truth) ** 2
    quarter = slice(PIXELS // 4, 3 * PIXELS // 4)
    return ReconstructionError(
        float(square.mean()),
        float(square.mean() / truth.var()),
        float(square[:, quarter, quarter].mean()),
    )


@torch.no_grad()
def normalize_latents(network: Autoencoder, maps: Maps) -> None:
    """Scale the latents to mean 0 and deviation 1 over `maps`, in the weights; the decoder's output stays."""
    batches = [torch.from_numpy(maps[k : k + 512])[:, None].float() / 255.0 for k in range(0, len(maps), 512)]
    latents = torch.cat([network.encode(batch) for batch in batches])
    mean, deviation = latents.mean(0), latents.std(0).clamp_min(1e-6)
    network.expand.bias.add_(network.expand.weight @ mean)
    network.expand.weight.mul_(deviation)
    network.latent.bias.sub_(mean).div_(deviation)
    network.latent.weight.div_(deviation[:, None])


def autoencoder_tensors(network: Autoencoder) -> Tensors:
    """Weights as stored: the encoder in the order that `MapEncoder` reads, the decoder as torch names it."""
    tensors: Tensors = {}
    for k, layer in enumerate(network.convolutions):
        tensors[f"convolution.{k}.weight"] = layer.weight.detach().permute(2, 3, 1, 0).contiguous().numpy()  # type: ignore[union-attr]
        tensors[f"convolution.{k}.bias"] = layer.bias.detach().numpy()  # type: ignore[union-attr]
    wide = network.latent.weight.detach().unflatten(1, (CHANNELS[-1], _SMALL, _SMALL))
    tensors["latent.weight"] = wide.permute(2, 3, 1, 0).flatten(0, 2).contiguous().numpy()
    tensors["latent.bias"] = network.latent.bias.detach().numpy()
    for name, value in network.state_dict().items():
        if name.startswith(("expand", "deconvolutions")):
            tensors[f"decoder.{name}"] = value.detach().contiguous().numpy()
    return tensors


def autoencoder_from_tensors(tensors: Tensors) -> Autoencoder:
    """Undo `autoencoder_tensors`."""
    network = Autoencoder()
    state = {
        name.removeprefix("decoder."): torch.tensor(v) for name, v in tensors.items() if "decoder." in name
    }
    for k in range(len(CHANNELS)):
        weight = torch.tensor(tensors[f"convolution.{k}.weight"])
        state[f"convolutions.{k}.weight"] = weight.permute(3, 2, 0, 1).contiguous()
        state[f"convolutions.{k}.bias"] = torch.tensor(tensors[f"convolution.{k}.bias"])
    wide = torch.tensor(tensors["latent.weight"]).unflatten(0, (_SMALL, _SMALL, CHANNELS[-1]))
    state["latent.weight"] = wide.permute(3, 2, 0, 1).flatten(1).contiguous()
    state["latent.bias"] = torch.tensor(tensors["latent.bias"])
    network.load_state_dict(state)
    return network
