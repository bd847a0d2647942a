"""Inference of small networks without torch: compiled loops, the same bits on any number of threads.

Training uses torch; what is shipped is a list of arrays and these loops. Inner loops run over outputs, so
they vectorise without reordering any sum. Zeros that a rectifier left are skipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.kernel import compile_kernel
from rl.artefacts import ArtefactError, Tensors

Array = NDArray[np.float32]


@compile_kernel
def _convolve(image: Array, weight: Array, bias: Array) -> Array:
    """4 x 4 kernel, stride 2, padding 1, rectified; image (rows, columns, in), weight (4, 4, in, out)."""
    rows, columns, channels = image.shape
    filters = bias.shape[0]
    out = np.empty((rows // 2, columns // 2, filters), dtype=np.float32)
    total = np.empty(filters, dtype=np.float32)
    for i in range(rows // 2):
        for j in range(columns // 2):
            total[:] = bias
            for p in range(4):
                y = 2 * i + p - 1
                if y < 0 or y >= rows:
                    continue
                for q in range(4):
                    x = 2 * j + q - 1
                    if x < 0 or x >= columns:
                        continue
                    for c in range(channels):
                        value = image[y, x, c]
                        if value != 0.0:
                            for k in range(filters):
                                total[k] += value * weight[p, q, c, k]
            for k in range(filters):
                out[i, j, k] = max(total[k], np.float32(0.0))
    return out


@compile_kernel
def _connect(inputs: Array, weight: Array, bias: Array, rectify: bool) -> Array:
    """Dense layer: inputs (in,), weight (in, out), bias (out,)."""
    out = bias.copy()
    for i in range(inputs.shape[0]):
        value = inputs[i]
        if value != 0.0:
            for k in range(out.shape[0]):
                out[k] += value * weight[i, k]
    if rectify:
        for k in range(out.shape[0]):
            out[k] = max(out[k], np.float32(0.0))
    return out


def _array(tensors: Tensors, name: str, dimensions: int) -> Array:
    if name not in tensors or tensors[name].dtype != np.float32 or tensors[name].ndim != dimensions:
        raise ArtefactError(f"the weights need a {dimensions}-dimensional float32 tensor {name!r}")
    return np.ascontiguousarray(tensors[name])


@dataclass(frozen=True, eq=False)
class MapEncoder:
    """Safety map -> latent: convolutions, then one dense layer.

    Attributes:
        convolutions: (weight (4, 4, in, out), bias (out,)) of each convolution.
        dense: (weight (in, latent), bias (latent,)).
    """

    convolutions: tuple[tuple[Array, Array], ...]
    dense: tuple[Array, Array]

    @classmethod
    def from_tensors(cls, tensors: Tensors) -> MapEncoder:
        """Take "convolution.K.weight" and "latent.weight" as stored.

        Raises:
            ArtefactError: a tensor is missing or of another type.
        """
        count = sum(name.startswith("convolution.") and name.endswith(".bias") for name in tensors)
        convolutions = tuple(
            (_array(tensors, f"convolution.{k}.weight", 4), _array(tensors, f"convolution.{k}.bias", 1))
            for k in range(count)
        )
        return cls(convolutions, (_array(tensors, "latent.weight", 2), _array(tensors, "latent.bias", 1)))

    def encode(self, safety_map: NDArray[np.float32]) -> Array:
        """Latent of one map, shape (latent,); the map has shape (64, 64)."""
        image = np.ascontiguousarray(safety_map, dtype=np.float32)[:, :, None]
        for weight, bias in self.convolutions:
            image = _convolve(image, weight, bias)
        return _connect(image.reshape(-1), *self.dense, False)


@dataclass(frozen=True, eq=False)
class Perceptron:
    """Dense layers with rectifiers between them.

    Attributes:
        layers: (weight (in, out), bias (out,)) of each layer.
    """

    layers: tuple[tuple[Array, Array], ...]

    @classmethod
    def from_tensors(cls, tensors: Tensors, sizes: Sequence[int]) -> Perceptron:
        """Take "layer.K.weight" and "layer.K.bias" as stored.

        Args:
            tensors: the arrays.
            sizes: expected number of inputs, of each hidden layer, and of outputs.

        Raises:
            ArtefactError: a tensor is missing or of another type or shape.
        """
        layers = []
        for k in range(len(sizes) - 1):
            weight, bias = _array(tensors, f"layer.{k}.weight", 2), _array(tensors, f"layer.{k}.bias", 1)
            if weight.shape != (sizes[k], sizes[k + 1]) or bias.shape != (sizes[k + 1],):
                raise ArtefactError(
                    f"layer {k} must be {sizes[k]} x {sizes[k + 1]}, got {weight.shape} and bias {bias.shape}"
                )
            layers.append((weight, bias))
        return cls(tuple(layers))

    def evaluate(self, inputs: NDArray[np.float32]) -> Array:
        """Outputs of one row, without a final nonlinearity."""
        values = np.ascontiguousarray(inputs, dtype=np.float32)
        last = len(self.layers) - 1
        for k, (weight, bias) in enumerate(self.layers):
            values = _connect(values, weight, bias, k < last)
        return values
