"""Choosing where to land: pure functions of a look, and the selections that policies are composed of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from guidance.arrays import Array
from hda.task.observation import Observation, ScenarioView

Site = Array


class SiteSelection(Protocol):
    """Picks the site of each decision. Memory goes in and comes out."""

    def begin(self, view: ScenarioView) -> Any:
        """Memory before the first look."""
        ...

    def select(self, observation: Observation, memory: Any) -> tuple[Site, Any]:
        """Site for this decision, shape (3,), and the memory for the next."""
        ...


def safest_site(observation: Observation) -> Site:
    """Pixel of greatest observed safety; of several, the first in row-major order."""
    row, column = divmod(int(np.argmax(observation.safety_map)), observation.safety_map.shape[1])
    return observation.site(row, column)


def nearest_safe_site(observation: Observation, threshold: float) -> Site | None:
    """Nearest pixel to the current target that looks at least `threshold` safe, or None."""
    safe = observation.safety_map >= threshold
    if not safe.any():
        return None
    square = observation.pixel_offset**2
    distance = np.where(safe, square[:, None] + square[None, :], np.inf)
    row, column = divmod(int(np.argmin(distance)), safe.shape[1])
    return observation.site(row, column)


def observed_safety(observation: Observation, site: Site) -> float:
    """Observed safety of the pixel that holds `site`; 0 outside the look."""
    pixel = observation.pixel(site)
    return float(observation.safety_map[pixel]) if pixel is not None else 0.0


@dataclass(frozen=True)
class NominalSite:
    """Always the first target."""

    def begin(self, view: ScenarioView) -> None:
        """Nothing to remember."""

    def select(self, observation: Observation, memory: None) -> tuple[Site, None]:
        """Keep the current target, which has never moved."""
        return observation.target, None


@dataclass(frozen=True)
class SingleDivertSite:
    """The paper's Single Divert: the first target until low enough, then once the safest pixel.

    Attributes:
        divert_altitude: [m] above the map datum; the first look at or below it diverts.
    """

    divert_altitude: float = 500.0

    def begin(self, view: ScenarioView) -> bool:
        """Whether the divert has been made."""
        return False

    def select(self, observation: Observation, memory: bool) -> tuple[Site, bool]:
        """Divert at the first look that is low enough and has a map."""
        if memory or observation.state.position[2] > self.divert_altitude or not observation.has_map:
            return observation.target, memory
        return safest_site(observation), True


@dataclass(frozen=True)
class NearestSafeSite:
    """Keep a site that still looks safe, else go to the nearest that does, else to the safest.

    Attributes:
        keep_threshold: after the first look, the site is kept while its observed safety is at least this.
        select_threshold: a new site must look at least this safe.
    """

    keep_threshold: float = 0.5
    select_threshold: float = 0.95

    def begin(self, view: ScenarioView) -> bool:
        """Whether a site has been selected."""
        return False

    def select(self, observation: Observation, memory: bool) -> tuple[Site, bool]:
        """Select at the first look with a map; afterwards only when the site no longer looks safe."""
        if not observation.has_map:
            return observation.target, memory
        if memory and observed_safety(observation, observation.target) >= self.keep_threshold:
            return observation.target, True
        site = nearest_safe_site(observation, self.select_threshold)
        return (safest_site(observation) if site is None else site), True
