"""Guidance that knows of a rigid body: its plans, its commands, and when it keeps a site."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hda
from guidance.rigid_body import DEFAULT_BODY
from guidance.rigid_body.attitude_loop import DEFAULT_LOOP
from guidance.rigid_body.loop_response import fly_turn
from guidance.tracking.looks_ahead import LooksAhead
from guidance.tracking.reference import TrackingReference
from hda.flight.episode import begin_flight, observe
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.planned_descent import PlannedDescent
from hda.policies.turning_law import TurningLaw, reversal_time
from hda.policy import DecisionStatus, PlanCommand, Policy
from hda.task.body_variants import vary_body
from hda.task.scenario import sample_scenario


def first_look(preset: str):
    scenario = sample_scenario(preset, 3, 0, split="tuning")
    return scenario.view, observe(scenario, begin_flight(scenario))


def test_a_reversal_takes_about_as_long_as_its_turns_flown_by_the_loop():
    lean = np.array([math.radians(6.0), 0.0, 0.0])
    flown = 0.0
    for turn in (lean, 2.0 * lean, lean):
        response = fly_turn(turn, DEFAULT_BODY.inertia_mass, 20.0, DEFAULT_BODY, DEFAULT_LOOP)
        flown += response.settling_time(math.radians(0.5))
    assert reversal_time(DEFAULT_BODY) < flown < 1.6 * reversal_time(DEFAULT_BODY)


def test_it_falls_with_the_root_of_the_torque():
    weak = replace(DEFAULT_BODY, torque_limit=(16.5, 16.5, 66.0))
    assert reversal_time(weak) == pytest.approx(2.0 * reversal_time(DEFAULT_BODY), rel=1e-12)


def test_a_body_is_planned_for_smoothly_and_a_point_mass_as_ever():
    view, look = first_look("rigid-body")
    law = PlannedDescent()
    command, status, memory = law.command(look, look.target, law.begin(view))
    assert isinstance(command, PlanCommand)
    assert status is DecisionStatus.NOMINAL
    assert command.lead == TurningLaw().lead
    assert command.lateral_gains is not None
    assert command.lateral_gains[0] < command.gains[0]
    assert memory.reference is not None
    assert np.linalg.norm(command.reference.thrust_acceleration, axis=1).min() > 0.25  # it never coasts
    plain_view, plain_look = first_look("navigated")
    plain, _, _ = law.command(plain_look, plain_look.target, law.begin(plain_view))
    assert isinstance(plain, PlanCommand)
    assert plain.lead == 0.0
    assert plain.lateral_gains is None


def test_with_a_sensor_fixed_to_the_body_a_plan_pays_for_its_looks():
    """An episode in which the cheapest plans miss many looks, and one that pays for them does not."""
    scenario = sample_scenario("rigid-body", 3, 3, split="tuning")
    preset = vary_body(scenario.preset, "body-fixed-sensor")
    fixed = sample_scenario(preset, 3, 3, split="tuning")
    look = observe(scenario, begin_flight(scenario))
    lidar, rules = preset.lidar, preset.rules
    own = LooksAhead(rules.decision_interval, lidar.off_nadir_limit, reversal_time(DEFAULT_BODY))
    free = TurningLaw(replace(TurningLaw().options, looks=replace(own, price=0.0)))
    plain, seeing = (TurningLaw().plan(look, look.target, world.view) for world in (scenario, fixed))
    indifferent = free.plan(look, look.target, fixed.view)  # looks of one's own are kept
    assert plain is not None
    assert seeing is not None
    assert indifferent is not None

    def cost(plan: TrackingReference) -> float:
        return float(np.linalg.norm(plan.thrust_acceleration, axis=1).sum())

    def missed(plan: TrackingReference) -> float:
        """Looks to come, each by the angle of site and axis over the whole field of view, 1 beyond it."""
        each, nodes = round(own.interval / plan.control_period), len(plan.thrust_acceleration)
        picked = slice(each, nodes - round(own.least_time / plan.control_period), each)
        sight, thrust = plan.position[picked] - look.target, plan.thrust_acceleration[picked]
        lengths = np.linalg.norm(sight, axis=1) * np.linalg.norm(thrust, axis=1)
        angle = np.arccos(np.clip((sight * thrust).sum(axis=1) / lengths, -1.0, 1.0))
        return float(np.minimum(angle / (2.0 * own.half_angle), 1.0).sum())

    assert missed(seeing) < 0.6 * min(missed(indifferent), missed(plain))
    assert cost(seeing) > cost(indifferent)  # of the same flights, the cheapest and one that sees


def test_a_site_is_kept_when_a_late_divert_comes_too_late():
    view, look = first_look("rigid-body")
    selection = HazardAwareSite()
    weights = selection.weights_for(view)
    assert weights.commit_time == reversal_time(DEFAULT_BODY)
    assert selection.weights_for(replace(view, body=None)) == selection.weights
    _, memory = selection.select(look, selection.begin(view))
    late = replace(look, time_to_go=0.9 * reversal_time(DEFAULT_BODY))
    site, _ = selection.select(late, memory)
    np.testing.assert_array_equal(site, look.target)


def test_deferred_decision_too_keeps_its_site_when_a_divert_comes_too_late():
    view, look = first_look("rigid-body")
    policy = hda.make_policy("deferred-decision")
    assert isinstance(policy, Policy)
    _, memory = policy.decide(look, policy.begin(view, np.random.default_rng(0)))
    late = replace(look, time_to_go=0.9 * reversal_time(DEFAULT_BODY))
    decision, _ = policy.decide(late, memory)
    np.testing.assert_array_equal(decision.site, look.target)
    earlier, _ = policy.decide(replace(look, time_to_go=1.1 * reversal_time(DEFAULT_BODY)), memory)
    assert not np.array_equal(earlier.site, look.target)


@pytest.mark.slow
def test_hazard_aware_lands_a_rigid_body():
    """The same twelve tuning episodes in every run, all of which it lands; rounding may cost one."""
    policy = hda.make_policy("hazard-aware")
    records = [hda.fly(policy, sample_scenario("rigid-body", 0, k, split="tuning")) for k in range(12)]
    assert sum(record.outcome.success for record in records) >= 11
    for record in records:
        report = record.outcome.report
        assert report is not None
        assert math.degrees(report.tilt) < 3.0
