"""Where an interval ends: at the look, not a period later; and what is left of the clock there."""

from __future__ import annotations

import dataclasses
import importlib
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hda.flight
from guidance import Lander, State, time_to_go
from guidance.lander import PAPER_LANDER
from guidance.tracking.reference import TrackingReference
from guidance.tracking.soft_landing import plan_soft_landing
from hda.flight import vehicle
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Segment, Surroundings, fly_over
from hda.policy import Command, Decision, PlanCommand, ZemZevCommand

GRAVITY = np.array([0.0, 0.0, -1.62])
SITE = np.array([500.0, 400.0, 50.0])
PERIOD = 0.5


def fly(state: State, command: Command, periods: int, lander: Lander = PAPER_LANDER) -> Segment:
    interval, errors = ControlPeriods(PERIOD, periods), FlightErrors(0.03)
    return fly_over(state, Decision(SITE, command), lander, Surroundings(GRAVITY), interval, errors)


@pytest.fixture(scope="module")
def reference() -> TrackingReference:
    start = State(SITE + np.array([180.0, -120.0, 880.0]), np.array([-6.0, 3.0, -28.0]), 1200.0)
    planned = plan_soft_landing(start, SITE, PAPER_LANDER, PERIOD).reference
    assert planned is not None
    return planned


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), first=st.integers(1, 9), limited=st.booleans())
def test_an_interval_flown_in_two_parts_is_the_same_to_the_last_bit(
    seed: int, first: int, limited: bool
) -> None:
    rng = np.random.default_rng(seed)
    lander = Lander(pointing_limit=math.radians(12.0)) if limited else PAPER_LANDER
    height = rng.uniform(3.0, 600.0)
    offset = np.array([*rng.uniform(-0.5, 0.5, 2), 1.0]) * height
    state = State(SITE + offset, np.array([*rng.uniform(-6, 6, 2), -(height**0.5)]), 1190.0)
    clock = round(4.0 * time_to_go(state, SITE) * rng.uniform(0.4, 1.2) + 1.0) / 4.0  # halves are exact
    whole = fly(state, ZemZevCommand(6.0, 2.0, clock), 10, lander)
    begun = fly(state, ZemZevCommand(6.0, 2.0, clock), first, lander)
    nodes = min(first + 1, len(whole.time))
    if begun.status is not FlightStatus.FLYING:
        assert np.array_equal(begun.path, whole.path)
        return
    assert np.array_equal(begun.path, whole.path[:nodes])
    assert np.array_equal(begun.commanded, whole.commanded[: nodes - 1])
    assert begun.time_to_go == pytest.approx(clock - PERIOD * first, abs=1e-12)
    rest = fly(begun.final_state, ZemZevCommand(6.0, 2.0, begun.time_to_go), 10 - first, lander)
    assert np.array_equal(rest.path, whole.path[nodes - 1 :])
    assert np.array_equal(rest.commanded, whole.commanded[nodes - 1 :])
    assert rest.status is whole.status
    assert begun.pointing_limited + rest.pointing_limited == whole.pointing_limited
    assert rest.time_to_go == pytest.approx(whole.time_to_go, abs=1e-9)


def commands(reference: TrackingReference) -> list[Command]:
    """A clock that is far from its end, and a plan that is: neither stops the fall from 4 m in time."""
    return [ZemZevCommand(6.0, 2.0, 60.0), PlanCommand(reference, (0.0, 0.0))]


@pytest.mark.parametrize("law", [0, 1])
def test_ground_that_is_met_after_the_look_is_not_met_before_it(
    law: int, reference: TrackingReference
) -> None:
    command = commands(reference)[law]
    state = State(SITE + np.array([0.0, 0.0, 12.0]), np.array([0.0, 0.0, -5.0]), 1190.0)
    landed = fly(state, command, 10)
    assert landed.status is FlightStatus.TOUCHDOWN
    periods = len(landed.commanded) - 1  # whole ones; the plane is crossed in the next
    assert periods >= 2
    segment = fly(state, command, periods)
    assert segment.status is FlightStatus.FLYING
    assert segment.time[-1] == PERIOD * periods
    assert len(segment.commanded) == periods
    assert np.array_equal(segment.path, landed.path[:-1])
    assert segment.final_state.position[2] > SITE[2]
    assert fly(state, command, periods + 1).status is FlightStatus.TOUCHDOWN


@pytest.mark.parametrize("periods", [1, 4, 10])
def test_what_is_left_of_a_plan_is_what_was_not_flown(periods: int, reference: TrackingReference) -> None:
    start = State(reference.position[0], reference.velocity[0], 1200.0)
    segment = fly(start, PlanCommand(reference, (0.9, 1.7)), periods)
    assert segment.time_to_go == pytest.approx(reference.duration - PERIOD * periods, abs=1e-12)
    rest = reference.after(len(reference.thrust_acceleration) - 2)
    assert rest is not None
    last = State(rest.position[0] + np.array([0.0, 0.0, 0.3]), rest.velocity[0], 1170.0)
    landed = fly(last, PlanCommand(rest, (0.9, 1.7)), 10)
    assert landed.status is FlightStatus.TOUCHDOWN
    assert landed.time_to_go == rest.duration - landed.time[-1]


@pytest.mark.parametrize("law", [0, 1, 2, 3])
def test_every_number_of_a_segment_is_written(
    law: int, reference: TrackingReference, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fresh memory often holds zeros, which hide a number that nothing wrote."""
    rest = reference.after(len(reference.thrust_acceleration) - 2)
    assert rest is not None
    command = [*commands(reference), ZemZevCommand(6.0, 2.0, 1.0), PlanCommand(rest, (0.0, 0.0))][law]
    state = State(SITE + np.array([0.0, 0.0, 12.0]), np.array([0.0, 0.0, -5.0]), 1190.0)
    plain = [fly(state, command, periods) for periods in (2, 10)]
    monkeypatch.setattr(vehicle.np, "empty", lambda shape: np.full(shape, np.nan))
    for periods, segment in zip((2, 10), plain, strict=True):
        again = fly(state, command, periods)
        assert (np.diff(again.time) > 0.0).all()
        assert np.array_equal(again.time, segment.time)
        assert np.array_equal(again.path, segment.path)
        assert np.array_equal(again.commanded, segment.commanded)


@pytest.mark.parametrize("degrees", [1.0, 4.0, 10.0])
def test_a_plan_counts_each_period_in_which_the_pointing_limit_acted_once(
    degrees: float, reference: TrackingReference
) -> None:
    """Without feedback the command points along the plan's own acceleration."""
    lander = Lander(pointing_limit=math.radians(degrees))
    late = reference.after(len(reference.thrust_acceleration) - 30)
    assert late is not None
    segment = fly(
        State(late.position[0], late.velocity[0], 1180.0), PlanCommand(late, (0.0, 0.0)), 10, lander
    )
    east, north, up = late.thrust_acceleration[: len(segment.commanded)].T
    acted = np.arctan2(np.hypot(east, north), up) > math.radians(degrees)
    assert acted.any()
    assert segment.pointing_limited == acted.sum()


def test_what_a_flight_gives_cannot_be_changed() -> None:
    checked = 0
    for path in Path(hda.flight.__file__).parent.glob("*.py"):
        module = importlib.import_module(
            f"hda.flight.{path.stem}" if path.stem != "__init__" else "hda.flight"
        )
        for kind in vars(module).values():
            if (
                isinstance(kind, type)
                and dataclasses.is_dataclass(kind)
                and kind.__module__ == module.__name__
            ):
                assert getattr(kind, "__dataclass_params__").frozen, kind  # noqa: B009 - private to dataclasses
                checked += 1
    assert checked >= 7
