"""How an agent learns: settings and the recipes of the shipped ones. Nothing of torch is imported here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from rl.environment.action import ActionRanges
from rl.environment.encoding import CURVED, PRINTED
from rl.inference.artefacts import ENCODER

AlgorithmName = Literal["td3", "sac", "ddpg", "tqc", "td3-lstm", "td3-lstm-plus"]


WITH_MEMORY = ("td3-lstm", "td3-lstm-plus")


@dataclass(frozen=True)
class OffPolicySettings:
    """What every off-policy algorithm asks for.

    Attributes:
        hidden: sizes of the hidden layers of every network.
        batch_size: transitions per update.
        discount: gamma.
        target_rate: tau, of the target networks.
        exploration_noise: standard deviation of the noise on actions in [-1, 1] (deterministic actors only).
        smoothing_noise: standard deviation of the noise on the target actor's actions, clipped at 2.5 of it
            (td3 and those with memory).
        random_steps: steps with uniform actions before the first update.
        replay_size: transitions kept.
    """

    hidden: tuple[int, ...] = (256, 256)
    batch_size: int = 256
    discount: float = 0.99
    target_rate: float = 0.005
    exploration_noise: float = 0.1
    smoothing_noise: float = 0.05
    random_steps: int = 25_000
    replay_size: int = 400_000


@dataclass(frozen=True)
class SequenceSettings(OffPolicySettings):
    """What learning from sequences asks for; `batch_size` counts sequences, `hidden` joins the branches.

    Attributes:
        memory: hidden size of each LSTM.
        update_every: environment steps for one update, which learns from whole sequences.
        window: longest sequence of td3-lstm-plus; longer episodes give windows of that many transitions.
        burn_in: transitions before a window that only fill the memory.
    """

    hidden: tuple[int, ...] = (256,)
    batch_size: int = 32
    smoothing_noise: float = 0.2
    random_steps: int = 20_000
    replay_size: int = 200_000
    memory: int = 128
    update_every: int = 1
    window: int = 20
    burn_in: int = 0


@dataclass(frozen=True)
class AgentSettings(OffPolicySettings):
    """Everything that decides what is learnt, but for the seed and the number of steps.

    Attributes:
        algorithm: which one.
        layout: observation vector (a name in `rl.environment.encoding.LAYOUTS`).
        encoder: shipped encoder of the looks, by name: `autoencoder`, or one that learnt on another preset.
        learning_rate: of Adam, until the decay begins.
        final_learning_rate: where the decay ends.
        learning_rate_decay: steps at which its linear decay begins and ends.
        control_prior_weight: of the actor's penalty that draws the gains and the clock to their nominal
            values (td3 and those with memory; see `rl.learning.td3.FastTD3`).
        control_prior_step: environment step from which it holds: first free, then settled.
        matmul_precision: "highest" is float32; "medium" lets the processor multiply in bfloat16 where it can.
        shift: the target moves by at most this share of the look's width in one decision.
    """

    algorithm: AlgorithmName = "td3"
    layout: str = CURVED.name
    encoder: str = ENCODER
    learning_rate: float = 3e-4
    final_learning_rate: float = 3e-5
    learning_rate_decay: tuple[int, int] = (190_000, 250_000)
    control_prior_weight: float = 0.2
    control_prior_step: int = 165_000
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
class RecurrentSettings(SequenceSettings, AgentSettings):
    """Settings of an agent with memory."""

    algorithm: AlgorithmName = "td3-lstm"
    learning_rate_decay: tuple[int, int] = (85_000, 115_000)
    control_prior_step: int = 80_000


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
