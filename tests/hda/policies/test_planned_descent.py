"""Fuel-optimal guidance in closed loop: soft, cheap, and labelled where it has to fall back."""

from dataclasses import replace

import numpy as np
import pytest

from guidance.state import State
from guidance.tracking.reference import TrackingReference
from guidance.tracking.soft_landing import SoftLandingOptions
from guidance.zem_zev import time_to_go
from hda.flight.episode import begin_flight, fly, observe
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Segment, Surroundings, fly_over
from hda.policies.composition import ComposedPolicy
from hda.policies.planned_descent import DescentMemory, PlannedDescent
from hda.policies.privileged.oracle import OracleSite
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import Decision, DecisionStatus, PlanCommand, ZemZevCommand
from hda.task.observation import Observation
from hda.task.presets import find_preset
from hda.task.scenario import Scenario, sample_scenario


def scenario_of(episode: int, thrust_error: float = 0.05) -> Scenario:
    paper = find_preset("paper")
    preset = replace(paper, rules=replace(paper.rules, thrust_error=thrust_error))
    return sample_scenario(preset, 0, episode, "tuning")


def to_true_site(scenario: Scenario, law: PlannedDescent | FixedGainZemZev) -> ComposedPolicy:
    return ComposedPolicy("test", OracleSite(scenario.tile), law)


def low_observation(scenario: Scenario, height: float, descent: float) -> Observation:
    """A look from low above the first target."""
    look = observe(scenario, begin_flight(scenario))
    position = scenario.nominal_target + np.array([0.0, 0.0, height])
    state = State(position, np.array([0.0, 0.0, -descent]), 1175.0)
    return replace(look, state=state, time_to_go=time_to_go(state, scenario.nominal_target))


@pytest.mark.parametrize("episode", range(12))
def test_soft_and_at_least_8_points_cheaper_than_zem_zev(episode: int) -> None:
    scenario = scenario_of(episode)
    planned = fly(to_true_site(scenario, PlannedDescent()), scenario).outcome
    feedback = fly(to_true_site(scenario, FixedGainZemZev()), scenario).outcome
    assert planned.success
    assert planned.touchdown_speed < 1.0
    assert planned.miss_distance < 0.5
    assert planned.propellant_fraction <= feedback.propellant_fraction - 0.08


@pytest.mark.parametrize("bound", [0.0, 0.03, 0.09])
def test_an_engine_error_within_the_margin_does_not_become_a_hard_landing(bound: float) -> None:
    for episode in range(4):
        scenario = scenario_of(episode, bound)
        outcome = fly(to_true_site(scenario, PlannedDescent()), scenario).outcome
        assert outcome.success, f"episode {episode} at error {bound}: {outcome}"
        assert outcome.touchdown_speed < 1.0


def fly_by_engine(law: PlannedDescent, scenario: Scenario, errors: tuple[float, ...]) -> Segment:
    """The last segment of a flight to the first target in which the engine errs as told, over and over."""
    view, site = scenario.view, scenario.nominal_target
    look, memory, segment = observe(scenario, begin_flight(scenario)), law.begin(view), None
    surroundings, periods = (
        Surroundings(view.gravity),
        ControlPeriods(view.control_period, view.control_periods),
    )
    for index in range(12):
        command, _, memory = law.command(look, site, memory)
        decision, error = Decision(site, command), FlightErrors(errors[index % len(errors)])
        segment = fly_over(look.state, decision, view.lander, surroundings, periods, error)
        if segment.status is not FlightStatus.FLYING:
            break
        look = replace(look, state=segment.final_state, time_to_go=segment.time_to_go)
    assert segment is not None
    assert segment.status is FlightStatus.TOUCHDOWN
    return segment


@pytest.mark.parametrize("bound", [0.15, 0.3])
@pytest.mark.parametrize("signs", [(-1.0,), (1.0,), (1.0, -1.0), (-1.0, 1.0)])
def test_it_bears_an_engine_at_either_end_of_its_bound(bound: float, signs: tuple[float, ...]) -> None:
    for episode in range(3):
        scenario = scenario_of(episode, bound)
        segment = fly_by_engine(PlannedDescent(), scenario, tuple(bound * sign for sign in signs))
        assert np.linalg.norm(segment.final_state.velocity) < 1.5, f"episode {episode}"
        assert np.linalg.norm(segment.final_state.position - scenario.nominal_target) < 0.5


@pytest.mark.parametrize("margin", [0.1, 0.3])
def test_a_constant_margin_does_not_be_it_the_bound_itself(margin: float) -> None:
    scenario, options = scenario_of(0, 0.3), SoftLandingOptions(thrust_margin=margin)
    segment = fly_by_engine(PlannedDescent(options, bears_engine=False), scenario, (-0.3,))
    assert np.linalg.norm(segment.final_state.velocity) > 5.0


@pytest.mark.parametrize("error", [-1.0, 1.5, float("nan")])
def test_an_engine_that_no_command_moves_is_not_assumed(error: float) -> None:
    reference = TrackingReference(0.5, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((1, 3)))
    with pytest.raises(ValueError, match="assumed_error"):
        PlanCommand(reference, (0.9, 1.7), error)


def test_a_far_site_late_in_the_flight_is_labelled_nearest() -> None:
    scenario = scenario_of(0)
    look = low_observation(scenario, 150.0, 35.0)
    site = scenario.nominal_target + np.array([280.0, 0.0, 0.0])
    command, status, _ = PlannedDescent().command(look, site, DescentMemory(scenario.view))
    assert status is DecisionStatus.FALLBACK_NEAREST
    assert isinstance(command, PlanCommand)
    assert np.linalg.norm(command.reference.position[-1] - site) > 1.0


def test_without_an_answer_the_last_plan_flies_on_then_zem_zev() -> None:
    scenario = scenario_of(0)
    law = PlannedDescent()
    _, _, memory = law.command(
        low_observation(scenario, 400.0, 40.0), scenario.nominal_target, law.begin(scenario.view)
    )
    below_gate = low_observation(scenario, 2.0, 2.0)
    moved = scenario.nominal_target + np.array([5.0, 0.0, 0.0])
    command, status, _ = law.command(below_gate, moved, memory)
    assert status is DecisionStatus.FALLBACK_LAST_PLAN
    assert isinstance(command, PlanCommand)
    assert memory.reference is not None
    np.testing.assert_array_equal(command.reference.position[-1], memory.reference.position[-1])
    command, status, _ = law.command(below_gate, moved, law.begin(scenario.view))
    assert status is DecisionStatus.FALLBACK_ZEM_ZEV
    assert isinstance(command, ZemZevCommand)


def test_the_same_site_is_tracked_to_the_end_without_a_new_plan() -> None:
    scenario = scenario_of(1)
    record = fly(to_true_site(scenario, PlannedDescent()), scenario)
    last, before = record.decisions[-1].command, record.decisions[-2].command
    assert isinstance(last, PlanCommand)
    assert isinstance(before, PlanCommand)
    np.testing.assert_array_equal(last.reference.position[-1], before.reference.position[-1])
    assert record.fallbacks == 0
