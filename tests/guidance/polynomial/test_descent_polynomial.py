"""Closed forms of polynomial descents: what they meet, and what they minimise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import guidance
from guidance.polynomial import Arrival, meet_arrival

SITE = np.array([10.0, -20.0, 50.0])


def vectors(bound: float) -> st.SearchStrategy[np.ndarray]:
    return arrays.arrays(np.float64, 3, elements=st.floats(-bound, bound))


@st.composite
def descents(draw: st.DrawFn, *, with_acceleration: bool) -> tuple[guidance.State, Arrival, float]:
    """A start, an end and a time of flight."""
    state = guidance.State(draw(vectors(1000.0)), draw(vectors(50.0)), 1180.0)
    acceleration = draw(vectors(5.0)) if with_acceleration else None
    return (
        state,
        Arrival(draw(vectors(100.0)), draw(vectors(10.0)), acceleration),
        draw(st.floats(1.0, 100.0)),
    )


@given(st.one_of(descents(with_acceleration=False), descents(with_acceleration=True)))
def test_it_leaves_the_state_and_meets_the_arrival(case):
    state, arrival, seconds = case
    descent = meet_arrival(state, arrival, seconds)
    ends = np.array([0.0, seconds])
    np.testing.assert_allclose(
        descent.position_at(ends), [state.position, arrival.position], rtol=0.0, atol=1e-8
    )
    np.testing.assert_allclose(
        descent.velocity_at(ends), [state.velocity, arrival.velocity], rtol=0.0, atol=1e-8
    )
    if arrival.acceleration is not None:
        np.testing.assert_allclose(
            descent.acceleration_at(ends)[1], arrival.acceleration, rtol=0.0, atol=1e-12
        )


@given(descents(with_acceleration=False))
def test_e_guidance_is_zem_zev_with_the_gains_of_least_energy(case):
    state, arrival, seconds = case
    descent = meet_arrival(state, arrival, seconds)
    gravity = np.array(guidance.MOON_GRAVITY)
    thrust = guidance.zem_zev_acceleration(
        state, arrival.position, seconds, target_velocity=arrival.velocity, gravity=gravity
    )
    np.testing.assert_allclose(
        descent.acceleration_at(np.zeros(1))[0] - gravity, thrust, rtol=1e-9, atol=1e-8
    )


@given(descents(with_acceleration=True))
def test_apollos_first_acceleration_is_klumpps(case):
    state, arrival, seconds = case
    start = meet_arrival(state, arrival, seconds).acceleration_at(np.zeros(1))[0]
    law = 12.0 * (arrival.position - state.position) / seconds**2
    law += -6.0 * (arrival.velocity + state.velocity) / seconds + arrival.acceleration
    np.testing.assert_allclose(start, law, rtol=1e-9, atol=1e-8)


@given(descents(with_acceleration=True), st.floats(0.0, 0.9))
def test_a_descent_solved_anew_on_its_way_is_the_same(case, share):
    state, arrival, seconds = case
    descent = meet_arrival(state, arrival, seconds)
    passed = np.array([share * seconds])
    midway = guidance.State(descent.position_at(passed)[0], descent.velocity_at(passed)[0], 1180.0)
    later = meet_arrival(midway, arrival, (1.0 - share) * seconds)
    np.testing.assert_allclose(
        later.acceleration_at(np.zeros(1)), descent.acceleration_at(passed), rtol=1e-6, atol=1e-6
    )


@given(descents(with_acceleration=False), vectors(1.0), st.integers(1, 4))
def test_no_flight_of_the_same_ends_and_time_has_less_energy_than_e_guidance(case, aside, waves):
    """Variations s^2 (T - s)^2 sin(...) keep position and velocity at both ends."""
    state, arrival, seconds = case
    descent = meet_arrival(state, arrival, seconds)
    time = np.linspace(0.0, seconds, 4001)
    bump = (time * (seconds - time) / seconds**2) ** 2 * np.sin(waves * np.pi * time / seconds)
    varied = np.gradient(np.gradient(bump, time), time)[:, None] * aside + descent.acceleration_at(time)
    least, other = (np.trapezoid((a**2).sum(axis=1), time) for a in (descent.acceleration_at(time), varied))
    assert least <= other * (1.0 + 1e-4) + 1e-6


def test_velocity_is_the_slope_of_position_and_acceleration_that_of_velocity():
    state = guidance.State(np.array([200.0, 100.0, 950.0]), np.array([-8.0, -4.0, -30.0]), 1200.0)
    descent = meet_arrival(state, Arrival(SITE, acceleration=np.array([0.0, 0.0, 2.0])), 33.0)
    time = np.linspace(1.0, 32.0, 200)
    step = 1e-4
    for value, slope in (
        (descent.position_at, descent.velocity_at),
        (descent.velocity_at, descent.acceleration_at),
    ):
        numerical = (value(time + step) - value(time - step)) / (2.0 * step)
        np.testing.assert_allclose(numerical, slope(time), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("position", lambda: Arrival(np.zeros(2))),
        ("velocity", lambda: Arrival(np.zeros(3), np.full(3, np.nan))),
        ("acceleration", lambda: Arrival(np.zeros(3), acceleration=np.zeros(4))),
        (
            "time_of_flight",
            lambda: meet_arrival(guidance.State(np.ones(3), np.zeros(3), 1200.0), Arrival(np.zeros(3)), 0.0),
        ),
    ],
)
def test_what_means_nothing_is_refused_by_name(name, make):
    with pytest.raises(ValueError, match=name):
        make()
