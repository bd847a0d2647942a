"""The environment that gives the raw map, for networks that read it themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from hda.task.observation import Observation
from hda.task.presets import Preset
from rl.environment.encoding import encode_flight, encode_map
from rl.environment.env import LandingEnv


class LunarHDAMapEnv(LandingEnv[dict[str, Any]]):
    """`LunarHDA-Map-v0`: the flight and the raw map, for networks that read the map themselves.

    - `flight`: float32, shape (12,), elements 0-11 of `LunarHDA-v0`, by the same `layout`;
    - `map`: uint8, shape (1, 64, 64), the observed safety times 255 (far finer than the sensor's noise);
      channel first, row i grows north, column j east, centred on the current target.

    Rewards, actions and options: `LandingEnv`.
    """

    def make_observation_space(self, preset: Preset) -> spaces.Space[dict[str, Any]]:
        """The flight and the map, each a box."""
        pixels = preset.lidar.pixels
        return spaces.Dict(
            flight=spaces.Box(self.layout.low, self.layout.high, dtype=np.float32),
            map=spaces.Box(0, 255, (1, pixels, pixels), np.uint8),
        )

    def encode(self, observation: Observation) -> dict[str, Any]:
        """The flight and the map."""
        assert self.scenario is not None
        return {
            "flight": encode_flight(self.layout, observation, self.scenario.nominal_target),
            "map": encode_map(observation.safety_map)[None],
        }
