"""Inference of an actor with memory without torch: compiled loops, the same bits on any number of threads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.kernel import compile_kernel
from rl.inference.arrays import Array32
from rl.inference.artefacts import ArtefactError, Tensors
from rl.inference.networks import Perceptron


@compile_kernel
def _remember(
    inputs: Array32, hidden: Array32, cell: Array32, weights: tuple[Array32, Array32, Array32]
) -> tuple[Array32, Array32]:
    """One step of an LSTM with gates in the order i, f, g, o (as torch): the new (hidden, cell)."""
    driving, recurrent, bias = weights
    size = hidden.shape[0]
    gates = bias.copy()
    for i in range(inputs.shape[0]):
        value = inputs[i]
        for k in range(4 * size):
            gates[k] += value * driving[i, k]
    for i in range(size):
        value = hidden[i]
        for k in range(4 * size):
            gates[k] += value * recurrent[i, k]
    after, kept = np.empty(size, dtype=np.float32), np.empty(size, dtype=np.float32)
    one = np.float32(1.0)
    for k in range(size):
        keep_new = one / (one + math.exp(-gates[k]))
        keep_old = one / (one + math.exp(-gates[size + k]))
        new = math.tanh(gates[2 * size + k])
        out = one / (one + math.exp(-gates[3 * size + k]))
        kept[k] = keep_old * cell[k] + keep_new * new
        after[k] = out * math.tanh(kept[k])
    return after, kept


@dataclass(frozen=True, eq=False)
class RecurrentNetwork:
    """An actor with memory: an LSTM of the past beside the present observation.

    Attributes:
        lstm: (W (history, 4 memory), U (memory, 4 memory), bias (4 memory,)).
        present: dense layer on the observation; a rectifier follows.
        head: dense layers on (past, present).
        previous_reward: the history holds the last reward after the last action.
    """

    lstm: tuple[Array32, Array32, Array32]
    present: Perceptron
    head: Perceptron
    previous_reward: bool

    @classmethod
    def from_tensors(
        cls, tensors: Tensors, observation: int, memory: int, hidden: Sequence[int], previous_reward: bool
    ) -> RecurrentNetwork:
        """Take the tensors as stored.

        Args:
            tensors: the arrays.
            observation: expected numbers in an observation.
            memory: expected size of the memory.
            hidden: expected sizes of the hidden layers of the head; five actions follow.
            previous_reward: whether the history holds it.

        Raises:
            ArtefactError: a tensor is missing or of another type or shape.
        """
        shapes = {
            "lstm.input": (observation + 5 + int(previous_reward), 4 * memory),
            "lstm.recurrent": (memory, 4 * memory),
            "lstm.bias": (4 * memory,),
        }
        for name, shape in shapes.items():
            if name not in tensors or tensors[name].dtype != np.float32 or tensors[name].shape != shape:
                raise ArtefactError(f"the weights need a float32 tensor {name!r} of shape {shape}")
        lstm = tuple(np.ascontiguousarray(tensors[name]) for name in shapes)
        parts = {f"layer.0.{kind}": tensors.get(f"present.{kind}") for kind in ("weight", "bias")}
        known = {name: tensor for name, tensor in parts.items() if tensor is not None}
        present = Perceptron.from_tensors(known, (observation, memory))
        head = Perceptron.from_tensors(tensors, (2 * memory, *hidden, 5))
        return cls(lstm, present, head, previous_reward)  # type: ignore[arg-type]

    @property
    def memory(self) -> int:
        """Size of the memory."""
        return self.lstm[1].shape[0]

    def evaluate(
        self, observation: Array32, history: Array32, past: tuple[Array32, Array32]
    ) -> tuple[Array32, ...]:
        """Action before its tanh (5,), and the new memory (hidden, cell), each (memory,)."""
        hidden, cell = _remember(history, *past, self.lstm)
        present = np.maximum(self.present.evaluate(observation), np.float32(0.0))
        return self.head.evaluate(np.concatenate([hidden, present])), hidden, cell
