"""Plans for the closed loop end gently, in whole control periods, within the thrust that is left to them."""

import math

import numpy as np
import pytest

from guidance.descent.plan import PlanStatus
from guidance.dynamics import propagate
from guidance.lander import PAPER_LANDER
from guidance.state import State
from guidance.tracking.soft_landing import SoftLandingOptions, plan_soft_landing, plan_timed_landing
from guidance.zem_zev import saturate_thrust

PERIOD = 0.5
SITE = np.array([500.0, 480.0, 50.0])
GRAVITY = np.array([0.0, 0.0, -1.62])


def starts(count: int, seed: int = 0) -> list[State]:
    rng = np.random.default_rng(seed)
    states = []
    for _ in range(count):
        azimuth, distance = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(200.0, 250.0)
        heading = azimuth + math.pi + rng.uniform(-0.5, 0.5)
        offset = np.array(
            [distance * math.cos(azimuth), distance * math.sin(azimuth), rng.uniform(850.0, 950.0)]
        )
        speed = rng.uniform(5.0, 10.0)
        velocity = np.array([speed * math.cos(heading), speed * math.sin(heading), -rng.uniform(20.0, 35.0)])
        states.append(State(SITE + offset, velocity, 1200.0))
    return states


@pytest.mark.parametrize("state", starts(8))
def test_a_landing_ends_at_rest_on_the_site_after_whole_periods(state: State) -> None:
    landing = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)
    assert landing.status is PlanStatus.OPTIMAL
    reference = landing.reference
    assert reference is not None
    np.testing.assert_allclose(reference.position[0], state.position, atol=1e-6)
    np.testing.assert_allclose(reference.velocity[0], state.velocity, atol=1e-6)
    np.testing.assert_allclose(reference.position[-1], SITE, atol=1e-3)
    np.testing.assert_allclose(reference.velocity[-1], 0.0, atol=1e-6)
    mean = 0.5 * (reference.velocity[1:] + reference.velocity[:-1])
    jerk_bound = 12.0 * PERIOD**2 / 8.0  # a period over which the acceleration turns by at most 12 m/s^2
    assert np.abs(np.diff(reference.position, axis=0) - PERIOD * mean).max() < jerk_bound


@pytest.mark.parametrize("state", starts(4, seed=1))
def test_open_loop_flight_of_the_reference_lands_softly(state: State) -> None:
    reference = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD).reference
    assert reference is not None
    flown = state
    for acceleration in reference.thrust_acceleration:
        thrust = saturate_thrust(flown.mass * acceleration, PAPER_LANDER)
        flown = propagate(flown, thrust, PERIOD, PAPER_LANDER)
    assert np.linalg.norm(flown.position - SITE) < 3.0
    assert np.linalg.norm(flown.velocity) < 0.3
    assert flown.mass > PAPER_LANDER.dry_mass + 15.0


def test_the_margin_of_thrust_is_kept() -> None:
    options = SoftLandingOptions(thrust_margin=0.25)
    landing = plan_soft_landing(starts(1)[0], SITE, PAPER_LANDER, PERIOD, options)
    assert landing.plan is not None
    assert np.linalg.norm(landing.plan.thrust, axis=1).max() <= 0.75 * PAPER_LANDER.max_thrust * 1.001


def test_the_terminal_phase_decelerates_as_asked() -> None:
    options = SoftLandingOptions(terminal_periods=6, terminal_deceleration=1.0)
    reference = plan_soft_landing(starts(1)[0], SITE, PAPER_LANDER, PERIOD, options).reference
    assert reference is not None
    np.testing.assert_allclose(reference.thrust_acceleration[-6:], [[0.0, 0.0, 2.62]] * 6, atol=1e-5)
    np.testing.assert_allclose(reference.velocity[-7], [0.0, 0.0, -3.0], atol=1e-5)
    assert reference.position[-7][2] == pytest.approx(50.0 + 0.5 * 3.0 * 3.0, abs=1e-3)


def test_the_flight_time_is_the_cheapest_whole_number_of_periods() -> None:
    state = starts(1, seed=5)[0]
    chosen = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)
    assert chosen.plan is not None
    assert chosen.reference is not None
    best = chosen.plan.propellant
    periods = chosen.reference.thrust_acceleration.shape[0]
    for other in (periods - 1, periods + 1):
        there = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD, periods=other)
        assert there.plan is not None
        assert there.plan.propellant == pytest.approx(best, abs=1e-6)  # the search walks back to the best


def test_a_site_out_of_reach_gives_the_nearest_point_and_still_ends_at_rest() -> None:
    state = State(SITE + np.array([0.0, 300.0, 150.0]), np.array([0.0, 0.0, -35.0]), 1170.0)
    landing = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)
    assert landing.status is PlanStatus.NEAREST
    assert landing.reference is not None
    end = landing.reference.position[-1]
    assert end[2] == pytest.approx(SITE[2], abs=1e-3)
    assert 1.0 < np.linalg.norm(end - SITE) < 300.0
    np.testing.assert_allclose(landing.reference.velocity[-1], 0.0, atol=1e-6)


def test_no_flight_near_an_impossible_time() -> None:
    landing = plan_soft_landing(starts(1)[0], SITE, PAPER_LANDER, PERIOD, periods=8)
    assert landing.status is PlanStatus.LIMIT_REACHED
    assert landing.reference is None


def test_a_fall_that_nothing_can_stop_has_no_reference() -> None:
    state = State(SITE + np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.0, -60.0]), 1200.0)
    landing = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)
    assert not landing.status.has_flight
    assert landing.reference is None


def test_a_start_below_the_gate_is_refused() -> None:
    state = State(SITE + np.array([0.0, 0.0, 1.0]), np.zeros(3), 1200.0)
    with pytest.raises(ValueError, match="below the gate"):
        plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)


def test_options_are_named() -> None:
    with pytest.raises(ValueError, match="thrust_margin"):
        SoftLandingOptions(thrust_margin=-0.1)
    with pytest.raises(ValueError, match="thrust_margin"):
        SoftLandingOptions(thrust_margin=1.0)
    with pytest.raises(ValueError, match="terminal_periods"):
        SoftLandingOptions(terminal_periods=0)
    with pytest.raises(ValueError, match="terminal_deceleration"):
        SoftLandingOptions(terminal_deceleration=0.0)


@pytest.mark.parametrize("speed", [20.0, 30.0, 45.0])
def test_a_speed_limit_is_kept_and_eased_where_the_vehicle_is_faster_already(speed: float) -> None:
    state = State(SITE + np.array([150.0, 0.0, 900.0]), np.array([-8.0, 0.0, -30.0]), 1200.0)
    reference = plan_soft_landing(
        state, SITE, PAPER_LANDER, PERIOD, SoftLandingOptions(speed_limit=speed)
    ).reference
    assert reference is not None
    fastest = np.linalg.norm(reference.velocity, axis=1).max()
    limit = max(speed, 1.02 * float(np.linalg.norm(state.velocity)))
    # held at the plan's nodes, in the frame that sinks at the gate's 3 m/s; between nodes it may bulge
    assert fastest <= limit + 3.0 + 0.5
    free = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD).reference
    assert free is not None
    assert np.linalg.norm(free.velocity, axis=1).max() > limit + 5.0


@pytest.mark.parametrize("later", [0, 10, 30])
def test_a_timed_landing_takes_the_time_asked_and_costs_no_less(later: int) -> None:
    state = starts(1)[0]
    best = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD)
    assert best.reference is not None
    assert best.plan is not None
    periods = len(best.reference.thrust_acceleration) + later
    landing = plan_timed_landing(state, SITE, PAPER_LANDER, (PERIOD, periods))
    assert landing.status is PlanStatus.OPTIMAL
    assert landing.reference is not None
    assert landing.plan is not None
    assert len(landing.reference.thrust_acceleration) == periods
    np.testing.assert_allclose(landing.reference.position[-1], SITE, atol=1e-3)
    np.testing.assert_allclose(landing.reference.velocity[-1], 0.0, atol=1e-3)
    assert landing.plan.propellant >= best.plan.propellant - 1e-3
    assert landing.plan.propellant > best.plan.propellant + 0.1 or later == 0


@pytest.mark.parametrize("periods", [12, 30])
def test_a_landing_sooner_than_the_engine_allows_is_infeasible(periods: int) -> None:
    landing = plan_timed_landing(starts(1)[0], SITE, PAPER_LANDER, (PERIOD, periods))
    assert landing.status is PlanStatus.INFEASIBLE
    assert landing.reference is None
    assert landing.plan is not None
    assert landing.plan.status is PlanStatus.INFEASIBLE


def test_a_landing_with_no_time_before_its_gate_is_not_planned() -> None:
    landing = plan_timed_landing(starts(1)[0], SITE, PAPER_LANDER, (PERIOD, 3))
    assert landing.status is PlanStatus.LIMIT_REACHED
    assert landing.reference is None
    assert landing.plan is None
