"""Policies by their actions: shipped agents that move gains, clock and target, and uniform draws.

Rules and planners have sites and plans, which are no actions of `LunarHDA-v0`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from hda.task.observation import Observation, ScenarioView
from rl.environment.action import ACTION_NAMES, PAPER_ACTIONS
from rl.inference.arrays import Array32
from rl.inference.artefacts import load_artefact, read_card
from rl.policies.actor import load_actor, shipped
from rl.policies.catalogue import entries
from rl.policies.recurrent_actor import load_memory_actor
from rl.settings import WITH_MEMORY

RANDOM = "random"


class Behaviour(Protocol):
    """Observation and memory -> action and memory."""

    @property
    def name(self) -> str:
        """Name in the dataset's card."""
        ...

    def begin(self, view: ScenarioView, rng: np.random.Generator) -> Any:
        """Memory before the first look."""
        ...

    def act(self, observation: Observation, memory: Any) -> tuple[Array32, Any]:
        """Action in [-1, 1], shape (5,), and the memory for the next."""
        ...


@dataclass(frozen=True)
class UniformActions:
    """Each number of an action drawn on its own, uniform in [-1, 1]; its memory is the generator."""

    name: str = field(default=RANDOM, init=False)

    def begin(self, view: ScenarioView, rng: np.random.Generator) -> np.random.Generator:
        """Draw from the episode's own stream."""
        return rng

    def act(
        self, observation: Observation, memory: np.random.Generator
    ) -> tuple[Array32, np.random.Generator]:
        """The next draw."""
        return memory.uniform(-1.0, 1.0, len(ACTION_NAMES)).astype(np.float32), memory


@dataclass(frozen=True)
class AgentActions:
    """A shipped agent.

    Attributes:
        name: of its weights.
        remembers: whether its network does.
    """

    name: str
    remembers: bool

    @property
    def actor(self) -> Any:
        """Its network with sight and steering; read once per process.

        Raises:
            ArtefactError: the weights are missing, damaged or foreign.
        """
        return (load_memory_actor if self.remembers else load_actor)(shipped(self.name))

    def begin(self, view: ScenarioView, rng: np.random.Generator) -> Any:
        """Memory of network and sight."""
        return self.actor.begin(view)

    def act(self, observation: Observation, memory: Any) -> tuple[Array32, Any]:
        """The action of its network."""
        return self.actor.act(observation, memory)


def behaviour_names() -> tuple[str, ...]:
    """Those that there are: uniform draws, and the agents whose actions are those of `LunarHDA-v0`."""
    cards = {
        entry.name: read_card(path, "actor")
        for entry in entries()
        if (path := shipped(entry.name).with_suffix(".json")).exists()
    }
    return RANDOM, *(name for name, card in cards.items() if card.get("guidance", "zem-zev") == "zem-zev")


def find_behaviour(name: str) -> Behaviour:
    """One by name.

    Raises:
        ValueError: there is none of that name, or its actions mean another thing.
    """
    if name == RANDOM:
        return UniformActions()
    if name not in (known := behaviour_names()):
        raise ValueError(
            f"policies must be among {', '.join(known)}, got {name!r}: no other has actions of LunarHDA-v0"
        )
    card = read_card(shipped(name).with_suffix(".json"), "actor")
    agent = AgentActions(name, card["algorithm"] in WITH_MEMORY)
    if agent.actor.design.ranges != PAPER_ACTIONS:
        raise ValueError(f"policies must have the action ranges of LunarHDA-v0, {name!r} has others")
    return agent


def weights_digest(name: str) -> str | None:
    """SHA-256 over an agent's weights; None for draws."""
    return None if name == RANDOM else load_artefact(shipped(name), "actor").digest
