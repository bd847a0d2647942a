"""The learning algorithms by name, and the settings that they are trained with here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rl.action import CONTROLS, ActionRanges
from rl.encoding import CURVED, PRINTED

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

    from rl.td3_lstm import RecurrentTD3

AlgorithmName = Literal["td3", "sac", "ddpg", "tqc", "td3-lstm", "td3-lstm-plus"]
WITH_MEMORY = ("td3-lstm", "td3-lstm-plus")


@dataclass(frozen=True)
class AgentSettings:
    """Everything that decides what is learnt, but for the seed and the number of steps.

    Attributes:
        algorithm: which one.
        layout: observation vector (a name in `rl.encoding.LAYOUTS`).
        hidden: sizes of the hidden layers of every network.
        learning_rate: of Adam, until the decay begins.
        final_learning_rate: where the decay ends.
        learning_rate_decay: steps at which its linear decay begins and ends.
        batch_size: transitions per update.
        discount: gamma.
        target_rate: tau, of the target networks.
        exploration_noise: standard deviation of the noise on actions (deterministic actors only).
        smoothing_noise: standard deviation of the noise on the target actor's actions, clipped at 2.5 of it
            (td3 and those with memory).
        control_prior_weight: of the actor's penalty that draws the gains and the clock to their nominal
            values (td3 and those with memory; see `rl.td3.FastTD3`).
        control_prior_step: environment step from which it holds: first free, then settled.
        random_steps: steps with uniform actions before the first update.
        replay_size: transitions kept.
        matmul_precision: "highest" is float32; "medium" lets the processor multiply in bfloat16 where it can.
        shift: the target moves by at most this share of the look's width in one decision.
    """

    algorithm: AlgorithmName = "td3"
    layout: str = CURVED.name
    hidden: tuple[int, ...] = (256, 256)
    learning_rate: float = 3e-4
    final_learning_rate: float = 3e-5
    learning_rate_decay: tuple[int, int] = (190_000, 250_000)
    batch_size: int = 256
    discount: float = 0.99
    target_rate: float = 0.005
    exploration_noise: float = 0.1
    smoothing_noise: float = 0.05
    control_prior_weight: float = 0.2
    control_prior_step: int = 165_000
    random_steps: int = 25_000
    replay_size: int = 400_000
    matmul_precision: Literal["highest", "high", "medium"] = "medium"
    shift: float = 0.25

    @property
    def action_ranges(self) -> ActionRanges:
        """What actions mean."""
        return ActionRanges(shift=self.shift)

    def learning_rate_at(self, step: int) -> float:
        """Learning rate at an environment step."""
        begin, end = self.learning_rate_decay
        passed = min(1.0, max(0.0, (step - begin) / max(end - begin, 1)))
        return self.learning_rate + passed * (self.final_learning_rate - self.learning_rate)

    def control_prior_at(self, step: int) -> float:
        """Weight of the penalty that draws the gains and the clock to their nominal values."""
        return self.control_prior_weight if step >= self.control_prior_step else 0.0


@dataclass(frozen=True)
class RecurrentSettings(AgentSettings):
    """Settings of an agent with memory; `batch_size` counts sequences, `hidden` joins the branches.

    Attributes:
        memory: hidden size of each LSTM.
        update_every: environment steps for one update, which learns from whole sequences.
        window: longest sequence of td3-lstm-plus.
        burn_in: transitions before a window that only fill the memory.
    """

    algorithm: AlgorithmName = "td3-lstm"
    hidden: tuple[int, ...] = (256,)
    learning_rate_decay: tuple[int, int] = (85_000, 115_000)
    batch_size: int = 32
    smoothing_noise: float = 0.2
    control_prior_step: int = 80_000
    random_steps: int = 20_000
    replay_size: int = 200_000
    memory: int = 128
    update_every: int = 1
    window: int = 20
    burn_in: int = 0


TD3_SETTINGS = AgentSettings()
SAC_SETTINGS = replace(
    TD3_SETTINGS,
    algorithm="sac",
    learning_rate=1e-3,
    final_learning_rate=1e-4,
    learning_rate_decay=(30_000, 150_000),
    discount=0.98,
    random_steps=5_000,
)
RECURRENT_RECIPES = {
    "td3-lstm": RecurrentSettings(),
    "td3-lstm-plus": RecurrentSettings(
        algorithm="td3-lstm-plus", control_prior_step=110_000, learning_rate_decay=(120_000, 160_000)
    ),
}
RECIPES: dict[str, AgentSettings] = {
    "td3": TD3_SETTINGS,
    "sac": SAC_SETTINGS,
    "ddpg": replace(TD3_SETTINGS, algorithm="ddpg"),
    "tqc": replace(SAC_SETTINGS, algorithm="tqc"),
    **RECURRENT_RECIPES,
    "td3-paper": replace(
        TD3_SETTINGS,
        layout=PRINTED.name,
        final_learning_rate=3e-4,
        smoothing_noise=0.2,
        control_prior_weight=0.0,
    ),
}
"""`td3-paper` is the vector that the paper prints with the settings that TD3's authors published, since the
paper gives none; the others start from what measurement found."""


def settings_from_json(values: dict[str, Any]) -> AgentSettings:
    """Undo `dataclasses.asdict` and JSON on AgentSettings."""
    kind = RecurrentSettings if values.get("algorithm") in WITH_MEMORY else AgentSettings
    return kind(**{**values, **{k: tuple(v) for k, v in values.items() if isinstance(v, list)}})


def make_agent_with_memory(settings: RecurrentSettings, env: Any, seed: int) -> RecurrentTD3:
    """Make an untrained agent with memory."""
    from rl.recurrent_hyperparameters import Hyperparameters
    from rl.td3_lstm import RecurrentTD3

    names = ("memory", "batch_size", "discount", "target_rate", "random_steps", "update_every")
    names += ("replay_size", "window", "burn_in", "exploration_noise", "smoothing_noise")
    chosen = {name: getattr(settings, name) for name in names}
    hyperparameters = Hyperparameters(
        plus=settings.algorithm == "td3-lstm-plus", head=settings.hidden, **chosen
    )
    agent = RecurrentTD3(env, hyperparameters, seed, settings.learning_rate_at)
    controls = (np.arange(agent.sizes.action) < CONTROLS).astype(np.float32)
    agent.action_prior = lambda step: settings.control_prior_at(step) * controls
    return agent


def make_algorithm(settings: AgentSettings, env: Any, seed: int) -> OffPolicyAlgorithm | RecurrentTD3:
    """Make an untrained algorithm.

    Args:
        settings: what is learnt.
        env: Gymnasium environment.
        seed: of the first weights, the exploration and the episodes.

    Raises:
        ValueError: unknown algorithm, or spaces that are not one-dimensional boxes, finite for actions.
        ImportError: `tqc` without sb3-contrib.
    """
    from rl.box_spaces import check_environment

    check_environment(env)
    if isinstance(settings, RecurrentSettings):
        return make_agent_with_memory(settings, env, seed)
    from stable_baselines3 import DDPG, SAC
    from stable_baselines3.common.noise import NormalActionNoise

    from rl.td3 import FastTD3

    classes: dict[str, Any] = {"td3": FastTD3, "ddpg": DDPG, "sac": SAC}
    if settings.algorithm == "tqc":
        from sb3_contrib import TQC

        classes["tqc"] = TQC
    if settings.algorithm not in classes:
        raise ValueError(f"algorithm must be td3, sac, ddpg or tqc, got {settings.algorithm!r}")
    algorithm: OffPolicyAlgorithm = classes[settings.algorithm](
        "MlpPolicy",
        env,
        learning_rate=settings.learning_rate,
        buffer_size=settings.replay_size,
        learning_starts=settings.random_steps,
        batch_size=settings.batch_size,
        tau=settings.target_rate,
        gamma=settings.discount,
        train_freq=1,
        gradient_steps=1,
        policy_kwargs={"net_arch": list(settings.hidden), "optimizer_kwargs": {"fused": True}},
        seed=seed,
        device="cpu",
    )
    # decays follow the step and not SB3's share of the total, so that a longer run begins as a shorter one
    algorithm.lr_schedule = lambda _: settings.learning_rate_at(algorithm.num_timesteps)
    if isinstance(algorithm, FastTD3):
        algorithm.control_prior = lambda: settings.control_prior_at(algorithm.num_timesteps)
        algorithm.target_policy_noise = settings.smoothing_noise
        algorithm.target_noise_clip = 2.5 * settings.smoothing_noise
    if settings.algorithm in ("td3", "ddpg"):
        still = np.zeros(env.action_space.shape)
        algorithm.action_noise = NormalActionNoise(still, still + settings.exploration_noise)
    return algorithm
