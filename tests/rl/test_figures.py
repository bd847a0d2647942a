"""Figures of learning, by what they draw."""

import numpy as np
import pytest

import hda
from hda.flight.episode import fly
from rl.figures import ComparisonFigure, draw_comparison


def test_a_comparison_shows_an_episode_that_parts_the_two() -> None:
    figure = draw_comparison(ComparisonFigure(agent="nearest-safe", other="no-divert", search=20))
    episode = int(figure.get_suptitle().removeprefix("episode "))
    scenario = hda.sample_scenario("paper", 0, episode)
    records = [fly(hda.make_policy(name), scenario) for name in ("nearest-safe", "no-divert")]
    assert [record.outcome.safe_site for record in records] == [True, False]
    tracks = [axis for axis in figure.axes if axis.images]
    for axis, record in zip(tracks, records, strict=True):
        assert axis.get_title() == f"{record.policy}: {record.outcome.ending}"
        assert np.array_equal(axis.lines[0].get_xdata(), record.position[:, 0])


def test_a_comparison_of_two_that_never_part_is_an_error_and_no_picture() -> None:
    options = ComparisonFigure(agent="no-divert", other="no-divert", search=3)
    with pytest.raises(ValueError, match="on none of 3 episodes does no-divert land on safe ground"):
        draw_comparison(options)
