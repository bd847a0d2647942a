"""The picture of a plan shows the plan's own numbers, and its limits where there are some."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import guidance
from guidance.descent.picture import draw_plan
from guidance.descent.plan import Plan
from tests.drawing import line_data

START = (300.0, -150.0, 900.0, -4.0, 3.0, -30.0, 1200.0)
TARGET = np.array([20.0, -10.0, 50.0])


def solve(**options: Any) -> Plan:
    return guidance.solve_pdg(START, TARGET, nodes=31, **options)


@pytest.fixture(scope="module")
def limited() -> Plan:
    lander = guidance.Lander(min_thrust=1000.0, pointing_limit=math.radians(50.0))
    return solve(lander=lander, speed_limit=60.0, glide_slope_limit=math.radians(70.0))


@pytest.fixture(scope="module")
def panels(limited: Plan) -> dict[str, Any]:
    return {axes.get_title(): axes for axes in draw_plan(limited).axes}


def test_there_is_a_panel_for_each_limit_of_a_landing_problem(panels: dict[str, Any]) -> None:
    slope = "glide slope, seen from the landing point"
    assert list(panels) == ["path", "velocity", "thrust", "mass", "pointing", slope]
    assert [axes.get_ylabel() for axes in panels.values()] == [
        "altitude above target [m]",
        "velocity [m/s]",
        "thrust [kN]",
        "mass [kg]",
        "thrust from the vertical [deg]",
        "vehicle from the vertical [deg]",
    ]
    assert panels["path"].get_xlabel() == "horizontal distance to target [m]"
    assert {axes.get_xlabel() for title, axes in panels.items() if title != "path"} == {"time [s]"}


def test_the_path_is_drawn_from_the_target(limited: Plan, panels: dict[str, Any]) -> None:
    across, height = (np.asarray(data) for data in panels["path"].get_lines()[0].get_data())
    np.testing.assert_allclose(across, np.hypot(*(limited.position - TARGET)[:, :2].T))
    np.testing.assert_allclose(height, limited.position[:, 2] - 50.0)
    assert across[0] == pytest.approx(math.hypot(280.0, 140.0))
    assert height[0] == pytest.approx(850.0)
    assert [values.tolist() for values in line_data(panels["path"], "target")] == [[0.0], [0.0]]


def test_velocity_and_mass_are_those_of_the_nodes(limited: Plan, panels: dict[str, Any]) -> None:
    time, across = line_data(panels["velocity"], "horizontal")
    np.testing.assert_array_equal(time, limited.time)
    np.testing.assert_allclose(across, np.hypot(limited.velocity[:, 0], limited.velocity[:, 1]))
    np.testing.assert_array_equal(line_data(panels["velocity"], "vertical (up)")[1], limited.velocity[:, 2])
    time, mass = (np.asarray(data) for data in panels["mass"].get_lines()[0].get_data())
    np.testing.assert_array_equal(time, limited.time)
    np.testing.assert_array_equal(mass, limited.mass)


def test_thrust_is_drawn_in_kilonewtons_between_its_bounds(limited: Plan, panels: dict[str, Any]) -> None:
    time, thrust = (np.asarray(data) for data in panels["thrust"].get_lines()[0].get_data())
    assert (time[0], time[-1]) == (0.0, pytest.approx(limited.time_of_flight))
    assert 0.98 < thrust.min() < 1.2
    assert 11.0 < thrust.max() < 12.1
    np.testing.assert_allclose(1e3 * thrust, np.linalg.norm(limited.thrust_at(time), axis=1))


def test_angles_are_taken_from_the_vertical(limited: Plan, panels: dict[str, Any]) -> None:
    time, angle = (np.asarray(data) for data in panels["pointing"].get_lines()[0].get_data())
    up = limited.thrust[:, 2] / np.linalg.norm(limited.thrust, axis=1)
    np.testing.assert_allclose(angle, np.degrees(np.arccos(up)), atol=1e-6)
    np.testing.assert_array_equal(time, limited.time)
    slope = panels["glide slope, seen from the landing point"]
    seen = np.asarray(slope.get_lines()[0].get_ydata())
    offset = (limited.position - limited.position[-1])[:-1]
    up = offset[:, 2] / np.linalg.norm(offset, axis=1)
    np.testing.assert_allclose(seen, np.degrees(np.arccos(up)), atol=1e-5)


def test_every_limit_stands_where_it_is(panels: dict[str, Any]) -> None:
    for title, label, value in (
        ("velocity", "speed limit", 60.0),
        ("thrust", "maximum", 12.0),
        ("thrust", "minimum", 1.0),
        ("mass", "dry mass", 1150.0),
        ("pointing", "pointing limit", 50.0),
        ("glide slope, seen from the landing point", "glide slope limit", 70.0),
    ):
        assert line_data(panels[title], label)[1] == pytest.approx([value, value])


def test_limits_that_are_not_set_are_not_drawn_and_a_coasting_engine_points_nowhere() -> None:
    plan = solve()
    panels = {axes.get_title(): axes for axes in draw_plan(plan).axes}
    labels = [line.get_label() for axes in panels.values() for line in axes.get_lines()]
    assert not {"speed limit", "pointing limit", "glide slope limit"} & set(labels)
    angle = np.asarray(panels["pointing"].get_lines()[0].get_ydata(), dtype=float)
    coasting = np.linalg.norm(plan.thrust, axis=1) < 120.0
    assert coasting.any()
    assert np.array_equal(np.isnan(angle), coasting)


def test_the_title_says_what_the_flight_costs() -> None:
    plan = solve()
    figure = draw_plan(plan)
    cost = f"{plan.time_of_flight:.2f} s, {plan.propellant:.2f} kg burnt, 0.0 m from the target"
    assert figure.get_suptitle() == f"optimal, indirect: {cost}"
