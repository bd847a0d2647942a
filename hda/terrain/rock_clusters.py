"""Rocks in clusters: a Poisson process of cluster centres with rocks scattered about each.

Source: Neyman and Scott, Journal of the Royal Statistical Society B 20, 1958; with normal scatter it is
Thomas's process (Biometrika 36, 1949).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from guidance.validation import finite_number
from hda.terrain.rocks import Rocks


@dataclass(frozen=True)
class RockClusters:
    """How rocks gather.

    Rocks lie around young craters and where boulders broke, not evenly. Both lengths are engineering choices.

    Attributes:
        spacing: [m] there is one cluster in the square of this length, on average.
        radius: [m] standard deviation of a rock's distance from the centre of its cluster, along each axis.

    Raises:
        ValueError: a field is out of range.
    """

    spacing: float = 40.0
    radius: float = 10.0

    def __post_init__(self) -> None:
        """Refuse clusters that cannot be drawn."""
        finite_number("spacing", self.spacing, above=0.0)
        finite_number("radius", self.radius, above=0.0)


def gather_rocks(
    rocks: Rocks, clusters: RockClusters, extent: float, margin: float, rng: np.random.Generator
) -> Rocks:
    """Move rocks into clusters; their number, sizes and shapes stay.

    What leaves the square on one side comes in on the other, so that the density is the same everywhere.

    Args:
        rocks: evenly spread over the square.
        clusters: how they gather.
        extent: [m] side of the tile.
        margin: [m] by which the square in which rocks lie reaches beyond the tile on every side.
        rng: source of the clusters.
    """
    side = extent + 2.0 * margin
    count = max(1, int(rng.poisson((side / clusters.spacing) ** 2)))
    centre = rng.uniform(0.0, side, size=(count, 2))
    cluster = rng.integers(count, size=len(rocks))
    scatter = clusters.radius * rng.standard_normal((len(rocks), 2))
    place = np.mod(centre[cluster] + scatter, side) - margin
    return replace(rocks, east=place[:, 0], north=place[:, 1])
