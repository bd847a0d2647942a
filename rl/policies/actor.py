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
from rl.environment.action import PAPER_ACTIONS, ActionRanges, decide_action
from rl.environment.encoding import ENCODING_VERSION, LAYOUTS, Layout, encode_observation
from rl.inference.arrays import Array32
from rl.inference.artefacts import WEIGHTS_FOLDER, Artefact, ArtefactError, load_artefact, require
from rl.inference.latent import LATENT_SIZE, encoder_of_card, load_encoder
from rl.inference.networks import MapEncoder, Perceptron
from rl.settings import ON_POLICY_ALGORITHMS


def bound_action(inputs: Array32, algorithm: str) -> Array32:
    """The action in [-1, 1] that an actor's last layer means: of proximal policies the mean, else its tanh.

    Args:
        inputs: shape (a,), of the last layer.
        algorithm: that it was trained by.
    """
    return np.clip(inputs, -1.0, 1.0) if algorithm in ON_POLICY_ALGORITHMS else np.tanh(inputs)


@dataclass(frozen=True, eq=False)
class Actor:
    """Observation -> action: the deterministic part of an agent without memory.

    Attributes:
        layout: observation vector that it was trained on.
        encoder: makes the latent of a map.
        network: its dense layers.
        ranges: what its actions mean.
        algorithm: that it was trained by, which says how its actions are bounded.
    """

    layout: Layout
    encoder: MapEncoder
    network: Perceptron
    ranges: ActionRanges = PAPER_ACTIONS
    algorithm: str = "td3"

    def act(self, observation: Observation, nominal_target: Array) -> Array32:
        """Action of shape (5,) in [-1, 1]."""
        latent = self.encoder.encode(observation.safety_map)
        vector = encode_observation(self.layout, observation, nominal_target, latent)
        return bound_action(self.network.evaluate(vector), self.algorithm)

    def decide(self, observation: Observation, nominal_target: Array) -> Decision:
        """Decision of the action."""
        return decide_action(self.act(observation, nominal_target), observation, self.ranges)


def read_actor_card(card: dict[str, Any], path: Path) -> tuple[Layout, tuple[int, ...], ActionRanges]:
    """Layout, sizes of the hidden layers and action ranges of an actor's card.

    Raises:
        ArtefactError: it was made for another encoding, or a field is wrong.
    """
    require(card, "encoding_version", ENCODING_VERSION, path)
    if not isinstance(card.get("layout"), str) or card["layout"] not in LAYOUTS:
        raise ArtefactError(f"{path}: unknown layout {card.get('layout')!r}")
    try:
        hidden = tuple(int(size) for size in card["hidden"])
        ranges = action_ranges_from_card(card["action_ranges"])
    except (KeyError, TypeError, ValueError) as error:
        raise ArtefactError(f"{path}: the card's 'hidden' or 'action_ranges' is wrong: {error}") from error
    return LAYOUTS[card["layout"]], hidden, ranges


def actor_from_artefact(artefact: Artefact, path: Path) -> Actor:
    """Make an actor from verified weights.

    Raises:
        ArtefactError: they were made for another encoding, another autoencoder, or have other shapes.
    """
    layout, hidden, ranges = read_actor_card(artefact.card, path)
    encoder = load_encoder(encoder_of_card(artefact.card, path))
    sizes = (len(layout.elements) + LATENT_SIZE, *hidden, 5)
    network = Perceptron.from_tensors(artefact.tensors, sizes)
    return Actor(layout, encoder, network, ranges, str(artefact.card.get("algorithm")))


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
    """The agent as the paper flies it: it moves the target, the gains and the time to go.

    Attributes:
        name: name in tables.
        weights: file name without suffix; read when the policy first flies.
    """

    name: str
    weights: Path

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> Array:
        """Read the weights, remember the first target.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        load_actor(self.weights)
        return scenario_view.nominal_target

    def decide(self, observation: Observation, memory: Array) -> tuple[Decision, Array]:
        """Decide from this observation alone."""
        return load_actor(self.weights).decide(observation, memory), memory


@dataclass(frozen=True)
class ActorPolicy:
    """An actor in memory as a policy, for validation during training.

    Attributes:
        name: name in tables.
        actor: the network.
    """

    name: str
    actor: Actor = field(repr=False)

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> Array:
        """Remember the first target."""
        return scenario_view.nominal_target

    def decide(self, observation: Observation, memory: Array) -> tuple[Decision, Array]:
        """Decide from this observation alone."""
        return self.actor.decide(observation, memory), memory


@dataclass(frozen=True)
class AgentSite:
    """The agent as a site selection: only where it moves the target counts, its gains are ignored.

    With `FixedGainZemZev` this is the paper's Fixed Control.

    Attributes:
        weights: file name without suffix; read when the policy first flies.
    """

    weights: Path

    def begin(self, view: ScenarioView) -> Array:
        """Read the weights, remember the first target.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        load_actor(self.weights)
        return view.nominal_target

    def select(self, observation: Observation, memory: Array) -> tuple[Array, Array]:
        """Site of the agent's decision."""
        return load_actor(self.weights).decide(observation, memory).site, memory


def weights_name(agent: str, preset: str) -> str:
    """Name of shipped weights; those that were trained on `paper` go by the agent's own."""
    return agent if preset == "paper" else f"{agent}-{preset}"


def shipped(name: str) -> Path:
    """Path of shipped weights, without suffix."""
    return WEIGHTS_FOLDER / name
