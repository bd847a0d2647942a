"""Inference of an actor with memory without torch: compiled loops, the same bits on any number of threads."""

from __future__ import annotations

import math
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


@dataclass(frozen=True)
class RecurrentSizes:
    """Shapes that the weights of an actor with memory must have.

    Attributes:
        observation: numbers in an observation.
        memory: size of the memory.
        hidden: sizes of the hidden layers of the head.
        history: what the LSTM sees beside the observation: "action", the last one; "reward", the last one.
        present: the head also sees the present observation, through a dense layer; else the memory alone.
        actions: numbers in an action.
    """

    observation: int
    memory: int
    hidden: tuple[int, ...]
    history: tuple[str, ...] = ("action",)
    present: bool = True
    actions: int = 5


@dataclass(frozen=True, eq=False)
class RecurrentNetwork:
    """An actor with memory: an LSTM of the past, and dense layers on what it holds.

    Attributes:
        lstm: (W (history, 4 memory), U (memory, 4 memory), bias (4 memory,)).
        present: dense layer on the observation; a rectifier follows. None: the head sees the memory alone.
        head: dense layers on (past, present).
        history: what the LSTM sees beside the observation, as in `RecurrentSizes`.
    """

    lstm: tuple[Array32, Array32, Array32]
    present: Perceptron | None
    head: Perceptron
    history: tuple[str, ...]

    @classmethod
    def from_tensors(cls, tensors: Tensors, sizes: RecurrentSizes) -> RecurrentNetwork:
        """Take the tensors as stored.

        Raises:
            ArtefactError: a tensor is missing or of another type or shape.
        """
        observation, memory = sizes.observation, sizes.memory
        beside = {"action": sizes.actions, "reward": 1}
        shapes = {
            "lstm.input": (observation + sum(beside[part] for part in sizes.history), 4 * memory),
            "lstm.recurrent": (memory, 4 * memory),
            "lstm.bias": (4 * memory,),
        }
        for name, shape in shapes.items():
            if name not in tensors or tensors[name].dtype != np.float32 or tensors[name].shape != shape:
                raise ArtefactError(f"the weights need a float32 tensor {name!r} of shape {shape}")
        lstm = tuple(np.ascontiguousarray(tensors[name]) for name in shapes)
        present = None
        if sizes.present:
            parts = {f"layer.0.{kind}": tensors.get(f"present.{kind}") for kind in ("weight", "bias")}
            known = {name: tensor for name, tensor in parts.items() if tensor is not None}
            present = Perceptron.from_tensors(known, (observation, memory))
        inputs = memory * (2 if sizes.present else 1)
        head = Perceptron.from_tensors(tensors, (inputs, *sizes.hidden, sizes.actions))
        return cls(lstm, present, head, sizes.history)  # type: ignore[arg-type]

    @property
    def memory(self) -> int:
        """Size of the memory."""
        return self.lstm[1].shape[0]

    @property
    def actions(self) -> int:
        """Numbers in an action."""
        return self.head.outputs

    def evaluate(
        self, observation: Array32, history: Array32, past: tuple[Array32, Array32]
    ) -> tuple[Array32, ...]:
        """Action before it is bounded (a,), and the new memory (hidden, cell), each (memory,).

        Args:
            observation: shape (o,).
            history: what the LSTM sees: the observation, and what `history` names.
            past: the memory so far.
        """
        hidden, cell = _remember(history, *past, self.lstm)
        if self.present is None:
            return self.head.evaluate(hidden), hidden, cell
        present = np.maximum(self.present.evaluate(observation), np.float32(0.0))
        return self.head.evaluate(np.concatenate([hidden, present])), hidden, cell
