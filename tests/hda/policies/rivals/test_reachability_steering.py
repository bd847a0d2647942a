"""Reachability steering: the mean that it maximises, and the site that it takes at the end."""

from dataclasses import replace

import numpy as np
import pytest

import hda
from guidance import State
from guidance.two_impulse import divert_cost
from hda.flight.episode import begin_flight, observe
from hda.policies.beliefs.belief import SafetyBelief
from hda.policies.beliefs.surroundings import infer_unseen
from hda.policies.hazard_aware import HazardAwareMemory, fuse_look, judge_ground
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


def test_ground_beyond_the_beliefs_square_is_left_out():
    """The belief ends within the next look: what counts is the part of it that lies inside."""
    cut = SafetyBelief.blank(OBSERVATION.target - np.array([100.0, 0.0, 0.0]), 104)
    safe = np.zeros((cut.side, cut.side), dtype=np.float32)
    columns = np.arange(cut.side) + cut.corner[0] + 0.5
    safe[:] = np.where(columns > OBSERVATION.target[0], 1.0, 0.0)  # the last four columns, and the edge
    target = OBSERVATION.target
    half = 0.5 * VIEW.lidar.width(SELECTION._next_state(target, OBSERVATION, VIEW).position, target)
    places = target[0] + np.linspace(-half, half, SELECTION.options.samples)
    inside = np.floor(places) < cut.corner[0] + cut.side
    assert not inside.all()
    most = float((places[inside] >= target[0]).mean())
    assert SELECTION.mean_safety(target, safe, OBSERVATION, VIEW, cut) <= 1.3 * most
    far = OBSERVATION.target + np.array([1000.0, 0.0, 0.0])
    assert SELECTION.mean_safety(far, ground(1.0), OBSERVATION, VIEW, BELIEF) == 0.0


def test_the_targets_are_as_many_as_the_options_say_and_differ():
    targets = SELECTION._lattice(OBSERVATION)
    assert len(targets) == SELECTION.options.targets**2
    assert len(np.unique(targets, axis=0)) == len(targets)
    np.testing.assert_array_equal(targets[0], OBSERVATION.target)


def test_it_judges_ground_by_looks_that_may_be_misplaced():
    """With a filter the site is what the blurred belief says, not what the looks said alone."""
    scenario = hda.sample_scenario("navigated", 6, 3)
    look = observe(scenario, begin_flight(scenario))
    assert look.covariance is not None
    unsure, sure = 3.0 * look.covariance, 0.03 * look.covariance
    belief = fuse_look(replace(look, covariance=unsure), scenario.view, None)
    later = replace(look, index=1, time_to_go=14.0, covariance=sure)
    fused = fuse_look(later, scenario.view, belief)
    judged = judge_ground(fused)
    site, memory = SELECTION.select(later, HazardAwareMemory(scenario.view, belief))
    assert memory.belief is not None
    expected = SELECTION.landing_site(judged, later, scenario.view, fused)
    np.testing.assert_array_equal(site, expected)
    alone = infer_unseen(fused.probability(), fused.seen)
    assert not np.array_equal(SELECTION.landing_site(alone, later, scenario.view, fused), expected)


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
    """Of two sites the better one costs more than is on board: the other is taken, not the target."""
    safe = ground(0.1)
    look = replace(low_look(), width=24.0)
    row, column = middle_of(look)
    safe[row + 2 : row + 9, column + 2 : column + 9] = 0.6
    safe[row - 22 : row - 15, column - 22 : column - 15] = 1.0
    corners = np.array([9.0, -15.0])  # the far corner of the first, the near one of the other
    x, y = look.target[0] + corners, look.target[1] + corners
    cost = np.diag(divert_cost(look.state, x, y, 50.0, VIEW.lander, VIEW.gravity))
    assert cost[1] > cost[0]
    free = ReachabilitySteeringSite(SteeringOptions(reserve=0.0))
    assert free.landing_site(safe, look, VIEW, BELIEF)[0] < look.target[0]
    mass = VIEW.lander.dry_mass + 0.5 * float(cost.sum())
    state = replace(look.state, mass=mass)
    site = free.landing_site(safe, replace(look, state=state), VIEW, BELIEF)
    assert ((site - look.target)[:2] > 2.0).all()


def test_while_nothing_was_seen_and_when_it_is_too_late_the_target_stays():
    blank = replace(OBSERVATION, safety_map=np.zeros_like(OBSERVATION.safety_map))
    site, memory = SELECTION.select(blank, SELECTION.begin(VIEW))
    np.testing.assert_array_equal(site, OBSERVATION.target)
    _, memory = SELECTION.select(OBSERVATION, memory)
    late = replace(low_look(), time_to_go=2.0)
    np.testing.assert_array_equal(SELECTION.select(late, memory)[0], late.target)


@pytest.mark.parametrize(
    ("name", "value"), [("reserve", 1.5), ("targets", 1), ("samples", 2.5), ("dispersion", 0.0)]
)
def test_options_that_mean_nothing_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        SteeringOptions(**{name: value})
