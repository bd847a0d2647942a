"""From a torch actor to the arrays that are shipped, and back into a policy."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rl.environment.encoding import ENCODING_VERSION, LAYOUTS
from rl.inference.artefacts import Tensors
from rl.inference.latent import LATENT_SIZE, encoder_path, load_autoencoder, load_encoder
from rl.inference.networks import Perceptron
from rl.inference.recurrent_network import RecurrentNetwork
from rl.policies.actor import Actor, ActorPolicy
from rl.policies.recurrent_actor import MemoryActor, RecurrentActorPolicy
from rl.settings import RecurrentSettings

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

    from rl.learning.recurrent.networks import RecurrentActor
    from rl.learning.recurrent.td3_lstm import RecurrentTD3
    from rl.settings import AgentSettings


def actor_tensors(algorithm: OffPolicyAlgorithm | RecurrentTD3) -> Tensors:
    """Dense layers of the actor, in order; for a stochastic actor those of its mean; and its LSTM."""
    from torch import nn

    actor: Any = algorithm.actor  # type: ignore[attr-defined]
    if hasattr(actor, "history"):
        return _recurrent_tensors(actor)
    parts = [actor.latent_pi, actor.mu] if hasattr(actor, "latent_pi") else [actor.mu]
    layers = [layer for part in parts for layer in part.modules() if isinstance(layer, nn.Linear)]
    tensors: Tensors = {}
    for k, layer in enumerate(layers):
        tensors[f"layer.{k}.weight"] = layer.weight.detach().T.contiguous().numpy().copy()
        tensors[f"layer.{k}.bias"] = layer.bias.detach().numpy().copy()
    return tensors


def _recurrent_tensors(actor: RecurrentActor) -> Tensors:
    from torch import nn

    history = dict(actor.history.named_parameters())
    parts = {"lstm.input": history["weight_ih_l0"].T, "lstm.recurrent": history["weight_hh_l0"].T}
    parts["lstm.bias"] = history["bias_ih_l0"] + history["bias_hh_l0"]
    parts["present.weight"], parts["present.bias"] = actor.present.weight.T, actor.present.bias
    for k, layer in enumerate(layer for layer in actor.head if isinstance(layer, nn.Linear)):
        parts[f"layer.{k}.weight"], parts[f"layer.{k}.bias"] = layer.weight.T, layer.bias
    return {name: value.detach().contiguous().numpy().copy() for name, value in parts.items()}


def actor_card(settings: AgentSettings) -> dict[str, Any]:
    """What a card must say for its weights to be used."""
    memory = {"memory": settings.memory} if isinstance(settings, RecurrentSettings) else {}
    return {
        **memory,
        "algorithm": settings.algorithm,
        "layout": settings.layout,
        "hidden": list(settings.hidden),
        "encoding_version": ENCODING_VERSION,
        "autoencoder": load_autoencoder(encoder_path(settings.encoder)).digest,
        "action_ranges": asdict(settings.action_ranges),
    }


def policy_of(
    tensors: Tensors, settings: AgentSettings, name: str = "training"
) -> ActorPolicy | RecurrentActorPolicy:
    """The policy that these weights would be when shipped."""
    layout, encoder = LAYOUTS[settings.layout], load_encoder(encoder_path(settings.encoder))
    if isinstance(settings, RecurrentSettings):
        reward = settings.algorithm == "td3-lstm-plus"
        network = RecurrentNetwork.from_tensors(
            tensors, len(layout.elements) + LATENT_SIZE, settings.memory, settings.hidden, reward
        )
        return RecurrentActorPolicy(name, MemoryActor(layout, encoder, network, settings.action_ranges))
    sizes = (len(layout.elements) + LATENT_SIZE, *settings.hidden, 5)
    network = Perceptron.from_tensors(tensors, sizes)
    return ActorPolicy(name, Actor(layout, encoder, network, settings.action_ranges))
