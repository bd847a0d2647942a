"""Torch networks with memory: the paper's two branches, the present beside an LSTM of the past.

At step t a network sees the observation o_t in one branch (the critic its action a_t too) and in the other an
LSTM over the history (o_0; a_0, o_1; ...; a_{t-1}, o_t), dense layers join them (after
Peng et al. 2018, the paper's reference for this architecture). Time is the first dimension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn

Memory = tuple[Tensor, Tensor]


@dataclass(frozen=True)
class NetworkSizes:
    """Sizes of an actor or a critic.

    Attributes:
        observation: numbers in an observation.
        action: numbers in an action.
        memory: hidden size of the LSTM and of the dense layer of the branch beside it.
        head: sizes of the hidden layers after the branches join.
        previous_reward: the history holds the last reward beside the last action.
    """

    observation: int
    action: int
    memory: int = 128
    head: tuple[int, ...] = (256,)
    previous_reward: bool = False

    @property
    def history(self) -> int:
        """Numbers that enter the history at each step."""
        return self.observation + self.action + int(self.previous_reward)


def _dense(sizes: Sequence[int]) -> nn.Sequential:
    """Dense layers with rectifiers between them."""
    layers: list[nn.Module] = []
    for k in range(len(sizes) - 1):
        layers += [nn.Linear(sizes[k], sizes[k + 1]), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


class RecurrentActor(nn.Module):
    """mu(h_t): actions before their tanh."""

    def __init__(self, sizes: NetworkSizes) -> None:
        """Make it with torch's own first weights."""
        super().__init__()
        self.history = nn.LSTM(sizes.history, sizes.memory)
        self.present = nn.Linear(sizes.observation, sizes.memory)
        self.head = _dense((2 * sizes.memory, *sizes.head, sizes.action))

    def forward(
        self, observations: Tensor, history: Tensor, memory: Memory | None = None
    ) -> tuple[Tensor, Memory]:
        """Inputs of the last tanh, (T, N, action), and the memory after the last step."""
        past, after = self.history(history, memory)
        present = torch.relu(self.present(observations))
        return self.head(torch.cat((past, present), -1)), after


class _ValueHead(nn.Module):
    """Q of the encoded past, the present observation and the action."""

    def __init__(self, sizes: NetworkSizes) -> None:
        super().__init__()
        self.present = nn.Linear(sizes.observation + sizes.action, sizes.memory)
        self.head = _dense((2 * sizes.memory, *sizes.head, 1))

    def forward(self, past: Tensor, observations: Tensor, actions: Tensor) -> Tensor:
        present = torch.relu(self.present(torch.cat((observations, actions), -1)))
        return self.head(torch.cat((past, present), -1)).squeeze(-1)


class TwinCritic(nn.Module):
    """Q_1 and Q_2; each with an LSTM of its own, or two heads on one.

    The past holds only actions that were taken, so it is encoded once for any present action: `remember`,
    then `values`.
    """

    def __init__(self, sizes: NetworkSizes, shared: bool) -> None:
        """Make it with torch's own first weights.

        Args:
            sizes: of the networks.
            shared: both values rest on one encoder of the history.
        """
        super().__init__()
        self.histories = nn.ModuleList(
            nn.LSTM(sizes.history, sizes.memory) for _ in range(1 if shared else 2)
        )
        self.heads = nn.ModuleList(_ValueHead(sizes) for _ in range(2))

    def remember(self, history: Tensor, count: int = 2) -> list[Tensor]:
        """Encoded past of the first `count` values: each (T, N, memory)."""
        encoded = [encoder(history)[0] for encoder in self.histories[:count]]  # type: ignore[union-attr]
        return [encoded[min(k, len(encoded) - 1)] for k in range(count)]

    def values(self, pasts: Sequence[Tensor], observations: Tensor, actions: Tensor) -> list[Tensor]:
        """One (T, N) for each of the pasts."""
        return [head(past, observations, actions) for head, past in zip(self.heads, pasts, strict=False)]
