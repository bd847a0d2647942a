"""The lander on paper: where it is put, what hides what, and what its sensor sees."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import hda
from guidance.rigid_body import DEFAULT_BODY
from guidance.rigid_body.quaternion import attitude_along, rotate
from hda.flight.portrait.pose import LanderPose
from hda.flight.portrait.shape import PLUME_COLOR
from hda.flight.portrait.view import FROM_ABOVE, View, draw_close, draw_reach, draw_sign, view_beside
from hda.task.presets import PRESETS
from hda.task.scenario import Scenario
from tests.drawing import line_data

LEANS = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Of a body on the ground of `paper`."""
    drawn = hda.sample_scenario("paper", 0, 3)
    return replace(drawn, preset=replace(PRESETS["paper"], name="with-a-body", body=DEFAULT_BODY))


def pose_of(
    scenario: Scenario, lean: tuple[float, float], height: float, throttle: float = 0.4
) -> LanderPose:
    place = scenario.nominal_target + np.array([40.0, -30.0, height])
    return leaning(place, lean, throttle)


def leaning(place: np.ndarray, lean: tuple[float, float], throttle: float) -> LanderPose:
    attitude = attitude_along([*lean, 1.0])
    return LanderPose(place, attitude, throttle * rotate(attitude, [0.0, 0.0, 1.0]))


def drawn_lander(axis: Any) -> PolyCollection:
    (lander,) = [each for each in axis.collections if isinstance(each, PolyCollection)]
    return lander


def test_the_view_beside_lies_across_the_way_and_sees_the_target_on_the_left(scenario: Scenario):
    view = view_beside(scenario)
    way = scenario.nominal_target - scenario.initial_state.position
    assert view.flat(way[None])[0, 0] == pytest.approx(-np.hypot(way[0], way[1]))
    np.testing.assert_allclose(np.stack(view) @ np.stack(view).T, np.eye(2), atol=1e-12)
    assert np.cross(*view)[2] > 0.0  # the eye is above


def test_a_sign_keeps_its_place_and_its_size_on_any_scale(scenario: Scenario):
    pose = pose_of(scenario, (0.3, -0.1), 300.0)
    for span in (1.0, 1000.0):
        figure = Figure(figsize=(4.0, 4.0), dpi=50)
        axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axis.set_xlim(0.0, span)
        axis.set_ylim(0.0, span)
        draw_sign(axis, pose, FROM_ABOVE, (0.5 * span, 0.25 * span), 0.6)
        lander = drawn_lander(axis)
        corners = np.concatenate([path.vertices for path in lander.get_paths()])
        placed = lander.get_transform().transform(corners) + lander.get_offset_transform().transform(
            lander.get_offsets()
        )
        middle = pose.to_site(np.zeros((1, 3)))[0, :2]
        np.testing.assert_allclose(middle, [0.0, 0.0])
        feet = pose.to_site(np.array([[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]]))[:, :2].mean(axis=0)
        np.testing.assert_allclose(feet, [0.0, 0.0], atol=1e-12)
        assert np.abs(placed - [100.0, 50.0]).max() < 0.6 * 50 * 1.5
        assert 0.6 * 50 * 0.6 < np.ptp(placed[:, 0]) < 0.6 * 50 * 1.5


@given(lean=LEANS, throttle=st.floats(0.05, 1.0))
def test_what_is_nearer_to_the_eye_is_drawn_later(lean, throttle):
    pose = leaning(np.zeros(3), lean, throttle)
    axis = Figure().subplots()
    draw_sign(axis, pose, FROM_ABOVE, (0.0, 0.0), 1.0)
    colors = np.asarray(drawn_lander(axis).get_facecolor())[:, :3]
    plume = np.flatnonzero((np.abs(colors - to_rgb(PLUME_COLOR)) < 1e-9).all(axis=1))
    assert len(plume) > 0
    assert len(plume) < len(colors)
    assert plume.mean() < 0.5 * len(colors)  # from above the plume lies behind the lander
    below = View(np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0]))
    axis = Figure().subplots()
    draw_sign(axis, pose, below, (0.0, 0.0), 1.0)
    colors = np.asarray(drawn_lander(axis).get_facecolor())[:, :3]
    plume = np.flatnonzero((np.abs(colors - to_rgb(PLUME_COLOR)) < 1e-9).all(axis=1))
    assert plume.mean() > 0.5 * len(colors)


def test_an_engine_that_is_off_has_no_plume(scenario: Scenario):
    axis = Figure().subplots()
    draw_sign(axis, pose_of(scenario, (0.0, 0.0), 10.0, throttle=0.0), FROM_ABOVE, (0.0, 0.0), 1.0)
    colors = np.asarray(drawn_lander(axis).get_facecolor())[:, :3]
    assert not (np.abs(colors - to_rgb(PLUME_COLOR)) < 1e-9).all(axis=1).any()


@pytest.mark.parametrize("lean", [(0.0, 0.0), (0.3, 0.1), (-0.2, 0.25)])
def test_the_reach_is_where_the_sensors_cone_meets_the_target_plane(scenario: Scenario, lean):
    pose = pose_of(scenario, lean, 250.0)
    point = replace(scenario, preset=PRESETS["paper"])
    down = -rotate(pose.attitude, [0.0, 0.0, 1.0])
    for flown, axis_down in ((scenario, down), (point, np.array([0.0, 0.0, -1.0]))):
        axis = Figure().subplots()
        draw_reach(axis, pose, flown)
        east, north = line_data(axis, "sensor's reach")
        ground = np.column_stack([east, north, np.full(len(east), flown.nominal_target[2])])
        rays = ground - pose.position
        cosine = rays @ axis_down / np.linalg.norm(rays, axis=1)
        np.testing.assert_allclose(cosine, np.cos(flown.preset.lidar.off_nadir_limit), atol=1e-12)


def test_a_cone_that_looks_past_the_horizon_has_a_gap(scenario: Scenario):
    axis = Figure().subplots()
    draw_reach(axis, pose_of(scenario, (3.0, 0.0), 250.0), scenario)
    east, _ = line_data(axis, "sensor's reach")
    assert 0 < np.isnan(east).sum() < len(east)


@pytest.mark.parametrize("height", [0.0, -0.5])
def test_on_the_plane_and_below_it_no_reach_is_drawn(scenario: Scenario, height: float):
    axis = Figure().subplots()
    draw_reach(axis, pose_of(scenario, (0.2, 0.1), height), scenario)
    assert not axis.lines


def test_close_by_the_line_leads_to_the_target_and_the_cone_hangs_from_the_lander(scenario: Scenario):
    pose, view = pose_of(scenario, (0.2, 0.1), 200.0), view_beside(scenario)
    axis = Figure().subplots()
    draw_close(axis, pose, scenario, scenario.nominal_target)
    x, y = line_data(axis, "towards the target")
    way = view.flat((scenario.nominal_target - pose.position)[None])[0]
    assert np.arctan2(y[1], x[1]) == pytest.approx(np.arctan2(way[1], way[0]))
    (cone,) = axis.patches
    corners = np.asarray(cone.get_path().vertices)
    assert np.hypot(*corners.T).min() < 1e-12  # its tip
    down = view.flat(-rotate(pose.attitude, [0.0, 0.0, 1.0])[None])[0]
    middle = corners[np.hypot(*corners.T) > 1.0].mean(axis=0)
    assert np.arctan2(middle[1], middle[0]) == pytest.approx(np.arctan2(down[1], down[0]), abs=0.1)
    landed = Figure().subplots()
    draw_close(
        landed,
        LanderPose(scenario.nominal_target, pose.attitude, np.zeros(3)),
        scenario,
        scenario.nominal_target,
    )
    assert "towards the target" not in [line.get_label() for line in landed.lines]
