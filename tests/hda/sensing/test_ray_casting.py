"""Rays against ground: closed forms, and a walk along the ray."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hda.sensing.ray_casting import find_ground
from tests.oracles import ray_march

SEEDS = st.integers(0, 2**32 - 1)


def cast(elevation, origin, direction) -> tuple[float, float, float]:
    elevation = np.asarray(elevation, dtype=np.float32)
    direction = np.array(direction, dtype=float)
    return find_ground(
        elevation,
        np.array(origin, dtype=float),
        direction / np.linalg.norm(direction),
        float(np.nanmax(elevation)),
    )


def cell_centers(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """x and y of every cell."""
    north, east = np.indices((rows, columns))
    return east + 0.5, north + 0.5


@given(
    slopes=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    lean=st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
    height=st.floats(1.0, 40.0),
)
def test_on_a_plane_the_range_is_that_of_the_plane(slopes, lean, height):
    x, y = cell_centers(80, 90)
    ground = 10.0 + slopes[0] * (x - 45.0) + slopes[1] * (y - 40.0)
    origin = np.array([45.0, 40.0, 10.0 + height])
    direction = np.array([*lean, -1.0]) / math.sqrt(1.0 + lean[0] ** 2 + lean[1] ** 2)
    closing = slopes[0] * direction[0] + slopes[1] * direction[1] - direction[2]
    assume(closing > 0.05)
    expected = height / closing
    place = origin + expected * direction
    assume(1.0 < place[0] < 89.0 and 1.0 < place[1] < 79.0)
    distance, east, north = cast(ground, origin, direction)
    assert distance == pytest.approx(expected, rel=1e-4)  # the heights are of single precision
    assert (east, north) == pytest.approx(slopes, abs=1e-4)


def test_on_a_spherical_cap_the_error_falls_with_the_square_of_the_cell():
    """Bilinear ground cuts under a cap by at most (cell)^2 / (4 radius)."""
    errors = []
    for radius in (400.0, 1600.0):
        x, y = cell_centers(120, 120)
        center = np.array([60.3, 59.6, 50.0 - radius])
        cap = center[2] + np.sqrt(radius**2 - (x - center[0]) ** 2 - (y - center[1]) ** 2)
        worst = 0.0
        for lean in np.linspace(-0.3, 0.3, 41):
            origin = np.array([60.0, 60.0, 150.0])
            direction = np.array([lean, 0.37 * lean, -1.0]) / math.sqrt(1.0 + 1.1369 * lean**2)
            offset = origin - center
            along = offset @ direction
            expected = -along - math.sqrt(along**2 - offset @ offset + radius**2)
            distance, _, _ = cast(cap, origin, direction)
            assert distance >= expected - 2e-5  # never above the cap, but for single precision
            worst = max(worst, distance - expected)
        assert worst < 1.1 / (4.0 * radius) + 2e-5
        errors.append(worst)
    assert errors[1] < 0.35 * errors[0]


@given(height=st.floats(0.5, 8.0), lean=st.floats(0.1, 1.2))
def test_behind_a_step_lies_its_shadow(height, lean):
    """The step's edge hides the lower ground for height x tan(angle) behind it."""
    ground = np.zeros((20, 80))
    ground[:, :40] = height  # high to x = 39.5, then a ramp of one cell
    shadow = 39.5 + height * lean
    assume(height > 1.0 / lean)  # steeper than the ray: a shadow
    for beyond in (-0.05, 0.05):
        target = shadow + beyond
        origin = np.array([target - 60.0 * lean, 10.0, 60.0])
        distance, _, _ = cast(ground, origin, [lean, 0.0, -1.0])
        x = origin[0] + distance * lean / math.hypot(1.0, lean)
        if beyond > 0.0:
            assert x == pytest.approx(target, abs=1e-4)
        else:
            assert x <= 39.5 + 1e-4  # the edge, or the plateau before it


@given(seed=SEEDS)
@settings(max_examples=40)
def test_a_ray_is_a_walk_along_it(seed):
    rng = np.random.default_rng(seed)
    elevation = (rng.uniform(0.0, 6.0, (14, 17)) * rng.choice([0.2, 1.0])).astype(np.float32)
    origin = np.array([rng.uniform(-4.0, 21.0), rng.uniform(-4.0, 18.0), rng.uniform(6.1, 30.0)])
    aim = np.array([rng.uniform(0.5, 16.5), rng.uniform(0.5, 13.5), rng.uniform(0.0, 5.0)])
    direction = (aim - origin) / np.linalg.norm(aim - origin)
    inside = 0.5 <= origin[0] <= 16.5 and 0.5 <= origin[1] <= 13.5
    assume(inside or origin[2] + direction[2] * 5.0 > 7.0)  # it must not come in under the ground
    distance, _, _ = cast(elevation, origin, direction)
    walked = ray_march.find_ground(elevation, origin, direction, 80.0)
    assert distance == pytest.approx(walked, abs=1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("origin", "direction"),
    [
        ([10.0, 10.0, 30.0], [0.0, 0.0, 1.0]),  # upwards
        ([10.0, 10.0, 30.0], [1.0, 0.0, 0.0]),  # level
        ([-30.0, 10.0, 30.0], [0.0, 0.0, -1.0]),  # beside the map
        ([10.0, 10.0, 30.0], [10.0, 0.0, -1.0]),  # over the map's edge
        ([-5.0, 10.0, 4.0], [1.0, 0.0, 0.0]),  # through the map's side, under the ground
        ([15.0, 15.0, 30.0], [0.0, 0.0, -1.0]),  # into a hole
    ],
)
def test_where_there_is_no_known_ground_there_is_no_echo(origin, direction):
    elevation = np.full((20, 20), 5.0)
    elevation[14:16, 14:16] = np.nan
    assert math.isnan(cast(elevation, origin, direction)[0])


def test_straight_down_on_the_corners_of_cells_is_their_own_height():
    elevation = np.random.default_rng(1).uniform(0.0, 5.0, (6, 7)).astype(np.float32)
    for row in range(6):
        for column in range(7):
            origin = [column + 0.5, row + 0.5, 20.0]
            assert cast(elevation, origin, [0.0, 0.0, -1.0])[0] == pytest.approx(
                20.0 - elevation[row, column]
            )
