"""The vehicle between two looks, against closed forms and an independent integration with events."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import (
    MOON_GRAVITY,
    PAPER_LANDER,
    Lander,
    State,
    saturate_thrust,
    time_to_go,
    zem_zev_acceleration,
)
from hda.flight.held_thrust import FlightConditions, VehicleLimits, hold_period
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Segment, Surroundings, fly_over
from hda.policy import Decision, ZemZevCommand
from tests.oracles import flown_interval

GRAVITY = np.array(MOON_GRAVITY)
PULL = 1.62
PLANE = 50.0
SITE = np.array([500.0, 400.0, PLANE])
EXHAUST_VELOCITY = 9.80665 * 325.0
SEEDS = st.integers(0, 2**32 - 1)
INTERVAL = ControlPeriods(0.5, 10)
STATUS = {
    FlightStatus.FLYING: "flying",
    FlightStatus.TOUCHDOWN: "touchdown",
    FlightStatus.TANK_EMPTY: "tank-empty",
}


def state_at(height: float, climb: float, mass: float = 1200.0, offset=(0.0, 0.0), drift=(0.0, 0.0)) -> State:
    position = SITE + np.array([*offset, height])
    return State(position, np.array([*drift, climb]), mass)


def fly(
    state: State,
    command: ZemZevCommand,
    interval: ControlPeriods = INTERVAL,
    thrust_error: float = 0.0,
    lander: Lander = PAPER_LANDER,
) -> Segment:
    return fly_over(
        state, Decision(SITE, command), lander, Surroundings(GRAVITY), interval, FlightErrors(thrust_error)
    )


def fall_time(height: float, climb: float) -> float:
    """Textbook: h + v t - g t^2/2 = 0."""
    return (climb + math.sqrt(climb**2 + 2.0 * PULL * height)) / PULL


def magnitudes(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def random_case(rng: np.random.Generator) -> tuple[State, ZemZevCommand, ControlPeriods, float, Lander]:
    """Starts from high up to a hand's breadth above the plane, full and nearly empty tanks."""
    height = float(10.0 ** rng.uniform(-1.0, 2.9))
    speed = math.sqrt(height)
    state = state_at(
        height,
        rng.uniform(-2.0, 0.5) * speed,
        1150.0 + float(10.0 ** rng.uniform(-2.0, 1.7)),
        height * rng.uniform(-0.3, 0.3, size=2),
        speed * rng.uniform(-0.5, 0.5, size=2),
    )
    command = ZemZevCommand(
        rng.uniform(5.0, 7.0), rng.uniform(1.0, 3.0), rng.uniform(0.3, 20.0), rng.uniform(0.85, 1.15)
    )
    periods = int(rng.integers(1, 12))
    lander = Lander(min_thrust=rng.choice([0.0, 1500.0]), max_thrust=rng.uniform(4000.0, 12000.0))
    return state, command, ControlPeriods(5.0 / periods, periods), rng.uniform(-0.05, 0.05), lander


def test_random_intervals_agree_with_dop853_and_its_events():
    """All that an interval can meet: saturation, thrust error, ground, dips, an empty tank, cut-off."""
    rng = np.random.default_rng(20)
    met = set()
    for _ in range(300):
        state, command, interval, error, lander = random_case(rng)
        segment = fly(state, command, interval, error, lander)
        task = flown_interval.Task(
            SITE,
            (command.position_gain, command.velocity_gain),
            command.time_to_go,
            command.time_to_go_rate,
            interval.period,
            interval.count,
            error,
        )
        vehicle = flown_interval.Vehicle(
            lander.dry_mass, lander.max_thrust, lander.specific_impulse, lander.min_thrust, MOON_GRAVITY
        )
        oracle = flown_interval.fly(state.as_array(), task, vehicle)
        assert STATUS[segment.status] == oracle.status
        np.testing.assert_allclose(segment.time, oracle.time, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(segment.path, oracle.path, rtol=1e-7, atol=2e-6)
        np.testing.assert_allclose(segment.commanded, oracle.commanded, rtol=1e-6, atol=1e-3)
        met.add(segment.status)
        met.add("saturated" if np.isclose(magnitudes(segment.commanded), lander.max_thrust).any() else "free")
    assert met == {*FlightStatus, "saturated", "free"}


@given(height=st.floats(1e-6, 2000.0), climb=st.floats(-80.0, 40.0), drift=st.floats(-30.0, 30.0))
def test_after_the_cut_off_the_vehicle_falls_as_galileo_says(height, climb, drift):
    state = state_at(height, climb, drift=(drift, -drift))
    segment = fly(state, ZemZevCommand(6.0, 2.0, 0.25))
    fall = fall_time(state.position[2] - PLANE, climb)
    assert segment.status is FlightStatus.TOUCHDOWN
    assert segment.commanded.tolist() == [[0.0, 0.0, 0.0]]
    np.testing.assert_allclose(segment.time, [0.0, fall], rtol=1e-7, atol=1e-9)
    final = segment.final_state
    np.testing.assert_allclose(final.position, SITE + np.array([drift * fall, -drift * fall, 0.0]), atol=1e-6)
    assert final.velocity[:2].tolist() == [drift, -drift]
    assert final.velocity[2] == pytest.approx(-math.sqrt(climb**2 + 2 * PULL * height), rel=1e-9, abs=1e-6)
    assert final.mass == state.mass


# The ground


def hold(state: State, thrust, duration: float, error: float = 0.0, lander: Lander = PAPER_LANDER):
    """hold_period with plain arguments: (time flown, status, state reached)."""
    vehicle = VehicleLimits(
        lander.min_thrust, lander.max_thrust, lander.exhaust_velocity, lander.dry_mass, math.pi
    )
    conditions = FlightConditions(duration, PLANE, GRAVITY, vehicle, error, np.zeros(6))
    out = np.empty(7)
    flown, status = hold_period(state.as_array(), np.array(thrust, dtype=float), conditions, out)
    return flown, FlightStatus(status), out


def lowest_point(climb: float, thrust: float, mass: float = 1200.0) -> tuple[float, float]:
    """(time, height change) at the bottom of a braking burn, by the rocket equation on a fine grid."""
    time = np.linspace(0.0, 5.0, 500_001)
    acceleration = thrust / (mass - thrust / EXHAUST_VELOCITY * time) - PULL
    velocity = climb + np.concatenate([[0.0], np.cumsum((acceleration[1:] + acceleration[:-1]) / 2 * 1e-5)])
    height = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2 * 1e-5)])
    bottom = int(np.argmin(height))
    return float(time[bottom]), float(height[bottom])


@pytest.mark.parametrize("climb", [-1.0, -3.0, -6.0])
@pytest.mark.parametrize("thrust", [4000.0, 12000.0])
def test_a_dip_below_the_plane_within_one_period_is_a_touchdown(climb, thrust):
    time, drop = lowest_point(climb, thrust)
    duration = 2.0 * time + 0.5  # long enough to be above the plane again at its end
    flown, status, reached = hold(state_at(-drop * (1.0 - 1e-5), climb), (0.0, 0.0, thrust), duration)
    assert status is FlightStatus.TOUCHDOWN
    assert flown < time
    assert reached[2] == pytest.approx(PLANE, abs=1e-9)
    assert -0.1 < reached[5] < 0.0
    flown, status, reached = hold(state_at(-drop * (1.0 + 1e-5) + 1e-6, climb), (0.0, 0.0, thrust), duration)
    assert (flown, status) == (duration, FlightStatus.FLYING)
    assert reached[2] > PLANE


def test_a_flight_that_reaches_the_plane_exactly_at_the_end_of_a_period_has_landed():
    state = state_at(PULL / 2.0, 0.0)  # falls 0.81 m in one second
    flown, status, reached = hold(state, (0.0, 0.0, 0.0), 1.0 + 1e-12)
    assert status is FlightStatus.TOUCHDOWN
    assert flown == pytest.approx(1.0, rel=1e-9)
    assert reached[5] == pytest.approx(-PULL, rel=1e-9)


# The tank


@given(propellant=st.floats(1e-3, 3.0), error=st.floats(-0.05, 0.05), height=st.floats(30.0, 500.0))
@settings(max_examples=50)
def test_a_tank_that_runs_dry_burns_all_it_has_and_then_falls(propellant, error, height):
    state = state_at(height, -20.0, 1150.0 + propellant)
    flown, status, reached = hold(state, (0.0, 0.0, 12000.0), 1.0, error)
    flow = 12000.0 * (1.0 + error) / EXHAUST_VELOCITY
    burn = (state.mass - 1150.0) / flow
    # Tsiolkovsky, then the fall; the burn's path by its own closed form.
    gain = EXHAUST_VELOCITY * math.log(state.mass / 1150.0)
    rise = EXHAUST_VELOCITY * burn - 1150.0 / flow * gain
    climb = -20.0 + gain - PULL * burn
    dry_height = height - 20.0 * burn + rise - PULL * burn**2 / 2.0
    assert status is FlightStatus.TANK_EMPTY
    assert reached[6] == pytest.approx(1150.0, abs=1e-9)
    assert reached[2] == pytest.approx(PLANE, abs=1e-6)
    assert flown == pytest.approx(burn + fall_time(dry_height, climb), rel=1e-6)
    assert reached[5] == pytest.approx(-math.sqrt(climb**2 + 2.0 * PULL * dry_height), rel=1e-6)


def test_a_tank_that_lasts_exactly_to_the_end_of_the_period_is_empty():
    flow = 12000.0 / EXHAUST_VELOCITY
    state = state_at(300.0, -20.0, 1150.0 + flow)
    assert hold(state, (0.0, 0.0, 12000.0), 1.0 - 1e-9)[1] is FlightStatus.FLYING
    assert hold(state, (0.0, 0.0, 12000.0), 1.0 + 1e-9)[1] is FlightStatus.TANK_EMPTY


def test_an_empty_tank_ends_the_interval():
    segment = fly(state_at(300.0, -20.0, 1151.0), ZemZevCommand(6.0, 2.0, 15.0))
    assert segment.status is FlightStatus.TANK_EMPTY
    assert segment.final_state.mass == pytest.approx(1150.0, abs=1e-9)
    assert segment.final_state.position[2] == pytest.approx(PLANE, abs=1e-6)


def test_the_ground_comes_before_the_tank_where_it_is_reached_first():
    flow = 12000.0 / EXHAUST_VELOCITY
    state = state_at(1.0, -20.0, 1150.0 + 0.5 * flow)
    flown, status, reached = hold(state, (0.0, 0.0, 12000.0), 1.0)
    assert status is FlightStatus.TOUCHDOWN
    assert flown < 0.1
    assert reached[6] > 1150.0


# The engine cut-off


@pytest.mark.parametrize("period", [0.1, 0.5, 1.0])
def test_the_engine_is_cut_at_half_a_control_period(period):
    state = state_at(100.0, -5.0)
    at_limit = fly(state, ZemZevCommand(6.0, 2.0, 0.5 * period), ControlPeriods(period, 5))
    assert len(at_limit.time) == 2
    assert not at_limit.commanded.any()
    above = fly(state, ZemZevCommand(6.0, 2.0, 0.5 * period * (1.0 + 1e-9)), ControlPeriods(period, 5))
    assert above.time[1] == pytest.approx(period)
    assert above.commanded[0].any()
    assert not above.commanded[1:].any()
    assert above.status is FlightStatus.TOUCHDOWN


@pytest.mark.parametrize("rate", [0.85, 1.0, 1.15])
def test_the_cut_off_holds_at_the_end_of_an_interval_too(rate):
    period, periods = 0.5, 10
    state = state_at(300.0, -20.0)
    limit = rate * period * periods + 0.5 * period
    cut = fly(state, ZemZevCommand(6.0, 2.0, limit - 1e-9, rate), ControlPeriods(period, periods))
    assert cut.status is FlightStatus.TOUCHDOWN
    assert len(cut.time) == periods + 2
    assert cut.commanded[:-1].any(axis=1).all()
    assert not cut.commanded[-1].any()
    kept = fly(state, ZemZevCommand(6.0, 2.0, limit + 1e-9, rate), ControlPeriods(period, periods))
    assert kept.status is FlightStatus.FLYING
    assert len(kept.time) == periods + 1
    assert kept.time_to_go == pytest.approx(0.5 * period + 1e-9, rel=1e-6)
    np.testing.assert_array_equal(cut.path[:-1], kept.path)


@given(remaining=st.floats(6.0, 90.0), rate=st.floats(0.5, 1.15))
def test_the_time_to_go_counts_down_at_its_rate(remaining, rate):
    segment = fly(state_at(900.0, -25.0), ZemZevCommand(6.0, 2.0, remaining, rate))
    assert segment.time_to_go == pytest.approx(remaining - rate * segment.time[-1], abs=1e-12)
    if segment.status is FlightStatus.FLYING:
        assert segment.time[-1] == pytest.approx(5.0)


# Thrust


@settings(max_examples=60)
@given(seed=SEEDS)
def test_each_interval_holds_the_saturated_law_and_the_error_comes_after_saturation(seed):
    state, command, interval, error, lander = random_case(np.random.default_rng(seed))
    segment = fly(state, command, interval, error, lander)
    period = interval.period
    for k, thrust in enumerate(segment.commanded):
        remaining = command.time_to_go - command.time_to_go_rate * period * k
        if remaining <= period / 2.0:
            assert not thrust.any()
            continue
        now = State(segment.path[k, :3], segment.path[k, 3:6], float(segment.path[k, 6]))
        gains = (command.position_gain, command.velocity_gain)
        law = now.mass * zem_zev_acceleration(now, SITE, remaining, gains)
        np.testing.assert_allclose(thrust, saturate_thrust(law, lander), rtol=1e-9, atol=1e-6)
        np.testing.assert_allclose(np.cross(thrust, law) / np.linalg.norm(law), 0.0, atol=1e-6)
        assert thrust @ law > 0.0
        # what was applied shows in the mass
        duration = segment.time[k + 1] - segment.time[k]
        burnt = segment.path[k, 6] - segment.path[k + 1, 6]
        applied = (1.0 + error) * float(np.linalg.norm(thrust))
        if segment.path[k + 1, 6] - lander.dry_mass > 1e-6:
            assert burnt == pytest.approx(applied * duration / EXHAUST_VELOCITY, rel=1e-6, abs=1e-9)
        assert burnt >= 0.0


def test_a_saturated_engine_with_a_positive_error_exceeds_its_greatest_thrust():
    state = state_at(100.0, -60.0)
    segment = fly(state, ZemZevCommand(6.0, 2.0, 5.0), ControlPeriods(0.5, 1), 0.05)
    assert np.linalg.norm(segment.commanded[0]) == pytest.approx(12000.0, rel=1e-12)
    burnt = segment.path[0, 6] - segment.path[1, 6]
    assert burnt == pytest.approx(1.05 * 12000.0 * 0.5 / EXHAUST_VELOCITY, rel=1e-9)
    assert segment.thrust_error == 0.05


@given(seed=SEEDS)
def test_n_nodes_have_n_minus_one_intervals(seed):
    state, command, interval, error, lander = random_case(np.random.default_rng(seed))
    segment = fly(state, command, interval, error, lander)
    n = len(segment.time)
    assert segment.path.shape == (n, 7)
    assert segment.commanded.shape == (n - 1, 3)
    assert segment.time[0] == 0.0
    assert (np.diff(segment.time) > 0.0).all()
    np.testing.assert_array_equal(segment.path[0], state.as_array())
    np.testing.assert_array_equal(segment.final_state.as_array(), segment.path[-1])
    if segment.status is FlightStatus.FLYING:
        assert n == interval.count + 1
        assert segment.path[-1, 2] > PLANE
    else:
        assert segment.path[-1, 2] == pytest.approx(PLANE, abs=1e-6)


# A whole flight


def descend(state: State, period: float) -> Segment:
    """An undisturbed 6/2 flight to the site, as one long interval."""
    remaining = time_to_go(state, SITE)
    return fly(
        state, ZemZevCommand(6.0, 2.0, remaining), ControlPeriods(period, math.ceil(remaining / period) + 1)
    )


@settings(max_examples=30)
@given(seed=SEEDS)
def test_an_undisturbed_flight_with_a_short_control_period_lands_softly_on_the_site(seed):
    rng = np.random.default_rng(seed)
    state = state_at(
        rng.uniform(850.0, 950.0),
        -rng.uniform(20.0, 35.0),
        offset=rng.uniform(-170.0, 170.0, size=2),
        drift=rng.uniform(-7.0, 7.0, size=2),
    )
    segment = descend(state, 0.01)
    final = segment.final_state
    assert segment.status is FlightStatus.TOUCHDOWN
    assert float(np.linalg.norm(final.position - SITE)) < 1e-3
    assert float(np.linalg.norm(final.velocity)) < 0.05
    assert final.mass > PAPER_LANDER.dry_mass


def test_touchdown_speed_falls_in_proportion_to_the_control_period():
    """The held command is a first-order scheme: a tenth of the period, about a tenth of the speed."""
    state = state_at(900.0, -25.0, offset=(150.0, -150.0), drift=(-5.0, 5.0))
    periods = np.array([0.4, 0.2, 0.1, 0.05, 0.025])
    # The remainder at cut-off depends on how the period divides the time to go: average over starts.
    speeds = [
        np.mean(
            [
                np.linalg.norm(
                    descend(state_at(900.0 + dz, -25.0, offset=(150.0, 9.0)), period).final_state.velocity
                )
                for dz in np.linspace(0.0, 20.0, 25)
            ]
        )
        for period in periods
    ]
    assert descend(state, 0.4).status is FlightStatus.TOUCHDOWN
    order = np.polyfit(np.log(periods), np.log(speeds), 1)[0]
    assert 0.8 < order < 1.2
