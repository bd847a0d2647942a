"""The task: its rules, its presets, and the scenario of an episode.

A preset names ground, starts, sensor, rules, lander, its body, and where its flights end; a scenario is one
draw from it by streams of random numbers that no policy can disturb. What a policy may know is an
`Observation` and a `ScenarioView`. It imports the ground and the sensor; policies and the simulator import
it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.task.body_variants import BODY_VARIANTS, vary_body
    from hda.task.observation import Observation, ScenarioView
    from hda.task.own_ground import place_preset
    from hda.task.presets import PRESETS, Preset, find_preset
    from hda.task.rules import Range, Rules, StartConditions
    from hda.task.scenario import Scenario, sample_scenario
    from hda.task.touchdown import GroundTouchdown, PlaneTouchdown

_HOMES = {
    "hda.task.body_variants": (
        "BODY_VARIANTS",
        "vary_body",
    ),
    "hda.task.observation": (
        "Observation",
        "ScenarioView",
    ),
    "hda.task.own_ground": ("place_preset",),
    "hda.task.presets": (
        "PRESETS",
        "Preset",
        "find_preset",
    ),
    "hda.task.rules": (
        "Range",
        "Rules",
        "StartConditions",
    ),
    "hda.task.scenario": (
        "Scenario",
        "sample_scenario",
    ),
    "hda.task.touchdown": (
        "GroundTouchdown",
        "PlaneTouchdown",
    ),
}

__all__ = [
    "BODY_VARIANTS",
    "PRESETS",
    "GroundTouchdown",
    "Observation",
    "PlaneTouchdown",
    "Preset",
    "Range",
    "Rules",
    "Scenario",
    "ScenarioView",
    "StartConditions",
    "find_preset",
    "place_preset",
    "sample_scenario",
    "vary_body",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
