"""Tiles: their datum, their seeds, the independence of their parts, the base surface and the islands."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tyro
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt
from scipy.stats import norm

from hda.safety.safety_map import assess_safety
from hda.terrain.__main__ import show_terrain
from hda.terrain.base_surface import BaseSurface, generate_base_surface, rms_slope
from hda.terrain.craters import CraterPopulation, DepthLaw
from hda.terrain.generator import TerrainParameters, generate_terrain, terrain_rng
from hda.terrain.islands import IslandField, generate_island_field
from hda.terrain.rocks import RockPopulation, rock_margin
from hda.terrain.settings import PAPER_TERRAIN
from studies.bench.terrain_timing import measure_terrain

DEFAULT = TerrainParameters()
SMALL = replace(DEFAULT, size=240)
NO_ROCKS = RockPopulation(area_fraction=0.0)
NO_CRATERS = CraterPopulation(coefficient=0.0)
FLAT = BaseSurface(rms_slope=0.0)


def tile(parameters: TerrainParameters, seed: int) -> np.ndarray:
    return generate_terrain(parameters, terrain_rng(seed))


def distance_from(place: np.ndarray) -> np.ndarray:
    """Distance [cells] of each cell from the nearest cell where `place` is true."""
    return np.asarray(distance_transform_edt(~place))


# The tile


@pytest.mark.parametrize("seed", range(4))
def test_a_tile_has_its_shape_and_its_highest_cell_at_50_m(seed: int):
    dem = tile(DEFAULT, seed)
    assert dem.shape == (1000, 1000)
    assert dem.dtype == np.float32
    assert dem.max() == 50.0
    assert np.isfinite(dem).all()
    # An empty or a monstrous tile would both be wrong: craters and base give metres to tens of metres.
    assert 5.0 < dem.max() - dem.min() < 150.0


@given(
    seed=st.integers(0, 10**6), pixel_size=st.sampled_from([0.1, 0.5, 1.0, 2.0]), elevation=st.floats(-99, 99)
)
@settings(max_examples=20)
def test_the_highest_cell_stands_where_it_is_asked_to(seed: int, pixel_size: float, elevation: float):
    dem = tile(replace(DEFAULT, size=64, pixel_size=pixel_size, maximum_elevation=elevation), seed)
    assert dem.max() == np.float32(elevation)


def test_equal_seeds_give_equal_tiles_and_others_differ():
    np.testing.assert_array_equal(tile(SMALL, 5), tile(SMALL, 5))
    np.testing.assert_array_equal(tile(SMALL, 5), generate_terrain(SMALL, np.random.default_rng(5)))
    assert not np.array_equal(tile(SMALL, 5), tile(SMALL, 6))


def test_a_change_of_one_part_leaves_the_others_as_they_are():
    whole = tile(replace(SMALL, rocks=NO_ROCKS), 7).astype(float)
    base = tile(replace(SMALL, rocks=NO_ROCKS, craters=NO_CRATERS), 7)
    craters = tile(replace(SMALL, rocks=NO_ROCKS, base_surface=FLAT), 7)
    sum_of_parts = base.astype(float) + craters
    np.testing.assert_allclose(whole - whole.max(), sum_of_parts - sum_of_parts.max(), rtol=0, atol=1e-4)
    for rocks in (RockPopulation(), RockPopulation(area_fraction=0.05)):
        added = tile(replace(SMALL, rocks=rocks), 7) - whole
        clear = np.abs(added - added.min()) < 1e-4  # cells without a rock are all shifted alike
        assert clear.mean() > 0.1
        assert added.max() - added.min() < 2.001  # and none rises above the largest rock


def test_rocks_stay_in_place_when_craters_change():
    first = tile(SMALL, 7) - tile(replace(SMALL, rocks=NO_ROCKS), 7).astype(float)
    pike = replace(SMALL, craters=CraterPopulation(depth_law=DepthLaw.PIKE))
    second = tile(pike, 7) - tile(replace(pike, rocks=NO_ROCKS), 7).astype(float)
    np.testing.assert_allclose(first - first.min(), second - second.min(), rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"size": 1}, "size must be a whole number"),
        ({"size": 100.5}, "size must be a whole number"),
        ({"pixel_size": 0.0}, "pixel_size"),
        ({"maximum_elevation": math.inf}, "maximum_elevation"),
    ],
)
def test_bad_terrain_parameters_are_named(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        TerrainParameters(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"), [({"hurst": 1.0}, "hurst"), ({"rms_slope": -0.1}, "rms_slope")]
)
def test_bad_base_surfaces_are_named(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        BaseSurface(**arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"smoothing_scale": 0.0}, "smoothing_scale"),
        ({"threshold": math.nan}, "threshold"),
        ({"remaining_share": 1.1}, "remaining_share"),
    ],
)
def test_bad_islands_are_named(arguments: dict, message: str):
    with pytest.raises(ValueError, match=message):
        IslandField(**arguments)


# The base surface


def test_rms_slope_of_a_plane():
    rows, columns = np.indices((20, 30)) * 0.5
    expected = math.atan(math.sqrt(0.5 * (0.3**2 + 0.4**2)))
    for cells in (1, 4):
        assert rms_slope(0.3 * rows + 0.4 * columns, 0.5, cells) == pytest.approx(expected)


@pytest.mark.parametrize(("pixel_size", "cells"), [(1.0, 1), (0.5, 2), (0.25, 4)])
def test_the_base_has_its_rms_slope_over_one_metre(pixel_size: float, cells: int):
    tangents = [
        math.tan(
            rms_slope(
                generate_base_surface(BaseSurface(), 400, pixel_size, np.random.default_rng(k)),
                pixel_size,
                cells,
            )
        )
        for k in range(30)
    ]
    mean_square = np.square(tangents)
    # Five standard errors of 30 tiles: false alarms about 1e-5 each (Student).
    error = 5.0 * mean_square.std(ddof=1) / math.sqrt(len(tangents))
    assert abs(mean_square.mean() - math.tan(math.radians(1.5)) ** 2) < error
    assert error < 0.1 * mean_square.mean()


def test_height_differences_grow_with_the_hurst_exponent():
    for hurst in (0.5, 0.8):
        steps = np.array([4, 8, 16, 32])
        squares = np.zeros(steps.size)
        for k in range(20):
            surface = generate_base_surface(BaseSurface(hurst=hurst), 400, 1.0, np.random.default_rng(k))
            squares += [(step * math.tan(rms_slope(surface, 1.0, int(step)))) ** 2 for step in steps]
        exponent = 0.5 * np.polyfit(np.log(steps), np.log(squares), 1)[0]
        # A grid cuts the spectrum off at both ends, which bends the power law by a few hundredths.
        assert exponent == pytest.approx(hurst, abs=0.06)


def test_a_coarse_grid_keeps_the_slope_law():
    # Over 4 m the same surface is less steep, by 4^(0.8 - 1).
    squares = [
        math.tan(rms_slope(generate_base_surface(BaseSurface(), 400, 4.0, np.random.default_rng(k)), 4.0))
        ** 2
        for k in range(20)
    ]
    expected = math.tan(math.radians(1.5)) * 4.0**-0.2
    assert math.sqrt(np.mean(squares)) == pytest.approx(expected, rel=0.03)


# Islands


def test_islands_cover_the_share_of_the_normal_law():
    islands = IslandField()
    shares = np.array(
        [
            np.mean(generate_island_field(islands, 600, 1.0, np.random.default_rng(k)) < islands.threshold)
            for k in range(60)
        ]
    )
    # Five standard errors of 60 tiles: false alarms about 1e-5 (Student).
    error = 5.0 * shares.std(ddof=1) / math.sqrt(shares.size)
    assert abs(shares.mean() - norm.cdf(-0.8)) < error
    assert error < 0.025


@pytest.mark.parametrize("pixel_size", [1.0, 0.5])
def test_the_island_field_is_white_noise_smoothed_over_its_scale(pixel_size: float):
    tiles, size = 300, 300
    distances = (0.0, 15.0, 30.0, 45.0)
    product = np.empty((tiles, len(distances), 2))  # along columns, along rows
    for k in range(tiles):
        field = generate_island_field(IslandField(), size, pixel_size, np.random.default_rng(k)).astype(float)
        for i, distance in enumerate(distances):
            width = size - round(distance / pixel_size)
            product[k, i] = (
                np.mean(field[:, -width:] * field[:, :width]),
                np.mean(field[-width:] * field[:width]),
            )
    expected = [[math.exp(-(distance**2) / (4.0 * 15.0**2))] * 2 for distance in distances]
    # Five standard errors at 8 points, twice: false alarms 1e-5.
    error = 5.0 * product.std(axis=0, ddof=1) / math.sqrt(tiles)
    assert np.all(np.abs(product.mean(axis=0) - expected) < error)
    assert error.max() < 0.12


@pytest.mark.parametrize("remaining_share", [0.0, 0.3])
def test_rocks_leave_islands_to_the_share_that_remains(remaining_share: float):
    parameters = replace(
        DEFAULT,
        size=600,
        base_surface=FLAT,
        craters=NO_CRATERS,
        islands=IslandField(remaining_share=remaining_share),
    )
    dem = tile(parameters, 9)
    rocky = dem > dem.min() + 1e-5
    margin = math.ceil(rock_margin(parameters.rocks))
    field = generate_island_field(
        parameters.islands, parameters.size + 2 * margin, 1.0, terrain_rng(9).spawn(4)[2]
    )
    island = field[margin:-margin, margin:-margin] < parameters.islands.threshold
    # Rocks on the shore reach into an island, by their longest axis and the cell.
    deep = distance_from(~island) > margin + 1.5
    far = distance_from(island) > margin + 1.5
    assert deep.mean() > 0.05
    if remaining_share == 0.0:
        assert not rocky[deep].any()
    # The share of cells without a rock falls as exp(-density), so its logarithm tells the density.
    density = [-math.log1p(-rocky[place].mean()) for place in (deep, far)]
    assert density[0] / density[1] == pytest.approx(remaining_share, abs=0.03)


# What it is for


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_default_ground_is_mostly_hazardous_with_islands(seed: int):
    safe = assess_safety(tile(DEFAULT, seed)).deterministic
    assert 0.75 < 1.0 - safe.mean() < 0.95
    clearance = distance_from(~safe)
    assert clearance.max() > 15.0
    # Most safe ground is on islands that hold a disc of 2 m, not in specks.
    broad = distance_from(clearance >= 2.0) < 2.0
    assert np.mean(broad[safe]) > 0.8


def test_the_command_draws_a_tile_and_says_what_it_is_like(tmp_path: Path, capsys: pytest.CaptureFixture):
    picture = tmp_path / "new" / "tile.png"
    arguments = ["--seed", "3", "--size", "150", "--rocks.area-fraction", "0.05", "--show", str(picture)]
    tyro.cli(show_terrain, args=arguments)
    assert picture.read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    paper = PAPER_TERRAIN
    small = replace(paper, size=150, rocks=replace(paper.rocks, area_fraction=0.05))
    hazard = 1.0 - assess_safety(tile(small, 3)).deterministic.mean()
    assert f"hazard share      {hazard:.3f}" in printed
    assert "RMS slope" in printed
    assert "generation time" in printed


def test_timings_are_of_the_asked_number_of_runs():
    timings = measure_terrain(repeats=2, size=64)
    assert timings[0].name == "terrain, 64 x 64 cells of 1 m"
    assert timings[1].name == "safety map, 64 x 64 cells of 1 m, 1 thread"
    assert all(len(timing.seconds) == 2 and min(timing.seconds) > 0.0 for timing in timings)
    with pytest.raises(ValueError, match="repeats"):
        measure_terrain(repeats=0)


def test_the_command_refuses_a_negative_seed():
    with pytest.raises(ValueError, match="seed must not be negative"):
        show_terrain(seed=-1)
