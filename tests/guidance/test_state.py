import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from guidance import State

NUMBERS = st.floats(-1e6, 1e6)
VECTORS = st.lists(NUMBERS, min_size=3, max_size=3)
MASSES = st.floats(1e-3, 1e6)


@given(position=VECTORS, velocity=VECTORS, mass=MASSES)
def test_seven_numbers_make_the_round_trip(position, velocity, mass):
    numbers = [*position, *velocity, mass]
    state = State.parse(numbers)
    assert state.as_array().tolist() == numbers
    again = State.parse(state.as_array())
    assert again.position.tolist() == position
    assert again.velocity.tolist() == velocity
    assert again.mass == mass


def test_parse_returns_a_state_unchanged():
    state = State(np.zeros(3), np.ones(3), 1200.0)
    assert State.parse(state) is state


def test_state_does_not_share_memory_with_its_source():
    position = np.array([1.0, 2.0, 3.0])
    state = State(position, np.zeros(3), 1200.0)
    position[0] = 99.0
    numbers = state.as_array()
    numbers[1] = 99.0
    assert state.position.tolist() == [1.0, 2.0, 3.0]


def test_state_cannot_be_changed():
    state = State(np.zeros(3), np.zeros(3), 1200.0)
    with pytest.raises(ValueError, match="read-only"):
        state.position[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        state.velocity[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.mass = 1.0  # type: ignore[misc]


def test_state_crosses_a_process_boundary():
    state = State(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 7.0)
    assert pickle.loads(pickle.dumps(state)).as_array().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]


@pytest.mark.parametrize("field", ["position", "velocity"])
@pytest.mark.parametrize(
    "value",
    [
        [0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0],
        [[0.0, 0.0, 0.0]],
        5.0,
        [0.0, math.nan, 0.0],
        [0.0, 0.0, math.inf],
        ["a", "b", "c"],
        [[0.0], [1.0, 2.0], 3.0],
        None,
    ],
)
def test_wrong_vector_is_named(field, value):
    fields = {"position": np.zeros(3), "velocity": np.zeros(3), "mass": 1200.0, field: value}
    with pytest.raises(ValueError, match=rf"^{field} must"):
        State(**fields)


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf, "heavy", None, [1200.0, 1.0]])
def test_wrong_mass_is_named(mass):
    with pytest.raises(ValueError, match=r"^mass must be"):
        State(np.zeros(3), np.zeros(3), mass)


@pytest.mark.parametrize("value", [[0.0] * 6, [0.0] * 8, [math.nan] * 7, "lander", None, 3.0])
def test_parse_names_what_is_not_a_state(value):
    with pytest.raises(ValueError, match=r"^state must"):
        State.parse(value)


def test_parse_names_a_mass_that_is_not_positive():
    with pytest.raises(ValueError, match=r"^mass must be greater than 0"):
        State.parse([0.0] * 7)
