"""Figures of learning, by what they draw."""

import numpy as np
import pytest

import hda
from hda.flight.episode import fly
from rl.figures import ComparisonFigure, ShiftsFigure, draw_comparison, draw_shifts


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


def test_moves_are_those_of_the_decisions(capsys: pytest.CaptureFixture[str]) -> None:
    figure = draw_shifts(ShiftsFigure(policies=("no-divert", "nearest-safe"), episodes=5, least=2.0))
    by_height, by_last = figure.axes
    last, farthest = [], 0.0
    for episode in range(5):
        record = fly(hda.make_policy("nearest-safe"), hda.sample_scenario("paper", 0, episode))
        moves = []
        for observation, decision in zip(record.observations, record.decisions, strict=True):
            shift = float(np.hypot(*(decision.site - observation.target)[:2]))
            farthest = max(farthest, shift)
            if shift >= 2.0:
                moves.append(observation.state.position[2] - observation.target[2])
        last += moves[-1:]
    none, some = (np.asarray(line.get_xdata()) for line in by_last.get_lines())
    assert none.size == 0
    np.testing.assert_allclose(some, np.sort(last))
    still, moving = (np.asarray(line.get_ydata()) for line in by_height.get_lines())
    assert still.max() == 0.0 < moving.max() <= farthest
    told = [line for line in capsys.readouterr().out.splitlines() if line]  # the bar's are empty
    assert told[0] == "no-divert: no move in 5 flights"
    assert told[1].startswith(f"nearest-safe: last move at {np.mean(last):.0f} m (")
    assert told[1].endswith(f", in {len(last)} of 5 flights")
