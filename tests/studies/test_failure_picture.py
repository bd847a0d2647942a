"""The picture of a failed episode: its descent, the ground where it ended, and the looks before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hda.flight.episode import fly, ground_point
from hda.flight.record import EpisodeRecord
from hda.registry import make_policy
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from studies.failures.picture import draw_failure
from tests.drawing import line_data


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    """A flight whose navigation is wrong, so that a site and where it really lies differ."""
    partial = PRESETS["partial"]
    preset = replace(partial, rules=replace(partial.rules, navigation_position_error=3.0))
    return fly(make_policy("nearest-safe"), sample_scenario(preset, 1, 0))


@pytest.fixture(scope="module")
def axes(record: EpisodeRecord) -> list[Any]:
    return draw_failure(record, "It fell.").axes


def test_height_speed_and_thrust_are_drawn_against_time(record: EpisodeRecord, axes: list[Any]) -> None:
    time, height = line_data(axes[1], "height [m]")
    np.testing.assert_array_equal(time, record.time)
    np.testing.assert_allclose(height, record.position[:, 2] - 50.0)
    np.testing.assert_allclose(line_data(axes[1], "speed [m/s]")[1], np.linalg.norm(record.velocity, axis=1))
    (thrust,) = axes[1].patches
    tenths, edges, _ = thrust.get_data()
    np.testing.assert_allclose(tenths, np.linalg.norm(record.thrust, axis=1) / 1200.0)
    np.testing.assert_array_equal(edges, record.time)
    marks = [line.get_xdata()[0] for line in axes[1].get_lines()[2:]]
    assert marks == [observation.time for observation in record.observations]
    assert (axes[1].get_yscale(), axes[1].get_ylim()[0]) == ("symlog", 0.0)


def test_the_ground_at_the_touchdown_shows_where_the_site_really_lay(
    record: EpisodeRecord, axes: list[Any]
) -> None:
    touchdown = record.outcome.touchdown
    site = record.decisions[-1].site
    really = ground_point(record.scenario, site)
    assert np.linalg.norm(really - site) > 1.0
    assert [v[0] for v in line_data(axes[2], "site")] == pytest.approx(really[:2])
    assert [v[0] for v in line_data(axes[2], "touchdown")] == pytest.approx(touchdown[:2])
    assert axes[2].get_xlim() == pytest.approx((touchdown[0] - 15.0, touchdown[0] + 15.0))
    assert axes[2].get_ylim() == pytest.approx((touchdown[1] - 15.0, touchdown[1] + 15.0))
    truth = record.scenario.tile.deterministic
    assert np.array_equal(axes[2].get_images()[0].get_array(), truth)
    assert list(axes[2].get_images()[0].get_extent()) == [0, truth.shape[1], 0, truth.shape[0]]


def test_measured_heights_stand_below_the_looks() -> None:
    record = fly(make_policy("nearest-safe"), sample_scenario("lidar", 1, 0))
    axes: list[Any] = draw_failure(record, "It fell.").axes
    assert len(axes) == 11
    for look, heights, observation in zip(axes[3::2], axes[4::2], record.observations[-4:], strict=True):
        shown, drawn = (np.ma.asarray(axis.get_images()[0].get_array()) for axis in (look, heights))
        assert np.array_equal(shown, observation.safety_map)
        assert observation.elevation is not None
        assert np.array_equal(np.ma.getmaskarray(drawn), np.isnan(observation.elevation))
        assert heights.get_xlim() == pytest.approx(look.get_xlim())


def test_the_last_four_looks_are_shown_with_what_was_chosen(record: EpisodeRecord, axes: list[Any]) -> None:
    assert len(axes) == 7
    for panel, observation in zip(axes[3:], record.observations[-4:], strict=True):
        (image,) = panel.get_images()
        assert np.array_equal(image.get_array(), observation.safety_map)
        x, y = observation.target[:2]
        half = 0.5 * observation.width
        assert image.get_extent() == pytest.approx([x - half, x + half, y - half, y + half])
        assert panel.get_xlim() == pytest.approx((x - half, x + half))
        chosen = record.decisions[observation.index].site
        assert [v[0] for v in line_data(panel, "chosen here")] == pytest.approx(chosen[:2])
        last = record.decisions[-1].site
        assert [v[0] for v in line_data(panel, "last site")] == pytest.approx(last[:2])
        before_end = record.time[-1] - observation.time
        assert panel.get_title() == f"look {observation.index}, {before_end:.1f} s before the end"
