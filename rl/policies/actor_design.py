"""What an actor's card says of it: what it sees, what its actions become, and how large it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from guidance.validation import unknown_name
from hda.task.observation import ScenarioView
from hda.task.rules import Range
from rl.environment.action import ActionRanges
from rl.environment.encoding import ENCODING_VERSION, LAYOUTS, Layout
from rl.environment.sight import SIGHTS, Sight, make_sight
from rl.environment.steering import STEERINGS, Steering, make_steering
from rl.inference.arrays import Array32
from rl.inference.artefacts import ArtefactError, require
from rl.inference.latent import encoder_of_card, load_encoder
from rl.inference.networks import MapEncoder
from rl.settings import ALGORITHMS, ON_POLICY_ALGORITHMS, refuse_thrust

THRUST = "thrust"
"""The guidance of an agent that gives the thrust itself."""
GUIDANCES = (*STEERINGS, THRUST)


def bound_action(inputs: Array32, algorithm: str) -> Array32:
    """The action in [-1, 1] that an actor's last layer means: of proximal policies the mean, else its tanh.

    Args:
        inputs: shape (a,), of the last layer.
        algorithm: that it was trained by.
    """
    return np.clip(inputs, -1.0, 1.0) if algorithm in ON_POLICY_ALGORITHMS else np.tanh(inputs)


@dataclass(frozen=True, eq=False)
class ActorDesign:
    """What an actor's card says of it, but its weights.

    Attributes:
        layout: which elements of its vector describe the flight.
        encoder: makes the latent of a map.
        hidden: sizes of its hidden layers.
        ranges: what its actions mean.
        algorithm: that it was trained by, which says how its actions are bounded.
        sight_name: "look" or "belief".
        guidance: "zem-zev", "convex" or "thrust".
    """

    layout: Layout
    encoder: MapEncoder
    hidden: tuple[int, ...]
    ranges: ActionRanges
    algorithm: str
    sight_name: str
    guidance: str

    @classmethod
    def from_card(cls, card: dict[str, Any], path: Path) -> ActorDesign:
        """Read it; `path` is named in messages.

        Raises:
            ArtefactError: it was made for another encoding or another autoencoder, or a field is wrong, or
                fields do not go together.
        """
        require(card, "encoding_version", ENCODING_VERSION, path)
        if not isinstance(card.get("layout"), str) or card["layout"] not in LAYOUTS:
            raise ArtefactError(f"{path}: unknown layout {card.get('layout')!r}")
        encoder = load_encoder(encoder_of_card(card, path))
        try:
            hidden = tuple(int(size) for size in card["hidden"])
            ranges = action_ranges_from_card(card["action_ranges"])
        except (KeyError, TypeError, ValueError) as error:
            raise ArtefactError(
                f"{path}: the card's 'hidden' or 'action_ranges' is wrong: {error}"
            ) from error
        algorithm = _known_name(card, "algorithm", ALGORITHMS, path)
        sight = _known_name({"sight": "look", **card}, "sight", SIGHTS, path)
        guidance = _known_name({"guidance": "zem-zev", **card}, "guidance", GUIDANCES, path)
        if guidance == THRUST:
            try:
                refuse_thrust(sight, algorithm)
            except ValueError as error:
                raise ArtefactError(f"{path}: {error}") from error
        return cls(LAYOUTS[card["layout"]], encoder, hidden, ranges, algorithm, sight, guidance)

    @cached_property
    def sight(self) -> Sight:
        """What it sees."""
        return make_sight(self.sight_name, self.layout, self.encoder)

    @cached_property
    def steering(self) -> Steering:
        """What its actions become."""
        return make_steering(self.guidance, self.ranges)

    @property
    def seen(self) -> int:
        """Numbers in what it sees."""
        return self.sight.bounds[0].size

    def begin(self, view: ScenarioView) -> tuple[Any, Any]:
        """Memory of sight and steering before the first look."""
        return self.sight.begin(view), self.steering.begin(view)


def _known_name(card: dict[str, Any], field: str, known: Iterable[str], path: Path) -> str:
    """The name in a card's field, which is one of those known."""
    name, names = card.get(field), tuple(known)
    if name not in names:
        raise ArtefactError(f"{path}: {unknown_name(field, name, names)}")
    return str(name)


def action_ranges_from_card(card: dict[str, object]) -> ActionRanges:
    """Undo `dataclasses.asdict` on ActionRanges."""
    values = {name: Range(**value) if isinstance(value, dict) else value for name, value in card.items()}
    return ActionRanges(**values)  # type: ignore[arg-type]
