from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats

from hda.flight.episode import fly
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.figures import GainsFigure, TrainingFigure, draw_gains, draw_training, moving_average
from rl.inference.artefacts import load_artefact
from rl.policies.actor import AgentPolicy
from rl.recipes import RECIPES
from rl.training.candidates import Choice, average_tensors, best_of_run
from rl.training.export import ExportWeights, run_export
from rl.training.run import run_training
from rl.training.run_folder import TrainingPlan

SMALL = replace(RECIPES["sac"], hidden=(8, 8), batch_size=8, random_steps=20, replay_size=100)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for seed in (0, 1):
        plan = TrainingPlan(
            60, seed, "sac", validate_every=30, validation_episodes=2, checkpoint_every=1000, log_every=10
        )
        run_training(folder / str(seed), PRESETS["paper"], SMALL, plan, resume=False)
    return folder / "0", folder / "1"


def test_exported_weights_fly_and_tell_where_they_came_from(runs, tmp_path):
    choice = Choice(averages=(1, 2), candidates=2, episodes=2)
    run_export(ExportWeights(runs, "sac", choice, validation_episodes=2, out=tmp_path / "weights"))
    artefact = load_artefact(tmp_path / "weights" / "sac", "actor")
    training = artefact.card["training"]
    assert [seed["seed"] for seed in training["seeds"]] == [0, 1]
    assert (training["recipe"], training["planned_steps"]) == ("sac", 60)
    assert training["command"].startswith(f"python -m rl.train sac --seed {training['seed']} --preset paper")
    assert "--hidden 8 8" in training["command"]
    assert "--learning-rate" not in training["command"]
    folder = runs[training["seed"]] / "actors"
    actors = [load_artefact(folder / f"step-{step:09d}", "actor").tensors for step in training["steps"]]
    for name, tensor in artefact.tensors.items():
        expected = sum(np.asarray(actor[name], np.float64) for actor in actors) / len(actors)
        np.testing.assert_allclose(tensor, expected, atol=1e-6)
    best = max(training["seeds"], key=lambda s: (s["tuning"]["success_percent"], s["tuning"]["reward"]))
    assert best["seed"] == training["seed"]
    record = fly(AgentPolicy("sac", tmp_path / "weights" / "sac"), sample_scenario("paper", 8, 0, "train"))
    assert len(record.decisions) >= 1


def test_the_choice_does_not_depend_on_the_processes(runs):
    choice = Choice(averages=(1, 2), candidates=3, episodes=2)
    one, two = (best_of_run(runs[0], choice, workers) for workers in (1, 2))
    assert (one.seed, one.steps, one.score) == (two.seed, two.steps, two.score)
    for name, tensor in one.tensors.items():
        np.testing.assert_array_equal(two.tensors[name], tensor)


@pytest.mark.parametrize(("last", "steps"), [(0, {30, 60}), (1, {60}), (2, {30, 60})])
def test_only_the_last_actors_are_judged(last, steps, runs, monkeypatch):
    choice = Choice(averages=(1,), candidates=9, episodes=2, last=last)
    flown = []
    monkeypatch.setattr(
        "rl.inference.artefacts.load_artefact",
        lambda path, kind: flown.append(int(path.name.removeprefix("step-"))) or load_artefact(path, kind),
    )
    assert set(best_of_run(runs[0], choice, 1).steps) <= steps
    assert set(flown) == steps


@given(arrays(np.float32, (4, 3), elements=floats(-10, 10, width=32)))
def test_the_mean_of_actors_is_the_mean_of_each_weight(weights):
    mean = average_tensors([{"bias": row, "twice": 2 * row} for row in weights])
    np.testing.assert_allclose(mean["bias"], weights.mean(0), atol=1e-5)
    np.testing.assert_allclose(mean["twice"], 2 * mean["bias"], atol=1e-5)
    np.testing.assert_array_equal(average_tensors([{"bias": weights[0]}])["bias"], weights[0])


def test_actors_of_different_kinds_are_not_averaged():
    with pytest.raises(ValueError, match="one kind"):
        average_tensors([{"bias": np.zeros(1)}, {"weight": np.zeros(1)}])
    with pytest.raises(ValueError, match="one kind"):
        average_tensors([])


def test_runs_that_do_not_belong_together_are_refused(runs, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    card = json.loads((runs[0] / "run.json").read_text())
    card["settings"]["discount"] = 0.5
    (other / "run.json").write_text(json.dumps(card))
    with pytest.raises(ValueError, match="same settings"):
        run_export(ExportWeights((runs[0], other), "sac"))
    with pytest.raises(ValueError, match="not a run"):
        run_export(ExportWeights((tmp_path / "nowhere",), "sac"))


def test_figures_of_a_run(runs, tmp_path):
    figure = draw_training(TrainingFigure(runs[0], window=2))
    assert [panel.get_title() for panel in figure.axes] == [
        "critic loss",
        "actor loss",
        "reward",
        "safe ratio",
    ]
    figure.savefig(tmp_path / "training.png")
    with pytest.raises(ValueError, match=r"training\.csv"):
        draw_training(TrainingFigure(tmp_path))


def test_figure_of_gains_shows_each_decision(tmp_path):
    figure = draw_gains(GainsFigure(policy="nearest-safe", episode=0))
    line = figure.axes[0].get_lines()[0]
    np.testing.assert_array_equal(np.asarray(line.get_ydata()), 6.0)
    figure.savefig(tmp_path / "gains.png")


def test_moving_average_equals_its_definition():
    values = np.random.default_rng(0).normal(size=30)
    expected = [values[max(0, k - 4) : k + 1].mean() for k in range(30)]
    np.testing.assert_allclose(moving_average(values, 5), expected, atol=1e-12)
