"""The hazard-avoidance world: terrain, safety maps, the LIDAR, the simulator, and the policy seam.

Frame: site-fixed, x east, y north, z up, metres; origin at the map's south-west corner; map[row, column] with
row north and column east.
"""

from typing import TYPE_CHECKING

import hda.own_guidance  # noqa: F401 - before anything of `guidance`: another one may stand in the way
from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.ground.library import SPLITS, Ground, load_tile, prepare_tiles
    from hda.flight.episode import EpisodeRecord, fly
    from hda.sensing.lidar import Lidar
    from hda.task.observation import Observation, ScenarioView
    from hda.flight.outcome import Ending, Outcome
    from hda.policy import Decision, DecisionStatus, Policy, PrivilegedPolicy, ZemZevCommand
    from hda.task.presets import PRESETS, place_preset, sample_scenario
    from hda.registry import PolicyEntry, make_policy, policy_names, register_policy
    from hda.safety.safety_map import SafetyCriteria, SafetyMap, assess_safety
    from hda.task.scenario import Preset, Rules, Scenario, StartConditions
    from hda.terrain.generator import TerrainParameters, generate_terrain
    from hda.ground.tile import Tile, make_tile

_HOMES = {
    "hda.ground.library": ("SPLITS", "Ground", "load_tile", "prepare_tiles"),
    "hda.flight.episode": ("EpisodeRecord", "fly"),
    "hda.sensing.lidar": ("Lidar",),
    "hda.task.observation": ("Observation", "ScenarioView"),
    "hda.flight.outcome": ("Ending", "Outcome"),
    "hda.policy": ("Decision", "DecisionStatus", "Policy", "PrivilegedPolicy", "ZemZevCommand"),
    "hda.task.presets": ("PRESETS", "place_preset", "sample_scenario"),
    "hda.registry": ("PolicyEntry", "make_policy", "policy_names", "register_policy"),
    "hda.safety.safety_map": ("SafetyCriteria", "SafetyMap", "assess_safety"),
    "hda.task.scenario": ("Preset", "Rules", "Scenario", "StartConditions"),
    "hda.terrain.generator": ("TerrainParameters", "generate_terrain"),
    "hda.ground.tile": ("Tile", "make_tile"),
}

__all__ = [
    "PRESETS",
    "SPLITS",
    "Decision",
    "DecisionStatus",
    "Ending",
    "EpisodeRecord",
    "Ground",
    "Lidar",
    "Observation",
    "Outcome",
    "Policy",
    "PolicyEntry",
    "Preset",
    "PrivilegedPolicy",
    "Rules",
    "SafetyCriteria",
    "SafetyMap",
    "Scenario",
    "ScenarioView",
    "StartConditions",
    "TerrainParameters",
    "Tile",
    "ZemZevCommand",
    "assess_safety",
    "fly",
    "generate_terrain",
    "load_tile",
    "make_policy",
    "make_tile",
    "place_preset",
    "policy_names",
    "prepare_tiles",
    "register_policy",
    "sample_scenario",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
