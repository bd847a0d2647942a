"""A training run: SB3 learns, this records, validates, keeps checkpoints and resumes.

A run's folder holds

- `run.json`: what was asked for;
- `training.csv`: losses, reward and safe ratio over windows of steps;
- `validation.csv`: the deterministic policy on the tuning tiles, every so many steps;
- `actors/`: the actor at each validation;
- `checkpoint-*.safetensors/.json`: where `--resume` goes on;
- `tensorboard/`.
"""

from __future__ import annotations

import csv
import json
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from hda.scenario import Preset
from rl.actor_export import actor_card, actor_tensors, policy_of
from rl.algorithms import AgentSettings, make_algorithm
from rl.artefacts import library_versions, save_artefact
from rl.checkpoint import newest_checkpoint, restore_checkpoint, save_checkpoint
from rl.env import LunarHDAEnv
from rl.scoring import Score, score_policy

TUNING_SEED = 900_000
"""Study seed of the periodic validation on the tuning tiles."""


@dataclass(frozen=True)
class TrainingPlan:
    """How long, how often, how seeded.

    Attributes:
        steps: environment steps; one update each after the random ones.
        seed: of weights, exploration and episodes.
        recipe: name of the command that trains it.
        validate_every: steps between validations.
        validation_episodes: episodes of each.
        checkpoint_every: least steps between checkpoints.
        log_every: steps in one row of `training.csv`.
    """

    steps: int
    seed: int
    recipe: str = "td3"
    validate_every: int = 10_000
    validation_episodes: int = 200
    checkpoint_every: int = 10_000
    log_every: int = 1_000


class Recorder(BaseCallback):
    """Follows a run between updates: windows of the log, validation, checkpoints, progress bar."""

    def __init__(
        self, folder: Path, plan: TrainingPlan, settings: AgentSettings, env: LunarHDAEnv, progress: Progress
    ) -> None:
        """Start empty; `restore` continues from a checkpoint's card."""
        super().__init__()
        self.folder, self.plan, self.settings, self.landing_env = folder, plan, settings, env
        self.progress = progress
        self.task = progress.add_task(settings.algorithm, total=plan.steps, rate=0.0, safe=0.0)
        self.window: dict[str, list[float]] = _empty_window()
        self.episode_reward = 0.0
        self.last_checkpoint = 0
        self.seconds_before = 0.0
        self.started = clock.perf_counter()
        self.ended_episode = False
        self.steps_before = 0

    def restore(self, card: Mapping[str, Any]) -> None:
        """Take over what a checkpoint's card keeps, and drop what was logged after it."""
        self.window = {name: list(card["window"][name]) for name in _empty_window()}
        self.seconds_before = float(card["seconds"])
        self.last_checkpoint = self.steps_before = int(card["counters"]["num_timesteps"])
        for name in ("training.csv", "validation.csv"):
            _truncate_rows(self.folder / name, self.last_checkpoint)

    @property
    def seconds(self) -> float:
        """Wall time of the run, all its sessions together."""
        return self.seconds_before + clock.perf_counter() - self.started

    def _on_step(self) -> bool:
        self.episode_reward += float(self.locals["rewards"][0])
        self.ended_episode = bool(self.locals["dones"][0])
        if self.ended_episode:
            info = self.locals["infos"][0]
            self.window["reward"].append(self.episode_reward)
            self.window["safe_ratio"].append(float(info["safe_site"]))
            self.episode_reward = 0.0
        return True

    def _on_rollout_start(self) -> None:
        """Runs after the update of the step before."""
        steps = self.num_timesteps
        if steps == self.steps_before:
            return
        losses = self.logger.name_to_value
        for name in ("critic_loss", "actor_loss"):
            if f"train/{name}" in losses:
                self.window[name].append(float(losses[f"train/{name}"]))
        if steps % self.plan.log_every == 0:
            self._log_window(steps)
        if steps % self.plan.validate_every == 0:
            self.validate(steps)
        due = steps - self.last_checkpoint >= self.plan.checkpoint_every
        if self.ended_episode and due:
            self.checkpoint()

    def _log_window(self, steps: int) -> None:
        means = {name: float(np.mean(values)) if values else "" for name, values in self.window.items()}
        row = {"step": steps, "updates": self.model._n_updates, "seconds": round(self.seconds, 1), **means}
        _append_row(self.folder / "training.csv", row)
        for name, value in means.items():
            if value != "":
                self.logger.record(f"window/{name}", value)
        self.logger.dump(steps)
        self.window = _empty_window()
        rate = (steps - self.steps_before) / (clock.perf_counter() - self.started)
        self.progress.update(self.task, completed=steps, rate=rate)

    def validate(self, steps: int) -> None:
        """Fly the deterministic policy over the tuning tiles; keep its weights and its score."""
        tensors = actor_tensors(self.model)  # type: ignore[arg-type]
        preset = self.landing_env.source.preset
        assert isinstance(preset, Preset)
        policy = policy_of(tensors, self.settings)
        score = score_policy(policy, preset, "tuning", TUNING_SEED, self.plan.validation_episodes)
        save_artefact(
            self.folder / "actors" / f"step-{steps:09d}", "actor", tensors, actor_card(self.settings)
        )
        values = score.as_dict()
        _append_row(
            self.folder / "validation.csv",
            {"step": steps, "updates": self.model._n_updates, "seconds": round(self.seconds, 1), **values},
        )
        for name, value in values.items():
            self.logger.record(f"tuning/{name}", value)
        self.progress.update(self.task, safe=score.safe_site_percent)
        self._report(steps, score)

    def _report(self, steps: int, score: Score) -> None:
        rate = (steps - self.steps_before) / (clock.perf_counter() - self.started)
        self.progress.console.print(
            f"step {steps}: safe {score.safe_site_percent:.1f} %, success {score.success_percent:.1f} %,"
            f" reward {score.reward:.3f}, {score.touchdown_speed_mps:.2f} m/s,"
            f" miss {score.miss_distance_m:.2f} m, propellant {score.propellant_percent:.1f} %;"
            f" {rate:.0f} steps/s, {self.seconds:.0f} s"
        )

    def checkpoint(self) -> None:
        """Keep everything that the run needs to go on."""
        card = {
            "settings": asdict(self.settings),
            "plan": asdict(self.plan),
            "window": self.window,
            "seconds": self.seconds,
        }
        save_checkpoint(self.folder, self.model, self.landing_env, card)  # type: ignore[arg-type]
        self.last_checkpoint = self.num_timesteps


def run_training(
    folder: Path, preset: Preset, settings: AgentSettings, plan: TrainingPlan, resume: bool
) -> None:
    """Train, or go on training.

    Args:
        folder: of the run.
        preset: setting to fly; its terrain is built beforehand.
        settings: what is learnt.
        plan: how long and how seeded.
        resume: go on from the newest checkpoint in the folder, if there is one.

    Raises:
        ValueError: the folder holds a run and `resume` is not set, or holds a run with other settings.
    """
    torch.set_num_threads(1)
    precision = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision(settings.matmul_precision)
    try:
        _train(folder, preset, settings, plan, resume)
    finally:
        torch.set_float32_matmul_precision(precision)


def _train(folder: Path, preset: Preset, settings: AgentSettings, plan: TrainingPlan, resume: bool) -> None:
    checkpoint = _open_folder(folder, preset, settings, plan, resume)
    env = LunarHDAEnv(preset, layout=settings.layout, action_ranges=settings.action_ranges)
    algorithm = make_algorithm(settings, env, plan.seed)
    algorithm.set_logger(Logger(str(folder), [TensorBoardOutputFormat(str(folder / "tensorboard"))]))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn(
            "{task.completed}/{task.total} steps, {task.fields[rate]:.0f}/s, safe {task.fields[safe]:.1f} %"
        ),
        TimeElapsedColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns) as progress:
        recorder = Recorder(folder, plan, settings, env, progress)
        if checkpoint is not None:
            recorder.restore(restore_checkpoint(checkpoint, algorithm, env))
            progress.console.print(f"resuming {folder} at step {algorithm.num_timesteps}")
        remaining = plan.steps - algorithm.num_timesteps
        if remaining > 0:
            algorithm.learn(remaining, recorder, log_interval=10**9, reset_num_timesteps=False)
            recorder.on_rollout_start()  # what is due after the last update
    algorithm.logger.close()


def _open_folder(
    folder: Path, preset: Preset, settings: AgentSettings, plan: TrainingPlan, resume: bool
) -> Path | None:
    """Write `run.json`, or check it; give the checkpoint to resume from."""
    asked = json.loads(
        json.dumps(
            {
                "preset": preset.name,
                "recipe": plan.recipe,
                "settings": asdict(settings),
                "seed": plan.seed,
            }
        )
    )
    card = folder / "run.json"
    if card.exists():
        if not resume:
            raise ValueError(
                f"{folder} already holds a run: pass --resume to go on with it, or another --out"
            )
        before = read_run(folder)
        changed = [name for name, value in asked.items() if before.get(name) != value]
        if changed:
            raise ValueError(
                f"{folder} was begun with another {' and '.join(changed)}; resume it with the same"
            )
    folder.mkdir(parents=True, exist_ok=True)
    contents = {**asked, "plan": asdict(plan), "versions": library_versions(), "card": actor_card(settings)}
    card.write_text(json.dumps(contents, indent=1, sort_keys=True) + "\n")
    checkpoint = newest_checkpoint(folder) if resume else None
    if checkpoint is None:
        for name in ("training.csv", "validation.csv"):
            (folder / name).unlink(missing_ok=True)
    return checkpoint


def read_run(folder: Path) -> dict[str, Any]:
    """What a run was begun with, from its `run.json`.

    Raises:
        ValueError: the folder holds no run, or its record is damaged.
    """
    try:
        card = json.loads((folder / "run.json").read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{folder} is not a run: {error}") from error
    if not isinstance(card, dict) or not {"settings", "preset", "seed", "plan", "recipe"} <= set(card):
        raise ValueError(f"{folder / 'run.json'} is not the record of a run")
    return card


def _empty_window() -> dict[str, list[float]]:
    return {name: [] for name in ("critic_loss", "actor_loss", "reward", "safe_ratio")}


def _append_row(path: Path, row: Mapping[str, Any]) -> None:
    fresh = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, list(row))
        if fresh:
            writer.writeheader()
        writer.writerow(row)


def read_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a log, all numbers; empty if there is none. A last line that was never finished is left out.

    Raises:
        ValueError: the log is damaged; the message names the line.
    """
    if not path.exists():
        return []
    rows: list[dict[str, str]] = []
    try:
        with path.open(newline="") as file:
            lines = file.read().splitlines(keepends=True)
        if lines and not lines[-1].endswith("\n"):
            lines.pop()  # a killed process was writing it
        for row in csv.DictReader(lines, strict=True):
            int(row["step"])
            for value in row.values():
                float("nan" if value == "" else value)  # no loss yet: left empty
            rows.append(row)
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise ValueError(f"{path}, line {len(rows) + 2}: damaged, or not a log ({error!r})") from error
    return rows


def _truncate_rows(path: Path, last_step: int) -> None:
    rows: Sequence[Mapping[str, str]] = [row for row in read_rows(path) if int(row["step"]) <= last_step]
    path.unlink(missing_ok=True)
    for row in rows:
        _append_row(path, row)
