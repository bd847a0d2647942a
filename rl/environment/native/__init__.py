"""The native vector environments: many episodes in one batch, each row to the bit a single environment.

It serves presets whose looks are the true map with noise. `rl.training` learns in them; nothing else of
`rl.environment` knows them.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.native.vector_env import LandingVectorEnv, LunarHDAMapVectorEnv, LunarHDAVectorEnv
    from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot

_HOMES = {
    "rl.environment.native.vector_env": (
        "LandingVectorEnv",
        "LunarHDAMapVectorEnv",
        "LunarHDAVectorEnv",
    ),
    "rl.environment.native.vector_snapshot": ("restore_snapshot", "take_snapshot"),
}

__all__ = [
    "LandingVectorEnv",
    "LunarHDAMapVectorEnv",
    "LunarHDAVectorEnv",
    "restore_snapshot",
    "take_snapshot",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
