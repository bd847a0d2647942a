"""From a scan to a verdict: what is known, what is safe, and where it is said."""

from dataclasses import replace

import numpy as np
import pytest

from guidance.state import State
from hda.safety.criteria import SafetyCriteria
from hda.safety.safety_map import assess_safety
from hda.sensing.gridding import ElevationMap, PixelGrid
from hda.sensing.measured_look import MeasuredGround, assess_elevation, find_holes, measure_ground
from hda.sensing.ranging import RangingLidar, scan
from hda.sensing.scan_draws import draw_scan

PLANE = 50.0
CRITERIA = SafetyCriteria()
TARGET = np.array([150.0, 150.0, PLANE])
FLAT = np.full((300, 300), PLANE, dtype=np.float32)


def look(ground, height: float, lidar: RangingLidar | None = None, east: float = 0.0, seed: int = 0):
    """What a sensor above the target makes of the ground, in the true frame."""
    sensor = RangingLidar() if lidar is None else lidar
    state = State(TARGET + np.array([east, 0.0, height]), np.array([0.0, 0.0, -20.0]), 1200.0)
    cloud = scan(sensor, ground, state, TARGET, draw_scan(np.random.default_rng(seed), sensor.rays))
    return measure_ground(cloud, sensor, state.position, TARGET, CRITERIA), sensor.width(
        state.position, TARGET
    )


@pytest.mark.parametrize("height", [900.0, 400.0, 100.0])
def test_flat_ground_is_known_and_safe_to_the_edge_of_the_look(height: float):
    ground, width = look(FLAT, height)
    seen = ground.safety_map(TARGET, width, 64)
    assert (seen >= 0.5).all()
    assert np.median(seen) > 0.99
    assert (ground.probability[~ground.known] == 0.0).all()


@pytest.mark.parametrize(("rays", "height"), [(128, 300.0), (128, 100.0), (64, 100.0)])
def test_a_boulder_is_a_hazard_wherever_the_lander_would_stand_over_it(rays: int, height: float):
    boulder = FLAT - np.float32(1.5)
    boulder[148:152, 148:152] = PLANE
    ground, width = look(boulder, height, replace(RangingLidar(), rays=rays))
    seen = ground.safety_map(TARGET, width, 64)
    truth = assess_safety(boulder).deterministic
    offset = ((np.arange(64) + 0.5) / 64 - 0.5) * width
    cells = np.floor(150.0 + offset).astype(int)
    true = truth[np.ix_(cells, cells)]
    assert ((seen >= 0.5) & ~true).mean() < 0.02
    assert 0.0 < true.mean() < 1.0
    assert ((seen < 0.5) & true).mean() < 0.15  # a cell beside the boulder, and its shadow


def test_what_lies_in_a_shadow_is_a_hole_and_not_safe():
    wall = FLAT - np.float32(12.0)
    wall[:, 140:142] = PLANE
    ground, width = look(wall, 150.0, east=-50.0)
    hole = np.isnan(ground.elevation.height)
    # The wall's edge at x = 141.5 is seen from 41.5 m beside and 150 m above: 12 m below it lie in the shadow
    # up to x = 144.8.
    columns = ground.grid.columns_of(np.array([142.5, 144.5]))
    assert hole[10:-10, columns[0] : columns[1]].all()
    assert ground.safety_map(np.array([143.5, 150.0]), 2.0, 8).max() == 0.0
    assert width > 0.0


def test_the_verdict_is_that_of_algorithm_1_on_the_elevation_map():
    rng = np.random.default_rng(3)
    height = 0.05 * rng.standard_normal((40, 35))
    spread = rng.uniform(0.01, 0.1, height.shape)
    height[4, 7] = spread[4, 7] = np.nan
    elevation = ElevationMap(PixelGrid(3, 5, 1.25, 40, 35), height, spread, np.ones(height.shape, np.int32))
    ground = assess_elevation(elevation, CRITERIA)
    expected = assess_safety(height, 1.25, range_noise=spread)
    np.testing.assert_array_equal(ground.probability, expected.probability)
    np.testing.assert_array_equal(ground.known, ~np.isnan(expected.slope))


def test_a_hole_is_where_the_lander_fits_and_one_of_its_cells_has_no_echo():
    height = np.zeros((30, 40))
    height[15, 20] = np.nan
    count = np.where(np.isnan(height), 0, 1).astype(np.int32)
    elevation = ElevationMap(PixelGrid(0, 0, 1.0, 30, 40), height, np.where(count, 0.01, np.nan), count)
    ground = assess_elevation(elevation, CRITERIA)
    holes = find_holes(ground, CRITERIA)
    fits = np.zeros(holes.shape, dtype=bool)
    fits[5:-5, 5:-5] = True
    np.testing.assert_array_equal(holes | ground.known, fits)
    assert not (holes & ground.known).any()
    rows, columns = np.nonzero(holes)
    assert max(np.abs(rows - 15).max(), np.abs(columns - 20).max()) == 5


@pytest.mark.parametrize("height", [0.0, -0.5])
def test_from_the_planes_height_or_below_it_nothing_is_known(height: float):
    lidar = RangingLidar()
    cloud = scan(
        lidar,
        FLAT - np.float32(20.0),
        State(TARGET + np.array([0.0, 0.0, height]), np.array([0.0, 0.0, -5.0]), 1200.0),
        TARGET,
        draw_scan(np.random.default_rng(0), lidar.rays),
    )
    assert len(cloud.offset) > 100  # sent before the decision, from above the plane
    ground = measure_ground(cloud, lidar, TARGET + np.array([0.0, 0.0, height]), TARGET, CRITERIA)
    assert ground.grid.shape == (0, 0)
    assert not ground.known_map(TARGET, 20.0, 8).any()


@pytest.mark.parametrize(("cells", "known"), [(10, 0), (11, 1), (12, 4)])
def test_a_map_that_just_holds_the_lander_knows_its_middle(cells: int, known: int):
    shape = (cells, cells)
    elevation = ElevationMap(
        PixelGrid(0, 0, 1.0, *shape), np.zeros(shape), np.full(shape, 0.01), np.ones(shape, np.int32)
    )
    assert assess_elevation(elevation, CRITERIA).known.sum() == known


def test_cells_that_swallow_the_lander_tell_nothing():
    shape = (40, 40)
    elevation = ElevationMap(
        PixelGrid(0, 0, 5.0, *shape), np.zeros(shape), np.full(shape, 0.01), np.ones(shape, np.int32)
    )
    assert not assess_elevation(elevation, replace(CRITERIA, footprint_diameter=4.0)).known.any()
    assert assess_elevation(elevation, CRITERIA).known.any()


def test_a_map_too_small_for_the_lander_knows_nothing():
    shape = (6, 6)
    elevation = ElevationMap(
        PixelGrid(0, 0, 1.0, *shape), np.zeros(shape), np.ones(shape), np.ones(shape, np.int32)
    )
    ground = assess_elevation(elevation, CRITERIA)
    assert not ground.known.any()
    assert not ground.probability.any()
    empty = assess_elevation(
        ElevationMap(
            PixelGrid(0, 0, 1.0, 0, 0), np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0), np.int32)
        ),
        CRITERIA,
    )
    assert empty.safety_map(TARGET, 20.0, 8).max() == 0.0


def test_a_pixel_shows_the_cell_that_holds_its_centre():
    grid = PixelGrid(first_row=10, first_column=20, pixel_size=2.5, rows=4, columns=6)
    probability = np.random.default_rng(0).random(grid.shape)
    shape = grid.shape
    elevation = ElevationMap(grid, np.zeros(shape), np.ones(shape), np.ones(shape, np.int32))
    ground = MeasuredGround(elevation, probability, np.ones(shape, dtype=bool))
    seen = ground.safety_map(np.array([57.0, 30.0]), 20.0, 9)
    for i in range(9):
        for j in range(9):
            x = 57.0 + ((j + 0.5) / 9 - 0.5) * 20.0
            y = 30.0 + ((i + 0.5) / 9 - 0.5) * 20.0
            row, column = int(np.floor((y - 25.0) / 2.5)), int(np.floor((x - 50.0) / 2.5))
            inside = 0 <= row < 4 and 0 <= column < 6
            assert seen[i, j] == pytest.approx(probability[row, column] if inside else 0.0)
