"""One flight of the study: the policy, the episode, and what is kept of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hda.flight.episode import fly
from hda.policies.entry import AnyPolicy
from hda.registry import make_policy
from hda.task.scenario import Scenario
from rl.inference.artefacts import load_artefact
from rl.policies.actor import AgentPolicy
from rl.policies.recurrent_actor import RecurrentAgentPolicy
from rl.settings import WITH_MEMORY
from studies.failures.causes import SAFE_READING
from studies.shortfall.encoded_sight import (
    Decoder,
    Loss,
    NearSight,
    SeenHazards,
    SeenIslands,
    SiteSight,
    count_hazards,
    count_islands,
    explain_loss,
    measure_depth,
    measure_near,
    trace_site,
)
from studies.shortfall.propellant_parts import PropellantParts, part_propellant


@dataclass(frozen=True)
class FlownEpisode:
    """What is kept of one flight.

    Attributes:
        tile: number of the tile.
        loss: what was seen of the ground that it failed on, or that it did not fail.
        depth: [m] from the cell of the touchdown to the nearest safe one; 0 on safe ground.
        sights: of the last site, of a failure.
        near: safe ground in each look within a shift of the target.
        hazards: in its looks.
        islands: of safe ground in its looks.
        parts: of its propellant.
    """

    tile: int
    loss: Loss
    depth: float
    sights: tuple[SiteSight, ...]
    near: tuple[NearSight, ...]
    hazards: tuple[SeenHazards, ...]
    islands: tuple[SeenIslands, ...]
    parts: PropellantParts

    @property
    def warned(self) -> float:
        """[s] from the first look whose encoding showed the last site as a hazard to the end; nan without."""
        shown = [sight.time for sight in self.sights if sight.encoded < SAFE_READING]
        return self.parts.time - shown[0] if shown else math.nan


def open_policy(name: str) -> AnyPolicy:
    """A policy by its name or by the card of its weights.

    Raises:
        ValueError: the name is unknown.
        ArtefactError: the weights are missing or damaged.
    """
    import rl  # noqa: F401 - registers the agents

    if not name.endswith(".json"):
        return make_policy(name)
    weights = Path(name).with_suffix("")
    remembers = load_artefact(weights, "actor").card.get("algorithm") in WITH_MEMORY
    return (RecurrentAgentPolicy if remembers else AgentPolicy)(weights.name, weights)


def fly_episode(policy: AnyPolicy, scenario: Scenario, decode: Decoder) -> FlownEpisode:
    """Fly an episode, and the ones that part its propellant."""
    record = fly(policy, scenario)
    decoded = decode(np.stack([observation.safety_map for observation in record.observations]))
    depth = measure_depth(scenario.tile.deterministic, scenario.view.nominal_target)
    outcome = record.outcome
    near = tuple(measure_near(record, decoded))
    row, column = (np.floor(outcome.touchdown[axis : axis + 1]).astype(int) for axis in (1, 0))
    return FlownEpisode(
        tile=scenario.tile.number,
        loss=explain_loss(record, near),
        depth=float(depth.read(row, column)[0]),
        sights=() if outcome.success else tuple(trace_site(record, decoded)),
        near=near,
        hazards=tuple(count_hazards(record, decoded, depth)),
        islands=tuple(count_islands(record, decoded)),
        parts=part_propellant(record),
    )
