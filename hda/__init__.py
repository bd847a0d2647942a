"""The hazard-avoidance world: terrain, safety maps, the LIDAR, the simulator, and the policy seam.

Frame: site-fixed, x east, y north, z up, metres; origin at the map's south-west corner; map[row, column] with
row north and column east.
"""

from typing import TYPE_CHECKING

import hda.own_guidance  # noqa: F401 - before anything of `guidance`: another one may stand in the way
from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.flight.episode import fly
    from hda.flight.outcome import Ending, Outcome
    from hda.flight.record import EpisodeRecord
    from hda.flight.touchdown_report import TouchdownFault, TouchdownReport
    from hda.ground.library import SPLITS, Ground, load_tile, prepare_tiles
    from hda.ground.tile import Tile, make_tile
    from hda.navigation.filter import FlownPath, navigate
    from hda.navigation.navigation_state import NavigationState, begin_navigation
    from hda.navigation.sensors import Altimeter, InertialUnit, SiteFixes, TerrainFixes, Velocimeter
    from hda.navigation.system import NavigationSystem
    from hda.policies.entry import PolicyEntry
    from hda.policy import Decision, DecisionStatus, Policy, PrivilegedPolicy, ZemZevCommand
    from hda.registry import make_policy, policy_names, register_policy
    from hda.safety.criteria import SafetyCriteria
    from hda.safety.safety_map import SafetyMap, assess_safety
    from hda.safety.touchdown_limits import DESIGN_LIMITS, TESTED_LIMITS, TouchdownLimits
    from hda.sensing.lidar import Lidar
    from hda.sensing.ranging import RangingLidar
    from hda.task.observation import Observation, ScenarioView
    from hda.task.own_ground import place_preset
    from hda.task.presets import PRESETS, Preset
    from hda.task.rules import Rules, StartConditions
    from hda.task.scenario import Scenario, sample_scenario
    from hda.task.touchdown import GroundTouchdown, PlaneTouchdown
    from hda.terrain.generator import TerrainParameters, generate_terrain

_HOMES = {
    "hda.flight.episode": ("fly",),
    "hda.flight.outcome": ("Ending", "Outcome"),
    "hda.flight.record": ("EpisodeRecord",),
    "hda.flight.touchdown_report": ("TouchdownFault", "TouchdownReport"),
    "hda.ground.library": ("SPLITS", "Ground", "load_tile", "prepare_tiles"),
    "hda.ground.tile": ("Tile", "make_tile"),
    "hda.navigation.filter": ("FlownPath", "navigate"),
    "hda.navigation.navigation_state": ("NavigationState", "begin_navigation"),
    "hda.navigation.sensors": ("Altimeter", "InertialUnit", "SiteFixes", "TerrainFixes", "Velocimeter"),
    "hda.navigation.system": ("NavigationSystem",),
    "hda.policies.entry": ("PolicyEntry",),
    "hda.policy": ("Decision", "DecisionStatus", "Policy", "PrivilegedPolicy", "ZemZevCommand"),
    "hda.registry": ("make_policy", "policy_names", "register_policy"),
    "hda.safety.criteria": ("SafetyCriteria",),
    "hda.safety.safety_map": ("SafetyMap", "assess_safety"),
    "hda.safety.touchdown_limits": ("DESIGN_LIMITS", "TESTED_LIMITS", "TouchdownLimits"),
    "hda.sensing.lidar": ("Lidar",),
    "hda.sensing.ranging": ("RangingLidar",),
    "hda.task.observation": ("Observation", "ScenarioView"),
    "hda.task.own_ground": ("place_preset",),
    "hda.task.presets": ("PRESETS", "Preset"),
    "hda.task.rules": ("Rules", "StartConditions"),
    "hda.task.scenario": ("Scenario", "sample_scenario"),
    "hda.task.touchdown": ("GroundTouchdown", "PlaneTouchdown"),
    "hda.terrain.generator": ("TerrainParameters", "generate_terrain"),
}

__all__ = [
    "DESIGN_LIMITS",
    "PRESETS",
    "SPLITS",
    "TESTED_LIMITS",
    "Altimeter",
    "Decision",
    "DecisionStatus",
    "Ending",
    "EpisodeRecord",
    "FlownPath",
    "Ground",
    "GroundTouchdown",
    "InertialUnit",
    "Lidar",
    "NavigationState",
    "NavigationSystem",
    "Observation",
    "Outcome",
    "PlaneTouchdown",
    "Policy",
    "PolicyEntry",
    "Preset",
    "PrivilegedPolicy",
    "RangingLidar",
    "Rules",
    "SafetyCriteria",
    "SafetyMap",
    "Scenario",
    "ScenarioView",
    "SiteFixes",
    "StartConditions",
    "TerrainFixes",
    "TerrainParameters",
    "Tile",
    "TouchdownFault",
    "TouchdownLimits",
    "TouchdownReport",
    "Velocimeter",
    "ZemZevCommand",
    "assess_safety",
    "begin_navigation",
    "fly",
    "generate_terrain",
    "load_tile",
    "make_policy",
    "make_tile",
    "navigate",
    "place_preset",
    "policy_names",
    "prepare_tiles",
    "register_policy",
    "sample_scenario",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
