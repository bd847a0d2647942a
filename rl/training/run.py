"""A training run: SB3 learns, this records, validates, keeps checkpoints and resumes."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hda.task.presets import Preset
from rl.environment.env import LandingEnv, LunarHDAEnv
from rl.environment.native.batch_settings import is_served
from rl.environment.native.landing_vector import LandingVectorEnv
from rl.environment.native.stepped_vector import SteppedVectorEnv
from rl.environment.native.vector_env import LunarHDAVectorEnv
from rl.environment.thrust.thrust_env import LunarHDAThrustEnv
from rl.environment.thrust.thrust_vector_env import LunarHDAThrustVectorEnv
from rl.inference.arrays import Array32
from rl.inference.artefacts import library_versions
from rl.learning.algorithms import make_algorithm
from rl.learning.precision import matmul_precision
from rl.settings import AgentSettings, OnPolicySettings, refuse_thrust, settings_from_json
from rl.training.actor_export import actor_card
from rl.training.checkpoint import newest_checkpoint, restore_checkpoint
from rl.training.run_folder import TrainingPlan, read_run


def run_training(
    folder: Path,
    preset: Preset,
    settings: AgentSettings,
    plan: TrainingPlan,
    resume: bool,
    device: str = "cpu",
) -> None:
    """Train, or go on training.

    Args:
        folder: of the run.
        preset: setting to fly; its terrain is built beforehand.
        settings: what is learnt.
        plan: how long and how seeded.
        resume: go on from the newest checkpoint in the folder, if there is one.
        device: that torch learns on, "cpu" or "cuda"; episodes are flown on the processor. A run may be
            resumed on another one, which is announced: it learns other weights than one that stays.

    Raises:
        ValueError: the folder holds a run and `resume` is not set, or holds a run with other settings; the
            settings do not go together; or the last steps would teach nothing.
    """
    import torch

    torch.set_num_threads(1)
    with matmul_precision(settings.matmul_precision):
        _train(folder, preset, settings, plan, resume, device)


def _train(
    folder: Path, preset: Preset, settings: AgentSettings, plan: TrainingPlan, resume: bool, device: str
) -> None:
    from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

    from rl.training.recorder import Recorder
    from rl.training.vector_adapter import StableBaselinesVector

    settings.refuse_steps(plan.steps)
    env = make_environment(settings, preset)  # refuses what cannot be learnt before a folder is made
    checkpoint = _open_folder(folder, preset, settings, plan, resume, device)
    flown = env if isinstance(env, LandingEnv) else StableBaselinesVector(env)
    algorithm = make_algorithm(settings, flown, plan.seed, device)
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
            card = restore_checkpoint(checkpoint, algorithm, env)
            recorder.restore(card)
            progress.console.print(f"resuming {folder} at step {algorithm.num_timesteps}")
            if card.get("device", device) != device:
                progress.console.print(f"it learnt on {card['device']} so far, and goes on on {device}")
        if isinstance(env, SteppedVectorEnv):
            progress.console.print("the native batch does not serve this: environments are stepped in turn")
        remaining = plan.steps - algorithm.num_timesteps
        if remaining > 0:
            algorithm.learn(remaining, recorder, log_interval=10**9, reset_num_timesteps=False)
            recorder.on_rollout_start()  # what is due after the last update
    algorithm.logger.close()


def make_environment(
    settings: AgentSettings, preset: Preset
) -> LandingEnv[Array32] | LandingVectorEnv[Array32]:
    """What an agent learns in: one environment, or a vector for what learns from many at a time.

    The vector is one native batch where that serves preset, sight and guidance; else its environments are
    stepped one after the other.

    Raises:
        ValueError: thrusts on a preset that is not served, or settings that do not go together.
    """
    options: dict[str, Any] = {"layout": settings.layout, "action_ranges": settings.action_ranges}
    options["encoder"] = settings.encoder
    if settings.guidance == "thrust":
        refuse_thrust(settings.sight, settings.algorithm)
        if isinstance(settings, OnPolicySettings):
            return LunarHDAThrustVectorEnv(settings.environments, preset=preset, **options)
        return LunarHDAThrustEnv(preset, **options)
    options |= {"sight": settings.sight, "guidance": settings.guidance}
    if isinstance(settings, OnPolicySettings):
        native = is_served(preset) and (settings.sight, settings.guidance) == ("look", "zem-zev")
        kind = LunarHDAVectorEnv if native else SteppedVectorEnv
        return kind(settings.environments, preset=preset, **options)
    return LunarHDAEnv(preset, **options)


def _open_folder(
    folder: Path, preset: Preset, settings: AgentSettings, plan: TrainingPlan, resume: bool, device: str
) -> Path | None:
    """Write `run.json`, or check it; give the checkpoint to resume from. The device need not be the same."""
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
        before["settings"] = json.loads(json.dumps(asdict(settings_from_json(before["settings"]))))
        changed = [name for name, value in asked.items() if before.get(name) != value]
        if changed:
            raise ValueError(
                f"{folder} was begun with another {' and '.join(changed)}; resume it with the same"
            )
    checkpoint = newest_checkpoint(folder) if resume else None
    folder.mkdir(parents=True, exist_ok=True)
    contents = {**asked, "plan": asdict(plan), "device": device}
    contents |= {"versions": library_versions(), "card": actor_card(settings)}
    card.write_text(json.dumps(contents, indent=1, sort_keys=True) + "\n")
    if checkpoint is None:
        for name in ("training.csv", "validation.csv"):
            (folder / name).unlink(missing_ok=True)
    return checkpoint
