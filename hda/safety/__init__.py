"""Algorithm 1: where a lander can stand on a digital elevation model.

The lander's footprint is set down on each cell in each orientation (`lander_footprint`, `stable_planes`),
and the worst slope and roughness decide (`criteria`). Where a flight ends on real ground, `touchdown_stance`
says at which height its pads meet it, `touchdown_pose` how it then stands, `touchdown_limits` what it takes.
It knows heights alone: no tile, no sensor.
Everything above imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.safety.criteria import DEFAULT_CRITERIA, SafetyCriteria
    from hda.safety.safety_map import SafetyMap, assess_safety
    from hda.safety.touchdown_limits import DESIGN_LIMITS, TESTED_LIMITS, TouchdownLimits
    from hda.safety.touchdown_pose import Pose, stand, tip_over_speed
    from hda.safety.touchdown_stance import Stance, contact_height, make_footing

_HOMES = {
    "hda.safety.criteria": (
        "DEFAULT_CRITERIA",
        "SafetyCriteria",
    ),
    "hda.safety.safety_map": (
        "SafetyMap",
        "assess_safety",
    ),
    "hda.safety.touchdown_limits": (
        "DESIGN_LIMITS",
        "TESTED_LIMITS",
        "TouchdownLimits",
    ),
    "hda.safety.touchdown_pose": (
        "Pose",
        "stand",
        "tip_over_speed",
    ),
    "hda.safety.touchdown_stance": (
        "Stance",
        "contact_height",
        "make_footing",
    ),
}

__all__ = [
    "DEFAULT_CRITERIA",
    "DESIGN_LIMITS",
    "TESTED_LIMITS",
    "Pose",
    "SafetyCriteria",
    "SafetyMap",
    "Stance",
    "TouchdownLimits",
    "assess_safety",
    "contact_height",
    "make_footing",
    "stand",
    "tip_over_speed",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
