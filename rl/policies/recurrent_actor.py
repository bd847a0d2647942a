"""The agents with memory as policies: memory goes in and comes out; torch is not needed to fly."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hda.flight.outcome import score_step
from hda.policy import Decision
from hda.task.observation import Observation, ScenarioView
from rl.inference.arrays import Array32
from rl.inference.artefacts import Artefact, ArtefactError, load_artefact
from rl.inference.recurrent_network import RecurrentNetwork, RecurrentSizes
from rl.policies.actor_design import ActorDesign, bound_action
from rl.settings import HISTORIES, ON_POLICY_ALGORITHMS


@dataclass(frozen=True, eq=False)
class FlightMemory:
    """What an agent with memory carries from one decision to the next.

    Attributes:
        parts: memory of sight and steering.
        dry_mass: [kg] of the lander.
        hidden: shape (memory,), h of the LSTM.
        cell: shape (memory,), c of the LSTM.
        action: shape (a,), last action; 0 before the first.
        first_mass: [kg] at the first decision; None before it.
        mass: [kg] at the last decision; None before the first.
    """

    parts: tuple[Any, Any]
    dry_mass: float
    hidden: Array32
    cell: Array32
    action: Array32
    first_mass: float | None = None
    mass: float | None = None

    def reward(self, mass: float) -> float:
        """Reward of the interval that led here: in flight it is the propellant burnt alone."""
        if self.mass is None or self.first_mass is None:
            return 0.0
        return score_step((self.mass - mass) / (self.first_mass - self.dry_mass), None).total


@dataclass(frozen=True, eq=False)
class MemoryActor:
    """Observation and memory -> decision and memory.

    Attributes:
        design: what it sees, and what its actions become.
        network: LSTM and dense layers.
    """

    design: ActorDesign
    network: RecurrentNetwork

    def begin(self, view: ScenarioView) -> FlightMemory:
        """Nothing remembered."""
        zero = np.zeros(self.network.memory, np.float32)
        action = np.zeros(self.network.actions, np.float32)
        return FlightMemory(self.design.begin(view), view.lander.dry_mass, zero, zero, action)

    def act(self, observation: Observation, memory: FlightMemory) -> tuple[Array32, FlightMemory]:
        """Action in [-1, 1], shape (a,), and what is remembered; the steering's memory is as it was."""
        design = self.design
        vector, seen = design.sight.see(observation, memory.parts[0])
        mass = observation.state.mass
        beside = {"action": memory.action, "reward": np.array([memory.reward(mass)], np.float32)}
        history = np.concatenate([vector, *(beside[part] for part in self.network.history)])
        inputs, hidden, cell = self.network.evaluate(vector, history, (memory.hidden, memory.cell))
        action = bound_action(inputs, design.algorithm)
        first = mass if memory.first_mass is None else memory.first_mass
        parts = seen, memory.parts[1]
        return action, FlightMemory(parts, memory.dry_mass, hidden, cell, action, first, mass)

    def decide(self, observation: Observation, memory: FlightMemory) -> tuple[Decision, FlightMemory]:
        """Decide, and remember."""
        action, after = self.act(observation, memory)
        seen, steered = after.parts
        decision, steered = self.design.steering.decide(action, observation, steered)
        return decision, replace(after, parts=(seen, steered))


def memory_actor_from_artefact(artefact: Artefact, path: Path) -> MemoryActor:
    """Make an actor with memory from verified weights.

    Raises:
        ArtefactError: they were made for another encoding, another autoencoder, or have other shapes.
    """
    design, memory = ActorDesign.from_card(artefact.card, path), artefact.card.get("memory")
    if not isinstance(memory, int):
        raise ArtefactError(f"{path}: the card's 'memory' must be a whole number, got {memory!r}")
    if design.algorithm not in HISTORIES:
        known = ", ".join(HISTORIES)
        raise ArtefactError(
            f"{path}: the card's 'algorithm' must be one with memory ({known}), got {design.algorithm!r}"
        )
    sizes = RecurrentSizes(
        design.seen,
        memory,
        design.hidden,
        HISTORIES[design.algorithm],
        present=design.algorithm not in ON_POLICY_ALGORITHMS,
        actions=design.steering.size,
    )
    return MemoryActor(design, RecurrentNetwork.from_tensors(artefact.tensors, sizes))


@cache
def load_memory_actor(path: Path) -> MemoryActor:
    """Read, verify and make an actor with memory; once per process.

    Raises:
        ArtefactError: the weights are missing, damaged, changed, or made for another version.
    """
    return memory_actor_from_artefact(load_artefact(path, "actor"), path)


@dataclass(frozen=True)
class RecurrentAgentPolicy:
    """The agent with memory as the paper flies it: it moves the target, the gains and the time to go.

    Attributes:
        name: name in tables.
        weights: file name without suffix; read when the policy first flies.
    """

    name: str
    weights: Path

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> FlightMemory:
        """Read the weights; nothing is remembered yet.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return load_memory_actor(self.weights).begin(scenario_view)

    def decide(self, observation: Observation, memory: FlightMemory) -> tuple[Decision, FlightMemory]:
        """Decide from this observation and what is remembered."""
        return load_memory_actor(self.weights).decide(observation, memory)


@dataclass(frozen=True)
class RecurrentActorPolicy:
    """An actor with memory as a policy, for validation during training.

    Attributes:
        name: name in tables.
        actor: the network.
    """

    name: str
    actor: MemoryActor = field(repr=False)

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> FlightMemory:
        """Nothing is remembered yet."""
        return self.actor.begin(scenario_view)

    def decide(self, observation: Observation, memory: FlightMemory) -> tuple[Decision, FlightMemory]:
        """Decide from this observation and what is remembered."""
        return self.actor.decide(observation, memory)
