"""The nearest admissible thrust, against a search that knows nothing of the closed form."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from guidance import Lander, saturate_thrust
from guidance.thrust_limits import limit_into, saturate_into

DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)
SIZES = st.floats(0.0, 40_000.0)
LIMITS = st.floats(0.5, 179.5)
LEAST = st.sampled_from([0.0, 1500.0, 12_000.0])


def vector(size: float, direction: tuple[float, ...]) -> np.ndarray:
    return size * np.array(direction) / np.linalg.norm(direction)


def tilt(thrust: np.ndarray) -> float:
    return math.atan2(math.hypot(thrust[0], thrust[1]), thrust[2])


def least_distance(command: np.ndarray, lander: Lander) -> float:
    """Distance to the admissible set: size, tilt and azimuth searched from many starts."""
    assert lander.pointing_limit is not None
    limit = lander.pointing_limit
    scale = lander.max_thrust

    def distance(x: np.ndarray) -> float:
        size, lean, azimuth = x
        across = size * math.sin(lean)
        point = np.array([across * math.cos(azimuth), across * math.sin(azimuth), size * math.cos(lean)])
        return float(np.linalg.norm(point - command / scale) ** 2)

    least = lander.min_thrust / scale
    bounds = [(least, 1.0), (0.0, limit), (-2.0 * math.pi, 2.0 * math.pi)]
    starts = [
        (size, lean, azimuth)
        for size in (least, 0.5 * (least + 1.0), 1.0)
        for lean in (0.0, 0.5 * limit, limit)
        for azimuth in (-2.0, 0.1, 2.2)
    ]
    found = sorted(starts, key=lambda x: distance(np.array(x)))[:4]
    best = min(minimize(distance, x, bounds=bounds, method="L-BFGS-B", tol=1e-14).fun for x in found)
    return scale * math.sqrt(best)


@settings(max_examples=150)
@given(size=SIZES, direction=DIRECTIONS, degrees=LIMITS, least=LEAST)
@example(size=5000.0, direction=(0.0, 0.0, -1.0), degrees=30.0, least=0.0)
@example(size=5000.0, direction=(0.0, 0.0, -1.0), degrees=120.0, least=1500.0)
@example(size=5000.0, direction=(1.0, 0.0, -0.5), degrees=30.0, least=1500.0)
@example(size=5000.0, direction=(1.0, 0.0, 0.0), degrees=90.0, least=0.0)
@example(size=0.0, direction=(0.0, 0.0, 1.0), degrees=10.0, least=1500.0)
def test_no_admissible_thrust_is_nearer(size, direction, degrees, least):
    limit = math.radians(degrees)
    lander = Lander(min_thrust=least, pointing_limit=limit)
    command = vector(size, direction)
    given_thrust = saturate_thrust(command, lander)
    magnitude = float(np.linalg.norm(given_thrust))
    assert least * (1.0 - 1e-12) <= magnitude <= lander.max_thrust * (1.0 + 1e-12)
    if magnitude > 0.0:
        assert tilt(given_thrust) <= limit + 1e-11
    distance = float(np.linalg.norm(given_thrust - command))
    assert distance <= least_distance(command, lander) + 0.02  # [N] the search's own accuracy
    rng = np.random.default_rng(1)
    lean = np.arccos(rng.uniform(math.cos(limit), 1.0, 4000))
    azimuth, others = rng.uniform(0.0, 2.0 * math.pi, 4000), rng.uniform(least, lander.max_thrust, 4000)
    across = others * np.sin(lean)
    points = np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), others * np.cos(lean)])
    assert distance <= np.linalg.norm(points - command, axis=1).min() + 1e-6


@given(size=st.floats(0.0, 12_000.0), lean=st.floats(0.0, 1.0), azimuth=st.floats(-3.0, 3.0), degrees=LIMITS)
def test_what_keeps_the_limits_is_left_alone(size, lean, azimuth, degrees):
    limit = math.radians(degrees)
    angle = lean * limit * (1.0 - 1e-9)  # on the limit itself rounding decides
    command = size * np.array(
        [math.sin(angle) * math.cos(azimuth), math.sin(angle) * math.sin(azimuth), math.cos(angle)]
    )
    thrust = command.copy()
    assert not limit_into(thrust, 0.0, 12_000.0 * (1.0 + 1e-12), limit)
    np.testing.assert_array_equal(thrust, command)


@given(size=SIZES, direction=DIRECTIONS, degrees=LIMITS, least=LEAST)
def test_a_second_time_nothing_changes_and_nothing_is_counted(size, direction, degrees, least):
    thrust = vector(size, direction)
    limit_into(thrust, least, 12_000.0, math.radians(degrees))
    once = thrust.copy()
    assert not limit_into(thrust, least, 12_000.0, math.radians(degrees))
    np.testing.assert_allclose(thrust, once, rtol=1e-12, atol=1e-9)


@given(size=SIZES, direction=DIRECTIONS, least=LEAST)
def test_without_a_limit_every_bit_is_as_it_was(size, direction, least):
    command = vector(size, direction)
    expected = command.copy()
    saturate_into(expected, least, 12_000.0)
    for limit in (None, math.pi):
        lander = Lander(min_thrust=least, pointing_limit=limit)
        assert saturate_thrust(command, lander).tobytes() == expected.tobytes()
    thrust = command.copy()
    assert not limit_into(thrust, least, 12_000.0, math.pi)


def test_it_counts_when_it_acts_alone():
    limit = math.radians(30.0)
    for degrees, acts in ((29.999999, False), (30.000001, True), (179.0, True)):
        thrust = 3000.0 * np.array([math.sin(math.radians(degrees)), 0.0, math.cos(math.radians(degrees))])
        assert limit_into(thrust, 0.0, 12_000.0, limit) is acts


@pytest.mark.parametrize("size", [1e-300, 1e300])
@pytest.mark.parametrize("degrees", [10.0, 90.0, 150.0])
def test_commands_of_any_size_are_limited(size, degrees):
    lander = Lander(pointing_limit=math.radians(degrees))
    thrust = saturate_thrust([size, -size, -size], lander)
    assert np.isfinite(thrust).all()
    assert tilt(thrust) <= math.radians(degrees) + 1e-11 or not thrust.any()


def test_a_command_from_behind_the_cone_stops_an_engine_that_can_stop():
    lander = Lander(pointing_limit=math.radians(40.0))
    assert saturate_thrust([100.0, 0.0, -5000.0], lander).tolist() == [0.0, 0.0, 0.0]
    cannot = Lander(pointing_limit=math.radians(40.0), min_thrust=1000.0)
    edge = 1000.0 * np.array([math.sin(math.radians(40.0)), 0.0, math.cos(math.radians(40.0))])
    np.testing.assert_allclose(saturate_thrust([100.0, 0.0, -5000.0], cannot), edge, rtol=1e-12)
