from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from hda.flight.episode import fly
from hda.policies.composition import ComposedPolicy
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import Policy, ZemZevCommand
from hda.registry import make_policy
from hda.task.scenario import sample_scenario
from rl.environment.env import LunarHDAEnv
from rl.inference.artefacts import ArtefactError, card_digest, save_artefact
from rl.policies.actor import AgentPolicy, AgentSite, load_actor
from rl.policies.catalogue import entries
from rl.recipes import RECIPES
from rl.training.actor_export import actor_card

SIZES = (44, 256, 256, 5)
SHIPPED = [entry.name for entry in entries()]


def random_tensors(seed: int = 0, sizes: tuple[int, ...] = SIZES):
    rng = np.random.default_rng(seed)
    tensors = {}
    for k, (rows, columns) in enumerate(pairwise(sizes)):
        tensors[f"layer.{k}.weight"] = rng.normal(0, rows**-0.5, (rows, columns)).astype(np.float32)
        tensors[f"layer.{k}.bias"] = rng.normal(0, 0.1, columns).astype(np.float32)
    return tensors


@pytest.fixture
def weights(tmp_path):
    save_artefact(tmp_path / "agent", "actor", random_tensors(), actor_card(RECIPES["td3"]))
    yield tmp_path / "agent"
    load_actor.cache_clear()


def test_the_network_equals_torch(weights):
    import torch

    tensors = random_tensors()
    rows = np.random.default_rng(1).normal(size=(20, 44)).astype(np.float32)
    values = torch.from_numpy(rows)
    for k in range(3):
        values = values @ torch.from_numpy(tensors[f"layer.{k}.weight"]) + torch.from_numpy(
            tensors[f"layer.{k}.bias"]
        )
        values = torch.relu(values) if k < 2 else values
    network = load_actor(weights).network
    np.testing.assert_allclose([network.evaluate(row) for row in rows], values.numpy(), atol=1e-5)


def test_an_agent_is_a_policy_without_hidden_state(weights):
    policy = AgentPolicy("agent", weights)
    assert isinstance(policy, Policy)
    first, second = (sample_scenario("paper", 3, k, "train") for k in range(2))
    alone = fly(policy, first)
    fly(policy, second)
    again = fly(AgentPolicy("agent", weights), first)
    np.testing.assert_array_equal(alone.path, again.path)
    assert alone.total_reward == again.total_reward


@pytest.mark.parametrize("episode", range(3))
def test_the_agent_in_the_environment_equals_the_agent_in_fly(weights, episode):
    scenario = sample_scenario("paper", 8, episode, "train")
    record = fly(AgentPolicy("agent", weights), scenario)
    env = LunarHDAEnv()
    vector, _ = env.reset(options={"scenario": scenario})
    network = load_actor(weights).network
    terminated = truncated = False
    for k in range(len(record.decisions)):
        vector, reward, terminated, truncated, _ = env.step(np.tanh(network.evaluate(vector)))
        assert reward == record.rewards[k].total
        np.testing.assert_array_equal(env.steps[k].flight.target, record.decisions[k].site)
    assert terminated or truncated


@pytest.mark.parametrize("preset", ["paper", "partial", "navigated"])
@pytest.mark.parametrize("name", ["td3-convex", "td3-belief", "td3-belief-convex"])
def test_an_agent_of_another_sight_or_guidance_flies_in_the_environment_as_in_fly(name, preset, tmp_path):
    recipe = replace(RECIPES[name], hidden=(16,))
    env = LunarHDAEnv(preset, sight=recipe.sight, guidance=recipe.guidance)
    assert env.observation_space.shape is not None
    tensors = random_tensors(2, (env.observation_space.shape[0], 16, env.steering.size))
    save_artefact(tmp_path / "agent", "actor", tensors, actor_card(recipe))
    scenario = sample_scenario(preset, 8, 2, "train")
    record = fly(AgentPolicy("agent", tmp_path / "agent"), scenario)
    vector, _ = env.reset(options={"scenario": scenario})
    network = load_actor(tmp_path / "agent").network
    over = False
    for reward, decision in zip(record.rewards, record.decisions, strict=True):
        vector, gained, terminated, truncated, _ = env.step(np.tanh(network.evaluate(vector)))
        assert gained == reward.total
        np.testing.assert_array_equal(env.steps[-1].flight.target, decision.site)
        over = terminated or truncated
    assert over


def test_fixed_gain_takes_the_agents_sites_and_nothing_else(weights):
    scenario = sample_scenario("paper", 8, 0, "train")
    policy = ComposedPolicy("fixed", AgentSite(weights), FixedGainZemZev())
    record = fly(policy, scenario)
    for observation, decision in zip(record.observations, record.decisions, strict=True):
        actor: Any = load_actor(weights)
        site = actor.decide(observation, actor.begin(scenario.view))[0].site
        np.testing.assert_array_equal(decision.site, site)
        assert isinstance(decision.command, ZemZevCommand)
        assert (decision.command.position_gain, decision.command.velocity_gain) == (6.0, 2.0)
        assert decision.command.time_to_go_rate == 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"encoding_version": 99}, "encoding_version 99"),
        ({"autoencoder": "0" * 64}, "autoencoder"),
        ({"layout": "square"}, "layout"),
        ({"layout": ["curved"]}, "layout"),
        ({"hidden": [8, 8]}, "layer 0 must be"),
        ({"hidden": "wide"}, "hidden"),
        ({"action_ranges": {"gain": 3}}, "action_ranges"),
        ({"sight": "ears"}, "unknown sight"),
        ({"guidance": "hope"}, "unknown guidance"),
        ({"guidance": ["convex"]}, "unknown guidance"),
        ({"algorithm": "a2c"}, "unknown algorithm 'a2c'"),
        ({"algorithm": None}, "unknown algorithm None"),
        ({"guidance": "thrust", "sight": "belief"}, "guidance thrust goes with sight look"),
        ({"guidance": "thrust", "algorithm": "recurrent-ppo"}, "an agent without memory"),
    ],
)
def test_weights_of_another_version_are_refused_when_the_policy_begins(weights, change, message):
    card = weights.with_suffix(".json")
    changed = {**json.loads(card.read_text()), **change}
    card.write_text(json.dumps({**changed, "card_sha256": card_digest(changed)}))
    scenario = sample_scenario("paper", 8, 0, "train")
    with pytest.raises(ArtefactError, match=message):
        fly(AgentPolicy("agent", weights), scenario)


def test_tampered_weights_fly_nothing(weights):
    file = weights.with_suffix(".safetensors")
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(bytes(content))
    with pytest.raises(ArtefactError, match="does not match its card"):
        fly(AgentPolicy("agent", weights), sample_scenario("paper", 8, 0, "train"))
    file.unlink()
    with pytest.raises(ArtefactError, match="cannot read the weights"):
        AgentPolicy("agent", weights).begin(
            sample_scenario("paper", 8, 0, "train").view, np.random.default_rng(0)
        )


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_agents_fly(name):
    record = fly(make_policy(name), sample_scenario("paper", 8, 1, "train"))
    assert record.policy == name


def test_agents_fly_without_torch():
    code = """
import sys, rl, hda
from rl.inference.latent import load_encoder
load_encoder()
scenario = hda.sample_scenario("paper", 8, 0, "train")
for entry in rl.policies.catalogue.entries():
    hda.fly(hda.make_policy(entry.name), scenario)
assert "torch" not in sys.modules
print("ok")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout.strip() == "ok", done.stderr
