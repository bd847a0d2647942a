"""Sensors and their faults: what is refused, when they read, and that chance repeats."""

from dataclasses import fields, replace

import numpy as np
import pytest

from guidance.state import State
from hda.navigation import (
    NAVIGATION_FAULTS,
    Altimeter,
    FlownPath,
    InertialUnit,
    NavigationState,
    NavigationSystem,
    SiteFixes,
    TerrainFixes,
    Velocimeter,
    add_fault,
    begin_navigation,
    draw_readings,
    draw_sensor_errors,
    navigate,
)
from hda.task.presets import PRESETS
from hda.task.random_streams import EpisodeStreams
from tests.hda.navigation.filter_cases import TARGET, fly_descent, run_filter, walk_ground

SYSTEM = NavigationSystem()


def sink(top: float, speed: float = 10.0, periods: int = 40) -> FlownPath:
    """Straight down from `top` above level ground at 0."""
    time = 0.5 * np.arange(periods + 1, dtype=np.float64)
    path = np.zeros((periods + 1, 7))
    path[:, 2], path[:, 5], path[:, 6] = top - speed * time, -speed, 1200.0
    return FlownPath(time, path, path[1:, 2].copy())


def readings(system: NavigationSystem, flown: FlownPath, seed: int = 0) -> np.ndarray:
    """Whether altimeter, velocimeter and terrain fix read after each period."""
    rng = np.random.default_rng(seed)
    start = begin_navigation(
        system, State.parse(flown.states[0]), np.zeros(3), draw_sensor_errors(system, rng)
    )
    _, log = navigate(system, start, flown, draw_readings(rng, flown.periods))
    return np.isfinite(log.innovation_square)


@pytest.mark.parametrize(
    ("sensor", "wrong"),
    [
        (InertialUnit, {"noise": -1.0}),
        (InertialUnit, {"tilt": 0.2}),
        (InertialUnit, {"correlation_time": 0.0}),
        (Altimeter, {"noise": 0.0}),
        (Altimeter, {"interval": 0.0}),
        (Altimeter, {"floor": 10.0, "ceiling": 5.0}),
        (Altimeter, {"dropout": 1.5}),
        (Altimeter, {"plume_noise": float("nan")}),
        (Velocimeter, {"beam_angle": 0.0}),
        (Velocimeter, {"bias": -0.1}),
        (TerrainFixes, {"noise": 0.0}),
        (SiteFixes, {"least_noise": 0.0}),
        (SiteFixes, {"dropout": -0.1}),
        (NavigationSystem, {"horizontal_error": -1.0}),
        (NavigationSystem, {"relief_length": 0.0}),
        (NavigationSystem, {"false_rejections": 0.0}),
        (NavigationSystem, {"patience": 0}),
    ],
)
def test_what_cannot_exist_is_refused_by_name(sensor, wrong):
    with pytest.raises(ValueError, match=next(reversed(wrong))):
        sensor(**wrong)


def test_the_gates_are_those_of_one_false_rejection_in_a_thousand():
    np.testing.assert_allclose(SYSTEM.numbers(0.5).gates, [10.83, 16.27, 16.27, 16.27], atol=0.01)


def test_each_sensor_reads_between_its_floor_and_its_ceiling_at_its_rate():
    flown = sink(600.0, speed=30.0)
    heights = flown.ranges
    altimeter, velocimeter, terrain = readings(SYSTEM, flown).T
    np.testing.assert_array_equal(altimeter, heights >= 1.0)
    np.testing.assert_array_equal(velocimeter, heights >= 30.0)
    instants = np.arange(1, heights.size + 1)
    np.testing.assert_array_equal(terrain, (heights >= 500.0) & (instants % 2 == 0))


def test_a_reading_falls_out_as_often_as_it_says():
    system = replace(SYSTEM, altimeter=Altimeter(dropout=0.3), velocimeter=Velocimeter(dropout=1.0))
    flown = sink(2000.0, speed=2.0, periods=1500)
    altimeter, velocimeter, _ = readings(system, flown).T
    assert abs(altimeter.mean() - 0.7) < 4.0 * np.sqrt(0.21 / 1500.0)
    assert not velocimeter.any()


def test_a_sensor_that_is_not_there_never_reads():
    bare = replace(SYSTEM, altimeter=None, velocimeter=None, terrain=None)
    assert not readings(bare, sink(900.0)).any()


def test_no_ground_below_is_no_reading():
    flown = sink(900.0)
    assert not readings(SYSTEM, replace(flown, ranges=np.full(flown.periods, np.nan))).any()


def test_the_faults_do_what_they_are_called():
    low = add_fault(SYSTEM, "altimeter-lost-low").altimeter
    assert low is not None
    assert low.floor == 100.0
    assert add_fault(SYSTEM, "velocimeter-lost").velocimeter is None
    assert add_fault(SYSTEM, "no-terrain-fix").terrain is None
    site = add_fault(SYSTEM, "site-fix-missing").site
    assert site is not None
    assert site.dropout == pytest.approx(1.0 / 3.0)
    plume = add_fault(SYSTEM, "plume-noise")
    assert plume.altimeter is not None
    assert plume.velocimeter is not None
    assert plume.altimeter.plume_noise > 10.0 * plume.altimeter.noise
    assert plume.velocimeter.plume_height > plume.velocimeter.floor  # it acts where the sensor still reads


@pytest.mark.parametrize("fault", sorted(NAVIGATION_FAULTS))
def test_a_fault_of_what_is_not_there_changes_nothing(fault: str):
    bare = NavigationSystem(altimeter=None, velocimeter=None, terrain=None, site=None)
    assert add_fault(bare, fault) == bare


def test_an_unknown_fault_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="velocimeter-lost"):
        add_fault(SYSTEM, "velocimeter-gone")


def as_bytes(navigation: NavigationState) -> bytes:
    arrays = (navigation.estimate, navigation.covariance, navigation.rejections)
    return b"".join(array.tobytes() for array in arrays)


def test_equal_seeds_give_equal_bytes_and_memory_is_never_changed():
    ends = []
    for seed in (7, 7, 8):
        rng = np.random.default_rng(seed)
        descent = fly_descent(np.random.default_rng(1))
        ground = walk_ground(SYSTEM, descent.path, rng)
        ends.append(as_bytes(run_filter(SYSTEM, descent, ground, rng).final))
    assert ends[0] == ends[1] != ends[2]
    streams = EpisodeStreams(3, 4)
    errors = draw_sensor_errors(SYSTEM, streams.navigation())
    flown = sink(800.0, periods=10)
    start = begin_navigation(SYSTEM, State.parse(flown.states[0]), TARGET, errors)
    before = as_bytes(start)
    first, _ = navigate(SYSTEM, start, flown, streams.readings(0, 10))
    again, _ = navigate(SYSTEM, start, flown, streams.readings(0, 10))
    assert as_bytes(start) == before
    assert as_bytes(first) == as_bytes(again)
    assert first.instant == 10
    with pytest.raises(ValueError, match="read-only"):
        first.estimate[0] = 0.0
    for shared in (errors.accelerometer_bias, errors.beam_bias, errors.tilt, first.errors.accelerometer_bias):
        with pytest.raises(ValueError, match="read-only"):
            shared[0] = 0.0


def test_a_path_in_two_parts_is_the_path_in_one():
    streams = EpisodeStreams(3, 5)
    flown = sink(800.0, periods=20)
    errors = draw_sensor_errors(SYSTEM, streams.navigation())
    start = begin_navigation(SYSTEM, State.parse(flown.states[0]), TARGET, errors)
    draws = streams.readings(0, 20)
    parts = [
        FlownPath(flown.time[:8], flown.states[:8], flown.ranges[:7]),
        FlownPath(flown.time[7:], flown.states[7:], flown.ranges[7:]),
    ]
    whole, _ = navigate(SYSTEM, start, flown, draws)
    half, _ = navigate(SYSTEM, start, parts[0], draws)
    rest = replace(draws, normal=draws.normal[7:], uniform=draws.uniform[7:])
    other, _ = navigate(SYSTEM, half, parts[1], rest)
    assert as_bytes(whole) == as_bytes(other)


@pytest.mark.parametrize(
    "wrong",
    [
        {"time": np.zeros(5)},
        {"time": np.zeros((2, 3))},
        {"states": np.zeros((6, 6))},
        {"ranges": np.zeros(3)},
        {"time": np.zeros(1), "states": np.zeros((1, 7)), "ranges": np.zeros(0)},
        {"attitudes": np.zeros((5, 4))},
    ],
)
def test_parts_of_a_flown_path_that_do_not_fit_are_refused(wrong: dict[str, np.ndarray]):
    with pytest.raises(ValueError, match=r"flown path: (shapes .* do not fit|attitudes must have shape)"):
        replace(sink(800.0, periods=5), **wrong)


def test_draws_and_intervals_that_do_not_fit_a_path_are_refused():
    flown = sink(800.0, periods=5)
    rng = np.random.default_rng(0)
    start = begin_navigation(SYSTEM, State.parse(flown.states[0]), TARGET, draw_sensor_errors(SYSTEM, rng))
    with pytest.raises(ValueError, match="draws must be for 5 periods, got 4"):
        navigate(SYSTEM, start, flown, draw_readings(rng, 4))
    late = flown.time.copy()
    late[-1] += 0.2  # where the flight ends
    navigate(SYSTEM, start, replace(flown, time=late), draw_readings(rng, 5))
    late[2] += 0.1
    with pytest.raises(ValueError, match="all intervals but the last"):
        navigate(SYSTEM, start, replace(flown, time=late), draw_readings(rng, 5))


def test_a_sensor_is_read_at_whole_numbers_of_control_periods():
    for period, every in ((0.5, 2), (0.25, 4), (1.0 / 3.0, 3)):
        assert replace(SYSTEM, altimeter=None, velocimeter=None).numbers(period).terrain.every == every
    for period in (0.3, 1.0):
        with pytest.raises(ValueError, match="interval of Altimeter must be a whole number"):
            SYSTEM.numbers(period)
    rules = replace(PRESETS["paper"].rules, control_period=1.0)
    with pytest.raises(ValueError, match=r"got 0\.5 s for 1 s"):
        replace(PRESETS["navigated"], rules=rules)


def test_an_altimeter_that_reads_only_low_is_lost_altogether():
    low = replace(SYSTEM, altimeter=Altimeter(ceiling=80.0))
    assert add_fault(low, "altimeter-lost-low").altimeter is None


def test_errors_are_drawn_in_one_order_whatever_is_aboard():
    full = draw_sensor_errors(SYSTEM, np.random.default_rng(9))
    bare = draw_sensor_errors(replace(SYSTEM, altimeter=None, velocimeter=None), np.random.default_rng(9))
    for field in fields(full):
        if field.name not in ("altimeter_bias", "beam_bias"):
            np.testing.assert_array_equal(getattr(full, field.name), getattr(bare, field.name))
    assert bare.altimeter_bias == 0.0
