"""What a planner commands, flown with and without air, and the limits that it leaves."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance.rigid_body.motion import fly_intervals
from studies.rigid_plans.commanded_flight import (
    CommandedFlight,
    fly_commanded,
    fly_in_air,
    least_between,
    limit_excess,
)
from studies.rigid_plans.peer_problems import (
    EXAMPLE_BODY,
    Surroundings,
    shared_example,
)

STILL = Surroundings((0.0, 0.0, 0.0), 0.0, 0.0)
NUMBERS = EXAMPLE_BODY.numbers((0.0, 0.0, -1.0))


def at_height(height: float, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """An upright state of the example's body."""
    return np.array([0.0, 0.0, height, *velocity, 1.0, *[0.0] * 6, 2.0, *[0.0] * 3])


def fly_held(start: np.ndarray, force: Any, duration: float, around: Surroundings) -> np.ndarray:
    thrust = np.broadcast_to(np.array(force, dtype=float), (1, 2, 3)).copy()
    return fly_in_air(start, thrust, np.zeros((1, 2, 3)), np.array([duration]), NUMBERS, around)[-1]


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-0.3, 0.3), min_size=6, max_size=6), st.floats(1.5, 6.5), st.floats(0.1, 1.0))
def test_without_air_the_motion_is_the_vehicle_s(across: list[float], up: float, duration: float) -> None:
    start = at_height(5.0, (-1.0, 0.5, -0.7))
    thrust = np.array([[[*across[:2], up], [*across[2:4], up]], [[*across[3:5], up], [*across[4:6], up]]])
    torque, durations = 1e-3 * thrust[:, ::-1], np.array([duration, 0.5 * duration])
    here = fly_in_air(start, thrust, torque, durations, NUMBERS, STILL)
    there = fly_intervals(start, thrust, torque, durations, NUMBERS)
    assert here[:, :14] == pytest.approx(there[:, :14], abs=1e-5)


def test_a_fall_in_air_follows_its_closed_form() -> None:
    """v = -V tanh(g t / V), with V^2 = m g / k: no thrust, upright."""
    drag, duration = 0.125, 3.0
    end = fly_held(at_height(20.0), 0.0, duration, Surroundings((0.25, 0.25, drag), 0.05, 0.0))
    most = math.sqrt(2.0 / drag)
    assert end[5] == pytest.approx(-most * math.tanh(duration / most), rel=1e-8)
    assert 20.0 - end[2] == pytest.approx(most**2 * math.log(math.cosh(duration / most)), rel=1e-8)
    assert end[13] == 2.0


def test_air_turns_the_body_by_the_arm_of_its_own() -> None:
    """For a short while: the moment of the force k v^2 at the arm, whatever the engine's arm is."""
    duration = 1e-3
    end = fly_held(
        at_height(20.0, (2.0, 0.0, 0.0)), 0.0, duration, Surroundings((0.25, 0.25, 0.0), 0.05, 0.0)
    )
    assert end[11] == pytest.approx(-0.25 * 4.0 * 0.05 / 0.168 * duration, rel=1e-3)
    assert end[10] == end[12] == 0.0
    assert end[3] == pytest.approx(2.0 - 0.5 * 4.0 * 0.25 * duration, rel=1e-6)


def test_a_leak_is_lost_beside_what_the_engine_burns() -> None:
    end = fly_held(at_height(20.0), (0.0, 0.0, 3.0), 2.0, replace(STILL, leak=0.01))
    assert end[13] == pytest.approx(2.0 - 2.0 * (3.0 / 30.0 + 0.01), rel=1e-9)


@pytest.mark.parametrize(
    ("name", "change", "share"),
    [
        ("most thrust", {"max_thrust": 1.5}, 1.0),
        ("least thrust", {"min_thrust": 4.0, "max_thrust": 5.0}, 0.25),
    ],
)
def test_a_limit_that_is_left_is_told_as_a_share(name: str, change: dict, share: float) -> None:
    peer = shared_example()
    lander = replace(EXAMPLE_BODY.lander, **{"min_thrust": 1.0, **change})
    peer = replace(peer, problem=replace(peer.problem, body=replace(EXAMPLE_BODY, lander=lander)))
    thrust = np.broadcast_to(np.array([0.0, 0.0, 3.0]), (1, 2, 3)).copy()
    states = np.tile(at_height(7.5)[:14], (2, 1))
    flight = CommandedFlight(np.array([0.0, 0.1]), states, thrust, np.zeros((1, 2, 3)))
    excess = limit_excess(fly_commanded(flight, peer), flight, peer)
    assert excess[name] == pytest.approx(share)
    assert excess["gimbal"] == excess["tank"] == excess["altitude"] == 0.0


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=6))
def test_the_least_thrust_lies_anywhere_on_an_interval(ends: list[float]) -> None:
    """Beside the least of many points of the same line, which their spacing bounds."""
    command = np.array(ends).reshape(1, 2, 3)
    shares = np.linspace(0.0, 1.0, 501)[:, None]
    fine = np.linalg.norm(command[0, 0] + shares * (command[0, 1] - command[0, 0]), axis=1).min()
    (least,) = least_between(command)
    assert least <= fine + 1e-12
    spacing = float(np.linalg.norm(command[0, 1] - command[0, 0])) / 500.0
    assert least == pytest.approx(fine, abs=0.5 * spacing + 1e-12)


def test_a_thrust_that_turns_linearly_dips_below_the_least_between_its_ends() -> None:
    peer = shared_example()
    thrust = np.array([[[1.5, 0.0, 1.0], [-1.5, 0.0, 1.0]]])  # both ends above 1.5, the middle at 1
    states = np.tile(at_height(7.5)[:14], (2, 1))
    flight = CommandedFlight(np.array([0.0, 0.1]), states, thrust, np.zeros((1, 2, 3)))
    excess = limit_excess(fly_commanded(flight, peer), flight, peer)
    assert excess["least thrust"] == pytest.approx(1.0 / 3.0)
