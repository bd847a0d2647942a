"""Quaternion kernels against scipy's rotations, and the attitude of a thrust."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from guidance.rigid_body import attitude_along, rotate
from guidance.rigid_body.quaternion import error_into, heading_angle, tilt_angle
from tests.guidance.rigid_body.rigid_cases import ATTITUDES, DIRECTIONS, vectors


def as_rotation(attitude: np.ndarray) -> Rotation:
    return Rotation.from_quat(attitude, scalar_first=True)


@given(attitude=ATTITUDES, vector=vectors(10.0))
def test_a_body_vector_is_seen_as_scipy_sees_it(attitude, vector):
    np.testing.assert_allclose(rotate(attitude, vector), as_rotation(attitude).apply(vector), atol=1e-12)


@given(attitude=ATTITUDES, turn=vectors(1.7), sign=st.sampled_from((-1.0, 1.0)))
def test_the_error_is_the_turn_that_was_made(attitude, turn, sign):
    wanted = (as_rotation(attitude) * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)
    error = np.empty(3)
    error_into(attitude, sign * wanted, error)  # q and -q are one attitude
    np.testing.assert_allclose(error, turn, atol=1e-9)


@given(direction=DIRECTIONS, heading=st.floats(-3.1, 3.1))
def test_an_attitude_along_a_direction_points_there_and_keeps_the_heading(direction, heading):
    attitude = attitude_along(direction, heading)
    unit = direction / np.linalg.norm(direction)
    np.testing.assert_allclose(rotate(attitude, [0.0, 0.0, 1.0]), unit, atol=1e-12)
    tilt = math.atan2(math.hypot(unit[0], unit[1]), unit[2])
    assert tilt_angle(attitude) == pytest.approx(tilt, abs=1e-9)
    if tilt < 3.0:
        assert math.remainder(heading_angle(attitude) - heading, 2.0 * math.pi) == pytest.approx(
            0.0, abs=1e-9
        )


def test_straight_down_is_an_attitude_too():
    axis = rotate(attitude_along([0.0, 0.0, -3.0]), [0.0, 0.0, 1.0])
    np.testing.assert_allclose(axis, [0.0, 0.0, -1.0], atol=1e-15)


def test_a_zero_direction_is_refused():
    with pytest.raises(ValueError, match="direction must not be zero"):
        attitude_along([0.0, 0.0, 0.0])
