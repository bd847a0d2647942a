"""Proximal policies by name: they learn in many environments, resume to the bit, and fly without torch."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hda.flight.episode import fly
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.environment.env import LunarHDAEnv
from rl.environment.native.vector_env import LunarHDAVectorEnv
from rl.inference.artefacts import Artefact, ArtefactError, load_artefact, save_artefact
from rl.learning.algorithms import make_algorithm
from rl.policies.actor import AgentPolicy
from rl.policies.recurrent_actor import RecurrentAgentPolicy, memory_actor_from_artefact
from rl.recipes import ON_POLICY_RECIPES, RECIPES, STEPS
from rl.settings import OnPolicySettings, settings_from_json
from rl.training.actor_export import actor_card, actor_tensors
from rl.training.candidates import Choice
from rl.training.export import ExportWeights, run_export
from rl.training.run import run_training
from rl.training.run_folder import TrainingPlan, read_rows
from rl.training.vector_adapter import StableBaselinesVector

PAPER = PRESETS["paper"]
TINY: dict[str, Any] = {"environments": 3, "horizon": 8, "batch_size": 12, "epochs": 2}
SMALL: dict[str, OnPolicySettings] = {
    "ppo": replace(ON_POLICY_RECIPES["ppo"], hidden=(16, 16), **TINY),
    "recurrent-ppo": replace(ON_POLICY_RECIPES["recurrent-ppo"], hidden=(16,), memory=8, **TINY),  # type: ignore[call-arg]
}
SMALL["ppo-thrust"] = replace(ON_POLICY_RECIPES["ppo-thrust"], hidden=(16, 16), **TINY)
NAMES = sorted(SMALL)


def plan(name: str, steps: int, seed: int = 0) -> TrainingPlan:
    return TrainingPlan(steps, seed, name, 48, validation_episodes=2, checkpoint_every=30, log_every=24)


def equal_tensors(a: Artefact, b: Artefact) -> bool:
    return set(a.tensors) == set(b.tensors) and all(
        np.array_equal(tensor, b.tensors[name]) for name, tensor in a.tensors.items()
    )


def newest(folder: Path, kind: str, pattern: str) -> Artefact:
    return load_artefact(sorted(folder.glob(f"{pattern}.json"))[-1].with_suffix(""), kind)


@pytest.mark.parametrize("name", NAMES)
def test_a_run_that_is_cut_in_flight_resumes_to_the_same_weights(name, tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    run_training(whole, PAPER, SMALL[name], plan(name, 192), resume=False)
    run_training(cut, PAPER, SMALL[name], plan(name, 110), resume=False)  # rounded up to 120
    assert [row["step"] for row in read_rows(cut / "training.csv")][-1] == "120"
    assert newest(cut, "checkpoint", "checkpoint-*").tensors["flight/index"].any()  # flights were under way
    run_training(cut, PAPER, SMALL[name], plan(name, 192), resume=True)
    a, b = (newest(folder, "checkpoint", "checkpoint-*") for folder in (whole, cut))
    assert equal_tensors(a, b)
    for part in ("counters", "generators", "episode_rewards", "window"):
        assert a.card[part] == b.card[part]
    assert equal_tensors(*(newest(folder / "actors", "actor", "step-*") for folder in (whole, cut)))
    for log in ("training.csv", "validation.csv"):
        rows = [
            [{k: v for k, v in row.items() if k != "seconds"} for row in read_rows(folder / log)]
            for folder in (whole, cut)
        ]
        assert rows[0] == rows[1] != []


def test_another_number_of_environments_does_not_resume(tmp_path):
    run_training(tmp_path, PAPER, SMALL["ppo"], plan("ppo", 48), resume=False)
    with pytest.raises(ValueError, match="another settings"):
        run_training(tmp_path, PAPER, replace(SMALL["ppo"], environments=4), plan("ppo", 96), resume=True)


def trained(name: str) -> tuple[Any, OnPolicySettings]:
    """A learner after some updates, so that no bias is zero."""
    settings = SMALL[name]
    vector = StableBaselinesVector(LunarHDAVectorEnv(settings.environments, preset=PAPER))
    algorithm: Any = make_algorithm(settings, vector, 3)
    algorithm.learn(72)
    return algorithm, settings


@pytest.mark.parametrize("name", ["ppo", "recurrent-ppo"])
def test_the_agent_flies_without_torch_what_the_learner_would(name, tmp_path):
    """The memory grows over the episode: each action is compared after all those before it."""
    algorithm, settings = trained(name)
    save_artefact(tmp_path / "agent", "actor", actor_tensors(algorithm), actor_card(settings))
    kind = AgentPolicy if name == "ppo" else RecurrentAgentPolicy
    policy, env = kind("agent", tmp_path / "agent"), LunarHDAEnv(split="train")
    for episode in range(2):
        scenario = sample_scenario("paper", 8, episode, "train")
        record = fly(policy, scenario)
        seen, _ = env.reset(options={"scenario": scenario})
        state, begins = None, np.ones(1, np.bool_)
        for decision, reward in zip(record.decisions, record.rewards, strict=True):
            action, state = algorithm.predict(seen, state, episode_start=begins, deterministic=True)
            begins[:] = False
            seen, gained, *_ = env.step(action)
            np.testing.assert_allclose(env.steps[-1].flight.target, decision.site, atol=1e-3)
            assert gained == pytest.approx(reward.total, abs=1e-4)


def test_actions_beyond_the_range_are_cut_and_not_squashed(tmp_path):
    """A mean of 3 flies as 1; tanh would make 0.995 of it."""
    algorithm, settings = trained("ppo")
    tensors = actor_tensors(algorithm)
    last = f"layer.{len(settings.hidden)}"
    tensors[f"{last}.weight"][:] = 0.0
    tensors[f"{last}.bias"][:] = np.array([3.0, -3.0, 0.5, 0.0, 0.0], np.float32)
    save_artefact(tmp_path / "agent", "actor", tensors, actor_card(settings))
    record = fly(AgentPolicy("agent", tmp_path / "agent"), sample_scenario("paper", 0, 0, "train"))
    command: Any = record.decisions[0].command
    assert (command.position_gain, command.velocity_gain) == (7.0, 1.0)


@pytest.mark.parametrize("name", NAMES)
def test_runs_are_exported(name, tmp_path):
    run = tmp_path / "run"
    run_training(run, PAPER, SMALL[name], plan(name, 48), resume=False)
    choice = Choice(averages=(1,), candidates=1, episodes=2)
    run_export(ExportWeights((run,), name, choice, validation_episodes=2, out=tmp_path))
    artefact = load_artefact(tmp_path / name, "actor")
    command = artefact.card["training"]["command"]
    assert command.startswith(f"python -m rl.train {name} --seed 0 --preset paper --steps 48")
    assert "--environments 3" in command
    assert "--algorithm" not in command
    assert settings_from_json(artefact.card["training"]["settings"]) == SMALL[name]


def test_weights_of_another_algorithm_are_refused(tmp_path):
    algorithm, settings = trained("recurrent-ppo")
    card = {**actor_card(settings), "algorithm": "ppo"}
    with pytest.raises(ArtefactError, match=r"algorithm' must be one with memory \(td3-lstm, "):
        memory_actor_from_artefact(Artefact("actor", actor_tensors(algorithm), card), tmp_path)
    card["algorithm"] = "td3-lstm"  # whose LSTM also sees the last action
    with pytest.raises(ArtefactError, match=r"lstm\.input"):
        memory_actor_from_artefact(Artefact("actor", actor_tensors(algorithm), card), tmp_path)


def test_what_cannot_be_learnt_is_refused():
    vector = StableBaselinesVector(LunarHDAVectorEnv(2, preset=PAPER))
    with pytest.raises(ValueError, match="batch_size must be at most environments times horizon = 16"):
        make_algorithm(replace(SMALL["ppo"], batch_size=17), vector, 0)
    with pytest.raises(ValueError, match="algorithm must be ppo with these settings, got 'td3'"):
        make_algorithm(replace(SMALL["ppo"], algorithm="td3"), vector, 0)


def test_thrust_goes_with_looks_and_without_memory(tmp_path):
    for changes in ({"sight": "belief"}, {"algorithm": "recurrent-ppo"}):
        with pytest.raises(ValueError, match="guidance thrust goes with sight look"):
            run_training(
                tmp_path, PAPER, replace(SMALL["ppo-thrust"], **changes), plan("ppo", 48), resume=False
            )
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", NAMES)
def test_no_run_goes_on_where_the_learning_rate_is_zero(name, tmp_path):
    settings, (_, end) = SMALL[name], SMALL[name].learning_rate_decay
    assert settings.learning_rate_at(end + 1) == 0.0 < settings.learning_rate_at(end - 1)
    settings.refuse_steps(end)
    message = f"steps must be at most {end}, .* --learning-rate-decay 0 {end + 1}"
    with pytest.raises(ValueError, match=message):
        run_training(tmp_path, PAPER, settings, plan(name, end + 1), resume=False)
    assert not any(tmp_path.iterdir())
    replace(settings, learning_rate_decay=(0, end + 1)).refuse_steps(end + 1)
    RECIPES["td3"].refuse_steps(10**9)  # its rate never comes to 0


def test_every_recipe_learns_for_all_steps_of_its_command():
    for name, recipe in RECIPES.items():
        recipe.refuse_steps(STEPS[name])


def test_the_page_says_what_each_recipe_has():
    page = (Path(__file__).parents[3] / "docs" / "explanation" / "agents.md").read_text(encoding="utf-8")
    table = page[page.index("| | `ppo` |") :].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    (_, *names), _, *said = rows
    recipes = {name.strip("`"): ON_POLICY_RECIPES[name.strip("`")] for name in names}
    assert set(recipes) == set(ON_POLICY_RECIPES)
    expected = {
        "steps": [f"{STEPS[name]:,}".replace(",", " ") for name in recipes],
        "environments": [str(one.environments) for one in recipes.values()],
        "decisions of each between updates": [str(one.horizon) for one in recipes.values()],
        "decisions of a gradient step": [str(one.batch_size) for one in recipes.values()],
        "deviation of the draws at the start": [f"$e^{one.log_deviation:g}$" for one in recipes.values()],
        "$\\lambda$ of the advantages": [f"{one.trace:g}" for one in recipes.values()],
    }
    assert {
        name: [cell.replace("{", "").replace("}", "") for cell in cells] for name, *cells in said
    } == expected


def test_thrusts_on_measured_looks_are_refused_with_the_way_out(tmp_path):
    with pytest.raises(ValueError, match="got 'lidar': thrusts are flown on paper, hard, partial"):
        run_training(tmp_path, PRESETS["lidar"], SMALL["ppo-thrust"], plan("ppo-thrust", 48), resume=False)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_settings_survive_their_card(name):
    recipe = RECIPES[name]
    assert settings_from_json(json.loads(json.dumps(asdict(recipe)))) == recipe
