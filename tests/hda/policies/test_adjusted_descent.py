"""A late change of site: the plan in flight is shifted where that will do, and replaced where it will not."""

from dataclasses import replace

import numpy as np
import pytest

from guidance.state import State
from guidance.tracking.retarget import velocity_change
from hda.flight.episode import begin_flight, observe
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.planned_descent import DescentMemory, PlannedDescent
from hda.policy import DecisionStatus, PlanCommand
from hda.task.observation import Observation
from hda.task.scenario import Scenario, sample_scenario

LAW = AdjustedDescent()


def underway(time: float) -> tuple[Scenario, Observation, DescentMemory]:
    """An exact flight along the first plan, `time` seconds on."""
    scenario = sample_scenario("paper", 0, 0, "tuning")
    observation = observe(scenario, begin_flight(scenario))
    command, _, memory = LAW.command(observation, observation.target, LAW.begin(scenario.view))
    assert isinstance(command, PlanCommand)
    flown = round(time / scenario.view.control_period)
    left = command.reference.after(flown)
    assert left is not None
    burnt = scenario.view.control_period * np.linalg.norm(
        command.reference.thrust_acceleration[:flown], axis=1
    )
    mass = 1200.0 * float(np.exp(-burnt.sum() / scenario.view.lander.exhaust_velocity))
    state = State(left.position[0], left.velocity[0], mass)
    later = replace(observation, state=state, time=time, time_to_go=left.duration)
    return scenario, later, replace(memory, reference=left)


def command_to(
    offset: float, time: float
) -> tuple[PlanCommand, DecisionStatus, DescentMemory, DescentMemory]:
    _, observation, memory = underway(time)
    site = observation.target + np.array([offset, 0.0, 0.0])
    command, status, after = LAW.command(observation, site, memory)
    assert isinstance(command, PlanCommand)
    return command, status, memory, after


@pytest.mark.parametrize("offset", [0.0, 1.0, 5.0])
def test_late_and_near_the_plan_keeps_its_time_and_ends_on_the_site(offset: float) -> None:
    command, status, memory, after = command_to(offset, 20.0)
    assert status is DecisionStatus.NOMINAL
    assert memory.reference is not None
    assert memory.site is not None
    assert command.reference.duration == memory.reference.duration
    np.testing.assert_allclose(command.reference.position[-1] - memory.site, [offset, 0.0, 0.0], atol=1e-6)
    assert after.site is not None
    assert after.site[0] - memory.site[0] == pytest.approx(offset)
    assert velocity_change(command.reference) < velocity_change(memory.reference) + 1.0


def test_early_it_costs_no_more_than_a_fresh_plan() -> None:
    _, observation, memory = underway(5.0)
    site = observation.target + np.array([30.0, 20.0, 0.0])
    command, _, _ = LAW.command(observation, site, memory)
    fresh, _, _ = PlannedDescent().command(observation, site, memory)
    assert isinstance(command, PlanCommand)
    assert isinstance(fresh, PlanCommand)
    assert velocity_change(command.reference) <= velocity_change(fresh.reference) + 1e-9


def test_a_site_too_far_for_a_shift_is_planned_anew() -> None:
    command, _, memory, _ = command_to(120.0, 20.0)
    assert memory.reference is not None
    assert command.reference.duration != memory.reference.duration


def test_without_a_plan_or_with_the_same_site_it_is_planned_descent() -> None:
    _, observation, memory = underway(10.0)
    mine = LAW.command(observation, observation.target, memory)
    theirs = PlannedDescent().command(observation, observation.target, memory)
    assert isinstance(mine[0], PlanCommand)
    assert isinstance(theirs[0], PlanCommand)
    np.testing.assert_array_equal(mine[0].reference.position, theirs[0].reference.position)
    assert mine[1] is theirs[1]
