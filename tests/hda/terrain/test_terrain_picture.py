"""The picture of a tile: the three maps, the right way up, on axes in metres."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hda.safety.safety_map import SafetyMap
from hda.terrain.picture import draw_terrain

ROWS, COLUMNS, PIXEL = 30, 40, 2.0


@pytest.fixture(scope="module")
def drawn() -> tuple[SafetyMap, list[Any]]:
    rng = np.random.default_rng(0)
    safety = SafetyMap(
        deterministic=rng.random((ROWS, COLUMNS)) > 0.5,
        probability=rng.random((ROWS, COLUMNS)),
        slope=rng.uniform(0.0, 0.6, (ROWS, COLUMNS)),
        roughness=rng.random((ROWS, COLUMNS)),
    )
    dem = np.tile(np.arange(COLUMNS) * PIXEL * math.tan(math.radians(20.0)), (ROWS, 1))
    figure = draw_terrain(dem, safety, PIXEL, max_slope=math.radians(10.0))
    return safety, figure.axes


def image(axes: Any) -> np.ndarray:
    (shown,) = axes.get_images()
    return np.asarray(shown.get_array())


def test_each_map_is_shown_as_it_is_with_the_south_below(drawn: tuple[SafetyMap, list[Any]]) -> None:
    safety, axes = drawn
    assert [a.get_title() for a in axes[:3]] == ["shaded relief", "worst slope", "safety map"]
    np.testing.assert_allclose(image(axes[1]), np.degrees(safety.slope))
    np.testing.assert_array_equal(image(axes[2]), safety.probability)
    for a in axes[:3]:
        (shown,) = a.get_images()
        assert tuple(shown.get_extent()) == (0.0, COLUMNS * PIXEL, 0.0, ROWS * PIXEL)
        assert shown.origin == "lower"
        assert a.get_xlabel() == "east [m]"
    assert axes[0].get_ylabel() == "north [m]"


def test_colours_have_fixed_ends_and_the_limit_is_marked(drawn: tuple[SafetyMap, list[Any]]) -> None:
    _, axes = drawn
    assert axes[1].get_images()[0].get_clim() == (0.0, 30.0)
    assert axes[2].get_images()[0].get_clim() == (0.0, 1.0)
    bars = {a.get_ylabel(): a for a in axes[3:]}
    assert set(bars) == {"slope [deg]", "probability of safe ground [-]"}
    assert any(
        list(line.get_ydata()) == pytest.approx([10.0, 10.0]) for line in bars["slope [deg]"].get_lines()
    )


@pytest.mark.parametrize(
    ("rise_east", "rise_north", "bright"), [(1, 0, True), (-1, 0, False), (0, -1, True), (0, 1, False)]
)
def test_the_sun_stands_in_the_north_west(rise_east: int, rise_north: int, bright: bool) -> None:
    """Ground that falls toward the north or the west is lit, ground that falls away from it is dark."""
    north, east = np.mgrid[:ROWS, :COLUMNS] * 0.2
    flat = np.zeros((ROWS, COLUMNS))
    safety = SafetyMap(flat > 0.0, flat, flat, flat)
    level = image(draw_terrain(flat, safety).axes[0]).mean()
    shade = image(draw_terrain(rise_east * east + rise_north * north, safety).axes[0]).mean()
    assert bool(shade > level) == bright
