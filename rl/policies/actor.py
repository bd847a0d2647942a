"""The trained agents as policies: an encoder and a small network; torch is not needed to fly."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from guidance.arrays import Array
from hda.policy import Decision
from hda.task.observation import Observation, ScenarioView
from rl.inference.arrays import Array32
from rl.inference.artefacts import WEIGHTS_FOLDER, Artefact, load_artefact
from rl.inference.networks import Perceptron
from rl.policies.actor_design import THRUST, ActorDesign, bound_action
from rl.policies.thrust_actor import ThrustActor, thrust_actor_from_tensors


@dataclass(frozen=True, eq=False)
class Actor:
    """Observation -> decision: the deterministic part of an agent whose network remembers nothing.

    What sight and steering remember, such as a belief or a plan, goes in and comes out.

    Attributes:
        design: what it sees, and what its actions become.
        network: its dense layers.
    """

    design: ActorDesign
    network: Perceptron

    def begin(self, view: ScenarioView) -> tuple[Any, Any]:
        """Memory before the first look."""
        return self.design.begin(view)

    def act(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Array32, tuple[Any, Any]]:
        """Action in [-1, 1], shape (a,), and the memory after the look; the steering's is as it was."""
        vector, seen = self.design.sight.see(observation, memory[0])
        return bound_action(self.network.evaluate(vector), self.design.algorithm), (seen, memory[1])

    def decide(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Decision, tuple[Any, Any]]:
        """Decision of the action, and the memory for the next."""
        action, (seen, steered) = self.act(observation, memory)
        decision, steered = self.design.steering.decide(action, observation, steered)
        return decision, (seen, steered)


def actor_from_artefact(artefact: Artefact, path: Path) -> Actor | ThrustActor:
    """Make an actor from verified weights.

    Raises:
        ArtefactError: they were made for another encoding, another autoencoder, or have other shapes.
    """
    design = ActorDesign.from_card(artefact.card, path)
    if design.guidance == THRUST:
        return thrust_actor_from_tensors(artefact.tensors, design)
    sizes = (design.seen, *design.hidden, design.steering.size)
    return Actor(design, Perceptron.from_tensors(artefact.tensors, sizes))


@cache
def load_actor(path: Path) -> Actor | ThrustActor:
    """Read, verify and make an actor; once per process.

    Raises:
        ArtefactError: the weights are missing, damaged, changed, or made for another version.
    """
    return actor_from_artefact(load_artefact(path, "actor"), path)


@dataclass(frozen=True)
class AgentPolicy:
    """An agent without memory in its network, as it was trained to fly.

    Attributes:
        name: name in tables.
        weights: file name without suffix; read when the policy first flies.
    """

    name: str
    weights: Path

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> Any:
        """Read the weights; memory of sight and steering.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return load_actor(self.weights).begin(scenario_view)

    def decide(self, observation: Observation, memory: Any) -> tuple[Decision, Any]:
        """Decide from this observation, and what sight and steering remember."""
        return load_actor(self.weights).decide(observation, memory)


@dataclass(frozen=True)
class ActorPolicy:
    """An actor in memory as a policy, for validation during training.

    Attributes:
        name: name in tables.
        actor: the network.
    """

    name: str
    actor: Actor | ThrustActor = field(repr=False)

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> Any:
        """Memory of sight and steering."""
        return self.actor.begin(scenario_view)

    def decide(self, observation: Observation, memory: Any) -> tuple[Decision, Any]:
        """Decide from this observation, and what sight and steering remember."""
        return self.actor.decide(observation, memory)


@dataclass(frozen=True)
class AgentSite:
    """The agent as a site selection: only where it moves the target counts, its gains are ignored.

    With `FixedGainZemZev` this is the paper's Fixed Control.

    Attributes:
        weights: file name without suffix; read when the policy first flies.
    """

    weights: Path

    def begin(self, view: ScenarioView) -> Any:
        """Read the weights; memory of sight and steering.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return load_actor(self.weights).begin(view)

    def select(self, observation: Observation, memory: Any) -> tuple[Array, Any]:
        """Site of the agent's decision."""
        decision, memory = load_actor(self.weights).decide(observation, memory)
        return decision.site, memory


def weights_name(agent: str, preset: str) -> str:
    """Name of shipped weights; those that were trained on `paper` go by the agent's own."""
    return agent if preset == "paper" else f"{agent}-{preset}"


def shipped(name: str) -> Path:
    """Path of shipped weights, without suffix."""
    return WEIGHTS_FOLDER / name
