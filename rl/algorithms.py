"""The learning algorithms by name, and the settings that they are trained with here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from rl.action import ActionRanges
from rl.encoding import PRINTED, RELATIVE

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

AlgorithmName = Literal["td3", "sac", "ddpg", "tqc"]


@dataclass(frozen=True)
class AgentSettings:
    """Everything that decides what is learnt, but for the seed and the number of steps.

    Attributes:
        algorithm: which one.
        layout: observation vector ("relative" or "printed").
        hidden: sizes of the hidden layers of every network.
        learning_rate: of Adam.
        batch_size: transitions per update.
        discount: gamma.
        target_rate: tau, of the target networks.
        exploration_noise: standard deviation of the noise on actions (deterministic actors only).
        random_steps: steps with uniform actions before the first update.
        replay_size: transitions kept.
        matmul_precision: "highest" is float32; "medium" lets the processor multiply in bfloat16 where it can.
        shift: the target moves by at most this share of the look's width in one decision.
    """

    algorithm: AlgorithmName = "td3"
    layout: str = RELATIVE.name
    hidden: tuple[int, ...] = (256, 256)
    learning_rate: float = 1e-3
    batch_size: int = 256
    discount: float = 0.98
    target_rate: float = 0.005
    exploration_noise: float = 0.5
    random_steps: int = 20_000
    replay_size: int = 400_000
    matmul_precision: Literal["highest", "high", "medium"] = "medium"
    shift: float = 0.25

    @property
    def action_ranges(self) -> ActionRanges:
        """What actions mean."""
        return ActionRanges(shift=self.shift)


TD3 = AgentSettings()
RECIPES: dict[str, AgentSettings] = {
    "td3": TD3,
    "sac": replace(TD3, algorithm="sac", random_steps=5_000),
    "ddpg": replace(TD3, algorithm="ddpg"),
    "tqc": replace(TD3, algorithm="tqc", random_steps=5_000),
    "td3-paper": AgentSettings(
        layout=PRINTED.name,
        learning_rate=3e-4,
        discount=0.99,
        exploration_noise=0.1,
        random_steps=25_000,
    ),
}
"""`td3-paper` is the vector that the paper prints with the settings that TD3's authors published, since the
paper gives none; the others start from what measurement found."""


def make_algorithm(settings: AgentSettings, env: Any, seed: int) -> OffPolicyAlgorithm:
    """Make an untrained algorithm.

    Args:
        settings: what is learnt.
        env: Gymnasium environment.
        seed: of the first weights, the exploration and the episodes.

    Raises:
        ValueError: unknown algorithm.
        ImportError: `tqc` without sb3-contrib.
    """
    import numpy as np
    from stable_baselines3 import DDPG, SAC
    from stable_baselines3.common.noise import NormalActionNoise

    from rl.td3 import FastTD3

    classes: dict[str, Any] = {"td3": FastTD3, "ddpg": DDPG, "sac": SAC}
    if settings.algorithm == "tqc":
        from sb3_contrib import TQC

        classes["tqc"] = TQC
    if settings.algorithm not in classes:
        raise ValueError(f"algorithm must be td3, sac, ddpg or tqc, got {settings.algorithm!r}")
    options: dict[str, Any] = {}
    if settings.algorithm in ("td3", "ddpg"):
        options["action_noise"] = NormalActionNoise(np.zeros(5), np.full(5, settings.exploration_noise))
    return classes[settings.algorithm](
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
        **options,
    )
