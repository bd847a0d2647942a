"""From a torch actor to the arrays that are shipped, and back into a policy."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from torch import nn

from rl.artefacts import Tensors
from rl.encoding import ENCODING_VERSION, LATENT_SIZE, LAYOUTS
from rl.latent import load_autoencoder, load_encoder
from rl.networks import Perceptron
from rl.policy import Actor, ActorPolicy

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

    from rl.algorithms import AgentSettings


def actor_tensors(algorithm: OffPolicyAlgorithm) -> Tensors:
    """Dense layers of the actor, in order; for a stochastic actor those of its mean."""
    actor: Any = algorithm.actor  # type: ignore[attr-defined]
    parts = [actor.latent_pi, actor.mu] if hasattr(actor, "latent_pi") else [actor.mu]
    layers = [layer for part in parts for layer in part.modules() if isinstance(layer, nn.Linear)]
    tensors: Tensors = {}
    for k, layer in enumerate(layers):
        tensors[f"layer.{k}.weight"] = layer.weight.detach().T.contiguous().numpy().copy()
        tensors[f"layer.{k}.bias"] = layer.bias.detach().numpy().copy()
    return tensors


def actor_card(settings: AgentSettings) -> dict[str, Any]:
    """What a card must say for its weights to be used."""
    return {
        "algorithm": settings.algorithm,
        "layout": settings.layout,
        "hidden": list(settings.hidden),
        "encoding_version": ENCODING_VERSION,
        "autoencoder": load_autoencoder().digest,
        "action_ranges": asdict(settings.action_ranges),
    }


def policy_of(tensors: Tensors, settings: AgentSettings, name: str = "training") -> ActorPolicy:
    """The policy that these weights would be when shipped."""
    layout = LAYOUTS[settings.layout]
    sizes = (len(layout.elements) + LATENT_SIZE, *settings.hidden, 5)
    network = Perceptron.from_tensors(tensors, sizes)
    return ActorPolicy(name, Actor(layout, load_encoder(), network, settings.action_ranges))
