"""The cheapest safe site that a flight could have known, in hindsight."""

from __future__ import annotations

from hda.policies.privileged.knowable_ground import KnowableGround, nearest_known_site
from hda.policies.privileged.oracle_fuel import CheapestSafeSite
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView


class BestKnownSite(CheapestSafeSite):
    """Privileged: the cheapest truly safe site if a flight could have seen it, else the nearest such one."""

    def choose(self, observation: Observation, view: ScenarioView) -> Site:
        """The first target where nothing could have been known."""
        ground = KnowableGround(observation.state, observation.target, observation.width, view)
        site = super().choose(observation, view)
        if ground.contains(site):
            return site
        known = nearest_known_site(ground, self.truth.deterministic)
        return observation.target if known is None else known
