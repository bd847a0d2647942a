from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from hda.task.presets import PRESETS
from rl.inference.artefacts import ArtefactError, load_artefact, save_artefact
from rl.learning.algorithms import make_algorithm
from rl.learning.recurrent.hyperparameters import Hyperparameters
from rl.recipes import RECIPES
from rl.training.checkpoint import KIND, newest_checkpoint, restore_checkpoint
from rl.training.export import ExportWeights, run_export
from rl.training.run import make_environment, run_training
from rl.training.run_folder import TrainingPlan, read_rows

PAPER = PRESETS["paper"]
SMALL = {
    name: replace(RECIPES[name], hidden=(16, 16), batch_size=16, random_steps=40, replay_size=90)
    for name in ("td3", "sac", "ddpg", "tqc", "td3-convex", "td3-belief")
}
"""Networks and a replay memory so small that it wraps around within a test."""


def plan(steps: int, seed: int = 0) -> TrainingPlan:
    return TrainingPlan(
        steps, seed, validate_every=50, validation_episodes=2, checkpoint_every=30, log_every=20
    )


def weights(folder, step: int):
    return load_artefact(folder / "actors" / f"step-{step:09d}", "actor").tensors


def assert_equal_weights(a, b):
    assert set(a) == set(b)
    for name in a:
        np.testing.assert_array_equal(a[name], b[name])


def columns(path, *dropped):
    return [{k: v for k, v in row.items() if k not in dropped} for row in read_rows(path)]


@pytest.mark.parametrize("name", SMALL)
def test_a_run_that_is_cut_resumes_to_the_same_weights(name, tmp_path):
    if name == "tqc":
        pytest.importorskip("sb3_contrib")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    run_training(whole, PAPER, SMALL[name], plan(150), resume=False)
    run_training(cut, PAPER, SMALL[name], plan(110), resume=False)
    assert list(cut.glob("checkpoint-*.json"))
    run_training(cut, PAPER, SMALL[name], plan(150), resume=True)
    assert_equal_weights(weights(whole, 150), weights(cut, 150))
    last = [sorted(folder.glob("checkpoint-*.json"))[-1].with_suffix("") for folder in (whole, cut)]
    assert last[0].name == last[1].name
    a, b = (load_artefact(path, "checkpoint") for path in last)
    assert_equal_weights(a.tensors, b.tensors)
    assert a.card["counters"] == b.card["counters"]
    assert a.card["generators"] == b.card["generators"]
    for log in ("training.csv", "validation.csv"):
        assert columns(whole / log, "seconds") == columns(cut / log, "seconds")


@pytest.mark.parametrize("every", [1, 2, 5])
def test_updates_come_every_so_many_steps(every, tmp_path):
    run_training(tmp_path, PAPER, replace(SMALL["td3"], update_every=every), plan(100), resume=False)
    last = read_rows(tmp_path / "training.csv")[-1]
    assert int(last["step"]) == 100
    assert int(last["updates"]) == sum(step > 40 for step in range(every, 101, every))


def test_same_seed_same_weights_and_another_seed_others(tmp_path):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        run_training(tmp_path / name, PAPER, SMALL["td3"], plan(100, seed), resume=False)
    a, b, c = (weights(tmp_path / name, 100) for name in "abc")
    assert_equal_weights(a, b)
    assert not np.array_equal(a["layer.0.weight"], c["layer.0.weight"])


def test_weights_move_and_logs_are_whole(tmp_path):
    run_training(tmp_path / "run", PAPER, SMALL["td3"], plan(100), resume=False)
    assert not np.array_equal(
        weights(tmp_path / "run", 50)["layer.0.weight"], weights(tmp_path / "run", 100)["layer.0.weight"]
    )
    rows = read_rows(tmp_path / "run" / "training.csv")
    assert [int(row["step"]) for row in rows] == [20, 40, 60, 80, 100]
    assert int(rows[-1]["updates"]) == 60
    assert float(rows[-1]["critic_loss"]) > 0.0
    validation = read_rows(tmp_path / "run" / "validation.csv")
    assert [int(row["step"]) for row in validation] == [50, 100]
    assert 0.0 <= float(validation[0]["safe_site_percent"]) <= 100.0


def test_a_run_is_not_overwritten_or_resumed_with_other_settings(tmp_path):
    folder = tmp_path / "run"
    run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    with pytest.raises(ValueError, match="--resume"):
        run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    with pytest.raises(ValueError, match="another seed"):
        run_training(folder, PAPER, SMALL["td3"], plan(60, seed=1), resume=True)
    with pytest.raises(ValueError, match="another settings"):
        run_training(folder, PAPER, replace(SMALL["td3"], discount=0.9), plan(60), resume=True)


def test_a_run_from_before_a_setting_was_added_goes_on(tmp_path):
    folder = tmp_path / "run"
    run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    card = json.loads((folder / "run.json").read_text())
    for name in ("sight", "guidance", "update_every"):
        del card["settings"][name]
    del card["device"]
    (folder / "run.json").write_text(json.dumps(card))
    run_training(folder, PAPER, SMALL["td3"], plan(80), resume=True)
    assert read_rows(folder / "training.csv")[-1]["step"] == "80"


def test_a_run_resumes_on_another_device_and_says_so(tmp_path, capsys):
    run_training(tmp_path, PAPER, SMALL["td3"], plan(60), resume=False)
    assert json.loads((tmp_path / "run.json").read_text())["device"] == "cpu"
    run_training(tmp_path, PAPER, SMALL["td3"], plan(70), resume=True)
    assert "goes on on" not in capsys.readouterr().out
    path = newest_checkpoint(tmp_path)
    assert path is not None
    kept = load_artefact(path, "checkpoint")
    save_artefact(path, "checkpoint", kept.tensors, {**kept.card, "device": "cuda"})
    run_training(tmp_path, PAPER, SMALL["td3"], plan(80), resume=True)
    assert "it learnt on cuda so far, and goes on on cpu" in capsys.readouterr().out


def test_a_gpu_that_resumes_a_run_of_the_processor_draws_by_its_seed(tmp_path, monkeypatch):
    import torch

    run_training(tmp_path, PAPER, SMALL["td3"], plan(60, seed=3), resume=False)
    env = make_environment(SMALL["td3"], PAPER)
    algorithm = make_algorithm(SMALL["td3"], env, 3)
    seeds = []
    monkeypatch.setattr(torch.cuda, "manual_seed", seeds.append)
    checkpoint = newest_checkpoint(tmp_path)
    assert checkpoint is not None
    restore_checkpoint(checkpoint, algorithm, env)
    assert seeds == []
    algorithm.device = torch.device("cuda")
    restore_checkpoint(checkpoint, algorithm, env)
    assert seeds == [3]


@pytest.mark.parametrize("every", [0, -1, 1.5])
def test_an_update_takes_at_least_one_step(every):
    with pytest.raises(ValueError, match=f"update_every must be an integer of at least 1, got {every}"):
        replace(SMALL["td3"], update_every=every)
    with pytest.raises(ValueError, match="update_every"):
        Hyperparameters(update_every=every)


def test_a_run_with_a_setting_of_another_version_is_refused(tmp_path):
    folder = tmp_path / "run"
    run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    card = json.loads((folder / "run.json").read_text())
    card["settings"] |= {"temperature": 1.0, "momentum": 0.9}
    (folder / "run.json").write_text(json.dumps(card))
    message = "settings of another version: momentum, temperature"
    with pytest.raises(ValueError, match=message):
        run_training(folder, PAPER, SMALL["td3"], plan(80), resume=True)
    with pytest.raises(ValueError, match=message):
        run_export(ExportWeights((folder,), "agent", out=tmp_path))


def test_a_damaged_checkpoint_is_refused(tmp_path):
    folder = tmp_path / "run"
    run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    checkpoint = next(folder.glob("checkpoint-*.safetensors"))
    content = bytearray(checkpoint.read_bytes())
    content[-5] ^= 1
    checkpoint.write_bytes(bytes(content))
    with pytest.raises(ArtefactError, match="does not match its card"):
        run_training(folder, PAPER, SMALL["td3"], plan(80), resume=True)


def test_a_damaged_card_is_named_and_the_checkpoint_before_it_is_taken(tmp_path, capsys):
    for step in (30, 60):
        save_artefact(tmp_path / f"checkpoint-{step:09d}", KIND, {"a": np.zeros(1)}, {})
    newest = tmp_path / "checkpoint-000000060.json"
    assert newest_checkpoint(tmp_path) == newest.with_suffix("")
    assert capsys.readouterr().err == ""
    newest.write_text(newest.read_text()[:-9])
    assert newest_checkpoint(tmp_path) == tmp_path / "checkpoint-000000030"
    words = capsys.readouterr().err
    assert words.startswith(f"passed over: {newest} is damaged or not a JSON card")
    (tmp_path / "checkpoint-000000030.json").write_text("{}")
    with pytest.raises(ArtefactError, match=r"no checkpoint in .* is whole"):
        newest_checkpoint(tmp_path)
    assert capsys.readouterr().err.count("passed over: ") == 2


def test_a_run_without_a_whole_checkpoint_keeps_its_log(tmp_path):
    folder = tmp_path / "run"
    run_training(folder, PAPER, SMALL["td3"], plan(60), resume=False)
    record, log = ((folder / name).read_bytes() for name in ("run.json", "validation.csv"))
    for card in folder.glob("checkpoint-*.json"):
        card.write_text("{}")
    with pytest.raises(ArtefactError, match="whole: train in another --out"):
        run_training(folder, PAPER, SMALL["td3"], plan(80), resume=True)
    assert (folder / "validation.csv").read_bytes() == log
    assert (folder / "run.json").read_bytes() == record


def test_fast_update_equals_that_of_sb3(tmp_path):
    """Same replay, weights and random numbers: FastTD3 and SB3's TD3 agree to rounding."""
    import torch
    from stable_baselines3 import TD3

    from rl.environment.env import LunarHDAEnv
    from rl.learning.precision import matmul_precision
    from rl.learning.td3 import FastTD3

    rng = np.random.default_rng(0)
    models = []
    data = [rng.normal(size=(64, n)).astype(np.float32) for n in (44, 44, 5)]
    for kind in (TD3, FastTD3):
        model = kind(
            "MlpPolicy",
            LunarHDAEnv(),
            seed=0,
            buffer_size=64,
            policy_kwargs={"net_arch": [16, 16]},
            device="cpu",
        )
        model._setup_learn(1, None)
        assert model.replay_buffer is not None
        for k in range(64):
            action = np.clip(data[2][k], -1, 1)
            done = np.array([k % 8 == 7])
            model.replay_buffer.add(data[0][k], data[1][k], action, np.array([0.1 * k]), done, [{}])
        torch.manual_seed(5)
        np.random.seed(5)  # noqa: NPY002 - SB3's replay memory draws from it
        with matmul_precision("highest"):
            model.train(6, 32)
        models.append(model)
    for a, b in zip(models[0].policy.parameters(), models[1].policy.parameters(), strict=True):
        torch.testing.assert_close(a, b, rtol=2e-5, atol=2e-6)
    assert models[0]._n_updates == models[1]._n_updates == 6


def test_the_command_line_trains_and_explains_itself(tmp_path, monkeypatch, capsys):
    from rl.train import main

    folder = tmp_path / "run"
    small = ["--random-steps", "20", "--batch-size", "8", "--hidden", "8", "8", "--replay-size", "100"]
    few = ["--steps", "40", "--validate-every", "40", "--validation-episodes", "2"]
    monkeypatch.setattr(sys, "argv", ["train", "td3", "--out", str(folder), *small, *few])
    main()
    with (folder / "validation.csv").open() as file:
        assert [row["step"] for row in csv.DictReader(file)] == ["40"]
    monkeypatch.setattr(sys, "argv", ["train", "td3", "--steps", "0"])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    assert capsys.readouterr().err.startswith("error: steps must be at least 1")
    monkeypatch.setattr(sys, "argv", ["train", "td3", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert "--learning-rate" in capsys.readouterr().out
