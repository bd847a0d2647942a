"""Figures of learning show the logs, the looks and the decisions that they are made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hda
import rl  # noqa: F401 - registers the agents
from hda.flight.episode import fly
from hda.policy import ZemZevCommand
from hda.task.presets import PRESETS
from rl.figures import (
    GainsFigure,
    ReconstructionFigure,
    TrainingFigure,
    draw_gains,
    draw_reconstruction,
    draw_training,
)
from rl.inference.latent import load_autoencoder
from rl.learning.autoencoder import autoencoder_from_tensors, collect_maps, reconstruct
from tests.drawing import line_data


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "training.csv").write_text(
        "step,critic_loss,actor_loss,reward,safe_ratio\n"
        "10,4.0,-1.0,-3.0,0.0\n20,2.0,,-1.0,0.5\n30,1.0,-3.0,0.0,1.0\n"
    )
    (tmp_path / "validation.csv").write_text("step,reward,safe_site_percent\n15,-2.5,40.0\n30,0.5,90.0\n")
    return tmp_path


def test_a_training_figure_shows_each_log_as_it_is_and_smoothed(run: Path) -> None:
    panels = {panel.get_title(): panel for panel in draw_training(TrainingFigure(run, window=2)).axes}
    assert list(panels) == ["critic loss", "actor loss", "reward", "safe ratio"]
    critic: Any = panels["critic loss"].get_lines()[0]
    np.testing.assert_array_equal(critic.get_xydata(), [[10, 4], [20, 2], [30, 1]])
    np.testing.assert_allclose(line_data(panels["critic loss"], "while exploring")[1], [4.0, 3.0, 1.5])
    steps, loss = line_data(panels["actor loss"], "while exploring")  # of one step it is not known
    np.testing.assert_array_equal(steps, [10, 30])
    np.testing.assert_allclose(loss, [-1.0, -2.0])
    assert panels["critic loss"].get_yscale() == "log"
    assert {panel.get_yscale() for title, panel in panels.items() if title != "critic loss"} == {"linear"}
    assert {panel.get_xlabel() for panel in panels.values()} == {"environment steps"}


def test_a_training_figure_shows_the_policys_score_on_the_tuning_tiles(run: Path) -> None:
    panels = {panel.get_title(): panel for panel in draw_training(TrainingFigure(run)).axes}
    steps, reward = line_data(panels["reward"], "policy, tuning tiles")
    np.testing.assert_array_equal(steps, [15, 30])
    np.testing.assert_array_equal(reward, [-2.5, 0.5])
    np.testing.assert_allclose(line_data(panels["safe ratio"], "policy, tuning tiles")[1], [0.4, 0.9])


def test_reconstructions_stand_below_the_looks_that_they_are_of() -> None:
    columns = 3
    axes = draw_reconstruction(ReconstructionFigure(columns=columns)).axes
    assert len(axes) == 2 * columns
    assert (axes[0].get_ylabel(), axes[columns].get_ylabel()) == ("observed", "reconstructed")
    looks = np.array([axes[k].get_images()[0].get_array() for k in range(columns)])
    shown = np.array([axes[columns + k].get_images()[0].get_array() for k in range(columns)])
    flown = collect_maps(PRESETS["paper"], "validation", columns, 0)
    for look in looks:
        assert any(np.array_equal(look, one) for one in flown)
    expected = reconstruct(autoencoder_from_tensors(load_autoencoder().tensors), looks)
    np.testing.assert_allclose(shown, expected, atol=1e-6)
    assert {axes[k].get_images()[0].get_clim() for k in range(columns)} == {(0.0, 255.0)}
    assert {image.origin for panel in axes for image in panel.get_images()} == {"lower"}
    blurred = np.abs(shown - looks / 255.0).mean(axis=(1, 2))
    swapped = np.abs(shown[[1, 2, 0]] - looks / 255.0).mean(axis=(1, 2))
    assert blurred.mean() < 0.5 * swapped.mean()


def test_gains_are_those_of_each_decision() -> None:
    figure = draw_gains(GainsFigure(policy="td3", episode=2))
    record = fly(hda.make_policy("td3"), hda.sample_scenario("paper", 0, 2))
    commands = [decision.command for decision in record.decisions]
    assert all(isinstance(command, ZemZevCommand) for command in commands)
    flown: list[Any] = commands
    gains, rate, shift = figure.axes
    times = [observation.time for observation in record.observations]
    for label, values in (
        ("$K_R$", [command.position_gain for command in flown]),
        ("$K_V$", [command.velocity_gain for command in flown]),
    ):
        time, drawn = line_data(gains, label)
        np.testing.assert_array_equal(time, times)
        np.testing.assert_array_equal(drawn, values)
        assert len(set(values)) > 1
    (line,) = rate.get_lines()
    np.testing.assert_array_equal(line.get_ydata(), [command.time_to_go_rate for command in flown])
    targets = [observation.target for observation in record.observations]
    moved = [np.linalg.norm(d.site - target) for d, target in zip(record.decisions, targets, strict=True)]
    bars: Any = shift.patches
    np.testing.assert_allclose([bar.get_height() for bar in bars], moved)
    np.testing.assert_allclose([bar.get_x() + 0.5 * bar.get_width() for bar in bars], times)
    assert figure.get_suptitle() == f"td3, episode 2: {record.outcome.ending}"
