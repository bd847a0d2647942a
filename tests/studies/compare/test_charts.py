"""The charts of a report hold the numbers of its tables."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hda.flight.episode_row import MEASURES, EpisodeRow
from hda.flight.palette import COLORS
from studies.campaign.monte_carlo import Chunk
from studies.compare import charts
from studies.compare.scores import StudyScores, score_study
from studies.compare.table import PolicySummary, summarize_policy
from studies.paper import PAPER_ROWS
from studies.statistics.ratios import wilson_interval

draw_distribution: Any = charts.draw_distribution
draw_headline: Any = charts.draw_headline  # plotly's figures say nothing of their traces to a type checker
EPISODES = 50
UNSAFE = {"single-divert": 10, "other": 1, "never": 0}


def made_row(policy: str, episode: int) -> EpisodeRow:
    safe = episode >= UNSAFE[policy]
    outcome = "success" if safe else "unsafe-site"
    speed = 0.1 + 0.01 * episode
    return EpisodeRow(
        policy, episode, 1000 + episode % 5, outcome, safe, safe, 0.1, speed, 60.0 + episode % 7, 71.0,
        4500.0, 0.5, 45.0, 9, 0, 500.0, 500.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def scores() -> StudyScores:
    names = tuple(UNSAFE)
    rows = {name: [made_row(name, k) for k in range(EPISODES)] for name in names}
    chunk = Chunk(0, EPISODES, rows, {name: np.ones(1) for name in names})
    return score_study(names, "single-divert", [chunk])


@pytest.fixture(scope="module")
def summaries(scores: StudyScores) -> list[PolicySummary]:
    return [
        summarize_policy(score, "paper", privileged=False, is_reference=name == "single-divert")
        for name, score in scores.policies.items()
    ]


def test_the_headline_is_the_unsafe_share_with_its_interval(summaries: list[PolicySummary]) -> None:
    figure = draw_headline(summaries)
    traces = {trace.name: trace for trace in figure.data}
    assert figure.layout.yaxis.type == "log"
    for name in ("single-divert", "other"):
        trace, safe = traces[name], wilson_interval(EPISODES - UNSAFE[name], EPISODES)
        assert trace.y[0] == pytest.approx(100.0 * UNSAFE[name] / EPISODES)
        assert trace.y[0] + trace.error_y.array[0] == pytest.approx(100.0 * (1.0 - safe.low))
        assert trace.y[0] - trace.error_y.arrayminus[0] == pytest.approx(100.0 * (1.0 - safe.high))
        assert "open" not in trace.marker.symbol


def test_a_policy_that_never_fails_stands_hollow_at_half_an_episode(summaries: list[PolicySummary]) -> None:
    (trace,) = [trace for trace in draw_headline(summaries).data if trace.name == "never"]
    assert trace.y[0] == pytest.approx(100.0 * 0.5 / EPISODES)
    assert trace.marker.symbol.endswith("-open")
    assert trace.error_y.arrayminus[0] == 0.0
    upper = 100.0 * (1.0 - wilson_interval(EPISODES, EPISODES).low)
    assert trace.y[0] + trace.error_y.array[0] == pytest.approx(upper)
    assert trace.text[0].startswith("never: 0.00 % unsafe (0.00 to")


@pytest.mark.parametrize("episodes", range(1, 400, 7))
def test_no_number_of_episodes_draws_the_axis_down(summaries: list[PolicySummary], episodes: int) -> None:
    """Wilson's upper end of a perfect ratio is 1 only to rounding."""
    never = next(summary for summary in summaries if summary.policy == "never")
    perfect = replace(never, episodes=episodes, safe_site=wilson_interval(episodes, episodes))
    figure = draw_headline([perfect])
    assert figure.data[0].error_y.arrayminus[0] == 0.0
    assert figure.layout.yaxis.range[0] > math.log10(min(25.0 / episodes, 3.0))  # the paper stands at 5.2


def test_everything_of_the_headline_lies_inside_its_axes(summaries: list[PolicySummary]) -> None:
    figure = draw_headline(summaries)
    (left, right), (low, high) = figure.layout.xaxis.range, figure.layout.yaxis.range
    for trace in figure.data:
        assert all(left < x < right for x in trace.x)
        assert all(low < math.log10(y) < high for y in trace.y)
    paper = figure.data[-1]
    assert dict(zip(paper.text, paper.y, strict=True)) == {
        name: pytest.approx(100.0 - row["safe_site_percent"]) for name, row in PAPER_ROWS.items()
    }
    assert len(set(paper.textposition)) == len(PAPER_ROWS)


def test_a_distribution_is_the_share_up_to_each_edge(scores: StudyScores) -> None:
    rng = np.random.default_rng(0)
    for measure in MEASURES:
        figure = draw_distribution(measure, scores.histograms)
        for trace in figure.data:
            share = np.array(trace.y)
            assert share[0] == 0.0
            assert share[-1] == 100.0
            assert (np.diff(share) >= 0.0).all()
    (speed,) = [
        t for t in draw_distribution("touchdown_speed_mps", scores.histograms).data if t.name == "never"
    ]
    values = np.array([made_row("never", k).touchdown_speed_mps for k in range(EPISODES)])
    for k in rng.integers(1, len(speed.x) - 1, 10):
        width = 100.0 / EPISODES  # a value on an edge belongs to the bin above
        assert abs(speed.y[k] - 100.0 * (values < speed.x[k]).mean()) <= width + 1e-6


def luminance(color: str) -> float:
    channels = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("color", COLORS)
def test_lines_stand_out_on_white(color: str) -> None:
    """WCAG 2.1, 1.4.11: a contrast of 3 for what must be seen to understand a picture."""
    assert 1.05 / (luminance(color) + 0.05) >= 3.0
