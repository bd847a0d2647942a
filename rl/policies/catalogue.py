"""The trained agents by name, as far as their weights are shipped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import ComposedPolicy
from hda.policies.entry import PolicyEntry
from hda.policies.zem_zev import FixedGainZemZev
from rl.inference.artefacts import read_card
from rl.policies.actor import AgentPolicy, AgentSite, shipped, weights_name
from rl.policies.recurrent_actor import RecurrentAgentPolicy
from rl.settings import WITH_MEMORY

_AGENTS = {
    "td3": "the paper's agent without memory: moves the target, the gains and the time to go",
    "sac": "the same agent trained with soft actor-critic",
    "td3-lstm": "the paper's agent with memory: TD3 with LSTM, Algorithm 3",
    "td3-lstm-plus": "the same with one masked memory, the last reward in the history, an encoder per role",
    "td3-convex": "moves the target alone; convex guidance flies to it, as in its training",
    "td3-belief": "sees the belief that all looks have left in place of the last one",
    "td3-belief-convex": "sees the belief, moves the target alone; convex guidance flies to it",
    "ppo": "the same agent trained by proximal policy optimisation",
    "recurrent-ppo": "the same with memory: an LSTM of what was seen",
    "ppo-thrust": "gives the thrust itself, without a guidance law; the lander tracks what it foretells",
    "td3-paper": "the plain recipe: the printed observation vector, TD3 as its authors published it",
}


def policy_from_card(name: str, weights: Path) -> AgentPolicy | RecurrentAgentPolicy:
    """An agent as a policy: with memory where the card of its weights says so.

    Args:
        name: in tables.
        weights: file name without suffix; the weights are verified in flight.

    Raises:
        ArtefactError: the card is missing or damaged.
    """
    remembers = read_card(weights.with_suffix(".json"), "actor").get("algorithm") in WITH_MEMORY
    return (RecurrentAgentPolicy if remembers else AgentPolicy)(name, weights)


def _agent(agent: str, preset: str = "paper") -> PolicyEntry:
    """An agent as it was trained on a preset; that of `paper` belongs in every table."""
    name, summary = weights_name(agent, preset), _AGENTS[agent]
    entry = PolicyEntry(name, lambda: policy_from_card(name, shipped(name)), summary)
    if preset == "paper":
        return entry
    return replace(entry, summary=f"{summary}; trained on {preset}", preset=preset)


_ENTRIES = (
    ("td3", _agent("td3")),
    (
        "td3",
        PolicyEntry(
            "td3-fixed-gain",
            lambda: ComposedPolicy("td3-fixed-gain", AgentSite(shipped("td3")), FixedGainZemZev()),
            "the paper's Fixed Control: the sites of td3, gains 6/2, time to go of the quartic",
        ),
    ),
    (
        "td3",
        PolicyEntry(
            "td3+convex",
            lambda: ComposedPolicy("td3+convex", AgentSite(shipped("td3")), AdjustedDescent()),
            "the sites of td3, flown by convex guidance",
        ),
    ),
    ("sac", _agent("sac")),
    ("td3-lstm", _agent("td3-lstm")),
    ("td3-lstm-plus", _agent("td3-lstm-plus")),
    ("td3-paper", _agent("td3-paper")),
    ("td3-convex", _agent("td3-convex")),
    ("td3-belief", _agent("td3-belief")),
    ("td3-belief-convex", _agent("td3-belief-convex")),
    ("ppo", _agent("ppo")),
    ("recurrent-ppo", _agent("recurrent-ppo")),
    ("ppo-thrust", _agent("ppo-thrust")),
    *(
        (weights_name(agent, "partial"), _agent(agent, "partial"))
        for agent in ("td3", "td3-lstm", "td3-lstm-plus", "td3-belief", "td3-belief-convex")
    ),
    (weights_name("td3", "lidar"), _agent("td3", "lidar")),
)


def entries() -> tuple[PolicyEntry, ...]:
    """Registry lines of the agents whose weight cards are there; the weights are verified in flight."""
    return tuple(entry for weights, entry in _ENTRIES if shipped(weights).with_suffix(".json").exists())
