"""Fuel-optimal guidance in closed loop: soft, cheap, and labelled where it has to fall back."""

from dataclasses import replace

import numpy as np
import pytest

from guidance.state import State
from guidance.zem_zev import time_to_go
from hda.flight.episode import begin_flight, fly, observe
from hda.policies.composition import ComposedPolicy
from hda.policies.planned_descent import DescentMemory, PlannedDescent
from hda.policies.privileged.oracle import OracleSite
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import DecisionStatus, PlanCommand, ZemZevCommand
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
