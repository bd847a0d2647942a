"""A policy of one's own, in the table beside the others.

Run: python -m studies.compare --policies examples.my_policy:SafestNearby single-divert --episodes 200
"""

from dataclasses import dataclass

import numpy as np

import hda
from guidance import time_to_go


@dataclass(frozen=True)
class SafestNearby:
    """Goes to the pixel of greatest safety less a price for distance; stays where it is good enough."""

    name: str = "safest-nearby"
    price: float = 0.002  # of one metre, in probability of safety
    margin: float = 0.1  # a new site must be better by this

    def begin(self, scenario_view, rng):
        """Remember gravity, which the time to go needs."""
        return scenario_view.gravity

    def decide(self, observation, memory):
        """Choose a site, and fly there by ZEM/ZEV with gains 6 and 2."""
        offset = observation.pixel_offset
        worth = observation.safety_map - self.price * np.hypot(offset[:, None], offset[None, :])
        row, column = np.unravel_index(np.argmax(worth), worth.shape)
        here = observation.pixel(observation.target)
        if worth[row, column] < worth[here] + self.margin:
            command = hda.ZemZevCommand(6.0, 2.0, observation.time_to_go)
            return hda.Decision(observation.target, command), memory
        site = observation.site(row, column)
        seconds = time_to_go(observation.state, site, memory)
        return hda.Decision(site, hda.ZemZevCommand(6.0, 2.0, seconds)), memory
