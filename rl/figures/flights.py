"""Pictures of flights: an agent's commands, and two policies on one episode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rl.figures.options import ComparisonFigure, GainsFigure
from rl.figures.sheet import open_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hda.flight.record import EpisodeRecord


def draw_gains(options: GainsFigure) -> Figure:
    """Gains, rate of time and shift of the target at each decision."""
    record = fly_episode(options.policy, options.preset, options.study_seed, options.episode)
    time = [observation.time for observation in record.observations]
    commands: Any = [decision.command for decision in record.decisions]
    figure = open_figure(7.0, 6.0)
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    upper.step(time, [c.position_gain for c in commands], ".-", where="post", label="$K_R$")
    upper.step(time, [c.velocity_gain for c in commands], ".-", where="post", label="$K_V$")
    upper.legend()
    upper.set_ylabel("gain")
    middle.step(time, [c.time_to_go_rate for c in commands], ".-", where="post")
    middle.set_ylabel("rate of time to go")
    moved = [
        np.linalg.norm(decision.site - observation.target)
        for observation, decision in zip(record.observations, record.decisions, strict=True)
    ]
    lower.bar(time, moved)
    lower.set_ylabel("target moved [m]")
    lower.set_xlabel("time [s]")
    figure.suptitle(f"{options.policy}, episode {options.episode}: {record.outcome.ending}")
    return figure


def draw_comparison(options: ComparisonFigure) -> Figure:
    """Ground track over the true safety map, velocity and thrust of two policies on one episode.

    Raises:
        ValueError: on none of the episodes does the agent land safely and the other not.
    """
    from hda.flight.picture import draw_ground_track, draw_thrust, draw_velocity

    names = (options.agent, options.other)
    for episode in range(options.search):
        records = [fly_episode(name, options.preset, options.study_seed, episode) for name in names]
        if [record.outcome.safe_site for record in records] == [True, False]:
            break
    else:
        raise ValueError(
            f"on none of {options.search} episodes does {options.agent} land on safe ground and"
            f" {options.other} not; a greater --search may find one"
        )
    figure = open_figure(10.0, 8.0)
    panels: Any = figure.subplots(3, 2, height_ratios=[2.2, 1, 1])
    for (ground, speed, thrust), record in zip(panels.T, records, strict=True):
        draw_ground_track(ground, record)
        ground.set_title(f"{record.policy}: {record.outcome.ending}")
        draw_velocity(speed, record)
        draw_thrust(thrust, record)
    figure.suptitle(f"episode {episode}")
    return figure


def fly_episode(name: str, preset: str, study_seed: int, episode: int) -> EpisodeRecord:
    """Fly an episode of the validation tiles."""
    import rl  # noqa: F401 - registers the agents
    from hda.flight.episode import fly
    from hda.registry import make_policy
    from hda.task.scenario import sample_scenario

    return fly(make_policy(name), sample_scenario(preset, study_seed, episode, "validation"))
