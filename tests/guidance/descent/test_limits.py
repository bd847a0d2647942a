"""Limits as one value: what it refuses, and that the old keywords are shorthands of it."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from descents import GRAVITY, TARGET
from hypothesis import given
from hypothesis import strategies as st

from guidance import PAPER_LANDER, Cone, Limits, State, solve_pdg
from guidance.descent.problem import LandingProblem

START = [200.0, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0]


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ({"glide_slope": 0.0}, "limits.glide_slope"),
        ({"glide_slope": 1.6}, "limits.glide_slope"),
        ({"glide_slope": math.nan}, "limits.glide_slope"),
        ({"speed": 0.0}, "limits.speed"),
        ({"speed": math.inf}, "limits.speed"),
        ({"speed": "fast"}, "limits.speed"),
        ({"thrust_rate": 0.0}, "limits.thrust_rate"),
        ({"thrust_rate": math.inf}, "limits.thrust_rate"),
        ({"final_thrust_direction": 0.1}, "limits.final_thrust_direction"),
        ({"line_of_sight": (0.1, (0.0, 0.0, 1.0))}, "limits.line_of_sight"),
        ({"line_of_sight": Cone(1.6)}, "limits.line_of_sight.angle"),
    ],
)
def test_what_nothing_can_keep_is_refused_by_its_name(given, name):
    with pytest.raises(ValueError, match=name):
        Limits(**given)


@pytest.mark.parametrize(
    ("angle", "axis", "name"),
    [
        (0.0, (0.0, 0.0, 1.0), "angle"),
        (3.2, (0.0, 0.0, 1.0), "angle"),
        (0.1, (0.0, 0.0, 0.0), "axis"),
        (0.1, (0.0, 1.0), "axis"),
        (0.1, (0.0, math.nan, 1.0), "axis"),
    ],
)
def test_a_cone_needs_an_angle_and_a_direction(angle, axis, name):
    with pytest.raises(ValueError, match=name):
        Cone(angle, axis)


@given(seed=st.integers(0, 1_000_000))
def test_a_cone_measures_angles_from_its_axis(seed):
    rng = np.random.default_rng(seed)
    axis, aside = rng.normal(size=3), rng.normal(size=3)
    axis, cone = axis / np.linalg.norm(axis), Cone(rng.uniform(0.01, 3.0), tuple(3.0 * axis))
    aside -= (aside @ axis) * axis
    aside /= np.linalg.norm(aside)
    angle = rng.uniform(0.0, math.pi)
    vector = rng.uniform(0.1, 1e4) * (math.cos(angle) * axis + math.sin(angle) * aside)
    assert cone.excess(vector) == pytest.approx(max(0.0, angle - cone.angle), abs=1e-9)
    assert cone.direction == pytest.approx(axis, abs=1e-15)
    frame = np.vstack([cone.across, cone.direction])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-14)


@given(seed=st.integers(0, 1_000_000))
def test_a_place_outside_a_cone_is_as_far_as_its_surface(seed):
    rng = np.random.default_rng(seed)
    cone = Cone(rng.uniform(0.05, 1.5), tuple(rng.normal(size=3)))
    bearing, distance = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(1.0, 1e3)
    beyond = rng.uniform(0.0, 0.3)
    aside = math.cos(bearing) * cone.across[0] + math.sin(bearing) * cone.across[1]
    angle = cone.angle + beyond
    point = distance * (math.cos(angle) * cone.direction + math.sin(angle) * aside)
    assert cone.outside(point) == pytest.approx(distance * math.sin(beyond), abs=1e-9 * distance)
    near = cone.on_surface(point)
    assert np.linalg.norm(near - point) == pytest.approx(distance * math.sin(beyond), abs=1e-9 * distance)
    assert cone.outside(near) == pytest.approx(0.0, abs=1e-9 * distance)
    inner = distance * (math.cos(0.9 * cone.angle) * cone.direction + math.sin(0.9 * cone.angle) * aside)
    assert cone.outside(inner) < 0.0


def test_limits_are_given_by_name_only():
    with pytest.raises(TypeError):
        Limits(0.5)  # pyright: ignore[reportCallIssue]


@pytest.mark.parametrize("name", ["glide_slope", "speed"])
def test_a_limit_given_twice_is_refused_with_both_names(name):
    twice: Any = {"limits": replace(Limits(), **{name: 1.0}), f"{name}_limit": 1.0}
    with pytest.raises(ValueError, match=rf"{name}_limit and limits\.{name} "):
        solve_pdg(START, TARGET, **twice)


def test_limits_must_be_limits():
    with pytest.raises(ValueError, match="limits"):
        solve_pdg(START, TARGET, limits=0.5)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="limits"):
        LandingProblem(State.parse(START), TARGET, PAPER_LANDER, GRAVITY, 0.5)  # pyright: ignore[reportArgumentType]


def test_a_shorthand_is_its_limit_to_the_bit():
    short = solve_pdg(START, TARGET, glide_slope_limit=0.6, speed_limit=45.0)
    whole = solve_pdg(START, TARGET, limits=Limits(glide_slope=0.6, speed=45.0))
    mixed = solve_pdg(START, TARGET, limits=Limits(speed=45.0), glide_slope_limit=0.6)
    for plan in (whole, mixed):
        assert plan.problem.limits == short.problem.limits == Limits(glide_slope=0.6, speed=45.0)
        assert plan.thrust.tobytes() == short.thrust.tobytes()
    assert short.problem.glide_slope_limit == 0.6
    assert short.problem.speed_limit == 45.0
    assert np.linalg.norm(short.velocity, axis=1).max() == pytest.approx(45.0, abs=0.1)
