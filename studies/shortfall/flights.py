"""One flight of the study: the policy, the episode, and what is kept of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hda.flight.episode import fly
from hda.policies.composition import ComposedPolicy
from hda.policies.entry import AnyPolicy
from hda.registry import make_policy
from hda.task.scenario import Scenario
from rl.inference.artefacts import read_card
from rl.inference.latent import encoder_of_card
from rl.policies.actor import AgentPolicy, AgentSite
from rl.policies.catalogue import policy_from_card
from rl.policies.recurrent_actor import RecurrentAgentPolicy
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
    sight_choice,
)
from studies.shortfall.propellant_parts import PropellantParts, part_propellant


@dataclass(frozen=True)
class FlownEpisode:
    """What is kept of one flight.

    Attributes:
        tile: number of the tile.
        loss: what was seen of the ground that it failed on, or that it did not fail.
        depth: [m] from the cell of the touchdown to the nearest safe one; 0 on safe ground.
        chosen: what the look on which the last site was chosen said of it; empty where it did not read it.
        near: safe ground in each look within a shift of the target.
        hazards: in its looks.
        islands: of safe ground in its looks.
        parts: of its propellant.
    """

    tile: int
    loss: Loss
    depth: float
    chosen: tuple[SiteSight, ...]
    near: tuple[NearSight, ...]
    hazards: tuple[SeenHazards, ...]
    islands: tuple[SeenIslands, ...]
    parts: PropellantParts


def open_policy(name: str) -> AnyPolicy:
    """A policy by its name or by the card of its weights.

    Raises:
        ValueError: the name is unknown.
        ArtefactError: the card is missing or damaged.
    """
    import rl  # noqa: F401 - registers the agents

    if not name.endswith(".json"):
        return make_policy(name)
    weights = Path(name).with_suffix("")
    return policy_from_card(weights.name, weights)


def find_encoder(policies: Iterable[AnyPolicy]) -> Path:
    """Where the weights of the encoder stand, without suffix, that the agents among policies see through.

    Raises:
        ValueError: an agent sees beliefs, none is an agent, or two have different encoders.
        ArtefactError: a card is missing, damaged, or of an encoder that is not shipped.
    """
    encoders: dict[Path, str] = {}
    for policy in policies:
        weights = _weights_of(policy)
        if weights is not None:
            path = weights.with_suffix(".json")
            card = read_card(path, "actor")
            if card.get("sight", "look") != "look":
                raise ValueError(
                    f"policies must see looks, and {policy.name} sees beliefs: take another agent"
                )
            encoders.setdefault(encoder_of_card(card, path), policy.name)
    if len(encoders) != 1:
        named = ", ".join(f"{encoder.name} of {name}" for encoder, name in encoders.items()) or "none"
        raise ValueError(
            f"policies must name an agent, and agents of one encoder alone, got {named}: "
            "study agents of different encoders one by one"
        )
    return next(iter(encoders))


def _weights_of(policy: AnyPolicy) -> Path | None:
    """Where an agent's weights stand, without suffix; None of what is no agent."""
    if isinstance(policy, ComposedPolicy):
        selection = policy.site_selection
        return selection.weights if isinstance(selection, AgentSite) else None
    return policy.weights if isinstance(policy, (AgentPolicy, RecurrentAgentPolicy)) else None


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
        chosen=() if (sight := sight_choice(record, decoded)) is None else (sight,),
        near=near,
        hazards=tuple(count_hazards(record, decoded, depth)),
        islands=tuple(count_islands(record, decoded)),
        parts=part_propellant(record),
    )
