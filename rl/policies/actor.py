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
from hda.task.rules import Range
from rl.environment.action import ActionRanges
from rl.environment.encoding import ENCODING_VERSION, LAYOUTS
from rl.environment.sight import Sight, make_sight
from rl.environment.steering import Steering, make_steering
from rl.inference.arrays import Array32
from rl.inference.artefacts import WEIGHTS_FOLDER, Artefact, ArtefactError, load_artefact, require
from rl.inference.latent import encoder_of_card, load_encoder
from rl.inference.networks import Perceptron
from rl.settings import ON_POLICY_ALGORITHMS


def bound_action(inputs: Array32, algorithm: str) -> Array32:
    """The action in [-1, 1] that an actor's last layer means: of proximal policies the mean, else its tanh.

    Args:
        inputs: shape (a,), of the last layer.
        algorithm: that it was trained by.
    """
    return np.clip(inputs, -1.0, 1.0) if algorithm in ON_POLICY_ALGORITHMS else np.tanh(inputs)


@dataclass(frozen=True)
class ActorDesign:
    """What an actor's card says of it, but its weights.

    Attributes:
        sight: what it sees.
        steering: what its actions become.
        hidden: sizes of its hidden layers.
        algorithm: that it was trained by, which says how its actions are bounded.
    """

    sight: Sight
    steering: Steering
    hidden: tuple[int, ...]
    algorithm: str

    @classmethod
    def from_card(cls, card: dict[str, Any], path: Path) -> ActorDesign:
        """Read it; `path` is named in messages.

        Raises:
            ArtefactError: it was made for another encoding or another autoencoder, or a field is wrong.
        """
        require(card, "encoding_version", ENCODING_VERSION, path)
        if not isinstance(card.get("layout"), str) or card["layout"] not in LAYOUTS:
            raise ArtefactError(f"{path}: unknown layout {card.get('layout')!r}")
        encoder = load_encoder(encoder_of_card(card, path))
        try:
            hidden = tuple(int(size) for size in card["hidden"])
            ranges = action_ranges_from_card(card["action_ranges"])
            sight = make_sight(card.get("sight", "look"), LAYOUTS[card["layout"]], encoder)
            steering = make_steering(card.get("guidance", "zem-zev"), ranges)
        except (KeyError, TypeError, ValueError) as error:
            fields = "'hidden', 'action_ranges', 'sight' or 'guidance'"
            raise ArtefactError(f"{path}: the card's {fields} is wrong: {error}") from error
        return cls(sight, steering, hidden, str(card.get("algorithm")))

    @property
    def seen(self) -> int:
        """Numbers in what it sees."""
        return self.sight.bounds[0].size

    def begin(self, view: ScenarioView) -> tuple[Any, Any]:
        """Memory of sight and steering before the first look."""
        return self.sight.begin(view), self.steering.begin(view)


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

    def decide(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Decision, tuple[Any, Any]]:
        """Decision of the action, and the memory for the next."""
        vector, seen = self.design.sight.see(observation, memory[0])
        action = bound_action(self.network.evaluate(vector), self.design.algorithm)
        decision, steered = self.design.steering.decide(action, observation, memory[1])
        return decision, (seen, steered)


def actor_from_artefact(artefact: Artefact, path: Path) -> Actor:
    """Make an actor from verified weights.

    Raises:
        ArtefactError: they were made for another encoding, another autoencoder, or have other shapes.
    """
    design = ActorDesign.from_card(artefact.card, path)
    sizes = (design.seen, *design.hidden, design.steering.size)
    return Actor(design, Perceptron.from_tensors(artefact.tensors, sizes))


def action_ranges_from_card(card: dict[str, object]) -> ActionRanges:
    """Undo `dataclasses.asdict` on ActionRanges."""
    values = {name: Range(**value) if isinstance(value, dict) else value for name, value in card.items()}
    return ActionRanges(**values)  # type: ignore[arg-type]


@cache
def load_actor(path: Path) -> Actor:
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

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> tuple[Any, Any]:
        """Read the weights; memory of sight and steering.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return load_actor(self.weights).begin(scenario_view)

    def decide(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Decision, tuple[Any, Any]]:
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
    actor: Actor = field(repr=False)

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> tuple[Any, Any]:
        """Memory of sight and steering."""
        return self.actor.begin(scenario_view)

    def decide(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Decision, tuple[Any, Any]]:
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

    def begin(self, view: ScenarioView) -> tuple[Any, Any]:
        """Read the weights; memory of sight and steering.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return load_actor(self.weights).begin(view)

    def select(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Array, tuple[Any, Any]]:
        """Site of the agent's decision."""
        decision, memory = load_actor(self.weights).decide(observation, memory)
        return decision.site, memory


def weights_name(agent: str, preset: str) -> str:
    """Name of shipped weights; those that were trained on `paper` go by the agent's own."""
    return agent if preset == "paper" else f"{agent}-{preset}"


def shipped(name: str) -> Path:
    """Path of shipped weights, without suffix."""
    return WEIGHTS_FOLDER / name
