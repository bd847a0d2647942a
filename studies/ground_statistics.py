"""How safe ground lies around a first target: its share, its islands, its specks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hda.policies.privileged.oracle import safe_clearance
from hda.task.scenario import Scenario

SPECK_RADIUS = 2.0
"""[m] safe ground that no disc of this radius fits into is a speck."""


@dataclass(frozen=True)
class GroundStatistics:
    """Safe ground within the hazard radius of a first target, on the true map.

    Attributes:
        hazard_share: share of the ground that is unsafe.
        largest_disc: [m] radius of the largest disc of safe ground centred within the radius.
        nearest_safe: [m] from the target to the centre of the nearest safe cell.
        speck_share: share of the safe ground that no safe disc of `SPECK_RADIUS` covers; nan without safe
            ground.
    """

    hazard_share: float
    largest_disc: float
    nearest_safe: float
    speck_share: float


def measure_ground(scenario: Scenario) -> GroundStatistics:
    """Measure the ground around a scenario's first target."""
    from scipy.ndimage import distance_transform_edt

    tile, target = scenario.tile, scenario.nominal_target
    radius = scenario.preset.start.hazard_radius
    room = safe_clearance(tile)
    rows, columns = tile.deterministic.shape
    north, east = np.ogrid[0:rows, 0:columns]
    distance = np.hypot(east + 0.5 - target[0], north + 0.5 - target[1])
    near = distance <= radius
    safe = tile.deterministic & near
    to_open_ground = np.asarray(distance_transform_edt(room < SPECK_RADIUS))
    specks = safe & (to_open_ground > SPECK_RADIUS + 0.5)
    return GroundStatistics(
        hazard_share=tile.hazard_share(target, radius),
        largest_disc=float(room[near].max()),
        nearest_safe=float(distance[tile.deterministic].min(initial=np.inf)),
        speck_share=float(specks.sum() / safe.sum()) if safe.any() else float("nan"),
    )
