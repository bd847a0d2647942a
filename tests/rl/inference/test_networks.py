"""The compiled encoder against the same sums written plainly, to the bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rl.inference.artefacts import ArtefactError
from rl.inference.latent import load_autoencoder, load_encoder
from rl.inference.networks import MapEncoder


def convolve_plainly(image: np.ndarray, kernel: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Image (in, rows, columns), kernel (4, 4, in, out) -> (out, rows/2, columns/2), in fours of terms."""
    inputs, rows, columns = image.shape
    padded = np.pad(image, ((0, 0), (1, 1), (1, 1)))
    total = np.broadcast_to(bias[:, None, None], (bias.size, rows // 2, columns // 2)).copy()
    for channel in range(inputs):
        for p in range(4):
            terms = [
                kernel[p, q, channel][:, None, None]
                * padded[channel, p : p + rows : 2, q : q + columns : 2][None]
                for q in range(4)
            ]
            total += (terms[0] + terms[1]) + (terms[2] + terms[3])
    return np.maximum(total, np.float32(0.0))


def encode_plainly(safety_map: np.ndarray, tensors: dict[str, np.ndarray], layers: int) -> np.ndarray:
    image = safety_map[None]
    for k in range(layers):
        image = convolve_plainly(image, tensors[f"convolution.{k}.weight"], tensors[f"convolution.{k}.bias"])
    out = tensors["latent.bias"].copy()
    for value, row in zip(image.transpose(1, 2, 0).ravel(), tensors["latent.weight"], strict=True):
        out += value * row
    return out


def draw_tensors(rng: np.random.Generator, channels: tuple[int, ...], side: int) -> dict[str, np.ndarray]:
    tensors = {}
    for k, (inputs, outputs) in enumerate(zip((1, *channels[:-1]), channels, strict=True)):
        shape = (4, 4, inputs, outputs)
        tensors[f"convolution.{k}.weight"] = rng.normal(0.0, 0.2, shape).astype(np.float32)
        tensors[f"convolution.{k}.bias"] = rng.normal(0.0, 0.2, outputs).astype(np.float32)
    numbers = (side >> len(channels)) ** 2 * channels[-1]
    tensors["latent.weight"] = rng.normal(0.0, 0.1, (numbers, 5)).astype(np.float32)
    tensors["latent.bias"] = rng.normal(0.0, 0.1, 5).astype(np.float32)
    return tensors


@settings(max_examples=15)
@given(
    seed=st.integers(0, 2**32 - 1),
    channels=st.sampled_from([(16,), (32,), (16, 32), (48, 16), (16, 32, 32)]),
)
def test_any_encoder_sums_in_the_stated_order(seed, channels):
    rng = np.random.default_rng(seed)
    side = 8 << len(channels)
    tensors = draw_tensors(rng, channels, side)
    safety_map = np.where(rng.random((side, side)) < 0.4, 0.0, rng.random((side, side))).astype(np.float32)
    latent = MapEncoder.from_tensors(tensors).encode(safety_map)
    np.testing.assert_array_equal(latent, encode_plainly(safety_map, tensors, len(channels)))


def test_the_shipped_encoder_sums_in_the_stated_order():
    rng = np.random.default_rng(4)
    for safety_map in (np.zeros((64, 64)), np.ones((64, 64)), rng.random((64, 64))):
        image = safety_map.astype(np.float32)
        expected = encode_plainly(image, load_autoencoder().tensors, 3)
        np.testing.assert_array_equal(load_encoder().encode(image), expected)


@pytest.mark.parametrize("shape", [(63, 64), (64, 16), (0, 64), (64,), (1, 64, 64)])
def test_a_map_that_cannot_be_halved_is_refused(shape):
    with pytest.raises(ValueError, match="safety_map must have sides in multiples of 32"):
        load_encoder().encode(np.zeros(shape, dtype=np.float32))


def test_outputs_that_fill_no_lanes_are_refused():
    tensors = draw_tensors(np.random.default_rng(0), (16, 24), 32)
    with pytest.raises(ArtefactError, match="convolution 1 must have a multiple of 16 outputs, got 24"):
        MapEncoder.from_tensors(tensors)
