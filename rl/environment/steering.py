"""What an agent's action becomes: a decision that the vehicle flies, by its own gains or by a law."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.validation import unknown_name
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import GuidanceLaw
from hda.policy import Decision
from hda.task.observation import Observation, ScenarioView
from rl.environment.action import PAPER_ACTIONS, ActionRanges, clip_actions, decide_action


class Steering(Protocol):
    """Turns actions into decisions. Memory goes in and comes out."""

    @property
    def size(self) -> int:
        """Numbers in an action, each in [-1, 1]."""
        ...

    def begin(self, view: ScenarioView) -> Any:
        """Memory before the first decision."""
        ...

    def decide(
        self, action: NDArray[np.floating], observation: Observation, memory: Any
    ) -> tuple[Decision, Any]:
        """The decision that an action of shape (size,) means, and the memory for the next.

        Raises:
            ValueError: the action has another shape or is not finite.
        """
        ...


@dataclass(frozen=True)
class GainSteering:
    """ZEM/ZEV with the agent's own gains and clock: five numbers, as `rl.environment.action` lists them.

    Attributes:
        ranges: what -1 and 1 mean.
    """

    ranges: ActionRanges = PAPER_ACTIONS
    size: int = field(default=5, init=False)

    def begin(self, view: ScenarioView) -> None:
        """Nothing is remembered."""

    def decide(
        self, action: NDArray[np.floating], observation: Observation, memory: None
    ) -> tuple[Decision, None]:
        """The decision of the five numbers."""
        return decide_action(action, observation, self.ranges), None


@dataclass(frozen=True)
class SiteSteering:
    """The site alone is the action, two numbers; a guidance law flies to it.

    The target moves east and north by shares of the look's width. A shift of less than half a pixel along
    both axes keeps the site, which the look cannot tell from its neighbour: the plan in flight goes on.

    Attributes:
        ranges: of the shift; the others mean nothing here.
        law: flies to the site, and remembers its plan.
    """

    ranges: ActionRanges = PAPER_ACTIONS
    law: GuidanceLaw = field(default_factory=AdjustedDescent)
    size: int = field(default=2, init=False)

    def begin(self, view: ScenarioView) -> Any:
        """Memory of the law."""
        return self.law.begin(view)

    def decide(
        self, action: NDArray[np.floating], observation: Observation, memory: Any
    ) -> tuple[Decision, Any]:
        """Move the site, and ask the law to fly there."""
        shift = self.ranges.shift * clip_actions(action, (2,)) * observation.width
        site = observation.target
        if np.abs(shift).max() >= 0.5 * observation.width / observation.safety_map.shape[0]:
            site = observation.settled(site + np.array([*shift, 0.0]))
        command, status, after = self.law.command(observation, site, memory)
        return Decision(site, command, status), after


STEERINGS = {"zem-zev": GainSteering, "convex": SiteSteering}
"""By the name of the guidance that flies to the site."""


def make_steering(guidance: str, ranges: ActionRanges = PAPER_ACTIONS) -> GainSteering | SiteSteering:
    """Make one by the name of its guidance.

    Raises:
        ValueError: there is none of that name.
    """
    if guidance not in STEERINGS:
        raise ValueError(unknown_name("guidance", guidance, STEERINGS))
    return STEERINGS[guidance](ranges)
