"""Steps in a frame that turns, against motion seen from one at rest and an integrator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from guidance.descent.rotating_frame import spin_matrix, transition, transition_and_rate

seeds = st.integers(0, 1_000_000)


def seen_from_turning(position, velocity, spin, time):
    """What stands at a place in the frame at rest, seen after `time` from the one that turns with `spin`."""
    back = Rotation.from_rotvec(-spin * time)
    place = back.apply(position)
    return np.concatenate([place, back.apply(velocity) - np.cross(spin, place)])


def drawn(seed, size=0.1):
    rng = np.random.default_rng(seed)
    return rng, rng.normal(0.0, size, 3), rng.normal(0.0, 500.0, 3), rng.normal(0.0, 30.0, 3)


@given(seed=seeds)
def test_without_any_pull_the_path_is_a_straight_line_seen_from_a_turning_frame(seed):
    rng, spin, position, velocity = drawn(seed)
    time = rng.uniform(0.1, 60.0)
    step = transition(spin, time)
    thrown = velocity + np.cross(spin, position)
    expected = seen_from_turning(position + thrown * time, thrown, spin, time)
    found = step.state @ np.concatenate([position, velocity])
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(seed=seeds)
def test_with_gravity_along_the_axis_it_is_a_parabola(seed):
    rng, _, position, velocity = drawn(seed)
    spin, gravity = np.array([0.0, 0.0, rng.normal(0.0, 0.1)]), np.array([0.0, 0.0, -rng.uniform(0.1, 10.0)])
    time = rng.uniform(0.1, 60.0)
    step = transition(spin, time)
    thrown = velocity + np.cross(spin, position)
    fallen = position + thrown * time + 0.5 * gravity * time**2
    expected = seen_from_turning(fallen, thrown + gravity * time, spin, time)
    found = step.state @ np.concatenate([position, velocity]) + (step.first + step.last) @ gravity
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_a_thrust_linear_in_time_is_integrated_exactly(seed):
    rng, spin, position, velocity = drawn(seed)
    time, first, last = rng.uniform(1.0, 20.0), rng.normal(0.0, 5.0, 3), rng.normal(0.0, 5.0, 3)

    def rate(t, x):
        push = first + (last - first) * t / time
        turn = -2.0 * np.cross(spin, x[3:]) - np.cross(spin, np.cross(spin, x[:3]))
        return np.concatenate([x[3:], push + turn])

    start = np.concatenate([position, velocity])
    flown = solve_ivp(rate, (0.0, time), start, method="DOP853", rtol=1e-12, atol=1e-10).y[:, -1]
    step = transition(spin, time)
    assert step.state @ start + step.first @ first + step.last @ last == pytest.approx(flown, abs=1e-6)


def test_at_rest_it_is_the_double_integrator():
    step, h = transition(np.zeros(3), 2.5), 2.5
    one, none = np.eye(3), np.zeros((3, 3))
    assert step.state == pytest.approx(np.block([[one, h * one], [none, one]]), abs=1e-14)
    assert step.first == pytest.approx(np.vstack([h * h / 3.0 * one, h / 2.0 * one]), abs=1e-14)
    assert step.last == pytest.approx(np.vstack([h * h / 6.0 * one, h / 2.0 * one]), abs=1e-14)


@given(seed=seeds)
def test_the_rate_is_the_derivative_by_the_logarithm_of_the_spin(seed):
    rng, spin, _, _ = drawn(seed, 1.0)
    h, small = rng.uniform(0.02, 0.5), 1e-6
    step, rate = transition_and_rate(spin, h)
    more, less = transition(spin * (1.0 + small), h), transition(spin * (1.0 - small), h)
    for part, moving, above, below in zip(step, rate, more, less, strict=True):
        assert moving == pytest.approx((above - below) / (2.0 * small), abs=1e-8)
        assert part.shape == moving.shape


def test_the_spin_matrix_is_the_cross_product():
    spin, vector = np.array([0.3, -0.7, 1.1]), np.array([2.0, 5.0, -1.0])
    assert spin_matrix(spin) @ vector == pytest.approx(np.cross(spin, vector), abs=1e-15)
