"""Pictures of measured looks, by what they draw."""

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import hda
from hda.flight.episode import fly
from hda.flight.look_picture import draw_elevation, draw_looks
from hda.flight.record import EpisodeRecord


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return fly(hda.make_policy("nearest-safe"), hda.sample_scenario("lidar-coarse", 0, 3))


def test_heights_are_drawn_where_they_were_measured_and_holes_are_left_out(record: EpisodeRecord) -> None:
    observation = record.observations[1]
    axis: Any = Figure().subplots()
    draw_elevation(axis, observation)
    (image,) = axis.get_images()
    drawn = image.get_array()
    height, grid = observation.elevation, observation.elevation_grid
    assert height is not None
    assert grid is not None
    assert drawn is not None
    np.testing.assert_array_equal(np.ma.getmaskarray(drawn), np.isnan(height))
    np.testing.assert_array_equal(np.ma.compressed(drawn), height[~np.isnan(height)])
    west, south = grid.corner
    assert image.get_extent() == pytest.approx(
        [west, west + grid.pixel_size * grid.columns, south, south + grid.pixel_size * grid.rows]
    )
    x, half = observation.target[0], 0.5 * observation.width
    assert axis.get_xlim() == pytest.approx((x - half, x + half))


def test_a_flight_is_drawn_look_by_look_with_verdict_and_truth(record: EpisodeRecord) -> None:
    axes: list[Any] = draw_looks(record, most=3).axes
    assert len(axes) == 9
    shown = [record.observations[k] for k in (0, round((len(record.observations) - 1) / 2), -1)]
    for row, observation in enumerate(shown):
        verdict, truth = axes[3 * row + 1], axes[3 * row + 2]
        np.testing.assert_array_equal(verdict.get_images()[0].get_array(), observation.safety_map)
        np.testing.assert_array_equal(truth.get_images()[0].get_array(), record.scenario.tile.deterministic)
        for axis in axes[3 * row : 3 * row + 3]:
            (cross,) = axis.get_lines()
            place = [cross.get_xdata()[0], cross.get_ydata()[0]]
            assert place == pytest.approx(record.decisions[observation.index].site[:2])
            assert axis.get_xlim() == pytest.approx(verdict.get_xlim())
    assert len(draw_looks(record, most=99).axes) == 3 * len(record.observations)


def test_a_flight_without_heights_is_refused():
    paper = fly(hda.make_policy("no-divert"), hda.sample_scenario("paper", 0, 3))
    with pytest.raises(ValueError, match="measured heights"):
        draw_looks(paper)
    with pytest.raises(ValueError, match="most"):
        draw_looks(paper, most=0)
