"""The named settings of the generator, and of the rocks that are added to a user's ground.

The numbers of the generator come from `python -m studies.calibrate`.
"""

from __future__ import annotations

from hda.terrain.generator import TerrainParameters
from hda.terrain.islands import IslandField
from hda.terrain.rocks import RockPopulation

BLOCKY_ROCKS = RockPopulation(area_fraction=0.3, decay_constant=0.6, decay_slope=0.0)
"""Dense large blocks, of which almost no pin-hole of safe ground is left between the islands. The Mars fit's
q (2.55 at k = 0.2) leaves 1.5 % of the rocky ground safe in specks, this 0.04 %; an engineering choice, not a
site."""


BOULDERS = RockPopulation(
    area_fraction=0.5, decay_constant=0.8, decay_slope=0.0, minimum_diameter=0.8, maximum_diameter=4.0
)
"""Boulders of 0.8 m and more over a quarter of the ground: 0.008 % of it is left safe between the islands."""


PAPER_TERRAIN = TerrainParameters(rocks=BLOCKY_ROCKS, islands=IslandField(20.0, threshold=-0.8))


def _lunar_rocks(area_fraction: float) -> RockPopulation:
    return RockPopulation(area_fraction, 0.5648, 0.01285, minimum_diameter=0.3, maximum_diameter=2.0)


ROCK_ABUNDANCES = {
    "sparse": _lunar_rocks(0.01),
    "medium": _lunar_rocks(0.03),
    "dense": _lunar_rocks(0.06),
}
"""Rocks of 0.3 to 2 m that an elevation model of coarse posts cannot show, by the share k of the ground that
rocks of all sizes cover. The law is that of nasa-jpl/lunasynth (commit 8618e3d), which calls its
q = 0.5648 + 0.01285 / k lunar; the shares span the range from which it draws k, 0.01 to 0.06. Its own named
scenes have more: 0.03 for sparse ground, 0.20 for dense."""
