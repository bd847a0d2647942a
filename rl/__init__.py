"""Learning agents: Gymnasium environments, training, shipped weights, and the agents as policies.

Importing this package registers the environments with Gymnasium and the agents with `hda.registry`:
`LunarHDA-v0`, and with one thing changed each `LunarHDA-Map-v0` (the raw map is seen), `LunarHDA-Belief-v0`
(what all looks have left is seen), `LunarHDA-Site-v0` (the site alone is the action) and
`LunarHDA-Thrust-v0` (the thrust is the action). Nothing of torch is imported until something is trained.
Where nothing has imported it, such as in a worker process, `gymnasium.make("rl:LunarHDA-v0")` does.
"""

from typing import TYPE_CHECKING, Any

import gymnasium

import hda
from guidance.exports import lazy_exports
from rl.policies.catalogue import entries

if TYPE_CHECKING:
    from rl.environment.action import ActionRanges, decide_action
    from rl.environment.dispersions import Dispersions
    from rl.environment.env import LunarHDAEnv
    from rl.environment.map_env import LunarHDAMapEnv
    from rl.inference.artefacts import ArtefactError
    from rl.policies.actor import AgentPolicy, AgentSite

_HOMES = {
    "rl.environment.action": ("ActionRanges", "decide_action"),
    "rl.environment.dispersions": ("Dispersions",),
    "rl.environment.env": ("LunarHDAEnv",),
    "rl.environment.map_env": ("LunarHDAMapEnv",),
    "rl.inference.artefacts": ("ArtefactError",),
    "rl.policies.actor": ("AgentPolicy", "AgentSite"),
}

__all__ = [
    "ActionRanges",
    "AgentPolicy",
    "AgentSite",
    "ArtefactError",
    "Dispersions",
    "LunarHDAEnv",
    "LunarHDAMapEnv",
    "decide_action",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)

_SPECIFICATION: dict[str, Any] = {"reward_threshold": 0.25, "max_episode_steps": 20}
_NATIVE = "rl.environment.native.vector_env"
gymnasium.register(
    "LunarHDA-v0",
    entry_point="rl.environment.env:LunarHDAEnv",
    vector_entry_point=f"{_NATIVE}:LunarHDAVectorEnv",
    **_SPECIFICATION,
)
gymnasium.register(
    "LunarHDA-Map-v0",
    entry_point="rl.environment.map_env:LunarHDAMapEnv",
    vector_entry_point=f"{_NATIVE}:LunarHDAMapVectorEnv",
    **_SPECIFICATION,
)
gymnasium.register(
    "LunarHDA-Thrust-v0",
    entry_point="rl.environment.thrust.thrust_env:LunarHDAThrustEnv",
    vector_entry_point="rl.environment.thrust.thrust_vector_env:LunarHDAThrustVectorEnv",
    reward_threshold=_SPECIFICATION["reward_threshold"],
    max_episode_steps=200,
)
for _name, _options in (("Site", {"guidance": "convex"}), ("Belief", {"sight": "belief"})):
    gymnasium.register(
        f"LunarHDA-{_name}-v0",
        entry_point="rl.environment.env:LunarHDAEnv",
        vector_entry_point="rl.environment.native.stepped_vector:SteppedVectorEnv",
        kwargs=_options,
        **_SPECIFICATION,
    )
for _entry in entries():
    hda.register_policy(_entry)
