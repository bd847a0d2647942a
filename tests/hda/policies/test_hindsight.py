"""The knowable ground: an outer bound, so nothing that flies may prove it too small."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from guidance import InfeasibleError, solve_pdg
from guidance.dynamics import propagate
from guidance.lander import PAPER_LANDER
from guidance.state import State
from hda.flight.episode import begin_flight, fly, observe
from hda.policies.privileged.knowable_ground import (
    KnowableGround,
    could_have_landed,
    first_ground,
    least_propellant,
    nearest_known_site,
)
from hda.policy import PrivilegedPolicy
from hda.registry import make_policy
from hda.site_selection import Site
from hda.task.presets import PRESETS, Preset
from hda.task.rules import Range
from hda.task.scenario import Scenario, sample_scenario

UNPRIVILEGED = ("no-divert", "single-divert", "nearest-safe", "nearest-safe+convex", "hazard-aware")
FEW_METRES = replace(PRESETS["paper"].start, altitude=Range(250.0, 300.0), mass=Range(1174.0, 1174.0))


def narrow(preset: Preset) -> Preset:
    """A setting in which the bound excludes much: low, little propellant, a narrow view."""
    return replace(preset, start=FEW_METRES, lidar=replace(preset.lidar, off_nadir_limit=math.radians(4.0)))


def with_one_safe_cell(scenario: Scenario, east: float, north: float) -> tuple[Scenario, Site]:
    """The scenario with one truly safe cell, so far from the first target; and that cell's centre."""
    column, row = (int(scenario.nominal_target[axis] + (east, north)[axis]) for axis in (0, 1))
    safe = np.zeros_like(scenario.tile.deterministic)
    safe[row, column] = True
    site = np.array([column + 0.5, row + 0.5, scenario.nominal_target[2]])
    return replace(scenario, tile=replace(scenario.tile, deterministic=safe)), site


@pytest.mark.parametrize("policy", UNPRIVILEGED)
@pytest.mark.parametrize("preset", ["paper", "hard", "narrow"])
def test_no_policy_lands_safely_outside_the_set(policy: str, preset: str) -> None:
    setting = narrow(PRESETS["hard"]) if preset == "narrow" else PRESETS[preset]
    pilot, landed = make_policy(policy), 0
    for episode in range(31):
        scenario = sample_scenario(setting, 3, episode)
        outcome = fly(pilot, scenario).outcome
        if outcome.success:
            landed += 1
            assert first_ground(scenario).contains(outcome.touchdown), episode
            assert could_have_landed(scenario), episode
            assert outcome.propellant_fraction >= least_propellant(scenario), episode
        if landed == 10:
            break
    assert landed, "nothing was tried: no flight landed"


@pytest.mark.parametrize(
    "changes",
    [
        {"soft_speed": 10.0, "crash_speed": 20.0},
        {"navigation_position_error": 150.0, "navigation_velocity_error": 8.0},
    ],
)
def test_hindsight_flies_to_the_only_safe_cell_where_a_flight_could_have_known_it(
    changes: dict[str, float],
) -> None:
    """By the preset's own soft speed, and by the true state: the policy's own estimate may be far off."""
    preset = narrow(PRESETS["hard"])
    scenario = sample_scenario(replace(preset, rules=replace(preset.rules, **changes)), 3, 0)
    known, policy = [], make_policy("hindsight")
    assert isinstance(policy, PrivilegedPolicy)
    for east in range(140, 541, 20):
        told, site = with_one_safe_cell(scenario, east, 0.0)
        known.append(first_ground(told).contains(site))
        pilot = policy.informed(told)
        memory = pilot.begin(told.view, told.streams.policy())
        decision, _ = pilot.decide(observe(told, begin_flight(told)), memory)
        assert np.array_equal(decision.site, site) == known[-1], east
    assert 5 < sum(known) < len(known)


def test_the_first_look_is_where_it_truly_falls() -> None:
    """A lander that is wrong about its place looks beside its target: those cells are what it has seen."""
    preset = narrow(PRESETS["hard"])
    rules = replace(preset.rules, navigation_position_error=100.0)
    start = replace(FEW_METRES, distance=Range(0.0, 0.0))
    scenario = sample_scenario(replace(preset, rules=rules, start=start), 3, 0)
    look, known = observe(scenario, begin_flight(scenario)), first_ground(scenario)
    assert math.hypot(*scenario.navigation_error[:2]) > look.width
    aim = scenario.nominal_target[:2] - scenario.navigation_error[:2]
    assert known.target[:2].tolist() == pytest.approx(aim.tolist())
    assert known.width == look.width


def test_the_narrow_setting_excludes_much() -> None:
    scenario = sample_scenario(narrow(PRESETS["hard"]), 3, 0)
    known = first_ground(scenario)
    steps = np.arange(-1500.0, 1501.0, 25.0)
    offsets = np.column_stack([steps, np.zeros_like(steps), np.zeros_like(steps)])
    reached = [known.within_reach(scenario.nominal_target + offset) for offset in offsets]
    seen = [known.contains(scenario.nominal_target + offset) for offset in offsets]
    assert 0 < sum(seen) < sum(reached) < 0.7 * steps.size


def test_what_can_be_seen_can_be_reached() -> None:
    scenario = sample_scenario(narrow(PRESETS["hard"]), 3, 1)
    known = first_ground(scenario)
    rng = np.random.default_rng(0)
    for _ in range(100):
        site = scenario.nominal_target + np.array([*rng.uniform(-900.0, 900.0, 2), 0.0])
        assert known.within_reach(site) or not known.contains(site)


@settings(max_examples=15)
@given(angle=st.floats(0.0, 2.0 * math.pi), distance=st.floats(0.0, 500.0), mass=st.floats(1172.0, 1200.0))
def test_every_site_that_a_planner_reaches_is_within_reach(
    angle: float, distance: float, mass: float
) -> None:
    scenario = sample_scenario("paper", 0, 0)
    state = replace(scenario.initial_state, mass=mass)
    offset = distance * np.array([math.cos(angle), math.sin(angle), 0.0])
    site = scenario.nominal_target + offset
    try:
        plan = solve_pdg(state, site, unreachable="nearest")
    except InfeasibleError:
        reject()  # no soft landing anywhere: nothing to hold against the bound
    landed = plan.position[-1]
    assert KnowableGround(state, scenario.nominal_target, 190.0, scenario.view, 2.0).within_reach(landed)


@settings(max_examples=60)
@given(data=st.data())
def test_a_random_flight_that_looks_down_on_its_landing_is_in_the_set(data: st.DataObject) -> None:
    """Any thrust history: where it ends is knowable if a look on the way could have shown it."""
    scenario = sample_scenario("paper", 0, data.draw(st.integers(0, 20)))
    view, limit = scenario.view, scenario.view.lidar.off_nadir_limit
    rng = np.random.default_rng(data.draw(st.integers(0, 2**31)))
    state, passed = scenario.initial_state, []
    for _ in range(int(rng.integers(2, 6))):
        passed.append(state.position)
        thrust = rng.normal(0.0, 2500.0, 3) + np.array([0.0, 0.0, 2000.0])
        state = propagate(state, thrust, 5.0, PAPER_LANDER, view.gravity)
    height = state.position[2]
    velocity = math.sqrt(float(state.velocity @ state.velocity))
    seen = any(
        position[2] > height
        and math.hypot(*(position - state.position)[:2]) <= math.tan(limit) * (position[2] - height)
        for position in passed[1:]
    )
    assume(seen and state.mass >= PAPER_LANDER.dry_mass)
    # what is left of the speed is taken off by one more impulse, paid for in mass
    mass = state.mass * math.exp(-velocity / PAPER_LANDER.exhaust_velocity)
    used = replace(PAPER_LANDER, dry_mass=mass)
    known = KnowableGround(
        scenario.initial_state,
        np.array([1e6, 1e6, height]),
        1.0,
        replace(view, lander=used),
        soft_speed=0.0,
    )
    assert known.contains(state.position)


def test_without_safe_ground_nothing_could_have_been_known() -> None:
    scenario = sample_scenario("paper", 0, 0)
    barren = replace(scenario.tile, deterministic=np.zeros_like(scenario.tile.deterministic))
    assert not could_have_landed(replace(scenario, tile=barren))
    assert least_propellant(replace(scenario, tile=barren)) == math.inf


def test_the_nearest_known_site_is_the_nearest_where_all_is_known() -> None:
    scenario = sample_scenario("paper", 0, 2)
    safe = np.zeros_like(scenario.tile.deterministic)
    x, y = (int(value) for value in scenario.nominal_target[:2])
    safe[y + 30, x] = safe[y, x - 12] = safe[y - 45, x + 45] = True
    site = nearest_known_site(first_ground(scenario), safe)
    assert site is not None
    assert site[:2].tolist() == [x - 11.5, y + 0.5]


def test_a_tank_that_cannot_stop_the_fall_knows_nothing() -> None:
    scenario = sample_scenario("paper", 0, 0)
    poor = State(scenario.initial_state.position, scenario.initial_state.velocity, 1160.0)
    assert not could_have_landed(replace(scenario, initial_state=poor))


@pytest.mark.parametrize("preset", ["lidar", "lidar-coarse"])
def test_where_ranges_are_measured_there_is_no_ceiling_but_a_floor(preset: str) -> None:
    with pytest.raises(ValueError, match="preset must not measure ranges"):
        could_have_landed(sample_scenario(preset, 0, 0))
    pilot, landed = make_policy("nearest-safe"), 0
    for episode in range(8):
        scenario = sample_scenario(preset, 0, episode)
        outcome = fly(pilot, scenario).outcome
        if outcome.success:
            landed += 1
            assert first_ground(scenario).within_reach(outcome.touchdown)
            assert outcome.propellant_fraction >= least_propellant(scenario) > 0.2
    assert landed, "nothing was tried: no flight landed"
