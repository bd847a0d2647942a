"""Reachability steering: the mean that it maximises, and the site that it takes at the end."""

from dataclasses import replace

import numpy as np
import pytest

import hda
from guidance import State
from guidance.two_impulse import divert_cost
from hda.flight.episode import begin_flight, observe
from hda.policies.beliefs.belief import SafetyBelief
from hda.policies.rivals.reachability_steering import ReachabilitySteeringSite, SteeringOptions
from hda.task.observation import Observation, ScenarioView

SCENARIO = hda.sample_scenario("paper", 0, 3)
VIEW: ScenarioView = SCENARIO.view
SELECTION = ReachabilitySteeringSite()
OBSERVATION: Observation = observe(SCENARIO, begin_flight(SCENARIO))
BELIEF = SafetyBelief.blank(OBSERVATION.target, 240)


def ground(level: float = 0.0) -> np.ndarray:
    return np.full((BELIEF.side, BELIEF.side), level, dtype=np.float32)


def low_look(mass: float = 1170.0) -> Observation:
    """60 m up, sinking at 8 m/s over the target, 14 s to go."""
    state = State(OBSERVATION.target + np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.0, -8.0]), mass)
    return replace(OBSERVATION, index=5, state=state, width=12.0, time_to_go=14.0)


def middle_of(look: Observation) -> tuple[int, int]:
    cell = BELIEF.cell(look.target)
    assert cell is not None
    return cell


def test_over_even_ground_the_mean_is_that_of_the_ground():
    for level in (0.0, 0.37, 1.0):
        for shift in ((0.0, 0.0), (40.0, -25.0)):
            target = OBSERVATION.target + np.array([*shift, 0.0])
            mean = SELECTION.mean_safety(target, ground(level), OBSERVATION, VIEW, BELIEF)
            assert mean == pytest.approx(level, rel=1e-6)


def test_the_mean_is_over_the_square_of_the_next_look():
    """A plain sum over cells, from the flight that 6/2 gains give over one interval, undisturbed."""
    safe = np.random.default_rng(1).random((BELIEF.side, BELIEF.side)).astype(np.float32)
    target, state = OBSERVATION.target, OBSERVATION.state
    position, velocity, seconds = state.position.copy(), state.velocity.copy(), OBSERVATION.time_to_go
    step = VIEW.decision_interval / 20000
    for _ in range(20000):
        acceleration = 6.0 * (target - position) / seconds**2 - 4.0 * velocity / seconds
        position = position + step * velocity + 0.5 * step**2 * acceleration
        velocity, seconds = velocity + step * acceleration, seconds - step
    half = 0.5 * VIEW.lidar.width(position, target)
    total, count = 0.0, 0
    for row in range(BELIEF.side):
        for column in range(BELIEF.side):
            cell = BELIEF.site(row, column, 50.0)
            if np.abs(cell - target)[:2].max() > half:
                continue
            away = np.hypot(*(cell - position)[:2]) / (position[2] - 50.0)
            if away <= np.tan(VIEW.lidar.off_nadir_limit):
                total, count = total + float(safe[row, column]), count + 1
    options = SteeringOptions(samples=200, reserve=0.0)
    mean = ReachabilitySteeringSite(options).mean_safety(target, safe, OBSERVATION, VIEW, BELIEF)
    assert mean == pytest.approx(total / count, abs=2e-3)


def test_what_is_out_of_reach_counts_for_nothing():
    dry = replace(
        OBSERVATION, state=replace(OBSERVATION.state, mass=float(np.nextafter(VIEW.lander.dry_mass, 2e3)))
    )
    assert SELECTION.mean_safety(OBSERVATION.target, ground(1.0), dry, VIEW, BELIEF) == 0.0


@pytest.mark.parametrize("side", [-1, 1])
def test_it_steers_towards_the_side_that_is_safe(side):
    safety = np.zeros_like(OBSERVATION.safety_map)
    half = safety.shape[1] // 2
    safety[:, half + 4 :] = 1.0
    seen = replace(OBSERVATION, safety_map=safety[:, ::side].copy())
    site, _ = SELECTION.select(seen, SELECTION.begin(VIEW))
    assert side * (site[0] - OBSERVATION.target[0]) > 0.1 * OBSERVATION.width


def test_at_the_end_it_takes_the_nearest_of_the_likely_sites():
    safe, look = ground(0.1), low_look()
    row, column = middle_of(look)
    safe[row - 2 : row + 3, column + 4 : column + 9] = 1.0  # middle 6 cells east
    safe[row + 6 : row + 13, column - 3 : column + 4] = 1.0
    site = SELECTION.landing_site(safe, look, VIEW, BELIEF)
    assert abs(site[1] - look.target[1]) <= 1.5
    assert 4.0 <= site[0] - look.target[0] <= 7.0
    safe[row - 3 : row + 4, column - 3 : column + 4] = 1.0
    np.testing.assert_array_equal(SELECTION.landing_site(safe, look, VIEW, BELIEF), look.target)


def test_without_a_likely_site_it_takes_the_likeliest():
    safe, look = ground(0.1), low_look()
    row, column = middle_of(look)
    safe[row - 8 : row - 4, column - 3 : column + 4] = 0.6
    safe[row + 4 : row + 9, column - 3 : column + 4] = 0.7
    site = SELECTION.landing_site(safe, look, VIEW, BELIEF)
    assert 3.0 < site[1] - look.target[1] < 10.0


def test_a_site_that_the_propellant_does_not_reach_is_not_taken():
    """Of two sites the further one costs more than is on board less the reserve."""
    safe = ground(0.1)
    look = low_look()
    row, column = middle_of(look)
    safe[row + 2 : row + 9, column + 2 : column + 9] = 0.6
    safe[row - 11 : row - 4, column - 11 : column - 4] = 1.0
    x, y = look.target[0] + np.array([5.0, -8.0]), look.target[1] + np.array([5.0, -8.0])
    cost = np.diag(divert_cost(look.state, x, y, 50.0, VIEW.lander, VIEW.gravity))
    assert cost[1] > cost[0]
    free = ReachabilitySteeringSite(SteeringOptions(reserve=0.0))
    assert free.landing_site(safe, look, VIEW, BELIEF)[0] < look.target[0]
    mass = VIEW.lander.dry_mass + 0.5 * float(cost.sum())
    state = replace(look.state, mass=mass)
    site = free.landing_site(safe, replace(look, state=state), VIEW, BELIEF)
    assert site[0] > look.target[0] - 6.0


def test_while_nothing_was_seen_and_when_it_is_too_late_the_target_stays():
    blank = replace(OBSERVATION, safety_map=np.zeros_like(OBSERVATION.safety_map))
    site, memory = SELECTION.select(blank, SELECTION.begin(VIEW))
    np.testing.assert_array_equal(site, OBSERVATION.target)
    _, memory = SELECTION.select(OBSERVATION, memory)
    late = replace(low_look(), time_to_go=2.0)
    np.testing.assert_array_equal(SELECTION.select(late, memory)[0], late.target)


@pytest.mark.parametrize(("name", "value"), [("reserve", 1.5), ("targets", 1), ("dispersion", 0.0)])
def test_options_that_mean_nothing_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        SteeringOptions(**{name: value})
