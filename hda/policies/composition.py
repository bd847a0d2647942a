"""A policy as a composition: where to land x how to fly there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from guidance.arrays import Array
from hda.policy import Command, Decision, DecisionStatus, Policy
from hda.site_selection import SiteSelection
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import Scenario


class GuidanceLaw(Protocol):
    """Gives the command that flies to a site. Memory goes in and comes out."""

    def begin(self, view: ScenarioView) -> Any:
        """Memory before the first look."""
        ...

    def command(
        self, observation: Observation, site: Array, memory: Any
    ) -> tuple[Command, DecisionStatus, Any]:
        """Command for this decision, how it came about, and the memory for the next."""
        ...


@dataclass(frozen=True)
class ComposedPolicy:
    """A site selection flown by a guidance law; its memory is the pair of theirs.

    Attributes:
        name: name in tables.
        site_selection: where to land.
        guidance_law: how to fly there.
    """

    name: str
    site_selection: SiteSelection
    guidance_law: GuidanceLaw

    def begin(self, scenario_view: ScenarioView, rng: np.random.Generator) -> tuple[Any, Any]:
        """Memory of both parts; neither draws random numbers."""
        return self.site_selection.begin(scenario_view), self.guidance_law.begin(scenario_view)

    def decide(self, observation: Observation, memory: tuple[Any, Any]) -> tuple[Decision, tuple[Any, Any]]:
        """Select the site, then ask the law to fly there."""
        site, site_memory = self.site_selection.select(observation, memory[0])
        command, status, law_memory = self.guidance_law.command(observation, site, memory[1])
        return Decision(site, command, status), (site_memory, law_memory)


@dataclass(frozen=True)
class PrivilegedComposition:
    """A composition whose site selection is made from the true map.

    Attributes:
        name: name in tables.
        make_selection: scenario -> site selection.
        guidance_law: how to fly there.
    """

    name: str
    make_selection: Callable[[Scenario], SiteSelection]
    guidance_law: GuidanceLaw
    privileged: bool = field(default=True, init=False)

    def informed(self, truth: Scenario) -> Policy[Any]:
        """Make the policy that knows this scenario."""
        return ComposedPolicy(self.name, self.make_selection(truth), self.guidance_law)
