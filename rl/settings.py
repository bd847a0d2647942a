"""How an agent learns. Nothing of torch is imported here."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from guidance.validation import whole_number
from rl.environment.action import ActionRanges
from rl.environment.encoding import CURVED
from rl.inference.artefacts import ENCODER

AlgorithmName = Literal["td3", "sac", "ddpg", "tqc", "td3-lstm", "td3-lstm-plus", "ppo", "recurrent-ppo"]
ALGORITHMS: tuple[str, ...] = get_args(AlgorithmName)
HISTORIES = {"td3-lstm": ("action",), "td3-lstm-plus": ("action", "reward"), "recurrent-ppo": ()}
"""What the LSTM of each algorithm with memory sees beside the observation."""
WITH_MEMORY = tuple(HISTORIES)
ON_POLICY_ALGORITHMS = ("ppo", "recurrent-ppo")


@dataclass(frozen=True)
class OffPolicySettings:
    """What every off-policy algorithm asks for.

    Attributes:
        batch_size: transitions per update.
        discount: gamma.
        target_rate: tau, of the target networks.
        exploration_noise: standard deviation of the noise on actions in [-1, 1] (deterministic actors only).
        smoothing_noise: standard deviation of the noise on the target actor's actions, clipped at 2.5 of it
            (td3 and those with memory).
        random_steps: steps with uniform actions before the first update.
        replay_size: transitions kept.
        update_every: environment steps for one update.

    Raises:
        ValueError: update_every is not a whole number of at least 1.
    """

    batch_size: int = 256
    discount: float = 0.99
    target_rate: float = 0.005
    exploration_noise: float = 0.1
    smoothing_noise: float = 0.05
    random_steps: int = 25_000
    replay_size: int = 400_000
    update_every: int = 1

    def __post_init__(self) -> None:
        """Refuse an interval between updates that is none."""
        whole_number("update_every", self.update_every, at_least=1)


@dataclass(frozen=True)
class SequenceSettings(OffPolicySettings):
    """What learning from sequences asks for; `batch_size` counts sequences.

    Attributes:
        hidden: sizes of the layers that join the branches.
        memory: hidden size of each LSTM.
        window: longest sequence of td3-lstm-plus; longer episodes give windows of that many transitions.
        burn_in: transitions before a window that only fill the memory.
    """

    hidden: tuple[int, ...] = (256,)
    batch_size: int = 32
    smoothing_noise: float = 0.2
    random_steps: int = 20_000
    replay_size: int = 200_000
    memory: int = 128
    window: int = 20
    burn_in: int = 0


@dataclass(frozen=True)
class AgentSettings:
    """What every agent asks for; with what its algorithm adds, all that decides what is learnt but the seed.

    Attributes:
        algorithm: which one.
        layout: observation vector (a name in `rl.environment.encoding.LAYOUTS`).
        encoder: shipped encoder of the looks, by name: `autoencoder`, or one that learnt on another preset.
        hidden: sizes of the hidden layers of every network.
        learning_rate: of Adam, until the decay begins.
        final_learning_rate: where the decay ends.
        learning_rate_decay: steps at which its linear decay begins and ends.
        matmul_precision: "highest" is float32; with "medium" the processor multiplies in bfloat16 where it
            can, and a GPU in TF32.
        shift: the target moves by at most this share of the look's width in one decision.
        sight: what it sees beside the flight: the last look, or the belief that all looks have left.
        guidance: what flies to the site: ZEM/ZEV with gains and clock of the agent's own; or convex guidance,
            where the site alone is the action; or nothing, where the thrust is the action.
    """

    algorithm: AlgorithmName = "td3"
    layout: str = CURVED.name
    encoder: str = ENCODER
    hidden: tuple[int, ...] = (256, 256)
    learning_rate: float = 3e-4
    final_learning_rate: float = 3e-5
    learning_rate_decay: tuple[int, int] = (190_000, 250_000)
    matmul_precision: Literal["highest", "high", "medium"] = "medium"
    shift: float = 0.25
    sight: Literal["look", "belief"] = "look"
    guidance: Literal["zem-zev", "convex", "thrust"] = "zem-zev"

    @property
    def action_ranges(self) -> ActionRanges:
        """What actions mean."""
        return ActionRanges(shift=self.shift)

    def refuse_steps(self, steps: int) -> None:
        """Refuse a run whose last steps teach nothing.

        Raises:
            ValueError: it goes on where the learning rate has come to 0.
        """
        end = self.learning_rate_decay[1]
        if self.final_learning_rate == 0.0 and steps > end:
            raise ValueError(
                f"steps must be at most {end}, where the learning rate has come to 0, got {steps}:"
                f" begin a run with --learning-rate-decay 0 {steps}"
            )

    def learning_rate_at(self, step: int) -> float:
        """Learning rate at an environment step."""
        begin, end = self.learning_rate_decay
        passed = min(1.0, max(0.0, (step - begin) / max(end - begin, 1)))
        return self.learning_rate + passed * (self.final_learning_rate - self.learning_rate)


@dataclass(frozen=True)
class OffPolicyAgentSettings(OffPolicySettings, AgentSettings):
    """Settings of an agent that learns from a replay memory.

    Attributes:
        control_prior_weight: of the actor's penalty that draws the gains and the clock to their nominal
            values (td3 and those with memory; see `rl.learning.td3.FastTD3`).
        shift_prior_weight: of the same penalty for the shift of the target, which makes each move of the site
            cost something.
        control_prior_step: environment step from which both hold: first free, then settled.
    """

    control_prior_weight: float = 0.2
    shift_prior_weight: float = 0.0
    control_prior_step: int = 165_000

    def control_prior_at(self, step: int) -> float:
        """Weight of the penalty that draws the gains and the clock to their nominal values."""
        return self.control_prior_weight if step >= self.control_prior_step else 0.0

    def shift_prior_at(self, step: int) -> float:
        """Weight of the penalty that draws the shift of the target to 0."""
        return self.shift_prior_weight if step >= self.control_prior_step else 0.0


@dataclass(frozen=True)
class RecurrentSettings(SequenceSettings, OffPolicyAgentSettings):
    """Settings of an agent with memory that learns from a replay memory."""

    algorithm: AlgorithmName = "td3-lstm"
    learning_rate_decay: tuple[int, int] = (85_000, 115_000)
    control_prior_step: int = 80_000


@dataclass(frozen=True)
class OnPolicySettings(AgentSettings):
    """Settings of proximal policy optimisation, which learns from what many environments have just flown.

    Attributes:
        environments: that fly together, in one batch.
        horizon: decisions of each environment between two updates.
        epochs: passes over what was flown.
        batch_size: decisions of one gradient step.
        discount: gamma.
        trace: lambda of the generalised advantages.
        clip: how far the ratio of likelihoods may leave 1.
        value_weight: of the critic's loss.
        greatest_gradient: norm at which gradients are cut.
        log_deviation: of the actions at the start. Their range is [-1, 1]: with 0 about a third of
            the draws lie beyond it, with -1 one in 150.
    """

    algorithm: AlgorithmName = "ppo"
    learning_rate: float = 1e-3
    final_learning_rate: float = 0.0
    learning_rate_decay: tuple[int, int] = (0, 2_000_000)
    matmul_precision: Literal["highest", "high", "medium"] = "highest"
    environments: int = 256
    horizon: int = 32
    epochs: int = 10
    batch_size: int = 1024
    discount: float = 0.99
    trace: float = 0.9
    clip: float = 0.2
    value_weight: float = 0.5
    greatest_gradient: float = 0.5
    log_deviation: float = -1.0


@dataclass(frozen=True)
class RecurrentOnPolicySettings(OnPolicySettings):
    """Settings of proximal policy optimisation with memory.

    Attributes:
        hidden: sizes of the layers behind each LSTM.
        memory: hidden size of each LSTM: one of the actor, one of the critic.
    """

    algorithm: AlgorithmName = "recurrent-ppo"
    hidden: tuple[int, ...] = (256,)
    learning_rate_decay: tuple[int, int] = (0, 600_000)
    memory: int = 128


_KINDS: dict[str, type[AgentSettings]] = {
    **dict.fromkeys(ALGORITHMS, OffPolicyAgentSettings),
    "td3-lstm": RecurrentSettings,
    "td3-lstm-plus": RecurrentSettings,
    "ppo": OnPolicySettings,
    "recurrent-ppo": RecurrentOnPolicySettings,
}


def refuse_thrust(sight: str, algorithm: str) -> None:
    """Refuse what an agent that gives the thrust itself cannot be.

    Raises:
        ValueError: it sees another thing than the last look, or has memory.
    """
    if sight != "look" or algorithm in WITH_MEMORY:
        raise ValueError("guidance thrust goes with sight look, and with an agent without memory")


def settings_from_json(values: dict[str, Any]) -> AgentSettings:
    """Undo `dataclasses.asdict` and JSON on settings; what was added since has its default.

    Raises:
        ValueError: settings that are not known here.
    """
    kind = _KINDS.get(values.get("algorithm", "td3"), OffPolicyAgentSettings)
    foreign = sorted(set(values) - {field.name for field in fields(kind)})
    if foreign:
        raise ValueError(f"the run has settings of another version: {', '.join(foreign)}")
    return kind(**{**values, **{k: tuple(v) for k, v in values.items() if isinstance(v, list)}})
