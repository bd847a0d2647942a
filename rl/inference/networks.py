"""Inference of small networks without torch: compiled loops, the same bits on any number of threads.

Training uses torch; what is shipped is a list of arrays and these loops. Inner loops run over outputs, so
they vectorise without reordering any sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guidance.kernel import compile_kernel
from rl.inference.arrays import Array32
from rl.inference.artefacts import ArtefactError, Tensors
from rl.inference.lanes import LANES, load_lanes, spread_element, store_positive


@compile_kernel
def _convolve_into(image: Array32, weight: Array32, bias: Array32, out: Array32, border: int) -> None:
    """4 x 4 kernel, stride 2, rectified: four neighbouring outputs of one row and 16 channels at a time.

    Args:
        image: shape (rows + 2, columns + 2, in), with a border of zeros; at least 8 columns.
        weight: shape (out / 16, in * 16 * 16): for each 16 outputs, for each input and tap, in this order.
        bias: shape (out,).
        out: shape (rows / 2 + 2 border, columns / 2 + 2 border, out); its border is left as it is.
        border: around what is written.
    """
    columns, inputs = image.shape[1], image.shape[2]
    outputs, line = out.shape[2], columns * inputs
    read, written = image.reshape(-1), out.reshape(-1)
    half_rows, half_columns = (image.shape[0] - 2) // 2, (columns - 2) // 2
    for block in range(weight.shape[0]):
        taps = weight[block]
        for i in range(half_rows):
            for start in range(0, half_columns, 4):
                j = min(start, half_columns - 4)
                first = second = third = fourth = load_lanes(bias, block * LANES)
                tap = 0
                for channel in range(inputs):
                    place = 2 * i * line + 2 * j * inputs + channel
                    for _ in range(4):
                        a, b = load_lanes(taps, tap), load_lanes(taps, tap + LANES)
                        c, d = load_lanes(taps, tap + 2 * LANES), load_lanes(taps, tap + 3 * LANES)
                        e, f = spread_element(read, place), spread_element(read, place + inputs)
                        g, h = (
                            spread_element(read, place + 2 * inputs),
                            spread_element(read, place + 3 * inputs),
                        )
                        first = first + ((a * e + b * f) + (c * g + d * h))
                        e, f = (
                            spread_element(read, place + 4 * inputs),
                            spread_element(read, place + 5 * inputs),
                        )
                        second = second + ((a * g + b * h) + (c * e + d * f))
                        g, h = (
                            spread_element(read, place + 6 * inputs),
                            spread_element(read, place + 7 * inputs),
                        )
                        third = third + ((a * e + b * f) + (c * g + d * h))
                        e, f = (
                            spread_element(read, place + 8 * inputs),
                            spread_element(read, place + 9 * inputs),
                        )
                        fourth = fourth + ((a * g + b * h) + (c * e + d * f))
                        tap, place = tap + 4 * LANES, place + line
                to = ((i + border) * out.shape[1] + j + border) * outputs + block * LANES
                store_positive(first, written, to)
                store_positive(second, written, to + outputs)
                store_positive(third, written, to + 2 * outputs)
                store_positive(fourth, written, to + 3 * outputs)


@compile_kernel
def _connect(inputs: Array32, weight: Array32, bias: Array32, rectify: bool) -> Array32:
    """Dense layer: inputs (in,), weight (in, out), bias (out,)."""
    out = bias.copy()
    for i in range(inputs.shape[0]):
        value, row = inputs[i], weight[i]
        if value != 0.0:
            for k in range(out.shape[0]):
                out[k] += value * row[k]
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
        convolutions: (weight, bias) of each convolution, as `_convolve_into` takes them.
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
            if stored.shape[3] % LANES:
                raise ArtefactError(
                    f"convolution {k} must have a multiple of {LANES} outputs, got {stored.shape[3]}"
                )
            blocks = stored.reshape(4, 4, stored.shape[2], -1, LANES).transpose(3, 2, 0, 1, 4)
            weight = np.ascontiguousarray(blocks).reshape(len(blocks), -1)
            convolutions.append((weight, _array(tensors, f"convolution.{k}.bias", 1)))
        return cls(
            tuple(convolutions), (_array(tensors, "latent.weight", 2), _array(tensors, "latent.bias", 1))
        )

    def encode(self, safety_map: Array32) -> Array32:
        """Latent of one map, shape (latent,); the map has shape (64, 64).

        Raises:
            ValueError: the map has sides that the convolutions cannot halve.
        """
        last = len(self.convolutions) - 1
        side = 8 << last
        if safety_map.ndim != 2 or 0 in safety_map.shape or any(n % side for n in safety_map.shape):
            raise ValueError(f"safety_map must have sides in multiples of {side}, got {safety_map.shape}")
        rows, columns = safety_map.shape
        image = np.zeros((rows + 2, columns + 2, 1), dtype=np.float32)
        image[1:-1, 1:-1, 0] = safety_map
        for k, (weight, bias) in enumerate(self.convolutions):
            rows, columns, border = rows // 2, columns // 2, int(k < last)
            out = np.zeros((rows + 2 * border, columns + 2 * border, bias.size), dtype=np.float32)
            _convolve_into(image, weight, bias, out, border)
            image = out
        return _connect(image.reshape(-1), *self.dense, False)


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

    @property
    def outputs(self) -> int:
        """Numbers that come out."""
        return self.layers[-1][1].size

    def evaluate(self, inputs: Array32) -> Array32:
        """Outputs of one row, without a final nonlinearity."""
        values = np.ascontiguousarray(inputs, dtype=np.float32)
        last = len(self.layers) - 1
        for k, (weight, bias) in enumerate(self.layers):
            values = _connect(values, weight, bias, k < last)
        return values
