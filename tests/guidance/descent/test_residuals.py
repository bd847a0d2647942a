"""The measure of a flown plan: each number against a closed form."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from guidance import PAPER_LANDER, Lander, Limits, State
from guidance.descent.problem import LandingProblem
from guidance.descent.residuals import Residuals, fly_residuals
from guidance.descent.thrust_direction import pointing_excess
from guidance.descent.trajectory import Trajectory

PERFECT = dict.fromkeys((field.name for field in fields(Residuals)), 0.0)


def problem_under(gravity: float, lander: Lander = PAPER_LANDER) -> LandingProblem:
    state = State(np.array([0.0, 0.0, 900.0]), np.array([0.0, 0.0, -30.0]), 1200.0)
    limits = Limits(thrust_rate=2500.0)
    return LandingProblem(state, np.zeros(3), lander, np.array([0.0, 0.0, -gravity]), limits)


@pytest.mark.parametrize(("gravity", "unit"), [(1.62, 1.0), (0.1, 1.0), (16.2, 10.0)])
def test_lengths_and_speeds_are_allowed_in_proportion_to_gravity_and_the_rest_alike(gravity, unit):
    lander = Lander(min_thrust=1000.0)
    allowed = {
        "position": 0.5 * unit,
        "velocity": 0.1 * unit,
        "thrust_above": 1e-3 * lander.max_thrust,
        "thrust_below": 1e-3 * lander.min_thrust,
        "thrust_dip": 0.04 * lander.min_thrust,
        "thrust_rate": 0.01 * 2500.0,
        "pointing": 1e-3,
        "final_thrust_direction": 1e-3,
        "glide_slope": 0.5 * unit,
        "line_of_sight": 0.5 * unit,
        "altitude": 0.2 * unit,
        "speed": 0.1 * unit,
        "propellant": 1e-3,
    }
    problem = problem_under(gravity, lander)
    for name, bound in allowed.items():
        missed = Residuals(**(PERFECT | {name: 1.5 * bound}))
        excess = missed.excess(problem)
        assert excess.pop(name) == pytest.approx(1.5)
        assert set(excess.values()) == {0.0}
        assert not missed.keeps_limits(problem)
        assert Residuals(**(PERFECT | {name: 0.99 * bound})).keeps_limits(problem)
    assert allowed.keys() == Residuals(**PERFECT).excess(problem).keys()


def test_an_engine_that_can_stop_has_no_least_thrust_to_miss_by_rounding():
    excess = Residuals(**(PERFECT | {"thrust_below": 2e-9, "thrust_dip": 3e-9})).excess(problem_under(1.62))
    assert excess["thrust_below"] == pytest.approx(2.0)
    assert excess["thrust_dip"] == pytest.approx(3.0)


def test_the_relaxation_gap_is_the_thrust_that_is_paid_for_and_not_given():
    """Mass falls as if a thrust were larger by a known gap; where the thrust turns, nothing is said."""
    problem, nodes, step = problem_under(1.62), 6, 2.0
    exhaust = problem.lander.exhaust_velocity
    size = np.linspace(3000.0, 5000.0, nodes)
    thrust = size[:, None] * np.array([0.6, 0.0, 0.8])
    gap = np.array([0.0, 10.0, 40.0, 25.0, 90.0])
    mean = 0.5 * (size[1:] + size[:-1])
    mass = 1200.0 - np.concatenate([[0.0], np.cumsum((mean + gap) * step / exhaust)])
    rest = np.zeros((nodes, 3))

    def measured(thrust):
        times = np.linspace(0.0, step * (nodes - 1), nodes)
        flight = Trajectory(times, rest.copy(), rest.copy(), mass.copy(), thrust, exhaust)
        return fly_residuals(flight, problem).relaxation_gap

    assert measured(thrust.copy()) == pytest.approx(90.0, rel=1e-9)
    turned = thrust.copy()
    turned[-1, 0] *= -1.0
    assert measured(turned) == pytest.approx(40.0, rel=1e-9)


def test_the_rate_of_the_thrust_is_that_of_its_vector():
    """Of constant size and turning evenly: the size times the rate of turn; and a jump is none to forgive."""
    nodes, turn, size = 201, 0.2, 6000.0
    time = np.linspace(0.0, 10.0, nodes)
    thrust = size * np.column_stack([np.sin(turn * time), np.zeros(nodes), np.cos(turn * time)])
    flow = size / PAPER_LANDER.exhaust_velocity
    rest, mass = np.zeros((nodes, 3)), 1200.0 - flow * time
    limits = Limits(thrust_rate=500.0)
    problem = replace(problem_under(1.62), limits=limits)
    flight = Trajectory(time, rest, rest.copy(), mass, thrust, PAPER_LANDER.exhaust_velocity)
    assert fly_residuals(flight, problem).thrust_rate == pytest.approx(turn * size - 500.0, abs=10.0)
    cut = thrust.copy()
    cut[100:] = 0.0
    gone = Trajectory(time.copy(), rest.copy(), rest.copy(), mass.copy(), cut, PAPER_LANDER.exhaust_velocity)
    assert fly_residuals(gone, problem).thrust_rate == pytest.approx(size / 0.05, rel=0.02)
    assert fly_residuals(flight, replace(problem, limits=Limits())).thrust_rate == 0.0


def test_a_thrust_leans_where_it_burns_and_what_a_solver_leaves_of_none_does_not():
    def lean(angle, size):
        return size * np.array([math.sin(angle), 0.0, math.cos(angle)])

    full = 12000.0
    thrust = np.array([lean(0.1, full), lean(0.7, 0.5 * full), lean(1.5, 2e-3 * full)])
    assert pointing_excess(thrust, 0.6, full) == pytest.approx(0.9)
    thrust[2] = lean(1.5, 0.5e-3 * full)  # a thousandth of the greatest is none
    assert pointing_excess(thrust, 0.6, full) == pytest.approx(0.1)
    assert pointing_excess(thrust, 0.8, full) == 0.0
    assert pointing_excess(thrust, None, full) == 0.0
    faint = np.array([lean(1.5, 0.9e-6 * full)])  # the greatest of a flight that does not burn
    assert pointing_excess(faint, 0.6, full) == 0.0
    assert pointing_excess(2.0 * faint, 0.6, full) == pytest.approx(0.9)
