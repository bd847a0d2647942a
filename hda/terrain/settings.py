"""The named settings of the generator. Their numbers come from `python -m studies.calibrate`."""

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
