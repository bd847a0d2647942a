"""Agents learn on measured looks, behind a filter and on a body; they resume to the bit, and fly there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hda.flight.episode import fly
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.environment.native.stepped_vector import SteppedVectorEnv
from rl.inference.artefacts import load_artefact
from rl.policies.catalogue import policy_from_card
from rl.recipes import RECIPES
from rl.settings import AgentSettings
from rl.training.actor_export import policy_of
from rl.training.run import make_environment, run_training
from rl.training.run_folder import TrainingPlan
from tests.equality import same

FEW: dict[str, Any] = {
    "hidden": (8, 8),
    "batch_size": 8,
    "random_steps": 8,
    "replay_size": 60,
    "update_every": 1,
}
TINY: dict[str, Any] = {"environments": 2, "horizon": 6, "batch_size": 6, "epochs": 1}
SMALL: dict[str, AgentSettings] = {
    **{name: replace(RECIPES[name], **FEW) for name in ("td3", "td3-belief", "td3-convex")},
    "ppo": replace(RECIPES["ppo"], hidden=(8, 8), **TINY),
    "recurrent-ppo": replace(RECIPES["recurrent-ppo"], hidden=(8,), memory=4, **TINY),
}


def learn_cut_and_whole(tmp_path: Path, preset: str, settings: AgentSettings, name: str) -> None:
    """A run that is cut resumes to the same weights, which fly on the preset when they are exported."""
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    plan = TrainingPlan(36, 0, name, 36, validation_episodes=1, checkpoint_every=6, log_every=12)
    run_training(whole, PRESETS[preset], settings, plan, resume=False)
    run_training(cut, PRESETS[preset], settings, replace(plan, steps=18), resume=False)
    assert list(cut.glob("checkpoint-*.json"))
    run_training(cut, PRESETS[preset], settings, plan, resume=True)
    a, b = (load_artefact(folder / "actors" / "step-000000036", "actor") for folder in (whole, cut))
    assert set(a.tensors) == set(b.tensors)
    assert all(np.array_equal(tensor, b.tensors[key]) for key, tensor in a.tensors.items())
    scenario = sample_scenario(preset, 0, 0, "tuning")
    shipped = fly(policy_from_card("agent", whole / "actors" / "step-000000036"), scenario)
    assert shipped.decisions
    assert all(np.isfinite(decision.site).all() for decision in shipped.decisions)
    kept = fly(policy_of(a.tensors, settings), scenario)  # as the run itself judged it
    assert same(kept.decisions, shipped.decisions)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["navigated", "rigid-body"])
@pytest.mark.parametrize("name", ["td3", "td3-belief", "td3-convex"])
def test_agents_learn_behind_a_filter_and_on_a_body(tmp_path: Path, name: str, preset: str) -> None:
    learn_cut_and_whole(tmp_path, preset, SMALL[name], name)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["lidar", "navigated", "rigid-body"])
@pytest.mark.parametrize("name", ["ppo", "recurrent-ppo"])
def test_proximal_policies_learn_on_measured_looks(tmp_path: Path, name: str, preset: str) -> None:
    learn_cut_and_whole(tmp_path, preset, SMALL[name], name)


@pytest.mark.parametrize("changes", [{"sight": "belief"}, {"guidance": "convex"}], ids=str)
@pytest.mark.parametrize("name", ["ppo", "recurrent-ppo"])
def test_proximal_policies_learn_on_beliefs_and_on_convex_guidance(
    tmp_path: Path, name: str, changes: dict[str, Any]
) -> None:
    settings = replace(SMALL[name], **changes)
    assert isinstance(make_environment(settings, PRESETS["paper"]), SteppedVectorEnv)
    learn_cut_and_whole(tmp_path, "paper", settings, name)
