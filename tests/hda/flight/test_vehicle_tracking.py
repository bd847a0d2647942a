"""The vehicle that tracks a plan: flown again by hand, with DOP853 between the control instants."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from guidance.lander import PAPER_LANDER
from guidance.state import State
from guidance.tracking.reference import TrackingReference, make_reference
from guidance.tracking.soft_landing import plan_soft_landing
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Surroundings, fly_over
from hda.policy import Decision, PlanCommand

GRAVITY = np.array([0.0, 0.0, -1.62])
GAINS = (0.9, 1.7)
SITE = np.array([500.0, 500.0, 50.0])
PERIOD = 0.5
EXHAUST_VELOCITY = 9.80665 * 325.0


def integrate(y: np.ndarray, thrust: np.ndarray, duration: float) -> np.ndarray:
    flow = float(np.linalg.norm(thrust)) / EXHAUST_VELOCITY

    def rate(_, y):
        return [*y[3:6], *(thrust / y[6] + GRAVITY), -flow]

    return solve_ivp(rate, (0.0, duration), y, "DOP853", rtol=1e-12, atol=1e-10).y[:, -1]


def fly_by_hand(
    y: np.ndarray, reference: TrackingReference, error: float, periods: int, assumed: float
) -> np.ndarray:
    """States at the control instants: feedforward, feedback, and the error known after the first burn."""
    path, known = [y], assumed
    for k in range(min(periods, len(reference.thrust_acceleration))):
        wanted = (
            reference.thrust_acceleration[k]
            - GAINS[0] * (y[:3] - reference.position[k])
            - GAINS[1] * (y[3:6] - reference.velocity[k])
        )
        thrust = y[6] * wanted / (1.0 + known)
        size = float(np.linalg.norm(thrust))
        thrust = thrust * min(1.0, PAPER_LANDER.max_thrust / size) if size > 0.0 else thrust
        y = integrate(y, thrust * (1.0 + error), PERIOD)
        if np.linalg.norm(thrust) > 0.05 * 0.5 * (path[-1][6] + y[6]):
            known = error
        path.append(y)
    return np.array(path)


@pytest.fixture(scope="module")
def flight() -> tuple[State, TrackingReference]:
    state = State(SITE + np.array([180.0, -120.0, 880.0]), np.array([-6.0, 3.0, -28.0]), 1200.0)
    reference = plan_soft_landing(state, SITE, PAPER_LANDER, PERIOD).reference
    assert reference is not None
    return state, reference


def fly(state: State, reference: TrackingReference, error: float, periods: int = 10, assumed: float = 0.0):
    decision = Decision(SITE, PlanCommand(reference, GAINS, assumed))
    return fly_over(
        state,
        decision,
        PAPER_LANDER,
        Surroundings(GRAVITY),
        ControlPeriods(PERIOD, periods),
        FlightErrors(error),
    )


@pytest.mark.parametrize("error", [0.0, 0.04, -0.05])
@pytest.mark.parametrize("skipped", [0, 20, 30])
@pytest.mark.parametrize("assumed", [0.0, -0.3])
def test_an_interval_equals_the_flight_by_hand(flight, error: float, skipped: int, assumed: float) -> None:
    _, reference = flight
    left = reference.after(skipped)
    assert left is not None
    start = State(left.position[0] + 0.3, left.velocity[0] - 0.2, 1190.0)
    segment = fly(start, left, error, assumed=assumed)
    by_hand = fly_by_hand(start.as_array(), left, error, 10, assumed)
    assert segment.status is FlightStatus.FLYING
    # the vehicle learns its engine's error from one period's change of velocity at the mean mass
    np.testing.assert_allclose(segment.path[:, :6], by_hand[:, :6], atol=2e-3)
    np.testing.assert_allclose(segment.path[:, 6], by_hand[:, 6], atol=2e-3)


def test_the_engine_is_cut_where_the_plan_ends(flight) -> None:
    _, reference = flight
    left = reference.after(len(reference.thrust_acceleration) - 4)
    assert left is not None
    segment = fly(State(left.position[0] + np.array([0.0, 0.0, 0.4]), left.velocity[0], 1175.0), left, 0.0)
    assert segment.status is FlightStatus.TOUCHDOWN
    assert segment.time.size == 6  # four periods and the fall
    np.testing.assert_array_equal(segment.commanded[-1], 0.0)
    assert segment.path[-1, 2] == pytest.approx(SITE[2], abs=1e-9)


def test_feedback_shrinks_an_error(flight) -> None:
    _, reference = flight
    start = State(reference.position[0] + np.array([2.0, -1.0, 1.5]), reference.velocity[0], 1200.0)
    segment = fly(start, reference, 0.0)
    before = np.linalg.norm(segment.path[0, :3] - reference.position[0])
    after = np.linalg.norm(segment.path[10, :3] - reference.position[10])
    assert after < 0.2 * before


def test_thrust_stays_in_the_engines_bounds(flight) -> None:
    _, reference = flight
    start = State(reference.position[0] + 200.0, reference.velocity[0] - 30.0, 1200.0)
    size = np.linalg.norm(fly(start, reference, 0.03).commanded, axis=1)
    assert size.max() == pytest.approx(PAPER_LANDER.max_thrust, rel=1e-12)


def test_a_reference_of_another_control_period_is_refused() -> None:
    path = np.zeros((4, 3)) + SITE + 100.0
    reference = make_reference(path, np.zeros((4, 3)), 0.25, GRAVITY)
    with pytest.raises(ValueError, match=r"control period of 0\.25 s"):
        fly(State(path[0], np.zeros(3), 1200.0), reference, 0.0)
