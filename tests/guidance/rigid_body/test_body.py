"""What a rigid body and its state refuse, and what they keep."""

import numpy as np
import pytest

from guidance import State
from guidance.rigid_body import DEFAULT_BODY, RigidBody, RigidState


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("inertia", (1.0, 1.0, 2.5)),
        ("inertia", (0.0, 1.0, 1.0)),
        ("inertia_mass", 0.0),
        ("inertia_exponent", -1.0),
        ("torque_limit", (-1.0, 1.0, 1.0)),
        ("rate_limit", 0.0),
        ("tilt_limit", 4.0),
        ("engine_lag", -0.1),
        ("gimbal_limit", 2.0),
        ("engine_arm", float("nan")),
        ("lander", "paper"),
    ],
)
def test_a_body_that_cannot_exist_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        RigidBody(**{field: value})


def test_inertia_follows_the_mass():
    np.testing.assert_allclose(DEFAULT_BODY.inertia_at(600.0), [440.0, 440.0, 520.0])
    fixed = RigidBody(inertia_exponent=0.0)
    np.testing.assert_array_equal(fixed.inertia_at(600.0), [880.0, 880.0, 1040.0])


def test_a_state_is_frozen_and_comes_back_from_its_numbers():
    state = RigidState(
        np.arange(3.0), np.ones(3), 1200.0, np.array([0.5, 0.5, 0.5, 0.5]), np.full(3, 0.1), np.full(3, 2.0)
    )
    np.testing.assert_array_equal(RigidState.of_array(state.as_array()).as_array(), state.as_array())
    with pytest.raises(ValueError, match="read-only"):
        state.attitude[0] = 2.0
    point = RigidState.parse(State(np.arange(3.0), np.ones(3), 1200.0))
    np.testing.assert_array_equal(point.attitude, [1.0, 0.0, 0.0, 0.0])
    assert RigidState.parse(state) is state


@pytest.mark.parametrize("attitude", [[0.0, 0.0, 0.0, 0.0], [1.0, 0.1, 0.0, 0.0], [1.0, 0.0, 0.0]])
def test_an_attitude_that_is_none_is_refused(attitude):
    with pytest.raises(ValueError, match="attitude"):
        RigidState(np.zeros(3), np.zeros(3), 1200.0, np.array(attitude))
