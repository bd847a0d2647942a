"""Learning agents: Gymnasium environments, training, shipped weights, and the agents as policies.

Importing this package registers the environments `LunarHDA-v0` and `LunarHDA-Map-v0` with Gymnasium and the
agents with `hda.registry`. Nothing of torch is imported until something is trained. Where nothing has
imported it, such as in a worker process, `gymnasium.make("rl:LunarHDA-v0")` does.
"""

from typing import TYPE_CHECKING

import gymnasium

import hda
from guidance.exports import lazy_exports
from rl.policies.catalogue import entries

if TYPE_CHECKING:
    from rl.environment.action import ActionRanges, decide_action
    from rl.environment.dispersions import Dispersions
    from rl.environment.env import LunarHDAEnv, LunarHDAMapEnv
    from rl.inference.artefacts import ArtefactError
    from rl.policies.actor import AgentPolicy, AgentSite

_HOMES = {
    "rl.environment.action": ("ActionRanges", "decide_action"),
    "rl.environment.dispersions": ("Dispersions",),
    "rl.environment.env": ("LunarHDAEnv", "LunarHDAMapEnv"),
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

for _name, _class in (("LunarHDA-v0", "LunarHDA{}Env"), ("LunarHDA-Map-v0", "LunarHDAMap{}Env")):
    gymnasium.register(
        _name,
        entry_point=f"rl.environment.env:{_class.format('')}",
        vector_entry_point=f"rl.environment.vector_env:{_class.format('Vector')}",
        reward_threshold=0.25,
        max_episode_steps=20,
    )
for _entry in entries():
    hda.register_policy(_entry)
