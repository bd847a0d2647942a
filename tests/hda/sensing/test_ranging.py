"""A scan against closed forms, a literal loop, and the statistics of its errors."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from guidance.state import State
from hda.sensing.ranging import PointCloud, RangingLidar, scan
from hda.sensing.scan_draws import ScanDraws, draw_scan
from hda.task.random_streams import EpisodeStreams
from tests.oracles import ray_march

SEEDS = st.integers(0, 2**32 - 1)
PLANE = 50.0

EXACT = RangingLidar(
    rays=24,
    range_noise=0.0,
    beam_divergence=0.0,
    range_bias=0.0,
    pointing_error=0.0,
    pointing_jitter=0.0,
    scan_duration=0.0,
    motion_error=0.0,
)
"""A sensor without an error."""

VELOCITY = np.array([8.0, -5.0, -25.0])
FLAT = np.full((300, 300), PLANE, dtype=np.float32)
TARGET = np.array([150.0, 150.0, PLANE])


def above(height: float, east: float = 0.0, north: float = 0.0) -> State:
    return State(TARGET + np.array([east, north, height]), VELOCITY, 1200.0)


def take(lidar: RangingLidar, state: State, elevation=FLAT, seed: int = 0) -> PointCloud:
    return scan(lidar, elevation, state, TARGET, draw_scan(np.random.default_rng(seed), lidar.rays))


def rough_ground(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    ground = PLANE - rng.uniform(0.0, 3.0, (300, 300))
    return ground.astype(np.float32)


def test_without_errors_the_points_are_the_aims_of_the_rays():
    state = above(400.0, east=60.0)
    cloud = take(EXACT, state)
    n, width = EXACT.rays, EXACT.rays * EXACT.ray_spacing(state.position, TARGET)
    assert width == pytest.approx(math.hypot(400.0, 60.0) * math.tan(math.radians(11.4)) + 12.0)
    along = ((np.arange(n) + 0.5) / n - 0.5) * width
    points = (cloud.offset + state.position).reshape(n, n, 3)
    np.testing.assert_allclose(points[..., 0], np.broadcast_to(TARGET[0] + along, (n, n)), atol=1e-6)
    np.testing.assert_allclose(points[..., 1], np.broadcast_to(TARGET[1] + along[:, None], (n, n)), atol=1e-6)
    np.testing.assert_allclose(points[..., 2], PLANE, atol=1e-6)


@pytest.mark.parametrize(("duration", "latency"), [(0.0, 0.0), (2.0, 0.0), (2.0, 1.5)])
def test_motion_that_is_known_leaves_every_point_on_the_ground(duration: float, latency: float):
    ground = rough_ground(1)
    state = above(500.0, north=-40.0)
    cloud = take(replace(EXACT, scan_duration=duration, latency=latency), state, ground)
    points = cloud.offset + state.position
    assert len(points) == EXACT.rays**2
    for point in points[::37]:
        below = ray_march.find_ground(
            ground, point + np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, -1.0]), 12.0
        )
        assert below == pytest.approx(5.0, abs=1e-5)


def test_motion_that_is_not_known_shears_the_scan_by_its_error_times_the_age_of_the_ray():
    lidar = replace(EXACT, scan_duration=2.0, latency=0.5, motion_error=0.1)
    state, draws = above(500.0), draw_scan(np.random.default_rng(4), EXACT.rays)
    cloud = scan(lidar, FLAT, state, TARGET, draws)
    age = 0.5 + 2.0 * (1.0 - np.arange(1, EXACT.rays**2 + 1) / EXACT.rays**2)
    # On level ground the range is right, and the whole error is that of the place the ray left from; its
    # direction is aimed with the same error, so that the point falls beside its aim by less than that.
    np.testing.assert_allclose(
        (cloud.offset + state.position)[:, 2] - PLANE, -0.1 * draws.motion[2] * age, atol=2e-3
    )


def test_an_error_of_attitude_moves_the_scan_by_range_times_angle_and_tilts_it():
    lidar = replace(EXACT, pointing_error=1e-3)
    draws = draw_scan(np.random.default_rng(9), EXACT.rays)
    state = above(600.0)
    moved, exact = scan(lidar, FLAT, state, TARGET, draws), scan(EXACT, FLAT, state, TARGET, draws)
    # A ray turned by w x d meets level ground elsewhere; what is believed is the aim's direction and the
    # range of the other place: level ground seems tilted by the angle.
    x, y = exact.offset[:, 0], exact.offset[:, 1]
    rise = 1e-3 * (draws.attitude[1] * x - draws.attitude[0] * y)
    np.testing.assert_allclose(moved.offset[:, 2] - exact.offset[:, 2], rise, atol=2e-3)


def test_a_bias_moves_every_point_along_its_ray():
    lidar, state = replace(EXACT, range_bias=0.4), above(300.0, east=50.0)
    draws = draw_scan(np.random.default_rng(2), EXACT.rays)
    biased, exact = scan(lidar, FLAT, state, TARGET, draws), scan(EXACT, FLAT, state, TARGET, draws)
    longer = np.linalg.norm(biased.offset, axis=1) - np.linalg.norm(exact.offset, axis=1)
    np.testing.assert_allclose(longer, 0.4 * draws.bias, atol=1e-9)
    np.testing.assert_allclose(np.cross(biased.offset, exact.offset), 0.0, atol=1e-6)


@pytest.mark.parametrize("height", [100.0, 800.0])
def test_the_noise_of_a_range_grows_with_the_range(height: float):
    lidar = replace(EXACT, rays=64, range_noise=0.05)
    state = above(height)
    noisy, exact = take(lidar, state), take(replace(EXACT, rays=64), state)
    error = np.linalg.norm(noisy.offset, axis=1) - np.linalg.norm(exact.offset, axis=1)
    expected = 0.05 * np.linalg.norm(exact.offset, axis=1) / 500.0
    square = float(((error / expected) ** 2).sum())
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], error.size)  # false alarm 1e-4
    assert low < square < high
    down = -exact.offset[:, 2] / np.linalg.norm(exact.offset, axis=1)
    np.testing.assert_allclose(noisy.deviation, expected * down, rtol=1e-3)


def test_the_beam_on_inclined_ground_adds_a_quarter_of_its_width_times_the_tangent():
    slope = math.radians(20.0)
    tilted = (PLANE - 40.0 + math.tan(slope) * (np.arange(300) + 0.5 - 150.0))[None, :].repeat(300, axis=0)
    lidar = replace(EXACT, rays=64, beam_divergence=2e-3)
    state = above(400.0)
    ground = tilted.astype(np.float32)
    noisy, exact = take(lidar, state, ground), take(replace(EXACT, rays=64), state, ground)
    distance = np.linalg.norm(exact.offset, axis=1)
    normal = np.array([-math.sin(slope), 0.0, math.cos(slope)])
    incidence = np.arccos(-(exact.offset @ normal) / distance)
    expected = 0.25 * 2e-3 * distance * np.tan(incidence)
    score = (np.linalg.norm(noisy.offset, axis=1) - distance) / expected
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], score.size)
    assert low < float((score**2).sum()) < high


def test_rays_beyond_the_limit_of_view_are_not_sent():
    state = above(300.0, east=90.0)
    cloud = take(replace(EXACT, rays=64), state)
    angle = np.arctan2(np.hypot(cloud.offset[:, 0], cloud.offset[:, 1]), -cloud.offset[:, 2])
    assert 0 < len(cloud.offset) < 64**2
    assert angle.max() <= math.radians(20.0) + 1e-9
    assert len(take(EXACT, above(0.0)).offset) == 0


def test_a_rock_casts_a_shadow_on_the_side_away_from_the_sensor():
    ground = FLAT - np.float32(8.0)
    ground[150, 150] = PLANE
    state = above(120.0, east=-40.0)
    cloud = take(replace(EXACT, rays=128), state, ground)
    points = cloud.offset + state.position
    on_row = np.abs(points[:, 1] - 150.5) < 0.2
    level = on_row & (points[:, 2] < PLANE - 7.999)
    x = np.sort(points[level, 0])
    gap = np.diff(x).max()
    start = x[int(np.diff(x).argmax())]
    shadow = 8.0 * 40.5 / 120.0  # behind the top at x = 150.5, seen from 40.5 m beside and 120 m above
    assert start == pytest.approx(149.5, abs=0.35)  # the rock's foot
    assert start + gap == pytest.approx(150.5 + shadow, abs=0.35)


def test_lost_echoes_are_of_the_stated_share():
    lidar = replace(EXACT, rays=128, ray_dropout=0.1)
    lost = 128**2 - len(take(lidar, above(500.0)).offset)
    assert abs(lost - 0.1 * 128**2) < 4.0 * math.sqrt(128**2 * 0.09)
    assert len(take(replace(EXACT, ray_dropout=1.0), above(500.0)).offset) == 0


@given(seed=SEEDS)
@settings(max_examples=10)
def test_a_scan_is_its_literal_loop(seed: int):
    rng = np.random.default_rng(seed)
    lidar = replace(
        RangingLidar(),
        rays=5,
        field_of_view=rng.uniform(0.05, 0.4),
        range_noise=rng.uniform(0.0, 0.2),
        beam_divergence=rng.uniform(0.0, 1e-3),
        pointing_error=2e-3,
        pointing_jitter=1e-3,
        latency=rng.uniform(0.0, 1.0),
        ray_dropout=0.2,
    )
    ground, state = rough_ground(seed), above(*rng.uniform([60.0, -15.0, -15.0], [120.0, 15.0, 15.0]))
    draws = draw_scan(rng, 5)
    cloud = scan(lidar, ground, state, TARGET, draws)
    expected = literal_scan(lidar, ground, state, draws)
    assert cloud.offset.shape == expected.shape
    np.testing.assert_allclose(cloud.offset, expected, atol=1e-4)


def literal_scan(lidar: RangingLidar, ground, state: State, draws: ScanDraws) -> np.ndarray:
    """Ray by ray, with vectors; the slope of the ground by differences."""
    n, points = lidar.rays, []
    width = lidar.width(state.position, TARGET) + 2.0 * lidar.margin
    attitude = lidar.pointing_error * draws.attitude
    error = lidar.motion_error * draws.motion
    for i in range(n):
        for j in range(n):
            age = lidar.latency + lidar.scan_duration * (1.0 - (i * n + j + 1) / n**2)
            across = np.array([(j + 0.5) / n - 0.5, (i + 0.5) / n - 0.5, 0.0]) * width
            believed_origin = state.position - age * (state.velocity + error)
            aim = TARGET + across - believed_origin
            aim = aim / np.linalg.norm(aim)
            if math.acos(-aim[2]) > lidar.off_nadir_limit or draws.dropout[i, j] < lidar.ray_dropout:
                continue
            turn = attitude + lidar.pointing_jitter * np.array([*draws.jitter[i, j], 0.0])
            ray = aim + np.cross(turn, aim)
            ray = ray / np.linalg.norm(ray)
            origin = state.position - age * state.velocity
            reach = ray_march.find_ground(ground, origin, ray, 400.0)
            hit = origin + reach * ray
            down = np.array([0.0, 0.0, -1.0])
            height = [
                hit[2] + 9.0 - ray_march.find_ground(ground, hit + np.array([dx, dy, 9.0]), down, 20.0)
                for dx, dy in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-3), (0.0, -1e-3))
            ]
            normal = np.array([height[1] - height[0], height[3] - height[2], 2e-3])
            cosine = -(ray @ normal) / np.linalg.norm(normal)
            own = lidar.range_noise * reach / lidar.noise_range
            inclined = lidar.beam_divergence * reach / 4.0 * math.tan(math.acos(cosine))
            measured = reach + lidar.range_bias * draws.bias + math.hypot(own, inclined) * draws.range[i, j]
            points.append(measured * aim + believed_origin - state.position)
    return np.array(points).reshape(-1, 3)


def test_the_draws_of_a_look_are_its_own():
    streams = EpisodeStreams(3, 17)
    first, again, other = streams.scan(2, 16), EpisodeStreams(3, 17).scan(2, 16), streams.scan(3, 16)
    for field in fields(ScanDraws):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(again, field.name))
        assert np.all(np.asarray(getattr(first, field.name)) != np.asarray(getattr(other, field.name)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rays": 1}, "rays must be at least 2"),
        ({"range_noise": -0.1}, "range_noise"),
        ({"noise_range": 0.0}, "noise_range"),
        ({"ray_dropout": 1.1}, "ray_dropout"),
        ({"pointing_error": math.nan}, "pointing_error"),
        ({"scan_duration": -1.0}, "scan_duration"),
        ({"field_of_view": 0.0}, "field_of_view"),
    ],
)
def test_a_sensor_that_cannot_exist_is_refused(changes, message: str):
    with pytest.raises(ValueError, match=message):
        RangingLidar(**changes)


def test_more_rays_have_noise_of_their_own_but_the_errors_common_to_a_scan_stay():
    few, many = (EpisodeStreams(0, 3).scan(2, rays) for rays in (32, 64))
    assert few.attitude.tolist() == many.attitude.tolist()
    assert (few.bias, few.motion.tolist()) == (many.bias, many.motion.tolist())
    for name in ("jitter", "dropout"):
        shared = np.isin(getattr(few, name), getattr(many, name)).mean()
        assert shared < 0.01, name


def test_draws_of_another_scan_are_refused():
    with pytest.raises(ValueError, match="draws must be of 24 x 24 rays"):
        scan(EXACT, FLAT, above(300.0), TARGET, draw_scan(np.random.default_rng(0), 8))
