"""The time to go under a pointing limit: the shortest flight that keeps it, judged by flying it."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from guidance import Lander, State, propagate, time_to_go, zem_zev_acceleration
from guidance.upright_time import upright_time_to_go

TARGET = np.array([500.0, 400.0, 50.0])
SEEDS = st.integers(0, 2**32 - 1)


def random_start(seed: int) -> State:
    rng = np.random.default_rng(seed)
    position = TARGET + np.array([*rng.uniform(-250.0, 250.0, 2), rng.uniform(300.0, 950.0)])
    return State(position, np.array([*rng.uniform(-10.0, 10.0, 2), rng.uniform(-35.0, -5.0)]), 1200.0)


def follow(state: State, flight_time: float) -> tuple[float, float]:
    """(greatest tilt [rad], mass at the end [kg]) of the undisturbed flight, by the law in short steps."""
    lander = Lander(max_thrust=1e6, dry_mass=1.0)
    tilt, remaining = 0.0, flight_time
    while remaining > 0.1:
        push = zem_zev_acceleration(state, TARGET, remaining)
        tilt = max(tilt, math.atan2(math.hypot(push[0], push[1]), push[2]))
        step = 0.005 * remaining
        state = propagate(state, state.mass * push, step, lander)
        remaining -= step
    return tilt, state.mass


@given(seed=SEEDS)
def test_without_a_limit_it_is_the_quartics_to_the_bit(seed):
    state = random_start(seed)
    assert upright_time_to_go(state, TARGET, Lander()) == time_to_go(state, TARGET)


@settings(max_examples=25)
@given(seed=SEEDS, degrees=st.floats(8.0, 80.0))
def test_the_flight_keeps_the_limit_less_the_margin_and_a_shorter_one_does_not(seed, degrees):
    state, limit = random_start(seed), math.radians(degrees)
    quartic = time_to_go(state, TARGET)
    chosen = upright_time_to_go(state, TARGET, Lander(pointing_limit=limit, dry_mass=600.0))
    assert quartic <= chosen <= 3.0 * quartic
    assume(chosen < 3.0 * quartic)
    assert follow(state, chosen)[0] <= 0.9 * limit + math.radians(0.2)
    if chosen > quartic:
        # the law's steps are held, and its last instants are cut off: half a degree
        assert follow(state, chosen - 0.03 * quartic)[0] > 0.9 * limit - math.radians(0.5)


def test_a_tank_that_cannot_pay_for_the_upright_flight_gets_the_most_upright_that_it_can():
    state, limit = random_start(3), math.radians(4.0)
    rich = upright_time_to_go(state, TARGET, Lander(pointing_limit=limit, dry_mass=600.0))
    poor = upright_time_to_go(state, TARGET, Lander(pointing_limit=limit, dry_mass=1150.0))
    empty = upright_time_to_go(state, TARGET, Lander(pointing_limit=limit, dry_mass=1199.9))
    assert empty == time_to_go(state, TARGET)
    assert empty < poor < rich
    assert follow(state, poor)[1] > 1150.0 > follow(state, rich)[1]
    assert follow(state, poor)[0] < follow(state, empty)[0]


def test_at_rest_on_the_target_no_time_is_left():
    state = State(TARGET, np.zeros(3), 1200.0)
    assert upright_time_to_go(state, TARGET, Lander(pointing_limit=0.2)) == 0.0


@pytest.mark.parametrize("margin", [-0.1, 0.95, float("nan")])
def test_a_margin_out_of_range_is_named(margin):
    with pytest.raises(ValueError, match="margin"):
        upright_time_to_go(random_start(0), TARGET, Lander(), margin=margin)
