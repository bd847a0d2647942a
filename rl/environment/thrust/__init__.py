"""`LunarHDA-Thrust-v0`: the agent gives the thrust itself, once each control period, without a guidance law.

World, looks and reward are those of `LunarHDA-v0`. One environment flies by the functions of `hda.flight`,
the native vector by their kernels, to the same bit. It builds on `rl.environment.native`.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.environment.thrust.thrust_action import REACH, thrust_acceleration
    from rl.environment.thrust.thrust_env import LunarHDAThrustEnv
    from rl.environment.thrust.thrust_vector_env import LunarHDAThrustVectorEnv

_HOMES = {
    "rl.environment.thrust.thrust_action": ("REACH", "thrust_acceleration"),
    "rl.environment.thrust.thrust_env": ("LunarHDAThrustEnv",),
    "rl.environment.thrust.thrust_vector_env": ("LunarHDAThrustVectorEnv",),
}

__all__ = [
    "REACH",
    "LunarHDAThrustEnv",
    "LunarHDAThrustVectorEnv",
    "thrust_acceleration",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
