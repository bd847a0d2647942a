"""Flights by the filter's estimate: the filter in the vehicle's loop against that along the flown path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import hda
from hda.flight.episode import Flight, advance, begin_flight, fly_legs, inform_pilot, observe
from hda.navigation import (
    FlownPath,
    NavigationSystem,
    SiteFixes,
    choose_site,
    measure_ranges,
    navigate,
    track_site,
)
from hda.task.estimation import estimation_error
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import Scenario, frame_point, ground_point

ON_PLANE = replace(PRESETS["paper"], name="navigated-on-plane", navigation=NavigationSystem())
"""The filter where looks are cheap and flights end on the plane."""
LAWS = ("nearest-safe", "nearest-safe+convex")


def draw(preset: Preset, count: int) -> list[Scenario]:
    return [hda.sample_scenario(preset, 6, episode) for episode in range(count)]


def flights_of(policy: str, scenario: Scenario) -> list[tuple[Flight, Flight]]:
    """Where each leg of an episode began and ended; the last, which ends on the ground, is left out."""
    pilot = inform_pilot(hda.make_policy(policy), scenario)
    memory = pilot.begin(scenario.view, scenario.streams.policy())
    begun, out = begin_flight(scenario), []
    for leg in fly_legs(scenario, pilot.decide, memory):
        if leg.step.outcome is None:
            out.append((begun, leg.step.flight))
        begun = leg.step.flight
    return out


@pytest.mark.parametrize("law", LAWS)
def test_the_loop_runs_the_same_filter_as_goes_along_the_flown_path(law: str):
    (scenario,) = draw(ON_PLANE, 1)
    system = scenario.preset.navigation
    assert system is not None
    pilot = inform_pilot(hda.make_policy(law), scenario)
    memory = pilot.begin(scenario.view, scenario.streams.policy())
    checked = 0
    before = begin_flight(scenario)
    for leg in fly_legs(scenario, pilot.decide, memory):
        after, segment = leg.step.flight, leg.step.segment
        if leg.step.outcome is None:
            assert before.navigation is not None
            assert after.navigation is not None
            started = choose_site(before.navigation, after.target - before.target)
            ranges = measure_ranges(scenario.tile.elevation, segment.path[1:], started.errors)
            draws = scenario.streams.readings(before.index, len(ranges))
            along, _ = navigate(system, started, FlownPath(segment.time, segment.path, ranges), draws)
            really, look = ground_point(scenario, after.target), scenario.streams.site_fix(after.index)
            fixed, _ = track_site(system, along, after.state.position, really, look)
            np.testing.assert_allclose(after.navigation.estimate, fixed.estimate, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(after.navigation.covariance, fixed.covariance, rtol=1e-7, atol=1e-12)
            assert after.navigation.instant == fixed.instant
            checked += 1
        before = after
    assert checked >= 4


@pytest.mark.parametrize("law", LAWS)
def test_the_error_that_the_vehicle_flies_by_is_as_large_as_the_covariance_says(law: str):
    """Six numbers at the last look of 40 flights, against chi-squared; one false alarm in 10 000."""
    total, scenarios = 0.0, draw(ON_PLANE, 40)
    for scenario in scenarios:
        last = flights_of(law, scenario)[-1][1]
        assert last.navigation is not None
        error = estimation_error(scenario, last.navigation, last.state, last.target)
        # The policies' frame stands off the map by a constant; what is left is position less site.
        error = error - scenario.navigation_error
        total += error @ np.linalg.solve(last.navigation.relative_covariance, error)
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 6 * len(scenarios))
    assert low < total < high


@pytest.mark.parametrize("law", LAWS)
def test_with_sensors_that_hardly_err_the_flight_is_the_one_with_perfect_navigation(law: str):
    still = {"bias": 0.0, "noise": 1e-9}
    exact = NavigationSystem(
        inertial=hda.InertialUnit(tilt=0.0, **still),
        altimeter=hda.Altimeter(**still),
        velocimeter=hda.Velocimeter(**still),
        terrain=hda.TerrainFixes(noise=1e-6),
        site=SiteFixes(noise_per_range=0.0, least_noise=1e-9),
        horizontal_error=0.0,
        vertical_error=0.0,
        velocity_error=0.0,
    )
    (plain,) = draw(PRESETS["paper"], 1)
    navigated = replace(plain, preset=replace(plain.preset, navigation=exact))
    records = [hda.fly(hda.make_policy(law), scenario) for scenario in (plain, navigated)]
    np.testing.assert_allclose(records[0].path, records[1].path, atol=1e-3)


def test_the_vehicle_steers_by_the_estimate_and_not_by_the_truth():
    """Two episodes that differ in the first velocity's error alone fly apart within one interval."""
    (scenario,) = draw(ON_PLANE, 1)
    ends = []
    for velocity_error in (0.0, 2.0):
        blind = NavigationSystem(velocimeter=None, velocity_error=velocity_error)
        flown = replace(scenario, preset=replace(scenario.preset, navigation=blind))
        flight = begin_flight(flown)
        pilot = inform_pilot(hda.make_policy("no-divert"), flown)
        memory = pilot.begin(flown.view, flown.streams.policy())
        decision, _ = pilot.decide(observe(flown, flight), memory)
        ends.append(advance(flown, flight, decision).flight.state.velocity)
    assert np.linalg.norm(ends[1] - ends[0]) > 0.05


def test_an_observation_states_the_covariance_where_there_is_a_filter():
    plain, navigated = draw(PRESETS["paper"], 1)[0], draw(ON_PLANE, 1)[0]
    assert observe(plain, begin_flight(plain)).covariance is None
    covariance = observe(navigated, begin_flight(navigated)).covariance
    assert covariance is not None
    assert covariance.shape == (6, 6)
    deviation = np.sqrt(np.diag(covariance))
    assert (deviation[:3] < 2.0).all()  # the look's own error, not the 20 m of the map
    np.testing.assert_allclose(deviation[3:], 0.2, rtol=1e-6)


def test_a_look_is_placed_where_the_lander_believes_to_be():
    """What a policy sees errs by its frame, which stands still, and by what the filter does not know."""
    (scenario,) = draw(ON_PLANE, 1)
    frame = scenario.navigation_error
    assert np.abs(frame[:2]).max() > 1.0
    for _, flight in flights_of("nearest-safe", scenario):
        observation = observe(scenario, flight)
        error = observation.state.position - flight.state.position - frame[:3]
        assert observation.covariance is not None
        deviation = np.sqrt(np.diag(observation.covariance))[:3]
        assert 0.0 < np.abs(error / deviation).max() < 5.0


def test_equal_episodes_are_equal_to_the_byte():
    for law in LAWS:
        first, again = (hda.fly(hda.make_policy(law), draw(ON_PLANE, 1)[0]).path.tobytes() for _ in range(2))
        assert first == again


def test_a_filter_leaves_no_constant_error_in_the_rules():
    rules = replace(PRESETS["paper"].rules, navigation_position_error=1.0)
    with pytest.raises(ValueError, match="constant navigation errors"):
        replace(PRESETS["navigated"], rules=rules)


def test_the_preset_is_lidar_with_a_filter():
    assert replace(PRESETS["navigated"], name="lidar", navigation=None) == PRESETS["lidar"]
    system = PRESETS["navigated"].navigation
    assert system is not None
    assert (system.horizontal_error, system.vertical_error, system.velocity_error) == (20.0, 5.0, 0.2)
    assert system.velocimeter is not None
    assert system.velocimeter.floor == 30.0


@pytest.mark.parametrize("name", ["oracle", "oracle-fuel", "hindsight"])
@pytest.mark.parametrize("preset", ["navigated", "navigated-on-plane"])
def test_a_policy_that_sees_the_map_lands_on_the_safe_cell_that_it_chose(name: str, preset: str):
    """The frame is metres off the map, so the site that it names is not the place it means."""
    (scenario,) = draw(ON_PLANE if preset == ON_PLANE.name else PRESETS[preset], 1)
    assert np.abs(scenario.navigation_error[:2]).max() > 2.0
    record = hda.fly(hda.make_policy(name), scenario)
    site = record.decisions[0].site
    meant = ground_point(scenario, site)
    np.testing.assert_allclose(frame_point(scenario, meant), site, atol=1e-9)
    np.testing.assert_allclose(meant[:2] % 1.0, 0.5, atol=1e-9)  # the middle of a cell of the true map
    assert scenario.tile.is_safe(meant)
    assert record.outcome.safe_site
    assert np.hypot(*(record.outcome.touchdown - meant)[:2]) < 2.0


@pytest.mark.slow
def test_flights_on_measured_looks_land_by_their_filter():
    scenarios = draw(PRESETS["navigated"], 6)
    records = [hda.fly(hda.make_policy("hazard-aware"), scenario) for scenario in scenarios]
    assert sum(record.outcome.success for record in records) >= 5
    for record in records:
        assert all(observation.covariance is not None for observation in record.observations)
