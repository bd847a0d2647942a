"""The cheap estimate of a landing's propellant: closed forms, a slow search, and `solve_pdg`."""

import itertools
import math

import numpy as np
import pytest
from descents import GRAVITY, paper_start
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import PAPER_LANDER, Lander, State, solve_pdg
from guidance.two_impulse import divert_cost

MIGHTY = Lander(dry_mass=1150.0, max_thrust=1e9, specific_impulse=325.0)


def estimate(state: State, x: float, y: float, lander: Lander = PAPER_LANDER) -> float:
    return float(divert_cost(state, np.array([x]), np.array([y]), 50.0, lander, GRAVITY)[0, 0])


def impulsive(time: float, state: State, site: np.ndarray) -> float:
    """Velocity change of two true impulses."""
    first = (site - state.position - GRAVITY * time**2 / 2.0) / time
    return float(np.linalg.norm(first - state.velocity) + np.linalg.norm(first + GRAVITY * time))


@pytest.mark.parametrize("gravity", [0.05, 1.62, 9.81])
def test_straight_above_it_is_free_fall_and_one_brake(gravity):
    height, sink = 400.0, 20.0
    state = State(np.array([0.0, 0.0, 50.0 + height]), np.array([0.0, 0.0, -sink]), 1190.0)
    speed = math.sqrt(sink**2 + 2.0 * gravity * height)
    expected = 1190.0 * -math.expm1(-speed / MIGHTY.exhaust_velocity)
    below = np.zeros(1)
    price = divert_cost(state, below, below, 50.0, MIGHTY, (0.0, 0.0, -gravity))[0, 0]
    assert price == pytest.approx(expected, rel=1e-5)


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32 - 1))
def test_for_an_engine_without_limit_it_is_the_best_of_two_impulses(seed):
    rng = np.random.default_rng(seed)
    state = State.parse(paper_start(rng))
    site = np.array([*rng.uniform(-200.0, 200.0, 2), 50.0])
    best = min(impulsive(time, state, site) for time in np.linspace(5.0, 40.0, 3501))
    expected = state.mass * -math.expm1(-best / MIGHTY.exhaust_velocity)
    assert estimate(state, site[0], site[1], MIGHTY) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_differences_between_sites_are_those_of_solve_pdg(seed):
    """Sites within 100 m of the first target: the choice among them is made by these differences."""
    rng = np.random.default_rng(seed)
    state = State.parse(paper_start(rng))
    sites = rng.uniform(-100.0, 100.0, (6, 2))
    true = np.array([solve_pdg(state, [x, y, 50.0], nodes=31).propellant for x, y in sites])
    cheap = np.array([estimate(state, x, y) for x, y in sites])
    np.testing.assert_allclose(cheap - cheap.mean(), true - true.mean(), atol=0.12)
    assert np.ptp(true) > 0.3
    assert abs(cheap.mean() - true.mean()) < 1.0


def test_rows_run_north_and_columns_east():
    state = State(np.array([0.0, 0.0, 900.0]), np.array([0.0, 0.0, -25.0]), 1200.0)
    east, north = np.array([-50.0, 0.0, 120.0]), np.array([0.0, 30.0])
    table = divert_cost(state, east, north, 50.0, PAPER_LANDER, GRAVITY)
    assert table.shape == (2, 3)
    for row in range(2):
        for column in range(3):
            assert table[row, column] == estimate(state, east[column], north[row])


def test_what_it_cannot_price_is_refused_by_name():
    state = State(np.array([0.0, 0.0, 40.0]), np.zeros(3), 1200.0)
    axis = np.zeros(1)
    with pytest.raises(ValueError, match="altitude 40 m must be above the plane"):
        divert_cost(state, axis, axis, 50.0, PAPER_LANDER, GRAVITY)
    for gravity in itertools.product((-0.1, 0.0, 0.1), (-0.1, 0.0, 0.1), (-1.62, 0.0, 1.62)):
        if gravity == (0.0, 0.0, -1.62):
            continue
        with pytest.raises(ValueError, match="gravity must point along -z"):
            divert_cost(state, axis, axis, 0.0, PAPER_LANDER, gravity)
