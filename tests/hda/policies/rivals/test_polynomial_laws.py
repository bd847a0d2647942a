"""E-guidance and Apollo's law in flight: when they solve anew, and where they end."""

from dataclasses import replace

import numpy as np
import pytest

import hda
from guidance import State
from guidance.polynomial import Arrival, cheapest_time_of_flight, meet_arrival
from hda.flight.episode import begin_flight, observe
from hda.policies.composition import ComposedPolicy
from hda.policies.rivals.polynomial_laws import ApolloGuidance, EGuidance
from hda.policies.zem_zev import FixedGainZemZev
from hda.policy import DecisionStatus, PlanCommand, ZemZevCommand
from hda.site_selection import NominalSite

SCENARIO = hda.sample_scenario("paper", 0, 3)
VIEW, LOOK = SCENARIO.view, observe(SCENARIO, begin_flight(SCENARIO))
CALM = replace(SCENARIO, preset=replace(SCENARIO.preset, rules=replace(VIEW.rules, thrust_error=0.0)))
ASIDE = LOOK.target + np.array([12.0, -7.0, 0.0])


def test_e_guidance_seeks_its_time_at_first_and_for_a_new_site_and_keeps_it_otherwise():
    law = EGuidance()
    first, status, memory = law.command(LOOK, LOOK.target, law.begin(VIEW))
    assert status is DecisionStatus.NOMINAL
    assert (first.position_gain, first.velocity_gain) == (6.0, 2.0)
    times = VIEW.control_period * np.arange(1, 200, dtype=np.float64)
    cheapest = cheapest_time_of_flight(LOOK.state, Arrival(LOOK.target), times, VIEW.lander, VIEW.gravity)
    assert first.time_to_go == pytest.approx(cheapest)
    later = replace(LOOK, index=1, time_to_go=23.4)
    assert law.command(later, LOOK.target, memory)[0].time_to_go == 23.4
    assert law.command(later, LOOK.target + np.array([0.0, 0.0, 2.0]), memory)[0].time_to_go == 23.4
    assert law.command(later, ASIDE, memory)[0].time_to_go != 23.4


@pytest.mark.parametrize("law", [EGuidance(), ApolloGuidance()], ids=["e-guidance", "apollo"])
def test_without_errors_it_ends_at_rest_on_its_site(law):
    record = hda.fly(ComposedPolicy("calm", NominalSite(), law), CALM)
    assert record.fallbacks == 0
    assert record.outcome.touchdown_speed < 0.5
    assert np.linalg.norm(record.outcome.touchdown[:2] - LOOK.target[:2]) < 0.2


@pytest.mark.parametrize("law", [EGuidance(), ApolloGuidance()], ids=["e-guidance", "apollo"])
def test_it_burns_less_than_zem_zev_by_the_papers_time(law):
    burnt = [
        hda.fly(ComposedPolicy("calm", NominalSite(), flown), CALM).path[-1, 6]
        for flown in (law, FixedGainZemZev())
    ]
    assert burnt[0] > burnt[1]


def test_apollos_reference_is_the_closed_form_at_the_control_instants():
    law = ApolloGuidance(arrival_acceleration=2.0)
    command, status, memory = law.command(LOOK, ASIDE, law.begin(VIEW))
    assert isinstance(command, PlanCommand)
    assert status is DecisionStatus.NOMINAL
    reference, period = command.reference, VIEW.control_period
    arrival = Arrival(ASIDE, acceleration=np.array([0.0, 0.0, 2.0]))
    descent = meet_arrival(LOOK.state, arrival, reference.duration)
    time = period * np.arange(len(reference.position), dtype=np.float64)
    np.testing.assert_allclose(reference.position, descent.position_at(time), atol=1e-9)
    np.testing.assert_allclose(reference.velocity[-1], 0.0, atol=1e-9)
    assert memory.reference is not None
    assert memory.reference.duration == pytest.approx(reference.duration - VIEW.decision_interval)


def test_apollos_law_is_solved_anew_until_the_last_ten_seconds():
    law = ApolloGuidance()
    _, _, memory = law.command(LOOK, LOOK.target, law.begin(VIEW))
    reference = memory.reference
    assert reference is not None
    off = State(reference.position[0] + 3.0, reference.velocity[0], 1185.0)
    again = law.command(replace(LOOK, index=1, state=off), LOOK.target, memory)[0]
    assert isinstance(again, PlanCommand)
    np.testing.assert_allclose(again.reference.position[0], off.position)
    assert again.reference.duration == pytest.approx(reference.duration)
    periods = len(reference.thrust_acceleration) - round(8.0 / VIEW.control_period)
    late = replace(memory, reference=reference.after(periods))
    kept = law.command(replace(LOOK, index=5, state=off), LOOK.target, late)[0]
    assert isinstance(kept, PlanCommand)
    np.testing.assert_array_equal(kept.reference.position, reference.position[periods:])


def test_from_below_its_site_it_flies_what_it_has():
    law = ApolloGuidance()
    sunk = replace(LOOK, state=State(LOOK.target - np.array([0.0, 0.0, 1.0]), np.zeros(3), 1160.0))
    command, status, _ = law.command(sunk, LOOK.target, law.begin(VIEW))
    assert isinstance(command, ZemZevCommand)
    assert status is DecisionStatus.FALLBACK_ZEM_ZEV
    _, _, memory = law.command(LOOK, LOOK.target, law.begin(VIEW))
    command, status, _ = law.command(sunk, ASIDE, memory)
    assert isinstance(command, PlanCommand)
    assert status is DecisionStatus.FALLBACK_LAST_PLAN


def test_an_end_that_no_flight_has_is_refused():
    with pytest.raises(ValueError, match="arrival_acceleration"):
        ApolloGuidance(arrival_acceleration=-1.0)
    with pytest.raises(ValueError, match="commit_time"):
        ApolloGuidance(commit_time=-1.0)
