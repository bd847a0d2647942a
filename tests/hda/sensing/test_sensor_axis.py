"""What a sensor on a body sees: the same upright, a cone about the body's axis when it leans."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from guidance.rigid_body.state import RigidState
from guidance.state import State
from hda.sensing.lidar import Lidar, look
from hda.sensing.ranging import RangingLidar, scan
from hda.sensing.scan_draws import draw_scan
from hda.sensing.sensor_axis import cone_rim, is_fixed, is_outside, sensor_axis

PLANE = 50.0
TARGET = np.array([150.0, 150.0, PLANE])
VELOCITY = np.array([8.0, -5.0, -25.0])
FLAT = np.full((300, 300), PLANE, dtype=np.float32)
SENSOR = RangingLidar(rays=32)
PERFECT = replace(SENSOR, pointing_error=0.0, pointing_jitter=0.0, scan_duration=0.0)
VECTORS = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def test_a_sensor_is_fixed_that_looks_no_further_aside_than_its_field_of_view():
    assert not is_fixed(SENSOR)
    half = math.radians(5.7)
    for sensor in (SENSOR, Lidar()):
        assert is_fixed(replace(sensor, off_nadir_limit=half))
        assert not is_fixed(replace(sensor, off_nadir_limit=1.01 * half))


def leaning(turn: tuple[float, float, float]) -> RigidState:
    attitude = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    return RigidState(TARGET + np.array([20.0, -10.0, 300.0]), VELOCITY, 1200.0, attitude=attitude)


@given(turn=VECTORS)
def test_the_axis_points_down_along_the_body(turn):
    rotation = Rotation.from_rotvec(turn)
    axis = sensor_axis(rotation.as_quat(scalar_first=True))
    np.testing.assert_allclose(axis, rotation.apply([0.0, 0.0, -1.0]), atol=1e-12)


@given(turn=VECTORS, limit=st.floats(0.05, 1.2), rays=st.integers(2, 40))
def test_the_rim_of_a_cone_goes_once_around_at_its_half_angle(turn, limit, rays):
    axis = Rotation.from_rotvec(turn).apply([0.0, 0.0, -1.0])
    rim = cone_rim(axis, limit, rays + 1)
    np.testing.assert_allclose(np.linalg.norm(rim, axis=1), 1.0)
    np.testing.assert_allclose(rim @ axis, math.cos(limit), atol=1e-12)
    np.testing.assert_allclose(rim[0], rim[-1], atol=1e-12)
    chords = np.linalg.norm(np.diff(rim, axis=0), axis=1)
    np.testing.assert_allclose(chords, 2.0 * math.sin(limit) * math.sin(math.pi / rays), rtol=1e-9)


@given(turn=VECTORS, ray=VECTORS, limit=st.floats(0.05, 1.2))
def test_a_ray_is_outside_by_its_angle_from_the_axis(turn, ray, limit):
    length = float(np.linalg.norm(ray))
    axis = Rotation.from_rotvec(turn).apply([0.0, 0.0, -1.0])
    angle = math.acos(min(max(float(axis @ ray) / max(length, 1e-9), -1.0), 1.0))
    if length > 1e-3 and abs(angle - limit) > 1e-6:
        assert is_outside(axis, math.tan(limit), ray, math.hypot(*ray[:2])) == (angle > limit)


def test_an_upright_body_sees_what_a_point_mass_sees():
    body = leaning((0.0, 0.0, 0.7))
    point = State(body.position, body.velocity, body.mass)
    draws = draw_scan(np.random.default_rng(1), SENSOR.rays)
    seen, plain = (scan(SENSOR, FLAT, state, TARGET, draws) for state in (body, point))
    np.testing.assert_array_equal(seen.offset, plain.offset)


def test_rays_leave_within_the_limit_about_a_leaning_body():
    for limit, least in ((math.radians(20.0), 0.9), (math.radians(5.7), 0.2)):
        sensor, body = replace(PERFECT, off_nadir_limit=limit), leaning((0.1, 0.05, 0.0))
        cloud = scan(sensor, FLAT, body, TARGET, draw_scan(np.random.default_rng(2), sensor.rays))
        axis = sensor_axis(body.attitude)
        cosine = cloud.offset @ axis / np.linalg.norm(cloud.offset, axis=1)
        assert (cosine >= math.cos(limit) - 1e-12).all()
        assert least * sensor.rays**2 < len(cloud.offset) <= sensor.rays**2


def test_a_body_that_leans_far_sees_nothing_of_its_target():
    cloud = scan(PERFECT, FLAT, leaning((0.0, 0.7, 0.0)), TARGET, draw_scan(np.random.default_rng(3), 32))
    assert len(cloud.offset) == 0


@given(turn=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)))
def test_pixels_of_algorithm_2_are_counted_from_the_axis_too(turn):
    lidar, body = Lidar(pixels=16), leaning((*turn, 0.0))
    axis, noise = sensor_axis(body.attitude), np.zeros((16, 16), dtype=np.float32)
    safe = np.ones((300, 300), dtype=np.float32)
    seen = look(lidar, body.position, TARGET, safe, noise, axis)
    offset = ((np.arange(16) + 0.5) / 16.0 - 0.5) * lidar.width(body.position, TARGET)
    for i in range(16):
        for j in range(16):
            ray = TARGET + np.array([offset[j], offset[i], 0.0]) - body.position
            angle = math.acos(min(float(axis @ ray / np.linalg.norm(ray)), 1.0))
            if abs(angle - lidar.off_nadir_limit) > 1e-9:
                assert seen[i, j] == (1.0 if angle < lidar.off_nadir_limit else 0.0)


def test_upright_the_axis_changes_no_pixel():
    lidar, body = Lidar(), leaning((0.0, 0.0, 0.0))
    rng = np.random.default_rng(8)
    probability = rng.random((300, 300), dtype=np.float32)
    noise = rng.standard_normal((64, 64), dtype=np.float32)
    place = TARGET + np.array([95.0, 0.0, 300.0])
    plain = look(lidar, place, TARGET, probability, noise)
    on_body = look(lidar, place, TARGET, probability, noise, sensor_axis(body.attitude))
    assert (plain == 0.0).any()
    np.testing.assert_array_equal(plain, on_body)
