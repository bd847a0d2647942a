"""The paper's figures of learning, from runs and shipped weights.

python -m rl.figures training --run runs/td3-0            # losses, reward and safe ratio over a run
python -m rl.figures reconstruction                       # looks above, their reconstructions below
python -m rl.figures gains --episode 3                    # gains and rate of time over one episode
python -m rl.figures comparison --search 300              # agent and fixed gains where they part
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro

from guidance.arrays import Array
from guidance.console import one_line_errors, tolerate_encoding

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hda.flight.record import EpisodeRecord

_OUT = Path("results/figures")


@dataclass(frozen=True)
class TrainingFigure:
    """Critic loss, actor loss, reward and safe ratio over a run.

    Attributes:
        run: folder of the run.
        window: rows of `training.csv` in the moving average.
        out: picture to write.
    """

    run: Path
    window: int = 10
    out: Path = _OUT / "training.png"


@dataclass(frozen=True)
class ReconstructionFigure:
    """Looks at unseen ground above, what the autoencoder keeps of them below.

    Attributes:
        columns: how many.
        preset: setting.
        seed: of the random rollouts that the looks are from.
        out: picture to write.
    """

    columns: int = 8
    preset: str = "paper"
    seed: int = 0
    out: Path = _OUT / "reconstruction.png"


@dataclass(frozen=True)
class GainsFigure:
    """The agent's gains, rate of time and shift of the target over one episode.

    Attributes:
        policy: name of an agent.
        episode: number of the episode on the validation tiles.
        preset: setting.
        study_seed: seed of the study.
        out: picture to write.
    """

    policy: str = "td3"
    episode: int = 0
    preset: str = "paper"
    study_seed: int = 0
    out: Path = _OUT / "gains.png"


@dataclass(frozen=True)
class ComparisonFigure:
    """Agent and fixed gains side by side, on the first episode of which only the agent lands safely.

    Attributes:
        agent: name of the left policy.
        other: name of the right policy.
        search: episodes of the validation tiles to search; it is an error if none parts them.
        preset: setting.
        study_seed: seed of the study.
        out: picture to write.
    """

    agent: str = "td3"
    other: str = "td3-fixed-gain"
    search: int = 300
    preset: str = "paper"
    study_seed: int = 0
    out: Path = _OUT / "comparison.png"


Command = (
    Annotated[TrainingFigure, tyro.conf.subcommand("training")]
    | Annotated[ReconstructionFigure, tyro.conf.subcommand("reconstruction")]
    | Annotated[GainsFigure, tyro.conf.subcommand("gains")]
    | Annotated[ComparisonFigure, tyro.conf.subcommand("comparison")]
)


def moving_average(values: Array, window: int) -> Array:
    """Mean of the last `window` values, or of as many as there are."""
    total = np.cumsum(np.insert(values, 0, 0.0))
    ends = np.arange(1, len(values) + 1)
    starts = np.maximum(ends - window, 0)
    return (total[ends] - total[starts]) / (ends - starts)


def draw_training(options: TrainingFigure) -> Figure:
    """Four panels as in the paper's training log; the deterministic policy's tuning score is added.

    Raises:
        ValueError: the folder holds no log.
    """
    from rl.training.run_folder import read_rows

    rows = read_rows(options.run / "training.csv")
    if not rows:
        raise ValueError(f"{options.run} holds no training.csv with rows")
    figure = _figure(9.0, 6.0)
    panels: Any = figure.subplots(2, 2)
    names = ("critic_loss", "actor_loss", "reward", "safe_ratio")
    for panel, name in zip(panels.flat, names, strict=True):
        kept = [row for row in rows if row[name]]
        steps = np.array([int(row["step"]) for row in kept])
        values = np.array([float(row[name]) for row in kept])
        panel.plot(steps, values, color="0.8")
        panel.plot(steps, moving_average(values, options.window), label="while exploring")
        panel.set_title(name.replace("_", " "))
        panel.set_xlabel("environment steps")
    panels[0, 0].set_yscale("log")
    scores = read_rows(options.run / "validation.csv")
    steps = [int(row["step"]) for row in scores]
    panels[1, 0].plot(steps, [float(row["reward"]) for row in scores], ".-", label="policy, tuning tiles")
    safe = [float(row["safe_site_percent"]) / 100.0 for row in scores]
    panels[1, 1].plot(steps, safe, ".-", label="policy, tuning tiles")
    panels[1, 1].legend()
    return figure


def draw_reconstruction(options: ReconstructionFigure) -> Figure:
    """Original looks above, reconstructions below, from the validation tiles."""
    from hda.task.presets import find_preset
    from rl.inference.latent import load_autoencoder
    from rl.learning.autoencoder import autoencoder_from_tensors, collect_maps, reconstruct

    maps = collect_maps(find_preset(options.preset), "validation", options.columns, options.seed)
    maps = maps[(maps > 127).mean((1, 2)) > 0.02]  # some ground to see
    chosen = maps[np.linspace(0, len(maps) - 1, options.columns).astype(int)]
    images = reconstruct(autoencoder_from_tensors(load_autoencoder().tensors), chosen)
    figure = _figure(1.3 * options.columns, 3.0)
    panels: Any = figure.subplots(2, options.columns)
    for k in range(options.columns):
        panels[0, k].imshow(chosen[k], cmap="gray", origin="lower", vmin=0, vmax=255)
        panels[1, k].imshow(images[k], cmap="gray", origin="lower", vmin=0, vmax=1)
    for panel in panels.flat:
        panel.set_xticks([])
        panel.set_yticks([])
    panels[0, 0].set_ylabel("observed")
    panels[1, 0].set_ylabel("reconstructed")
    return figure


def draw_gains(options: GainsFigure) -> Figure:
    """Gains, rate of time and shift of the target at each decision."""
    record = _fly(options.policy, options.preset, options.study_seed, options.episode)
    time = [observation.time for observation in record.observations]
    commands: Any = [decision.command for decision in record.decisions]
    figure = _figure(7.0, 6.0)
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
        records = [_fly(name, options.preset, options.study_seed, episode) for name in names]
        if [record.outcome.safe_site for record in records] == [True, False]:
            break
    else:
        raise ValueError(
            f"on none of {options.search} episodes does {options.agent} land on safe ground and"
            f" {options.other} not; a greater --search may find one"
        )
    figure = _figure(10.0, 8.0)
    panels: Any = figure.subplots(3, 2, height_ratios=[2.2, 1, 1])
    for (ground, speed, thrust), record in zip(panels.T, records, strict=True):
        draw_ground_track(ground, record)
        ground.set_title(f"{record.policy}: {record.outcome.ending}")
        draw_velocity(speed, record)
        draw_thrust(thrust, record)
    figure.suptitle(f"episode {episode}")
    return figure


def _fly(name: str, preset: str, study_seed: int, episode: int) -> EpisodeRecord:
    import rl  # noqa: F401 - registers the agents
    from hda.flight.episode import fly
    from hda.registry import make_policy
    from hda.task.scenario import sample_scenario

    return fly(make_policy(name), sample_scenario(preset, study_seed, episode, "validation"))


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure((width, height), dpi=120, layout="constrained")


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    command = tyro.cli(Command, description=__doc__)  # type: ignore[call-overload]
    drawers: dict[type, Any] = {
        TrainingFigure: draw_training,
        ReconstructionFigure: draw_reconstruction,
        GainsFigure: draw_gains,
        ComparisonFigure: draw_comparison,
    }
    with one_line_errors():
        figure = drawers[type(command)](command)
        command.out.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(command.out)
    sys.stdout.write(f"wrote {command.out}\n")


if __name__ == "__main__":
    main()
