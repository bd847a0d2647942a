"""The Gymnasium environments: what an agent sees, what it may do, and which episodes it flies.

One step is one decision, flown by the functions of `hda.flight`; `native` flies many at a time. It
imports `rl.inference` for the encoder; agents learn and fly on top of it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.action import ActionRanges, decide_action
    from rl.environment.dispersions import Dispersions
    from rl.environment.env import LandingEnv, LunarHDAEnv
    from rl.environment.map_env import LunarHDAMapEnv
    from rl.environment.sight import BeliefSight, LookSight, make_sight
    from rl.environment.steering import GainSteering, SiteSteering, make_steering

_HOMES = {
    "rl.environment.action": (
        "ActionRanges",
        "decide_action",
    ),
    "rl.environment.dispersions": ("Dispersions",),
    "rl.environment.env": (
        "LandingEnv",
        "LunarHDAEnv",
    ),
    "rl.environment.map_env": ("LunarHDAMapEnv",),
    "rl.environment.sight": ("BeliefSight", "LookSight", "make_sight"),
    "rl.environment.steering": ("GainSteering", "SiteSteering", "make_steering"),
}

__all__ = [
    "ActionRanges",
    "BeliefSight",
    "Dispersions",
    "GainSteering",
    "LandingEnv",
    "LookSight",
    "LunarHDAEnv",
    "LunarHDAMapEnv",
    "SiteSteering",
    "decide_action",
    "make_sight",
    "make_steering",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
