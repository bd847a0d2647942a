"""The scaled motion and its derivatives against central differences and the truth in SI."""

import numpy as np
import pytest

from guidance.rigid_body import RigidBody, RigidState
from guidance.rigid_body.motion import fly_into
from guidance.rigid_descent import RigidLandingProblem
from guidance.successive.discretisation import discretise, shoot
from guidance.successive.units import RigidUnits

BODY = RigidBody(gimbal_limit=0.1, engine_arm=0.01, engine_lag=0.0)
PROBLEM = RigidLandingProblem(
    RigidState.parse([200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]), np.array([0.0, 0.0, 50.0]), BODY
)
UNITS = RigidUnits.of(PROBLEM)
STEP = 1e-6


def drawn() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    states, controls = rng.normal(size=(3, 14)), 0.01 * rng.normal(size=(3, 6))
    states[:, 13] = 0.9
    return states, controls, np.array([0.3, 0.2])


def differences(states, controls, durations, k):
    """d(end of interval k) by one number: (what changes, the change of the states, controls, durations)."""
    body = UNITS.body(PROBLEM)
    ahead = shoot(states[0] + states[1], controls[0] + controls[1], durations[0] + durations[1], body)
    behind = shoot(states[0] - states[1], controls[0] - controls[1], durations[0] - durations[1], body)
    return (ahead - behind)[k] / (2.0 * STEP)


@pytest.mark.parametrize("k", [0, 1])
def test_derivatives_are_central_differences(k):
    x, u, h = drawn()
    motion = discretise(x, u, h, UNITS.body(PROBLEM))
    still = (x, 0.0 * x), (u, 0.0 * u), (h, 0.0 * h)
    for j in range(14):
        change = np.zeros_like(x)
        change[k, j] = STEP
        found = differences((x, change), still[1], still[2], k)
        np.testing.assert_allclose(motion.by_state[k, :, j], found, atol=1e-6)
    for node, table in ((k, motion.by_first), (k + 1, motion.by_last)):
        for j in range(6):
            change = np.zeros_like(u)
            change[node, j] = STEP
            found = differences(still[0], (u, change), still[2], k)
            np.testing.assert_allclose(table[k, :, j], found, atol=1e-6)
    found = differences(still[0], still[1], (h, np.full(2, STEP)), k)
    np.testing.assert_allclose(motion.by_duration[k], found, atol=1e-6)


def test_the_scaled_motion_is_the_truth_in_other_units():
    state = np.concatenate([PROBLEM.state.as_array()])
    state[10:13] = 0.05, -0.08, 0.02
    controls = np.array([[300.0, -200.0, 5000.0, 30.0, -60.0, 20.0], [-100.0, 0.0, 9000.0, -60.0, 10.0, 0.0]])
    flown = state.copy()
    fly_into(flown, controls[:, :3].copy(), controls[:, 3:].copy(), 0.8, BODY.numbers(PROBLEM.gravity))
    scaled = np.tile(state[:14] / UNITS.state, (2, 1))
    ends = shoot(scaled, controls / UNITS.control, np.array([0.8 / UNITS.time]), UNITS.body(PROBLEM))
    np.testing.assert_allclose(ends[0] * UNITS.state, flown[:14], rtol=1e-6, atol=1e-5)
