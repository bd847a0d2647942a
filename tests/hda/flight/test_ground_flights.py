"""Whole episodes that end on real ground: sites at measured heights, and honest ends for those at others."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hda
from guidance.two_impulse import divert_cost
from hda.flight.episode import advance, begin_flight, fly, observe
from hda.flight.record import EpisodeRecord
from hda.flight.touchdown_report import TouchdownFault
from hda.policy import Decision, ZemZevCommand
from hda.safety.touchdown_stance import contact_height
from hda.sensing.measured_look import STANDOFF
from hda.task.observation import Observation
from hda.task.scenario import Scenario
from tests.equality import same

EPISODES = 12


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    return [hda.sample_scenario("lidar", 23, k) for k in range(EPISODES)]


@pytest.fixture(scope="module")
def records(scenarios) -> list[EpisodeRecord]:
    return [fly(hda.make_policy("nearest-safe"), scenario) for scenario in scenarios]


class OntoThePlane:
    """A third party's policy that never heard of real ground: it flies to the plane of the first target."""

    name = "onto-the-plane"

    def begin(self, scenario_view, rng) -> Any:
        return scenario_view.nominal_target

    def decide(self, observation: Observation, memory: Any) -> tuple[Decision, Any]:
        return Decision(memory, ZemZevCommand(6.0, 2.0, observation.time_to_go)), memory


def true_contact(scenario: Scenario, place: np.ndarray) -> float:
    assert scenario.footing is not None
    return contact_height(scenario.footing, float(place[0]), float(place[1]))


def test_a_flight_ends_where_the_lander_touches_the_true_ground(scenarios, records):
    for scenario, record in zip(scenarios, records, strict=True):
        touchdown = record.outcome.touchdown
        assert touchdown[2] == pytest.approx(true_contact(scenario, touchdown), abs=1e-5)
        for node in record.position[:-1]:
            assert node[2] > true_contact(scenario, node)
        assert record.outcome.report is not None
        assert record.outcome.report.safe_cell == scenario.tile.is_safe(touchdown)
        assert touchdown[2] < 49.0


def test_the_height_of_the_ground_is_known_better_the_later_it_is_measured(scenarios, records):
    """In the median of 12 flights: within 1 m at the first look, and within 0.2 m at the last."""
    first, last = [], []
    for scenario, record in zip(scenarios, records, strict=True):
        errors = [
            decision.site[2] - STANDOFF - true_contact(scenario, decision.site)
            for decision in record.decisions
        ]
        first.append(abs(errors[0]))
        last.append(abs(errors[-1]))
    assert np.median(last) < 0.2
    assert np.median(last) < np.median(first) < 1.0


def test_with_a_sensor_without_errors_the_site_lies_just_above_its_ground(scenarios):
    """Cells of 1 m at their highest points: no lower than the contact by a few centimetres, little higher."""
    scenario = scenarios[0]
    exact = replace(
        scenario.preset.lidar,
        rays=512,
        range_noise=0.0,
        range_bias=0.0,
        pointing_error=0.0,
        pointing_jitter=0.0,
        motion_error=0.0,
        beam_divergence=0.0,
        scan_duration=0.0,
    )
    preset = replace(scenario.preset, lidar=exact)
    record = fly(hda.make_policy("nearest-safe"), replace(scenario, preset=preset))
    for observation, decision in zip(record.observations[1:-2], record.decisions[1:-2], strict=True):
        if observation.elevation_grid is not None and observation.elevation_grid.pixel_size == 1.0:
            above = decision.site[2] - true_contact(scenario, decision.site) - STANDOFF
            assert -0.1 < above < 0.5


def test_a_policy_that_flies_to_the_plane_falls_from_there(scenarios):
    for scenario in scenarios[:4]:
        record = fly(OntoThePlane(), scenario)
        outcome, plane = record.outcome, float(scenario.nominal_target[2])
        assert outcome.touchdown[2] == pytest.approx(true_contact(scenario, outcome.touchdown), abs=1e-5)
        depth = plane - outcome.touchdown[2]
        assert depth > 2.0
        assert outcome.touchdown_speed == pytest.approx(math.sqrt(2.0 * 1.62 * depth), abs=0.6)
        assert outcome.report is not None
        assert TouchdownFault.VERTICAL_SPEED in outcome.report.faults
        assert not outcome.success


def test_on_the_plane_the_same_sensor_flies_to_the_plane(scenarios):
    preset = replace(scenarios[0].preset, touchdown=hda.PlaneTouchdown())
    scenario = replace(scenarios[0], preset=preset)
    record = fly(hda.make_policy("nearest-safe"), scenario)
    assert {float(decision.site[2]) for decision in record.decisions} == {50.0}
    assert record.outcome.touchdown[2] == pytest.approx(50.0, abs=1e-9)
    assert record.outcome.report is None
    lifted = Decision(np.array([500.0, 500.0, 49.0]), ZemZevCommand(6.0, 2.0, 40.0))
    with pytest.raises(ValueError, match="target plane"):
        advance(scenario, begin_flight(scenario), lifted)
    assert advance(scenarios[0], begin_flight(scenarios[0]), lifted).outcome is None


def test_equal_seeds_give_equal_flights(scenarios, records):
    again = fly(hda.make_policy("nearest-safe"), hda.sample_scenario("lidar", 23, 3))
    assert same(again.segments, records[3].segments)
    assert same(again.outcome, records[3].outcome)


def test_where_nothing_was_measured_a_site_keeps_the_height_of_the_target(scenarios):
    observation = observe(scenarios[0], begin_flight(scenarios[0]))
    far = observation.target + np.array([400.0, 0.0, 0.0])
    assert observation.ground_height(float(far[0]), float(far[1])) == observation.target[2]
    near = observation.target + np.array([20.0, 20.0, 0.0])
    assert abs(observation.settled(near)[2] - true_contact(scenarios[0], near)) < 2.0
    assert same(observation.settled(observation.target), observation.target)
    on_plane = replace(observation, stance=None)
    assert on_plane.settled(near) is near


def test_shortly_before_the_end_no_height_is_changed(scenarios):
    start = begin_flight(scenarios[0])
    target = start.target - np.array([0.0, 0.0, 9.0])
    for time_to_go, moved in ((2.6, True), (2.5, False)):
        observation = observe(scenarios[0], replace(start, index=3, target=target, time_to_go=time_to_go))
        assert (observation.target[2] != target[2]) == moved
        assert (observation.stance is not None) == moved
        pixel = observation.site(10, 10)
        assert (pixel[2] != observation.target[2]) == moved


def test_the_oracles_know_the_true_height(scenarios):
    for name in ("oracle", "oracle-fuel", "hindsight"):
        record = fly(hda.make_policy(name), scenarios[1])
        for decision in record.decisions:
            assert decision.site[2] == true_contact(scenarios[1], decision.site)
        assert record.outcome.success


def test_ten_metres_of_height_change_the_price_of_a_site_by_less_than_a_hundredth(scenarios):
    """So that sites may be priced on the level of the present target."""
    for scenario in scenarios:
        view, state = scenario.view, scenario.initial_state
        east, north = (scenario.nominal_target[axis] + np.linspace(-200.0, 200.0, 9) for axis in (0, 1))
        low, high = (
            divert_cost(state, east, north, height, view.lander, view.gravity) for height in (40.0, 50.0)
        )
        assert (np.abs(high / low - 1.0) < 0.01).all()


def test_planned_descents_follow_a_new_height_without_a_fallback(scenarios):
    for scenario in scenarios[:4]:
        record = fly(hda.make_policy("hazard-aware"), scenario)
        heights = {float(decision.site[2]) for decision in record.decisions}
        assert len(heights) > 3
        assert record.fallbacks == 0
        assert record.outcome.success
