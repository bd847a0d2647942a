"""What follows a training run between its updates: logs, validation on the tuning tiles, checkpoints."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import Progress
from stable_baselines3.common.callbacks import BaseCallback

from hda.task.presets import Preset
from rl.environment.env import LandingEnv
from rl.environment.native.landing_vector import LandingVectorEnv
from rl.inference.arrays import Array32
from rl.inference.artefacts import save_artefact
from rl.settings import AgentSettings, OnPolicySettings
from rl.training.actor_export import actor_card, actor_tensors, policy_of
from rl.training.candidates import TUNING_SEED
from rl.training.checkpoint import save_checkpoint
from rl.training.run_folder import TrainingPlan, append_row, truncate_rows
from rl.training.scoring import Score, score_policy

_LOSSES = (
    ("critic_loss", "critic_loss"),
    ("actor_loss", "actor_loss"),
    ("critic_loss", "value_loss"),
    ("actor_loss", "policy_gradient_loss"),
)
"""Names here, and in the learners' own logs: of those with a replay memory, and of proximal policies."""


class Recorder(BaseCallback):
    """Follows a run between updates: windows of the log, validation, checkpoints, progress bar."""

    def __init__(
        self,
        folder: Path,
        plan: TrainingPlan,
        settings: AgentSettings,
        env: LandingEnv[Array32] | LandingVectorEnv[Array32],
        progress: Progress,
    ) -> None:
        """Start empty; `restore` continues from a checkpoint's card."""
        super().__init__()
        self.folder, self.plan, self.settings, self.landing_env = folder, plan, settings, env
        self.progress = progress
        self.task = progress.add_task(settings.algorithm, total=plan.steps, rate=0.0, safe=0.0)
        self.window: dict[str, list[float]] = _empty_window()
        self.episode_rewards = np.zeros(getattr(env, "num_envs", 1))
        self.last_checkpoint = 0
        self.seconds_before = 0.0
        self.started = clock.perf_counter()
        self.may_stop = isinstance(settings, OnPolicySettings)
        self.steps_before = self.steps_seen = 0

    def restore(self, card: Mapping[str, Any]) -> None:
        """Take over what a checkpoint's card keeps, and drop what was logged after it."""
        self.window = {name: list(card["window"][name]) for name in _empty_window()}
        self.seconds_before = float(card["seconds"])
        self.episode_rewards[:] = card.get("episode_rewards", 0.0)
        self.last_checkpoint = self.steps_before = int(card["counters"]["num_timesteps"])
        self.steps_seen = self.steps_before
        for name in ("training.csv", "validation.csv"):
            truncate_rows(self.folder / name, self.last_checkpoint)

    @property
    def seconds(self) -> float:
        """Wall time of the run, all its sessions together."""
        return self.seconds_before + clock.perf_counter() - self.started

    def _on_step(self) -> bool:
        self.episode_rewards += np.asarray(self.locals["rewards"], np.float64)
        ended = np.flatnonzero(self.locals["dones"]).tolist()
        for place in ended:
            self.window["reward"].append(float(self.episode_rewards[place]))
            self.window["safe_ratio"].append(float(self.locals["infos"][place]["safe_site"]))
            self.episode_rewards[place] = 0.0
        if not isinstance(self.settings, OnPolicySettings):
            self.may_stop = bool(ended)  # a checkpoint keeps no flight of a single environment
        return True

    def _has_passed(self, interval: int) -> bool:
        """Whether a multiple of the interval lies between the last two updates."""
        return self.num_timesteps // interval > self.steps_seen // interval

    def _on_rollout_start(self) -> None:
        """Runs after the update of the step before, or of all that was flown between two updates."""
        steps = self.num_timesteps
        if steps == self.steps_seen:
            return
        losses, excluded = self.logger.name_to_value, self.logger.name_to_excluded
        for name, logged in _LOSSES:
            if f"train/{logged}" in losses:
                # taken out: not every step has an update, and each loss counts once
                self.window[name].append(float(losses.pop(f"train/{logged}")))
                excluded.pop(f"train/{logged}")
        if self._has_passed(self.plan.log_every):
            self._log_window(steps)
        if self._has_passed(self.plan.validate_every):
            self.validate(steps)
        self.steps_seen = steps
        due = steps - self.last_checkpoint >= self.plan.checkpoint_every
        if self.may_stop and due:
            self.checkpoint()

    def _log_window(self, steps: int) -> None:
        means = {name: float(np.mean(values)) if values else "" for name, values in self.window.items()}
        row = {"step": steps, "updates": self.model._n_updates, "seconds": round(self.seconds, 1), **means}
        append_row(self.folder / "training.csv", row)
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
        append_row(
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
            "episode_rewards": self.episode_rewards.tolist(),
        }
        save_checkpoint(self.folder, self.model, self.landing_env, card)  # type: ignore[arg-type]
        self.last_checkpoint = self.num_timesteps


def _empty_window() -> dict[str, list[float]]:
    return {name: [] for name in ("critic_loss", "actor_loss", "reward", "safe_ratio")}
