"""Shipped agents as policies of `hda`: an actor's site, gains and clock.

`catalogue` lists them for the registry. Nothing of torch or of learning is imported.
"""

from typing import TYPE_CHECKING

from guidance.exports import lazy_exports

if TYPE_CHECKING:
    from rl.policies.actor import AgentPolicy, AgentSite
    from rl.policies.catalogue import entries, policy_from_card
    from rl.policies.recurrent_actor import RecurrentAgentPolicy

_HOMES = {
    "rl.policies.actor": (
        "AgentPolicy",
        "AgentSite",
    ),
    "rl.policies.catalogue": (
        "entries",
        "policy_from_card",
    ),
    "rl.policies.recurrent_actor": ("RecurrentAgentPolicy",),
}

__all__ = [
    "AgentPolicy",
    "AgentSite",
    "RecurrentAgentPolicy",
    "entries",
    "policy_from_card",
]

__getattr__, __dir__ = lazy_exports(
    __name__, {name: home for home, names in _HOMES.items() for name in names}
)
