"""The hazard-aware objective: what it must prefer, against slow sums, and what it does in flight."""

import itertools
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hda
from guidance import State
from guidance.two_impulse import divert_cost
from hda.flight.episode import begin_flight, fly, observe
from hda.policies.beliefs.belief import SafetyBelief
from hda.policies.hazard_aware import HazardAwareMemory, HazardAwareSite, fuse_look, landing_spread
from hda.policies.landing_dispersion import landing_probability
from hda.policies.site_price import (
    HazardAwareWeights,
    NextLook,
    predict_next_look,
    price_sites,
)
from hda.task.body_variants import vary_body
from hda.task.observation import Observation
from hda.task.scenario import sample_scenario

WEIGHTS = HazardAwareWeights()
SIDE = 120
FREE = np.zeros((SIDE // 8 + 2, SIDE // 8 + 2))


def look_ahead(
    height: float = 300.0, east: float = 60.0, north: float = 60.0, useful: bool = True
) -> NextLook:
    slope = 0.5 * math.tan(math.radians(11.4))
    return NextLook(east, north, height, slope, height * math.tan(math.radians(20.0)), useful)


def ground(*patches: tuple[slice, slice, float], elsewhere: float = 0.0) -> np.ndarray:
    safe = np.full((SIDE, SIDE), elsewhere, dtype=np.float32)
    for rows, columns, value in patches:
        safe[rows, columns] = value
    return safe


def best(price: np.ndarray) -> tuple[int, int]:
    row, column = divmod(int(np.argmin(price)), price.shape[1])
    return row, column


def slow_price(safe, propellant, next_look, cell, weights=WEIGHTS) -> float:
    """J of one cell by plain sums; propellant is the same everywhere."""
    row, column = cell
    dispersion = 0.0
    for i in range(-2, 3):
        for j in range(-2, 3):
            mass = 1.0
            for k in (i, j):
                scale = weights.dispersion * math.sqrt(2.0)
                share = 0.5 * (math.erf((k + 0.5) / scale) - math.erf((k - 0.5) / scale))
                mass *= share / math.erf(2.5 / scale)
            dispersion += mass * safe[row + i, column + j]
    known = unknown = 0.0
    reach = int(max(weights.divert_slope * next_look.height, 1.0))
    across = math.hypot(column + 0.5 - next_look.east, row + 0.5 - next_look.north)
    half_width = int(next_look.half_width_slope * math.hypot(across, next_look.height))
    for i in range(SIDE):
        for j in range(SIDE):
            gap = max(abs(i - row), abs(j - column))
            if safe[i, j] > 0.5:
                known += safe[i, j] if gap <= reach else 0.0
            elif math.hypot(j + 0.5 - next_look.east, i + 0.5 - next_look.north) <= next_look.nadir_radius:
                unknown += safe[i, j] if gap <= half_width else 0.0
    exponent = known / weights.surprise_area + unknown / weights.island_area if next_look.useful else 0.0
    risk = weights.divert_cost + weights.failure_cost * math.exp(-exponent)
    return propellant + (1.0 - dispersion) * risk


@settings(max_examples=12)
@given(seed=st.integers(0, 2**32 - 1), height=st.sampled_from([20.0, 120.0, 400.0]), useful=st.booleans())
def test_the_price_is_the_sum_that_the_docstring_states(seed, height, useful):
    rng = np.random.default_rng(seed)
    coarse = rng.choice([0.0, 0.1, 0.95, 1.0], size=(SIDE // 10, SIDE // 10), p=[0.5, 0.4, 0.05, 0.05])
    safe = np.kron(coarse, np.ones((10, 10))).astype(np.float32)
    east, north = (float(metres) for metres in rng.uniform(20.0, 100.0, 2))
    next_look = look_ahead(height, east, north, useful)
    price = price_sites(safe, FREE + 7.0, next_look, WEIGHTS)
    for row, column in rng.integers(3, SIDE - 3, (8, 2)):
        expected = slow_price(safe, 7.0, next_look, (row, column))
        assert price[row, column] == pytest.approx(expected, rel=1e-4, abs=1e-3)


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    height=st.sampled_from([20.0, 120.0, 400.0]),
    within=st.sampled_from([0.0, 0.05, 3.0]),
    greatest=st.sampled_from([0.3, 0.98, 1.0]),
)
def test_what_cannot_be_cheapest_is_left_out_and_nothing_else(seed, height, within, greatest):
    """Ground that is nowhere surely safe leaves no cell out by its own price alone."""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(0.0, greatest, (SIDE // 10, SIDE // 10)) ** rng.uniform(0.2, 3.0)
    safe = np.kron(coarse, np.ones((10, 10))).astype(np.float32)
    propellant = rng.uniform(0.0, 4.0, FREE.shape)
    east, north = (float(metres) for metres in rng.uniform(20.0, 100.0, 2))
    next_look = look_ahead(height, east, north)
    every = price_sites(safe, propellant, next_look, WEIGHTS)
    few = price_sites(safe, propellant, next_look, WEIGHTS, within)
    most = every.min() + within
    assert best(few) == best(every)
    np.testing.assert_array_equal(few[every <= most], every[every <= most])
    rest = every > most
    assert (few[rest] > most).all()
    assert (few[rest] <= every[rest]).all()


def test_a_dispersed_landing_on_even_ground_is_as_safe_as_the_ground():
    even = np.full((20, 20), 0.7, dtype=np.float32)
    for cell in itertools.product((2, 9, 17), (2, 9, 17)):
        assert landing_probability(even, 0.5, cell) == pytest.approx(0.7, rel=1e-6)
    for cell in ((0, 9), (1, 9), (18, 9), (19, 9), (9, 0), (9, 1), (9, 18), (9, 19)):
        assert landing_probability(even, 0.5, cell) == 0.0
    edge = ground((slice(0, 60), slice(0, SIDE), 1.0))
    assert landing_probability(edge, 0.5, (50, 60)) == pytest.approx(1.0)
    inside, outside = (landing_probability(edge, 0.5, (row, 60)) for row in (59, 60))
    assert inside + outside == pytest.approx(1.0, abs=1e-6)
    assert 0.8 < inside < 0.9  # half a metre inside at 0.5 m: Phi(1) = 0.84


def test_it_prefers_the_inside_of_an_island_to_a_speck_and_to_its_own_edge():
    safe = ground((slice(40, 60), slice(40, 60), 1.0), (slice(70, 72), slice(52, 54), 1.0))
    row, column = best(price_sites(safe, FREE, look_ahead(50.0), WEIGHTS))
    assert 41 <= row <= 58
    assert 41 <= column <= 58


def test_it_takes_the_cheaper_of_two_equal_islands_and_pays_for_safety():
    slope = np.linspace(0.0, 2.0, FREE.shape[1])[None, :] * np.ones((FREE.shape[0], 1))
    twins = ground((slice(40, 60), slice(20, 40), 1.0), (slice(40, 60), slice(80, 100), 1.0))
    assert best(price_sites(twins, slope, look_ahead(), WEIGHTS))[1] < 40
    doubtful = ground((slice(40, 60), slice(20, 40), 0.6), (slice(40, 60), slice(80, 100), 1.0))
    assert best(price_sites(doubtful, slope, look_ahead(useful=False), WEIGHTS))[1] > 80


def test_where_nothing_is_safe_it_looks_where_most_is_unknown_and_visible():
    safe = ground((slice(0, SIDE), slice(60, SIDE), 0.1))
    assert best(price_sites(safe, FREE, look_ahead(300.0), WEIGHTS))[1] > 75
    beyond = look_ahead(60.0, east=-40.0)  # from there the unknown ground is too far from the vertical
    price = price_sites(safe, FREE, beyond, WEIGHTS)
    np.testing.assert_allclose(price[20:100, 20:50], price[60, 30], rtol=1e-6)


def test_without_another_look_the_risk_is_the_risk():
    safe = ground(elsewhere=0.9)
    price = price_sites(safe, FREE, look_ahead(useful=False), WEIGHTS)
    assert price[60, 60] == pytest.approx(0.1 * (WEIGHTS.divert_cost + WEIGHTS.failure_cost), rel=1e-5)


@pytest.mark.parametrize("name", ["surprise_area", "island_area", "dispersion"])
def test_a_weight_that_means_nothing_is_named(name):
    with pytest.raises(ValueError, match=name):
        HazardAwareWeights(**{name: 0.0})
    with pytest.raises(ValueError, match="failure_cost"):
        HazardAwareWeights(failure_cost=-1.0)


def first_look(episode: int) -> tuple[hda.Scenario, Observation]:
    scenario = sample_scenario("paper", 3, episode, "tuning")
    return scenario, observe(scenario, begin_flight(scenario))


def test_the_next_look_is_predicted_by_coasting():
    scenario, observation = first_look(0)
    ahead = predict_next_look(observation, scenario.view, (100, 200), 2.5)
    state = observation.state
    expected = state.position + 5.0 * state.velocity + 12.5 * scenario.view.gravity
    assert (ahead.east, ahead.north) == pytest.approx((expected[0] - 100.0, expected[1] - 200.0))
    assert ahead.height == pytest.approx(expected[2] - 50.0)
    assert ahead.useful
    late = replace(observation, time_to_go=7.0)
    assert not predict_next_look(late, scenario.view, (0, 0), 2.5).useful


def test_a_sensor_fixed_to_a_body_sees_ground_about_the_easiest_landing():
    gimballed = sample_scenario("rigid-body", 3, 0, "tuning")
    fixed = sample_scenario(vary_body(gimballed.preset, "body-fixed-sensor"), 3, 0, "tuning")
    observation = observe(fixed, begin_flight(fixed))
    state, coasted = observation.state, predict_next_look(observation, gimballed.view, (0, 0), 8.0)
    ahead = predict_next_look(observation, fixed.view, (100, 200), 8.0)
    expected = state.position + 0.5 * observation.time_to_go * state.velocity
    assert (ahead.east, ahead.north) == pytest.approx((expected[0] - 100.0, expected[1] - 200.0))
    assert ahead.height == coasted.height
    assert ahead.nadir_radius == pytest.approx(ahead.height * math.tan(math.radians(5.7)))
    assert coasted.east == pytest.approx(state.position[0] + 5.0 * state.velocity[0])


def test_the_site_is_kept_once_committed_and_at_the_plane():
    scenario, observation = first_look(1)
    selection = HazardAwareSite()
    _, memory = selection.select(observation, selection.begin(scenario.view))
    late = replace(observation, time_to_go=2.0)
    site, after = selection.select(late, memory)
    np.testing.assert_array_equal(site, observation.target)
    assert isinstance(after.belief, SafetyBelief)
    low = State(np.array([*observation.target[:2], 50.0]), np.zeros(3), 1180.0)
    site, _ = selection.select(replace(observation, state=low), HazardAwareMemory(scenario.view))
    np.testing.assert_array_equal(site, observation.target)


def test_what_was_seen_is_remembered_when_it_has_left_the_view():
    """A first look sees all the safe ground; the second, of nothing, does not make it forget."""
    scenario, observation = first_look(2)
    selection = HazardAwareSite()
    site, memory = selection.select(observation, selection.begin(scenario.view))
    away = observation.target + np.array([400.0, 0.0, 0.0])
    blind = replace(observation, index=1, target=away, safety_map=np.zeros_like(observation.safety_map))
    again, _ = selection.select(blind, memory)
    np.testing.assert_array_equal(again, site)


@pytest.mark.parametrize("episode", range(6))
def test_it_lands_softly_on_truly_safe_ground_for_little_more_than_the_floor(episode):
    scenario = sample_scenario("paper", 5, episode, "tuning")
    outcome = fly(hda.make_policy("hazard-aware"), scenario).outcome
    floor = fly(hda.make_policy("oracle-fuel"), scenario).outcome
    assert outcome.success
    assert floor.success
    assert outcome.touchdown_speed < 1.0
    assert outcome.propellant_fraction < floor.propellant_fraction + 0.05


def test_the_floor_is_the_cheapest_clear_cell():
    scenario, observation = first_look(4)
    record = fly(hda.make_policy("oracle-fuel"), scenario)
    site = record.decisions[0].site
    view = scenario.view
    rng = np.random.default_rng(0)

    def cost(x: float, y: float) -> float:
        at = (np.array([x]), np.array([y]))
        return float(divert_cost(observation.state, *at, 50.0, view.lander, view.gravity)[0, 0])

    safe = scenario.tile.deterministic
    row, column = int(site[1]), int(site[0])
    assert safe[row - 2 : row + 3, column].all()
    assert safe[row, column - 2 : column + 3].all()
    rows, columns = np.nonzero(safe)
    for k in rng.integers(0, rows.size, 400):
        row, column = rows[k], columns[k]
        if safe[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4].sum() == 49:
            assert cost(float(column) + 0.5, float(row) + 0.5) >= cost(site[0], site[1]) - 1e-9
    assert all(np.array_equal(decision.site, site) for decision in record.decisions)


FIRST_DECISION = """
import sys
from numba.core.dispatcher import Dispatcher
import hda
from hda.flight.episode import begin_flight, observe
from hda.policies.hazard_aware import HazardAwareSite

def loaded():
    own = [vars(m) for name, m in list(sys.modules.items()) if name.partition(".")[0] in ("hda", "guidance")]
    kernels = {id(k): k for names in own for k in list(names.values()) if isinstance(k, Dispatcher)}
    return sum(len(k.signatures) for k in kernels.values()), set(sys.modules)

scenario = hda.sample_scenario("PRESET", 0, 0)
look = observe(scenario, begin_flight(scenario))
before = loaded()
memory = HazardAwareSite().begin(scenario.view)
ready = loaded()
HazardAwareSite().select(look, memory)
after = loaded()
print(ready[0] - before[0], after[0] - ready[0], sorted(after[1] - ready[1]))
"""


@pytest.mark.parametrize("preset", ["paper", "lidar", "navigated"])
def test_the_first_decision_waits_for_no_compiled_code(preset: str) -> None:
    answer = subprocess.run(
        [sys.executable, "-c", FIRST_DECISION.replace("PRESET", preset)],
        capture_output=True,
        text=True,
        check=True,
    )
    begun, late, modules = answer.stdout.split(maxsplit=2)
    assert int(begun) > 0
    assert (int(late), modules.strip()) == (0, "[]")


def test_the_scatter_of_a_landing_is_what_control_and_filter_leave() -> None:
    scenario = sample_scenario("paper", 0, 0, "tuning")
    look = observe(scenario, begin_flight(scenario))
    assert landing_spread(look, 0.3) == 0.3
    stated = np.diag([0.16, 0.16, 9.0, 9.0, 9.0, 9.0])
    assert landing_spread(replace(look, covariance=stated), 0.3) == pytest.approx(0.5)
    assert landing_spread(replace(look, covariance=100.0 * stated), 0.3) == 1.0


def test_a_filter_that_knows_less_keeps_further_from_hazards() -> None:
    scenario = sample_scenario("paper", 0, 0, "tuning")
    look = observe(scenario, begin_flight(scenario))
    belief = fuse_look(look, scenario.view, None)
    safe = np.zeros((belief.side, belief.side), dtype=np.float32)
    middle = belief.side // 2
    safe[middle - 1 : middle + 2, middle - 1 : middle + 2] = 1.0  # three cells wide
    sharp, vague = (
        HazardAwareSite().price_by(
            safe, replace(look, covariance=sigma**2 * np.eye(6)), scenario.view, belief
        )
        for sigma in (0.0, 0.8)
    )
    plain = HazardAwareSite().price_by(safe, look, scenario.view, belief)
    np.testing.assert_array_equal(sharp, plain)
    assert vague[middle, middle] > sharp[middle, middle] + 1.0
