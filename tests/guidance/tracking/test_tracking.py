"""Tracking references and the regulator about them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance.pdg.solve import solve_pdg
from guidance.tracking.reference import TrackingReference, hold_thrust, make_reference
from guidance.tracking.regulator import TrackingWeights, tracking_gains

GRAVITY = np.array([0.0, 0.0, -1.62])


@pytest.fixture(scope="module")
def plan():
    return solve_pdg(
        (200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0), (0.0, 0.0, 50.0), nodes=21, method="convex"
    )


def test_held_feedforward_keeps_the_velocity_of_the_reference(plan) -> None:
    times = np.linspace(0.0, plan.time_of_flight, 40)
    position, velocity = plan.states_at(times)
    reference = make_reference(position, velocity, times[1], GRAVITY)
    flown = velocity[0] + np.cumsum((reference.thrust_acceleration + GRAVITY) * times[1], axis=0)
    np.testing.assert_allclose(flown, velocity[1:], atol=1e-10)


def test_states_between_nodes_match_a_fine_integration(plan) -> None:
    times = np.linspace(0.0, plan.time_of_flight, 200_001)
    thrust = plan.thrust / plan.mass[:, None]
    acceleration = np.stack([np.interp(times, plan.time, thrust[:, k]) for k in range(3)], axis=1) + GRAVITY
    step = times[1]
    velocity = plan.velocity[0] + np.vstack(
        [np.zeros(3), np.cumsum(0.5 * (acceleration[1:] + acceleration[:-1]) * step, axis=0)]
    )
    position = plan.position[0] + np.vstack(
        [np.zeros(3), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * step, axis=0)]
    )
    at = np.array([0, 777, 50_001, 123_456, 200_000])
    got_position, got_velocity = plan.states_at(times[at])
    np.testing.assert_allclose(got_velocity, velocity[at], atol=2e-4)
    np.testing.assert_allclose(got_position, position[at], atol=5e-3)


def test_states_at_nodes_are_the_nodes(plan) -> None:
    position, velocity = plan.states_at(plan.time)
    np.testing.assert_allclose(position, plan.position, atol=1e-4)
    np.testing.assert_allclose(velocity, plan.velocity, atol=1e-4)


@given(st.integers(0, 10**6), st.sampled_from(["auto", "convex"]), st.sampled_from([0.2, 0.5, 1.0]))
def test_held_thrusts_end_where_the_plan_ends_and_coast_where_it_coasts(seed, method, period) -> None:
    rng = np.random.default_rng(seed)
    start = (*rng.uniform(-200.0, 200.0, 2), 950.0, *rng.uniform(-8.0, 8.0, 2), -30.0, 1200.0)
    plan = solve_pdg(start, (0.0, 0.0, 50.0), nodes=31, method=method)
    times = np.minimum(period * np.arange(1 + int(plan.time_of_flight / period)), plan.time_of_flight)
    position, velocity = plan.states_at(times)
    held_position, held_velocity = hold_thrust(position, velocity, period, GRAVITY)
    thrust = np.diff(held_velocity, axis=0) / period - GRAVITY
    flown = held_position[:-1] + period * held_velocity[:-1] + 0.5 * period**2 * (thrust + GRAVITY)
    np.testing.assert_allclose(flown, held_position[1:], atol=1e-9)
    np.testing.assert_allclose(held_position[[0, -1]], position[[0, -1]], atol=1e-6)
    np.testing.assert_allclose(held_velocity[[0, -1]], velocity[[0, -1]], atol=1e-8)
    assert np.linalg.norm(held_position - position, axis=1).max() < 3.0 * period**2
    asked = np.diff(velocity, axis=0) / period - GRAVITY
    size = np.linalg.norm(asked, axis=1)
    assert np.linalg.norm(thrust - asked, axis=1)[size < 1e-9].max(initial=0.0) < 1e-9
    assert np.linalg.norm(thrust - asked, axis=1).max() < 0.12 * size.max()


def test_a_single_held_thrust_cannot_be_corrected() -> None:
    position, velocity = (
        np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]]),
        np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 0.0]]),
    )
    same = hold_thrust(position, velocity, 1.0, GRAVITY)
    assert same[0] is position
    assert same[1] is velocity


@settings(max_examples=25)
@given(
    h=st.floats(0.2, 2.0),
    position=st.floats(0.05, 1.0),
    velocity=st.floats(0.1, 5.0),
    acceleration=st.floats(0.1, 5.0),
)
def test_gains_solve_the_riccati_equation_and_are_stable(
    h: float, position: float, velocity: float, acceleration: float
) -> None:
    gains = np.array([tracking_gains(h, TrackingWeights(position, velocity, acceleration))])
    motion, push = np.array([[1.0, h], [0.0, 1.0]]), np.array([[0.5 * h * h], [h]])
    cost, effort = np.diag([position**-2, velocity**-2]), acceleration**-2
    value, gain = cost.copy(), np.zeros((1, 2))  # value iteration: shares nothing with a Riccati solver
    for _ in range(4000):
        gain = (push.T @ value @ motion) / (effort + push.T @ value @ push)
        value = cost + motion.T @ value @ (motion - push @ gain)
    np.testing.assert_allclose(gains, gain, rtol=1e-5)
    assert np.abs(np.linalg.eigvals(motion - push @ gains)).max() < 1.0


@settings(max_examples=50)
@given(
    h=st.floats(0.01, 5.0),
    position=st.floats(0.01, 10.0),
    velocity=st.floats(0.01, 10.0),
    acceleration=st.floats(0.05, 20.0),
)
def test_gains_are_those_of_python_control_to_the_bit(
    h: float, position: float, velocity: float, acceleration: float
) -> None:
    import control

    theirs, _, _ = control.dlqr(
        [[1.0, h], [0.0, 1.0]],
        [[0.5 * h * h], [h]],
        np.diag([position**-2, velocity**-2]),
        [[acceleration**-2]],
        method="scipy",
    )
    ours = tracking_gains(h, TrackingWeights(position, velocity, acceleration))
    assert tuple(ours) == tuple(np.asarray(theirs)[0])


def test_what_is_left_of_a_reference() -> None:
    rng = np.random.default_rng(0)
    reference = make_reference(rng.random((6, 3)), rng.random((6, 3)), 0.5, GRAVITY)
    assert reference.duration == 2.5
    left = reference.after(3)
    assert left is not None
    np.testing.assert_array_equal(left.position, reference.position[3:])
    np.testing.assert_array_equal(left.thrust_acceleration, reference.thrust_acceleration[3:])
    assert reference.after(5) is None
    assert reference.after(9) is None


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(ValueError, match="thrust_acceleration"):
        TrackingReference(0.5, np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3)))
    with pytest.raises(ValueError, match="velocity"):
        TrackingReference(0.5, np.zeros((4, 3)), np.zeros((5, 3)), np.zeros((3, 3)))


@pytest.mark.parametrize("name", ["position", "velocity", "acceleration"])
def test_weights_must_be_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        TrackingWeights(**{name: 0.0})
