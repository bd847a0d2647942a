"""The Gymnasium environments: what an agent sees, what it may do, and which episodes it flies.

One step is one decision, flown by the functions of `hda.flight`. It imports `rl.inference` for the encoder;
agents learn and fly on top of it.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.action import ActionRanges, decide_action
    from rl.environment.dispersions import Dispersions
    from rl.environment.env import LandingEnv, LunarHDAEnv, LunarHDAMapEnv

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
}

__all__ = [
    "ActionRanges",
    "Dispersions",
    "LandingEnv",
    "LunarHDAEnv",
    "LunarHDAMapEnv",
    "decide_action",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
