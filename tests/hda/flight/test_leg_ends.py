"""What one leg reports: against which site a landing is judged, and how long each part took."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import count
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hda
from guidance import State, time_to_go
from hda.flight import episode
from hda.flight.episode import Flight, advance, begin_flight, fly_legs
from hda.flight.held_thrust import fall_to_plane
from hda.policy import Decision, ZemZevCommand
from hda.task.scenario import Scenario


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    drawn = hda.sample_scenario("paper", 3, 0)
    preset = drawn.preset
    return replace(drawn, preset=replace(preset, rules=replace(preset.rules, thrust_error=0.0)))


def test_a_landing_is_judged_against_the_site_that_was_decided_last(scenario: Scenario) -> None:
    target = scenario.nominal_target
    site = target + np.array([1.5, -2.0, 0.0])
    state = State(target + np.array([0.0, 0.0, 4.0]), np.array([0.0, 0.0, -2.0]), 1170.0)
    clock = time_to_go(state, site)
    step = advance(scenario, Flight(7, state, target, clock), Decision(site, ZemZevCommand(6.0, 2.0, clock)))
    assert step.outcome is not None
    miss = math.dist(step.outcome.touchdown, site)
    assert step.outcome.miss_distance == pytest.approx(miss, rel=1e-12)
    assert abs(miss - math.dist(step.outcome.touchdown, target)) > 0.5


def test_each_part_of_a_leg_is_timed_by_itself(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a clock that counts how often it is read: each part lies between two readings in a row."""
    readings = count()
    monkeypatch.setattr(episode, "clock", SimpleNamespace(perf_counter=lambda: float(next(readings))))
    policy: Any = hda.make_policy("no-divert")
    memory = policy.begin(scenario.view, np.random.default_rng(0))
    legs = list(fly_legs(scenario, policy.decide, memory))
    parts = [part for leg in legs for part in (leg.look_time, leg.decision_time, leg.flight_time)]
    assert parts == [1.0] * (3 * len(legs))
    assert next(readings) == 4 * len(legs)


def test_flights_are_told_apart_by_identity(scenario: Scenario) -> None:
    """Their arrays cannot be compared as one truth value."""
    flight = begin_flight(scenario)
    assert flight != begin_flight(scenario)
    record = hda.fly(hda.make_policy("no-divert"), scenario)
    assert len({flight, record, *record.segments, *record.observations, *record.decisions}) > 20


@pytest.mark.parametrize("below", [0.0, 1e-12, 1e-6])
def test_a_vehicle_on_the_plane_has_fallen(below: float) -> None:
    """A crossing is found to rounding, so a fall may begin a little below the plane."""
    start = np.array([1.0, 2.0, 50.0 - below, 0.3, 0.0, 0.0, 1170.0])
    out = np.full(7, np.nan)
    assert fall_to_plane(start, np.array([0.0, 0.0, -1.62]), 50.0, out) == 0.0
    assert np.array_equal(out, start)
