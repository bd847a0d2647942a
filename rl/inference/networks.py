"""Inference of small networks without torch: compiled loops, the same bits on any number of threads.

Training uses torch; what is shipped is a list of arrays and these loops. Inner loops run over outputs, so
they vectorise without reordering any sum. Zeros that a rectifier left are skipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.kernel import compile_kernel
from rl.inference.arrays import Array32
from rl.inference.artefacts import ArtefactError, Tensors


@compile_kernel
def _gather_patches(image: Array32) -> Array32:
    """4 x 4 patches at stride 2 and padding 1: image (in, rows, columns) -> (in * 16, rows/2 * columns/2)."""
    channels, rows, columns = image.shape
    half = columns // 2
    patches = np.zeros((channels * 16, rows // 2 * half), dtype=np.float32)
    for c in range(channels):
        for p in range(4):
            for q in range(4):
                row = patches[c * 16 + p * 4 + q]
                for i in range(rows // 2):
                    y = 2 * i + p - 1
                    if y < 0 or y >= rows:
                        continue
                    for j in range((1 if q == 0 else 0), (half - 1 if q == 3 else half)):
                        row[i * half + j] = image[c, y, 2 * j + q - 1]
    return patches


@compile_kernel
def _convolve(image: Array32, weight: Array32, bias: Array32) -> Array32:
    """4 x 4 kernel, stride 2, padding 1, rectified; image (in, rows, columns), weight (out, in * 16)."""
    patches = _gather_patches(image)
    size = patches.shape[1]
    out = np.empty((weight.shape[0], size), dtype=np.float32)
    for k in range(weight.shape[0]):
        total = out[k]
        total[:] = bias[k]
        for t in range(0, weight.shape[1], 4):
            # four terms at a time, so that the sums are stored a quarter as often
            first, second, third, fourth = patches[t], patches[t + 1], patches[t + 2], patches[t + 3]
            a, b, c, d = weight[k, t], weight[k, t + 1], weight[k, t + 2], weight[k, t + 3]
            for m in range(size):
                total[m] += (a * first[m] + b * second[m]) + (c * third[m] + d * fourth[m])
        for m in range(size):
            total[m] = max(total[m], np.float32(0.0))
    return out.reshape((weight.shape[0], image.shape[1] // 2, image.shape[2] // 2))


@compile_kernel
def _connect(inputs: Array32, weight: Array32, bias: Array32, rectify: bool) -> Array32:
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


def _array(tensors: Tensors, name: str, dimensions: int) -> Array32:
    if name not in tensors or tensors[name].dtype != np.float32 or tensors[name].ndim != dimensions:
        raise ArtefactError(f"the weights need a {dimensions}-dimensional float32 tensor {name!r}")
    return np.ascontiguousarray(tensors[name])


@dataclass(frozen=True, eq=False)
class MapEncoder:
    """Safety map -> latent: convolutions, then one dense layer.

    Attributes:
        convolutions: (weight (out, in * 16), bias (out,)) of each convolution.
        dense: (weight (in, latent), bias (latent,)); its inputs run over rows, columns, channels.
    """

    convolutions: tuple[tuple[Array32, Array32], ...]
    dense: tuple[Array32, Array32]

    @classmethod
    def from_tensors(cls, tensors: Tensors) -> MapEncoder:
        """Take "convolution.K.weight" and "latent.weight" as stored.

        Raises:
            ArtefactError: a tensor is missing or of another type.
        """
        count = sum(name.startswith("convolution.") and name.endswith(".bias") for name in tensors)
        convolutions = []
        for k in range(count):
            stored = _array(tensors, f"convolution.{k}.weight", 4)  # (4, 4, in, out)
            rows = stored.transpose(3, 2, 0, 1).reshape(stored.shape[3], -1)
            convolutions.append((np.ascontiguousarray(rows), _array(tensors, f"convolution.{k}.bias", 1)))
        return cls(
            tuple(convolutions), (_array(tensors, "latent.weight", 2), _array(tensors, "latent.bias", 1))
        )

    def encode(self, safety_map: Array32) -> Array32:
        """Latent of one map, shape (latent,); the map has shape (64, 64)."""
        image = np.ascontiguousarray(safety_map, dtype=np.float32)[None]
        for weight, bias in self.convolutions:
            image = _convolve(image, weight, bias)
        return _connect(image.transpose(1, 2, 0).reshape(-1), *self.dense, False)


@dataclass(frozen=True, eq=False)
class Perceptron:
    """Dense layers with rectifiers between them.

    Attributes:
        layers: (weight (in, out), bias (out,)) of each layer.
    """

    layers: tuple[tuple[Array32, Array32], ...]

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

    def evaluate(self, inputs: Array32) -> Array32:
        """Outputs of one row, without a final nonlinearity."""
        values = np.ascontiguousarray(inputs, dtype=np.float32)
        last = len(self.layers) - 1
        for k, (weight, bias) in enumerate(self.layers):
            values = _connect(values, weight, bias, k < last)
        return values
