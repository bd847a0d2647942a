"""ZEM/ZEV with fixed gains as a guidance law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from guidance.arrays import Array
from guidance.upright_time import upright_time_to_go
from hda.policy import DecisionStatus, ZemZevCommand
from hda.task.observation import Observation, ScenarioView


@dataclass(frozen=True)
class FixedGainZemZev:
    """ZEM/ZEV with fixed gains; the time to go is the quartic's at each change of site, and a clock between.

    Attributes:
        position_gain: K_R.
        velocity_gain: K_V.
    """

    position_gain: float = 6.0
    velocity_gain: float = 2.0

    def begin(self, view: ScenarioView) -> ScenarioView:
        """Remember the lander and gravity."""
        return view

    def command(
        self, observation: Observation, site: Array, memory: ScenarioView
    ) -> tuple[ZemZevCommand, DecisionStatus, ScenarioView]:
        """Keep the clock for the same site, else ask the quartic, and for longer under a pointing limit."""
        remaining = observation.time_to_go
        if not np.array_equal(site[:2], observation.target[:2]):  # a new height of it keeps the clock
            remaining = upright_time_to_go(observation.state, site, memory.lander, memory.gravity)
        return (
            ZemZevCommand(self.position_gain, self.velocity_gain, remaining),
            DecisionStatus.NOMINAL,
            memory,
        )
