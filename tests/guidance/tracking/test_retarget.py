"""A shifted descent: ends where asked, keeps its time and height, and costs what the quintic says."""

import math

import numpy as np
import pytest
from descents import GRAVITY, TARGET
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import PAPER_LANDER, Lander, State
from guidance.tracking.reference import TrackingReference, make_reference
from guidance.tracking.retarget import shift_landing_point, velocity_change, within_pointing, within_thrust
from guidance.tracking.soft_landing import plan_soft_landing

PERIOD = 0.5


@pytest.fixture(scope="module")
def descent() -> TrackingReference:
    start = State(np.array([200.0, 60.0, 950.0]), np.array([-7.0, -2.0, -25.0]), 1200.0)
    reference = plan_soft_landing(start, TARGET, PAPER_LANDER, PERIOD).reference
    assert reference is not None
    return reference


@settings(max_examples=40)
@given(x=st.floats(-20.0, 20.0), y=st.floats(-20.0, 20.0), flown=st.sampled_from([0, 20, 40]))
def test_it_starts_as_it_is_and_ends_at_rest_on_the_new_site(descent, x, y, flown):
    left = descent.after(flown)
    site = TARGET + np.array([x, y, 0.0])
    shifted = shift_landing_point(left, site, GRAVITY)
    np.testing.assert_allclose(shifted.position[0], left.position[0], atol=1e-9)
    np.testing.assert_allclose(shifted.velocity[0], left.velocity[0], atol=1e-9)
    np.testing.assert_allclose(shifted.position[-1], site, atol=1e-9)
    np.testing.assert_allclose(shifted.velocity[-1], 0.0, atol=1e-6)
    np.testing.assert_allclose(shifted.position[:, 2], left.position[:, 2], atol=1e-6)
    assert shifted.duration == left.duration


def test_its_acceleration_integrates_to_its_velocity(descent):
    shifted = shift_landing_point(descent, TARGET + np.array([15.0, -5.0, 0.0]), GRAVITY)
    step = PERIOD * (shifted.thrust_acceleration + GRAVITY)
    np.testing.assert_allclose(np.diff(shifted.velocity, axis=0), step, atol=1e-12)
    mean = 0.5 * (shifted.velocity[1:] + shifted.velocity[:-1])
    gap = np.diff(shifted.position, axis=0) - np.diff(descent.position, axis=0)
    old = 0.5 * (descent.velocity[1:] + descent.velocity[:-1])
    np.testing.assert_allclose(gap, PERIOD * (mean - old), atol=2e-3)  # the trapezoidal rule's error


def test_the_greatest_acceleration_is_5_77_offsets_over_the_time_squared():
    count = 400
    hover = make_reference(np.tile(TARGET, (count, 1)), np.zeros((count, 3)), 0.02, GRAVITY)
    shifted = shift_landing_point(hover, TARGET + np.array([10.0, 0.0, 0.0]), GRAVITY)
    across = np.abs(shifted.thrust_acceleration[:, 0]).max()
    assert across == pytest.approx(5.7735 * 10.0 / hover.duration**2, rel=1e-3)
    assert velocity_change(hover) == pytest.approx(1.62 * hover.duration, rel=1e-9)
    assert velocity_change(shifted) > velocity_change(hover)


def test_thrust_is_judged_at_the_start_mass(descent):
    push = np.linalg.norm(descent.thrust_acceleration, axis=1).max() * 1200.0
    spare = 1.0 - push / PAPER_LANDER.max_thrust
    assert 0.0 < spare < 0.2
    assert within_thrust(descent, PAPER_LANDER, 1200.0, spare - 1e-6)
    assert not within_thrust(descent, PAPER_LANDER, 1200.0, spare + 1e-6)
    far = shift_landing_point(descent.after(45), TARGET + np.array([200.0, 0.0, 0.0]), GRAVITY)
    assert not within_thrust(far, PAPER_LANDER, 1200.0, 0.05)


def test_a_shift_that_leans_too_far_is_seen():
    count = 41
    hover = make_reference(np.tile(TARGET, (count, 1)), np.zeros((count, 3)), PERIOD, GRAVITY)
    limited = Lander(pointing_limit=math.radians(10.0))
    reach = math.tan(math.radians(10.0)) * 1.62 * hover.duration**2 / 5.7735
    for share, kept in ((0.9, True), (1.3, False)):
        shifted = shift_landing_point(hover, TARGET + np.array([0.0, share * reach, 0.0]), GRAVITY)
        assert within_pointing(shifted, limited, 0.0) is kept
        assert within_pointing(shifted, PAPER_LANDER, 0.0)
    near = shift_landing_point(hover, TARGET + np.array([0.9 * reach, 0.0, 0.0]), GRAVITY)
    assert not within_pointing(near, limited, 0.4)


def test_a_coasting_engine_cannot_shift_sideways_under_a_limit(descent):
    limited = Lander(pointing_limit=math.radians(60.0))
    start = State(np.array([200.0, 60.0, 950.0]), np.array([-7.0, -2.0, -25.0]), 1200.0)
    upright = plan_soft_landing(start, TARGET, limited, PERIOD).reference
    assert upright is not None
    assert within_pointing(upright, limited, 0.05)
    coasts = np.linalg.norm(upright.thrust_acceleration, axis=1) < 0.01
    assert coasts.sum() > 5
    shifted = shift_landing_point(upright, TARGET + np.array([30.0, 0.0, 0.0]), GRAVITY)
    assert not within_pointing(shifted, limited, 0.05)
    assert not within_pointing(descent, Lander(pointing_limit=math.radians(5.0)), 0.05)
