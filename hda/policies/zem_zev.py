"""ZEM/ZEV with fixed gains as a guidance law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.zem_zev import time_to_go
from hda.observation import Observation, ScenarioView
from hda.policy import DecisionStatus, ZemZevCommand


@dataclass(frozen=True)
class FixedGainZemZev:
    """ZEM/ZEV with fixed gains; the time to go is the quartic's at each change of site, and a clock between.

    Attributes:
        position_gain: K_R.
        velocity_gain: K_V.
    """

    position_gain: float = 6.0
    velocity_gain: float = 2.0

    def begin(self, view: ScenarioView) -> tuple[float, float, float]:
        """Remember gravity."""
        x, y, z = view.gravity
        return float(x), float(y), float(z)

    def command(
        self, observation: Observation, site: NDArray[np.float64], memory: tuple[float, float, float]
    ) -> tuple[ZemZevCommand, DecisionStatus, tuple[float, float, float]]:
        """Keep the clock for the same site, else ask the quartic."""
        remaining = observation.time_to_go
        if not np.array_equal(site, observation.target):
            remaining = time_to_go(observation.state, site, memory)
        return (
            ZemZevCommand(self.position_gain, self.velocity_gain, remaining),
            DecisionStatus.NOMINAL,
            memory,
        )
