"""Flight over true ground against closed forms, the flight to a plane, and a literal loop."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import MOON_GRAVITY, PAPER_LANDER, State
from guidance.dynamics import propagate_into
from hda.flight.ground_contact import Motion, fall_to_ground, hold_over_ground
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Surroundings, fly_over
from hda.policy import Decision, ZemZevCommand
from hda.safety.criteria import DEFAULT_CRITERIA
from hda.safety.touchdown_stance import Footing, Stance, contact_height, make_footing

GRAVITY = np.array(MOON_GRAVITY)
PULL = 1.62
EXHAUST_VELOCITY = PAPER_LANDER.exhaust_velocity
INTERVAL = ControlPeriods(0.5, 10)
LOW = 20.0


def footing(elevation: np.ndarray, plane: float = 50.0) -> Footing:
    ground = elevation.astype(np.float32)
    ground.flags.writeable = False
    return make_footing(ground, Stance.of(DEFAULT_CRITERIA), plane)


def flat(height: float = LOW, side: int = 200) -> Footing:
    return footing(np.full((side, side), height))


WIDE = flat(side=2000)


def motion(position: Any, velocity: Any, thrust: Any = (0.0, 0.0, 0.0), mass: float = 1170.0) -> Motion:
    start = np.array([*position, *velocity, mass], dtype=float)
    return Motion(start, np.array(thrust, dtype=float), GRAVITY, EXHAUST_VELOCITY)


def state_at(held: Motion, time: float) -> np.ndarray:
    out = np.empty(7)
    propagate_into(held.start, held.thrust, time, held.gravity, held.exhaust_velocity, out)
    return out


@given(height=st.floats(0.01, 900.0), climb=st.floats(-40.0, 20.0), drift=st.floats(-3.0, 3.0))
def test_over_flat_ground_it_falls_as_galileo_says(height, climb, drift):
    out = np.empty(7)
    start = np.array([1000.0, 1000.0, LOW + height, drift, -drift, climb, 1170.0])
    took = fall_to_ground(start, GRAVITY, WIDE, out)
    expected = (climb + math.sqrt(climb**2 + 2.0 * PULL * height)) / PULL
    assert took == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert out[2] == pytest.approx(LOW, abs=1e-6)
    assert out[5] == pytest.approx(-math.sqrt(climb**2 + 2.0 * PULL * height), abs=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=300)
def test_flat_ground_at_the_sites_height_is_the_plane(seed):
    """Whatever an interval meets: saturation, dips, cut-off, an empty tank, the ground under power."""
    rng = np.random.default_rng(seed)
    height = float(10.0 ** rng.uniform(-1.0, 2.5))
    speed = math.sqrt(height)
    site = np.array([1000.0, 1000.0, LOW])
    state = State(
        site + np.array([*rng.uniform(-0.2, 0.2, 2) * height, height]),
        np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-2.0, 0.5)]) * speed,
        1150.0 + float(10.0 ** rng.uniform(-2.0, 1.7)),
    )
    command = ZemZevCommand(rng.uniform(5.0, 7.0), rng.uniform(1.0, 3.0), rng.uniform(0.3, 15.0))
    decision, errors = Decision(site, command), FlightErrors(rng.uniform(-0.05, 0.05))
    plane = fly_over(state, decision, PAPER_LANDER, Surroundings(GRAVITY), INTERVAL, errors)
    ground = fly_over(state, decision, PAPER_LANDER, Surroundings(GRAVITY, WIDE), INTERVAL, errors)
    assert ground.status is plane.status
    np.testing.assert_allclose(ground.time, plane.time, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(ground.path, plane.path, rtol=1e-9, atol=1e-6)
    np.testing.assert_array_equal(ground.commanded, plane.commanded)


def test_ground_below_the_site_is_hit_faster_and_ground_above_it_sooner():
    site = np.array([100.0, 100.0, LOW])
    state = State(site + np.array([0.0, 0.0, 8.0]), np.array([0.0, 0.0, -4.0]), 1170.0)
    decision = Decision(site, ZemZevCommand(6.0, 2.0, 4.0))
    ends = {}
    for height in (LOW - 6.0, LOW, LOW + 2.0):
        flown = fly_over(
            state, decision, PAPER_LANDER, Surroundings(GRAVITY, flat(height)), INTERVAL, FlightErrors()
        )
        assert flown.status is FlightStatus.TOUCHDOWN
        assert flown.path[-1, 2] == pytest.approx(height, abs=1e-6)
        ends[height] = float(flown.time[-1]), float(np.linalg.norm(flown.path[-1, 3:6]))
    (late, fast), (planned, soft), (early, caught) = (ends[key] for key in (LOW - 6.0, LOW, LOW + 2.0))
    assert early < planned < late
    assert fast == pytest.approx(math.sqrt(soft**2 + 2.0 * PULL * 6.0), rel=1e-6)
    assert soft < 0.5 < caught


def test_an_empty_tank_lets_it_fall_to_the_ground_below():
    site = np.array([100.0, 100.0, LOW])
    state = State(site + np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, -5.0]), 1151.0)
    flown = fly_over(
        state,
        Decision(site, ZemZevCommand(6.0, 2.0, 12.0)),
        PAPER_LANDER,
        Surroundings(GRAVITY, flat(LOW - 10.0)),
        INTERVAL,
        FlightErrors(),
    )
    assert flown.status is FlightStatus.TANK_EMPTY
    assert flown.path[-1, 2] == pytest.approx(LOW - 10.0, abs=1e-6)
    assert flown.path[-1, 6] == pytest.approx(PAPER_LANDER.dry_mass)


def test_a_wall_is_struck_when_the_leading_pad_reaches_its_ramp():
    ground = np.full((60, 60), LOW)
    ground[:, 40:] = LOW + 30.0
    held = motion((25.0, 30.0, LOW + 15.0), (8.0, 0.0, 0.0), (0.0, 0.0, 1170.0 * PULL))
    out = np.empty(7)
    time, touched = hold_over_ground(held, 5.0, footing(ground), out)
    # the ramp rises by 30 m from 39.5 to 40.5 m: half of it, at 40.0 m, is met by the rim 5 m ahead
    assert touched
    assert out[0] == pytest.approx(40.0 - 5.0, abs=0.02)
    assert time == pytest.approx(10.0 / 8.0, abs=0.003)


def test_a_rock_lower_than_its_path_is_flown_over_and_a_higher_one_is_not():
    held = motion((20.0, 30.5, LOW + 5.0), (10.0, 0.0, -0.5), (0.0, 0.0, 1170.0 * PULL))
    for height, touched in ((3.9, False), (4.6, True)):
        ground = np.full((60, 60), LOW)
        ground[30, 35] += height
        assert hold_over_ground(held, 2.0, footing(ground), np.empty(7))[1] is touched


def contacts(held: Motion, duration: float, ground: Footing, step: float) -> np.ndarray:
    """Whether the lander touches the ground at each instant of a walk in small steps."""
    times = np.arange(0.0, duration + 0.5 * step, step)
    path = np.array([state_at(held, time)[:3] for time in times])
    return np.array([z <= contact_height(ground, x, y) for x, y, z in path.tolist()])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_contact_is_missed_that_a_literal_loop_finds(seed):
    """Only a graze of less than 0.1 s and 0.1 m may be: a longer one meets an instant that is looked at."""
    rng = np.random.default_rng(seed)
    ground = footing(LOW + rng.uniform(0.1, 1.5) * rng.standard_normal((60, 60)))
    held = motion(
        (rng.uniform(15.0, 45.0), rng.uniform(15.0, 45.0), LOW + rng.uniform(2.0, 9.0)),
        (rng.uniform(-4.0, 4.0), rng.uniform(-4.0, 4.0), rng.uniform(-4.0, 1.0)),
        (rng.uniform(-800.0, 800.0), rng.uniform(-800.0, 800.0), rng.uniform(0.0, 6000.0)),
    )
    out, step = np.empty(7), 0.002
    time, touched = hold_over_ground(held, 1.0, ground, out)
    seen = contacts(held, 1.0, ground, step)
    if touched:
        np.testing.assert_allclose(out, state_at(held, time), atol=1e-9)
        assert out[2] <= contact_height(ground, out[0], out[1])
        before = state_at(held, time - 1e-12)
        assert time == 0.0 or before[2] > contact_height(ground, before[0], before[1]) - 1e-9
    speed = max(math.hypot(*state_at(held, t)[3:5]) for t in (0.0, 1.0))
    longest, run = 0, 0
    for k, contact in enumerate(seen):
        run = run + 1 if contact and k * step < (time if touched else 1.0) else 0
        longest = max(longest, run)
    assert longest * step * max(speed, 1.0) <= 0.1 + 2.0 * step * max(speed, 1.0)


@given(seed=st.integers(0, 2**32 - 1), raised=st.floats(0.0, 4.0))
@settings(max_examples=100)
def test_raising_the_ground_never_lets_the_flight_end_later(seed, raised):
    rng = np.random.default_rng(seed)
    low = LOW + rng.standard_normal((60, 60))
    high = low + raised * rng.random(low.shape)
    start = np.array([30.0, 30.0, LOW + 15.0, *rng.uniform(-2.0, 2.0, 2), rng.uniform(-3.0, 3.0), 1170.0])
    ends = [fall_to_ground(start, GRAVITY, footing(ground), np.empty(7)) for ground in (low, high)]
    assert ends[1] <= ends[0] + 1e-9


def test_over_unknown_ground_the_flight_ends_at_the_plane_or_at_once_below_it():
    nowhere, out = footing(np.full((60, 60), np.nan), plane=40.0), np.empty(7)
    start = np.array([30.0, 30.0, 45.0, 0.0, 0.0, 0.0, 1170.0])
    assert fall_to_ground(start, GRAVITY, nowhere, out) == pytest.approx(math.sqrt(2.0 * 5.0 / PULL))
    start[2] = 35.0
    assert fall_to_ground(start, GRAVITY, nowhere, out) == 0.0
