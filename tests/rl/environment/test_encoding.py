from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance.state import State
from hda.task.observation import Observation
from rl.environment.encoding import (
    CURVED,
    LATENT_BOUND,
    LAYOUTS,
    PRINTED,
    RELATIVE,
    encode_map,
    encode_observation,
)
from rl.inference.latent import LATENT_SIZE

LATENT = np.linspace(-1.0, 1.0, LATENT_SIZE, dtype=np.float32)
NOMINAL = np.array([400.0, 600.0, 50.0])


def observation(position=(450.0, 500.0, 900.0), velocity=(5.0, -6.0, -30.0), mass=1195.0, clock=33.0):
    return Observation(
        index=2,
        time=10.0,
        state=State(np.array(position), np.array(velocity), mass),
        target=np.array([430.0, 560.0, 50.0]),
        safety_map=np.zeros((64, 64), dtype=np.float32),
        width=171.0,
        time_to_go=clock,
    )


def test_relative_vector_element_by_element():
    vector = encode_observation(RELATIVE, observation(), NOMINAL, LATENT)
    expected = [
        20 / 200,
        -60 / 200,
        400 / 450,
        5 / 20,
        -6 / 20,
        -10 / 20,
        20 / 25,
        0.71,
        13 / 20,
        0.3,
        -0.4,
        0.0,
    ]
    assert vector.shape == (44,)
    assert vector.dtype == np.float32
    np.testing.assert_allclose(vector[:12], expected, rtol=1e-6)
    np.testing.assert_array_equal(vector[12:], LATENT)


def test_curved_vector_element_by_element():
    vector = encode_observation(CURVED, observation(), NOMINAL, LATENT)
    curved = np.arcsinh([20 / 5, -60 / 5, 850 / 5, 2.5, -3.0, -15.0, 171 / 2, 33.0]) / 2
    expected = [*curved[:6], 0.8, *curved[6:], 0.3, -0.4, 0.0]
    np.testing.assert_allclose(vector[:12], expected, rtol=1e-6)


def test_printed_vector_element_by_element():
    vector = encode_observation(PRINTED, observation(), NOMINAL, LATENT)
    expected = [-0.1, 0.0, 400 / 450, 0.25, -0.3, -0.5, 0.8, 0.71, 0.71, -0.14, 0.12, 0.0]
    np.testing.assert_allclose(vector[:12], expected, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_names_are_unique_and_constants_are_listed(layout):
    names = [element.name for element in layout.elements]
    assert len(set(names)) == len(names) == 12
    assert set(layout.constant) <= set(names)


finite = st.floats(-1e5, 1e5)


@given(st.tuples(finite, finite, finite), st.tuples(finite, finite, finite), st.floats(1.0, 1e5), finite)
def test_always_inside_finite_bounds(position, velocity, mass, clock):
    wild = np.full(LATENT_SIZE, 1e6, dtype=np.float32)
    for layout in LAYOUTS.values():
        vector = encode_observation(layout, observation(position, velocity, mass, clock), NOMINAL, wild)
        assert np.all(vector[:12] >= layout.low)
        assert np.all(vector[:12] <= layout.high)
        assert np.all(vector[12:] == LATENT_BOUND)


def test_a_map_is_rounded_to_bytes_as_numpy_rounds():
    halves = (np.arange(256, dtype=np.float32) + np.float32(0.5)) / np.float32(255.0)
    drawn = np.random.default_rng(0).random((62, 64), dtype=np.float32)
    safety_map = np.concatenate([np.clip(halves, 0.0, 1.0).reshape(4, 64), drawn])
    assert np.array_equal(encode_map(safety_map), np.round(safety_map * 255.0).astype(np.uint8))
    assert encode_map(np.array([[0.0, 1.0]], np.float32)).tolist() == [[0, 255]]
