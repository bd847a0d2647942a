"""The vector environments: many episodes at a time, each row to the bit a single environment.

The native ones fly a batch, on presets whose looks are the true map with noise; `stepped_vector` steps single
environments in turn, for all else. `rl.training` learns in them; of `rl.environment` only `thrust` knows
them.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.native.landing_vector import LandingVectorEnv
    from rl.environment.native.stepped_vector import SteppedVectorEnv
    from rl.environment.native.vector_env import LunarHDAMapVectorEnv, LunarHDAVectorEnv
    from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot

_HOMES = {
    "rl.environment.native.landing_vector": ("LandingVectorEnv",),
    "rl.environment.native.stepped_vector": ("SteppedVectorEnv",),
    "rl.environment.native.vector_env": (
        "LunarHDAMapVectorEnv",
        "LunarHDAVectorEnv",
    ),
    "rl.environment.native.vector_snapshot": ("restore_snapshot", "take_snapshot"),
}

__all__ = [
    "LandingVectorEnv",
    "LunarHDAMapVectorEnv",
    "LunarHDAVectorEnv",
    "SteppedVectorEnv",
    "restore_snapshot",
    "take_snapshot",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
