"""The cheapest safe site that a flight could have known, in hindsight.

On presets that measure ranges a policy may know ground outside the set (`knowable_ground`), so there it is
one privileged policy among others and bounds none.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from hda.policies.privileged.knowable_ground import KnowableGround, first_ground, nearest_known_site
from hda.policies.privileged.oracle import frame_offset
from hda.policies.privileged.oracle_fuel import CheapestSafeSite
from hda.site_selection import Site
from hda.task.observation import Observation, ScenarioView
from hda.task.scenario import Scenario


@dataclass(frozen=True, eq=False)
class BestKnownSite(CheapestSafeSite):
    """Privileged: the cheapest truly safe site if a flight could have seen it, else the nearest such one.

    Attributes:
        ground: what a flight could have known, by the true state at the start.
    """

    ground: KnowableGround = field(kw_only=True, repr=False)

    @classmethod
    def informed(cls, truth: Scenario) -> BestKnownSite:
        """Make the selection that knows the tile of this scenario, and its knowable ground."""
        offset = frame_offset(truth)
        return cls(truth.tile, footing=truth.footing, offset=offset, ground=first_ground(truth))

    def choose(self, observation: Observation, view: ScenarioView) -> Site:
        """The first target where nothing could have been known; all is told by the map."""
        site = super().choose(observation, view)
        if self.ground.contains(site):
            return site
        known = nearest_known_site(self.ground, self.truth.deterministic)
        return observation.target if known is None else known
