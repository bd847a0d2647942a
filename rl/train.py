"""Training at the command line. Each command explains its options with --help.

python -m rl.train autoencoder                        # the map encoder that every agent needs
python -m rl.train td3 --seed 0 --out runs/td3-0      # an agent; also sac, td3-convex, td3-belief, ..
python -m rl.train td3-lstm --seed 0 --out runs/m-0   # an agent with memory; also td3-lstm-plus
python -m rl.train ppo --seed 0 --out runs/ppo-0      # in many at a time; also recurrent-ppo, ppo-thrust
python -m rl.train td3 --seed 0 --out runs/td3-0 --resume
python -m rl.train export --name td3 --runs runs/td3-0 runs/td3-1 runs/td3-2

Training needs the extra `train` (torch, Stable-Baselines3, tensorboard): pip install 'lunar-hda[train]'.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union

import tyro

from guidance.console import one_line_errors, tolerate_encoding
from rl.recipes import (
    OFF_POLICY_RECIPES,
    ON_POLICY_RECIPES,
    RECIPES,
    RECURRENT_PPO_SETTINGS,
    RECURRENT_RECIPES,
    STEPS,
)
from rl.settings import (
    WITH_MEMORY,
    AgentSettings,
    OffPolicyAgentSettings,
    OnPolicySettings,
    RecurrentOnPolicySettings,
    RecurrentSettings,
)
from rl.training.export import ExportWeights, run_export
from rl.training.train_autoencoder import TrainAutoencoder, run_autoencoder_training
from rl.training_libraries import require_training_libraries


@dataclass(frozen=True)
class TrainingOptions:
    """How an agent is trained, whatever it is.

    Attributes:
        settings: what is learnt.
        seed: of the first weights, the exploration and the episodes.
        out: folder of the run; runs/NAME-SEED by default.
        preset: setting to fly.
        steps: environment steps; not beyond the end of a decay of the learning rate to 0.
        resume: go on from the newest checkpoint in the folder.
        validate_every: steps between validations.
        validation_episodes: episodes of each validation.
        checkpoint_every: least steps between checkpoints.
        device: that torch learns on; auto takes a GPU for an agent with memory, where torch sees one.
            Episodes fly on the processor.
    """

    settings: tyro.conf.OmitArgPrefixes[AgentSettings]
    seed: int = 0
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    preset: str = "paper"
    steps: int = STEPS["td3"]
    resume: bool = False
    validate_every: int = 10_000
    validation_episodes: int = 200
    checkpoint_every: int = 10_000
    device: Literal["auto", "cpu", "cuda"] = "auto"


@dataclass(frozen=True)
class TrainAgent(TrainingOptions):
    """Train an agent on the training tiles; it is validated on the tuning tiles as it learns.

    Attributes:
        settings: what is learnt.
        steps: environment steps; one update every `update_every` once the random steps are over.
    """

    settings: tyro.conf.OmitArgPrefixes[OffPolicyAgentSettings] = OFF_POLICY_RECIPES["td3"]


@dataclass(frozen=True)
class TrainRecurrentAgent(TrainingOptions):
    """Train an agent with memory (TD3 with LSTM) on the training tiles.

    Attributes:
        settings: what is learnt.
        steps: environment steps; one update every `update_every` once the random steps are over.
    """

    settings: tyro.conf.OmitArgPrefixes[RecurrentSettings] = RECURRENT_RECIPES["td3-lstm"]
    steps: int = STEPS["td3-lstm"]


@dataclass(frozen=True)
class TrainOnPolicyAgent(TrainingOptions):
    """Train an agent by proximal policy optimisation, in many environments at a time.

    Attributes:
        settings: what is learnt.
        steps: environment steps of all environments together, rounded up to whole updates. The learning rate
            comes to 0 at the end of `learning_rate_decay`: for more steps, lengthen it too.
    """

    settings: tyro.conf.OmitArgPrefixes[OnPolicySettings] = ON_POLICY_RECIPES["ppo"]
    steps: int = STEPS["ppo"]


@dataclass(frozen=True)
class TrainRecurrentOnPolicyAgent(TrainingOptions):
    """Train an agent with memory by proximal policy optimisation, in many environments at a time.

    Attributes:
        settings: what is learnt.
        steps: environment steps of all environments together, rounded up to whole updates. The learning rate
            comes to 0 at the end of `learning_rate_decay`: for more steps, lengthen it too.
    """

    settings: tyro.conf.OmitArgPrefixes[RecurrentOnPolicySettings] = RECURRENT_PPO_SETTINGS
    steps: int = STEPS["recurrent-ppo"]


_OPTIONS: tuple[tuple[type[AgentSettings], type[TrainingOptions]], ...] = (
    (RecurrentOnPolicySettings, TrainRecurrentOnPolicyAgent),
    (OnPolicySettings, TrainOnPolicyAgent),
    (RecurrentSettings, TrainRecurrentAgent),
    (OffPolicyAgentSettings, TrainAgent),
)
"""Options of each kind of settings, the narrowest kind first."""


def _named(name: str) -> Any:
    """The command of a recipe."""
    recipe = RECIPES[name]
    kind = next(options for settings, options in _OPTIONS if isinstance(recipe, settings))
    default = kind(settings=recipe, steps=STEPS[name])  # type: ignore[arg-type]
    return Annotated[kind, tyro.conf.subcommand(name, default=default)]


Command = Union[
    (
        Annotated[TrainAutoencoder, tyro.conf.subcommand("autoencoder")],
        *map(_named, RECIPES),
        Annotated[ExportWeights, tyro.conf.subcommand("export")],
    )
]


def run_agent_training(options: TrainingOptions, name: str) -> None:
    """Run the command of an agent.

    Raises:
        ValueError: an option is out of range, torch does not see the device, or the folder holds another run.
    """
    from guidance.validation import finite_number
    from hda.ground.library import Ground, prepare_tiles
    from hda.task.presets import find_preset
    from rl.learning.device import choose_device
    from rl.training.run import run_training
    from rl.training.run_folder import TrainingPlan

    for field in ("steps", "validate_every", "validation_episodes", "checkpoint_every"):
        finite_number(field, getattr(options, field), at_least=1)
    finite_number("seed", options.seed, at_least=0)
    device = choose_device(options.device, options.settings.algorithm in WITH_MEMORY)
    preset = find_preset(options.preset)
    for split in ("train", "tuning"):
        prepare_tiles(Ground(preset.terrain, preset.criteria), split)
    plan = TrainingPlan(
        options.steps,
        options.seed,
        name,
        options.validate_every,
        options.validation_episodes,
        options.checkpoint_every,
    )
    folder = options.out or Path("runs") / f"{name}-{options.seed}"
    run_training(folder, preset, options.settings, plan, options.resume, device)


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    command = tyro.cli(Command, description=__doc__)  # type: ignore[call-overload]
    with one_line_errors():
        if isinstance(command, ExportWeights):
            run_export(command)
            return
        require_training_libraries()
        if isinstance(command, TrainAutoencoder):
            run_autoencoder_training(command)
        else:
            run_agent_training(command, sys.argv[1])


if __name__ == "__main__":
    main()
