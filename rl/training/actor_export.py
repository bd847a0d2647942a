"""From a torch actor to the arrays that are shipped, and back into a policy."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rl.environment.encoding import ENCODING_VERSION
from rl.inference.artefacts import Artefact, Tensors
from rl.inference.latent import encoder_path, load_autoencoder
from rl.policies.actor import ActorPolicy, actor_from_artefact
from rl.policies.recurrent_actor import RecurrentActorPolicy, memory_actor_from_artefact
from rl.settings import WITH_MEMORY, RecurrentOnPolicySettings, RecurrentSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
    from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
    from torch import Tensor, nn

    from rl.learning.recurrent.td3_lstm import RecurrentTD3
    from rl.settings import AgentSettings


def actor_tensors(algorithm: OffPolicyAlgorithm | OnPolicyAlgorithm | RecurrentTD3) -> Tensors:
    """Dense layers of the actor, in order; for a stochastic actor those of its mean; and its LSTM."""
    policy: Any = getattr(algorithm, "policy", None)
    if hasattr(policy, "action_net"):
        memory = _lstm_tensors(policy.lstm_actor) if hasattr(policy, "lstm_actor") else {}
        return {**memory, **_dense_tensors([policy.mlp_extractor.policy_net, policy.action_net])}
    actor: Any = algorithm.actor  # type: ignore[union-attr]
    if hasattr(actor, "history"):
        present = {"present.weight": _numbers(actor.present.weight.T)}
        present["present.bias"] = _numbers(actor.present.bias)
        return {**_lstm_tensors(actor.history), **present, **_dense_tensors([actor.head])}
    return _dense_tensors([actor.latent_pi, actor.mu] if hasattr(actor, "latent_pi") else [actor.mu])


def _dense_tensors(parts: Iterable[nn.Module]) -> Tensors:
    from torch import nn

    layers = [layer for part in parts for layer in part.modules() if isinstance(layer, nn.Linear)]
    tensors: Tensors = {}
    for k, layer in enumerate(layers):
        tensors[f"layer.{k}.weight"], tensors[f"layer.{k}.bias"] = map(_numbers, (layer.weight.T, layer.bias))
    return tensors


def _lstm_tensors(lstm: nn.LSTM) -> Tensors:
    weights = dict(lstm.named_parameters())
    return {
        "lstm.input": _numbers(weights["weight_ih_l0"].T),
        "lstm.recurrent": _numbers(weights["weight_hh_l0"].T),
        "lstm.bias": _numbers(weights["bias_ih_l0"] + weights["bias_hh_l0"]),
    }


def _numbers(values: Tensor) -> NDArray[Any]:
    return values.detach().cpu().contiguous().numpy().copy()


def actor_card(settings: AgentSettings) -> dict[str, Any]:
    """What a card must say for its weights to be used."""
    recurrent = isinstance(settings, RecurrentSettings | RecurrentOnPolicySettings)
    memory = {"memory": settings.memory} if recurrent else {}
    return {
        **memory,
        "algorithm": settings.algorithm,
        "layout": settings.layout,
        "hidden": list(settings.hidden),
        "encoding_version": ENCODING_VERSION,
        "autoencoder": load_autoencoder(encoder_path(settings.encoder)).digest,
        "action_ranges": asdict(settings.action_ranges),
        "sight": settings.sight,
        "guidance": settings.guidance,
    }


def policy_of(
    tensors: Tensors, settings: AgentSettings, name: str = "training"
) -> ActorPolicy | RecurrentActorPolicy:
    """The policy that these weights would be when shipped."""
    artefact = Artefact("actor", tensors, actor_card(settings))
    if settings.algorithm in WITH_MEMORY:
        return RecurrentActorPolicy(name, memory_actor_from_artefact(artefact, Path(name)))
    return ActorPolicy(name, actor_from_artefact(artefact, Path(name)))
