"""The Gymnasium environments: what an agent sees, what it may do, and which episodes it flies.

One step is one decision, flown by the functions of `hda.flight`; a native vector flies many at a time. It
imports `rl.inference` for the encoder; agents learn and fly on top of it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.action import ActionRanges, decide_action
    from rl.environment.dispersions import Dispersions
    from rl.environment.env import LandingEnv, LunarHDAEnv, LunarHDAMapEnv
    from rl.environment.vector_env import LandingVectorEnv, LunarHDAMapVectorEnv, LunarHDAVectorEnv

_HOMES = {
    "rl.environment.action": (
        "ActionRanges",
        "decide_action",
    ),
    "rl.environment.dispersions": ("Dispersions",),
    "rl.environment.env": (
        "LandingEnv",
        "LunarHDAEnv",
        "LunarHDAMapEnv",
    ),
    "rl.environment.vector_env": (
        "LandingVectorEnv",
        "LunarHDAMapVectorEnv",
        "LunarHDAVectorEnv",
    ),
}

__all__ = [
    "ActionRanges",
    "Dispersions",
    "LandingEnv",
    "LandingVectorEnv",
    "LunarHDAEnv",
    "LunarHDAMapEnv",
    "LunarHDAMapVectorEnv",
    "LunarHDAVectorEnv",
    "decide_action",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
