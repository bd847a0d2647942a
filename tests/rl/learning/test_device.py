from __future__ import annotations

from dataclasses import replace
from operator import attrgetter

import pytest
import torch

from examples.memory_task import Recall
from rl.learning.algorithms import make_algorithm
from rl.learning.device import choose_device
from rl.recipes import RECIPES
from rl.settings import OffPolicyAgentSettings, OnPolicySettings
from rl.train import TrainingOptions, run_agent_training
from rl.training import run as training_run  # what imports `prepare_tiles` by name has the true one


@pytest.mark.parametrize("with_memory", [True, False])
@pytest.mark.parametrize("seen", [True, False])
def test_a_gpu_is_taken_by_itself_only_for_memory(with_memory, seen, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: seen)
    assert choose_device("auto", with_memory) == ("cuda" if seen and with_memory else "cpu")
    assert choose_device("cpu", with_memory) == "cpu"
    if seen:
        assert choose_device("cuda", with_memory) == "cuda"


def test_a_gpu_that_torch_does_not_see_is_refused_before_ground_is_made(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr("hda.ground.library.prepare_tiles", lambda *_: pytest.fail("ground was made"))
    with pytest.raises(ValueError, match="torch sees no GPU here; pass --device cpu"):
        run_agent_training(TrainingOptions(RECIPES["td3"], device="cuda"), "td3")


@pytest.mark.parametrize(("name", "device"), [("td3", "cpu"), ("ppo", "cpu"), ("td3-lstm", "cuda")])
def test_the_command_trains_on_the_chosen_device(name, device, monkeypatch):
    reached = []
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr("hda.ground.library.prepare_tiles", lambda *_: None)
    monkeypatch.setattr(training_run, "run_training", lambda *given: reached.append(given[-1]))
    run_agent_training(TrainingOptions(RECIPES[name]), name)
    assert reached == [device]


@pytest.mark.filterwarnings("ignore:You are trying to run PPO on the GPU:UserWarning")
@pytest.mark.parametrize(
    "name", ["td3", "sac", "ddpg", "tqc", "td3-lstm", "td3-lstm-plus", "ppo", "recurrent-ppo"]
)
def test_every_learner_is_where_it_is_told_to_be(name):
    """The device "meta" computes nothing, and any machine has it."""
    if name in ("tqc", "recurrent-ppo"):
        pytest.importorskip("sb3_contrib")
    from stable_baselines3.common.vec_env import DummyVecEnv

    settings = RECIPES[name]
    env = Recall()
    if isinstance(settings, OnPolicySettings):
        settings, env = replace(settings, hidden=(8,), batch_size=16), DummyVecEnv([Recall])
    else:
        assert isinstance(settings, OffPolicyAgentSettings)
        settings = replace(settings, hidden=(8,), replay_size=64)
    algorithm = make_algorithm(settings, env, 0, "meta")
    assert algorithm.device == torch.device("meta")
    modules = algorithm._get_torch_save_params()[0]  # what a checkpoint keeps: networks, targets, optimisers
    networks = [attrgetter(module)(algorithm) for module in modules if "optimizer" not in module]
    assert networks
    assert {weight.device.type for network in networks for weight in network.parameters()} == {"meta"}
