"""Algorithm 1: where a lander can stand on a digital elevation model.

The lander's footprint is set down on each cell in each orientation (`lander_footprint`, `stable_planes`),
and the worst slope and roughness decide (`criteria`). It knows heights alone: no tile, no sensor.
Everything above imports it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from hda.safety.criteria import DEFAULT_CRITERIA, SafetyCriteria
    from hda.safety.safety_map import SafetyMap, assess_safety

_HOMES = {
    "hda.safety.criteria": (
        "DEFAULT_CRITERIA",
        "SafetyCriteria",
    ),
    "hda.safety.safety_map": (
        "SafetyMap",
        "assess_safety",
    ),
}

__all__ = [
    "DEFAULT_CRITERIA",
    "SafetyCriteria",
    "SafetyMap",
    "assess_safety",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
