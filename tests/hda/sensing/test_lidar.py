"""The observed safety map against a literal Algorithm 2, closed forms and its statistics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from hda.sensing.lidar import Lidar, look
from hda.task.random_streams import EpisodeStreams
from tests.oracles import algorithm_2

SEEDS = st.integers(0, 2**32 - 1)
PLANE = 50.0


def observe(lidar: Lidar, position, target, probability, noise=None) -> np.ndarray:
    if noise is None:
        noise = np.zeros((lidar.pixels, lidar.pixels), dtype=np.float32)
    probability = np.asarray(probability, dtype=np.float32)
    return look(lidar, np.array(position, dtype=float), np.array(target, dtype=float), probability, noise)


@settings(max_examples=60)
@given(seed=SEEDS, pixels=st.sampled_from([2, 7, 16, 33]))
def test_a_look_is_algorithm_2(seed, pixels):
    rng = np.random.default_rng(seed)
    probability = rng.random((40, 60), dtype=np.float32)  # not square: rows and columns must not mix
    target = np.array([*rng.uniform([-5.0, -5.0], [65.0, 45.0]), PLANE])
    height = rng.uniform(2.0, 300.0)
    position = target + np.array([*(height * rng.uniform(-0.5, 0.5, size=2)), height])
    noise = rng.standard_normal((pixels, pixels), dtype=np.float32)
    noise *= rng.choice([1.0, 30.0])  # strong noise reaches both clips
    sensor = algorithm_2.Sensor(
        field_of_view=rng.uniform(0.05, 0.8),
        pixels=pixels,
        noise=rng.uniform(0.0, 0.3),
        noise_range=rng.uniform(100.0, 900.0),
        off_nadir_limit=rng.uniform(0.1, 0.8),
    )
    observed = look(Lidar(*sensor), position, target, probability, noise)
    oracle = algorithm_2.observe(sensor, position, target, probability, noise)
    assert observed.dtype == np.float32
    np.testing.assert_allclose(observed, oracle, rtol=0, atol=2e-7)


def test_the_papers_sensor_is_algorithm_2_on_a_whole_look():
    rng = np.random.default_rng(5)
    probability = rng.random((400, 400), dtype=np.float32)
    position, target = np.array([260.0, 150.0, 950.0]), np.array([50.3, 200.7, PLANE])
    noise = rng.standard_normal((64, 64), dtype=np.float32)
    oracle = algorithm_2.observe(algorithm_2.Sensor(), position, target, probability, noise)
    np.testing.assert_allclose(look(Lidar(), position, target, probability, noise), oracle, rtol=0, atol=2e-7)
    assert 0 < np.count_nonzero(oracle) < oracle.size  # part of it lies outside the map


def test_rows_grow_north_and_columns_east():
    north = np.broadcast_to(np.linspace(0.0, 1.0, 200)[:, None], (200, 200))
    seen = observe(Lidar(pixels=8), (100.0, 100.0, 450.0), (100.0, 100.0, PLANE), north)
    assert (np.diff(seen, axis=0) > 0.0).all()
    assert (np.diff(seen, axis=1) == 0.0).all()
    east = observe(Lidar(pixels=8), (100.0, 100.0, 450.0), (100.0, 100.0, PLANE), north.T)
    np.testing.assert_array_equal(east, seen.T)


@given(
    offset=st.tuples(*[st.floats(-500.0, 500.0)] * 2),
    height=st.floats(1.0, 1500.0),
    field_of_view=st.floats(0.01, 1.0),
)
def test_the_width_is_the_slant_range_times_the_tangent(offset, height, field_of_view):
    target = np.array([500.0, 400.0, PLANE])
    position = target + np.array([*offset, height])
    width = Lidar(field_of_view=field_of_view).width(position, target)
    slant_range = math.sqrt(offset[0] ** 2 + offset[1] ** 2 + height**2)
    assert width == pytest.approx(slant_range * math.tan(field_of_view), rel=1e-12)


def test_the_papers_field_of_view_is_a_hundred_metres_wide_at_500_m():
    target = np.array([0.0, 0.0, PLANE])
    assert Lidar().width(target + np.array([0.0, 0.0, 500.0]), target) == pytest.approx(100.82, abs=0.01)


def test_a_pixel_reads_the_cell_that_it_lies_in_up_to_its_west_and_south_edge():
    # Two pixels a side over 4 m: their centres lie 1 m from the target, here on a corner between cells.
    lidar = Lidar(field_of_view=math.atan(4.0 / 8.0), pixels=2, off_nadir_limit=1.0)
    probability = np.arange(100, dtype=np.float32).reshape(10, 10) / 100.0
    seen = observe(lidar, (5.0, 5.0, PLANE + 8.0), (5.0, 5.0, PLANE), probability)
    np.testing.assert_array_equal(seen, probability[np.ix_([4, 6], [4, 6])])


def test_outside_the_map_a_look_reads_zero_whatever_the_noise():
    ones = np.ones((100, 100), dtype=np.float32)
    noise = np.full((64, 64), 50.0, dtype=np.float32)
    seen = observe(Lidar(), (0.0, 50.0, 250.0), (0.0, 50.0, PLANE), ones, noise)
    assert (seen[:, :32] == 0.0).all()
    assert (seen[:, 32:] == 1.0).all()
    assert (observe(Lidar(), (500.0, 50.0, 250.0), (500.0, 50.0, PLANE), ones, noise) == 0.0).all()


def test_pixels_beyond_the_off_nadir_limit_read_zero():
    # Lander 200 m up, west of the target; pixels are seen within a circle of 200 tan(20 deg) = 72.8 m.
    ones = np.ones((400, 400), dtype=np.float32)
    lidar = Lidar()
    position, target = np.array([130.0, 200.0, 250.0]), np.array([200.0, 200.0, PLANE])
    seen = observe(lidar, position, target, ones)
    offset = ((np.arange(64) + 0.5) / 64 - 0.5) * lidar.width(position, target)
    distance = np.hypot(offset[None, :] + 70.0, offset[:, None])
    np.testing.assert_array_equal(seen == 1.0, distance <= 200.0 * math.tan(math.radians(20.0)))
    assert 0.0 < seen.mean() < 1.0


def test_an_observation_stays_between_zero_and_one():
    noise = np.random.default_rng(0).standard_normal((64, 64), dtype=np.float32) * 20.0
    seen = observe(
        Lidar(), (200.0, 200.0, 550.0), (200.0, 200.0, PLANE), np.full((400, 400), 0.5, np.float32), noise
    )
    assert seen.min() == 0.0
    assert seen.max() == 1.0


@pytest.mark.parametrize("height", [50.0, 250.0, 500.0, 950.0])
def test_noise_grows_in_proportion_to_range(height):
    # The sum of n squared standard normals is chi-square. Two sides of 5e-7, four heights: false alarm 4e-6.
    lidar = Lidar()
    middle = np.full((400, 400), 0.5, dtype=np.float32)
    position, target = np.array([200.0, 200.0, PLANE + height]), np.array([200.0, 200.0, PLANE])
    offset = ((np.arange(64) + 0.5) / 64 - 0.5) * lidar.width(position, target)
    slant_range = np.sqrt(offset[:, None] ** 2 + offset[None, :] ** 2 + height**2)
    streams = EpisodeStreams(11, int(height))
    total = 0.0
    for k in range(10):
        seen = look(lidar, position, target, middle, streams.look(k, 64))
        total += float(np.sum(((seen - 0.5) / (0.05 * slant_range / 500.0)) ** 2))
    n = 10 * 64 * 64
    assert chi2.ppf(5e-7, n) < total < chi2.ppf(1.0 - 5e-7, n)


def test_a_look_changes_none_of_its_arguments():
    rng = np.random.default_rng(1)
    arguments = [
        np.array([50.0, 40.0, 150.0]),
        np.array([45.0, 45.0, PLANE]),
        rng.random((90, 90), dtype=np.float32),
        rng.standard_normal((64, 64), dtype=np.float32),
    ]
    before = [argument.copy() for argument in arguments]
    seen = look(Lidar(), *arguments)
    for argument, copy in zip(arguments, before, strict=True):
        np.testing.assert_array_equal(argument, copy)
        assert not np.shares_memory(argument, seen)


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("field_of_view", 0.0),
        ("field_of_view", math.pi / 2),
        ("noise", -0.1),
        ("noise", math.nan),
        ("noise_range", 0.0),
        ("off_nadir_limit", 0.0),
        ("off_nadir_limit", math.inf),
        ("pixels", 1),
    ],
)
def test_a_sensor_that_cannot_exist_is_refused_by_name(name, bad):
    with pytest.raises(ValueError, match=f"^{name} must"):
        Lidar(**{name: bad})
