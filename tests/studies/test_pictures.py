"""What the studies' pictures draw is what the studies found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.text import Annotation

from guidance import PlanStatus
from hda.flight.episode_row import MEASURES, EpisodeRow
from hda.task.presets import PRESETS
from studies.campaign.monte_carlo import Study
from studies.campaign.score import Score
from studies.compare.figures import draw_histograms
from studies.compare.histograms import BINS, MeasureHistograms
from studies.memory.answer import MEASURES as SEED_MEASURES
from studies.memory.answer import GroupRow
from studies.memory.report import draw_memory
from studies.memory.scores import AgentScore
from studies.robustness.picture import draw_sweep
from studies.stability.held_loop import Gains, least_safe_time, sampled_margins, stable_above
from studies.stability.picture import draw_stability
from studies.stability.sweep import Requirement
from studies.statistics.ratios import Interval, wilson_interval
from studies.timing.measures import Call
from studies.timing.methods import Method
from studies.timing.picture import draw_timing
from studies.trade_off.picture import draw_trade_off
from studies.trade_off.table import Bounds, TradeOffRow
from tests.drawing import bar_ends, legend_words, line_data


def episode_row(policy: str, episode: int, landed: bool, propellant: float = 65.0) -> EpisodeRow:
    outcome = "success" if landed else "unsafe-site"
    measures = (0.1, 0.5, propellant, 72.0, 4600.0, 1.0 if landed else -1.0, 40.0)
    return EpisodeRow(policy, episode, 1000, outcome, landed, landed, *measures, 8, 0, 500.0, 500.0)


def rows_of(policy: str, landed: int, episodes: int) -> tuple[EpisodeRow, ...]:
    return tuple(episode_row(policy, k, k < landed) for k in range(episodes))


# Robustness


def test_a_sweep_shows_each_policys_ratio_with_wilsons_interval_at_each_level() -> None:
    landed = {0.0: {"a": 19, "b": 10}, 0.05: {"a": 18, "b": 9}, 0.3: {"a": 7, "b": 0}}
    levels = {
        value: {name: rows_of(name, count, 20) for name, count in counts.items()}
        for value, counts in landed.items()
    }
    figure = draw_sweep("bound of the thrust error", 0.05, levels)
    for axes, title in zip(figure.axes, ("safe site [%]", "success [%]"), strict=True):
        assert axes.get_ylabel() == title
        assert axes.get_xlabel() == "bound of the thrust error"
        assert axes.get_ylim() == (-3.0, 103.0)
        containers: Any = axes.containers
        for container, name in zip(containers, ("a", "b"), strict=True):
            assert container.get_label() == name
            intervals = [wilson_interval(counts[name], 20) for counts in landed.values()]
            middle = np.asarray(container.lines[0].get_ydata())
            np.testing.assert_allclose(middle, [100.0 * i.estimate for i in intervals])
            low, high = bar_ends(container)
            np.testing.assert_allclose(low[:, 1], [100.0 * i.low for i in intervals], atol=1e-9)
            np.testing.assert_allclose(high[:, 1], [100.0 * i.high for i in intervals], atol=1e-9)
            np.testing.assert_allclose(low[:, 0], list(landed), atol=0.002)
        own = [line for line in axes.get_lines() if np.asarray(line.get_xdata()).tolist() == [0.05, 0.05]]
        assert len(own) == 1
    assert legend_words(figure.legends[0]) == ["a", "b"]


# Comparison


def test_histograms_hold_every_episode_once() -> None:
    rng = np.random.default_rng(3)
    policies = ("one", "two")
    histograms = MeasureHistograms(policies)
    burnt = {name: rng.normal(60.0 + 5.0 * k, 1.0, 50) for k, name in enumerate(policies)}
    for k in range(50):
        histograms.add({name: episode_row(name, k, k % 3 > 0, burnt[name][k]) for name in policies})
    histograms.finish()
    figure = draw_histograms(Study(PRESETS["hard"], policies, 50), histograms)
    drawn = {axes.get_xlabel(): axes for axes in figure.axes if axes.get_xlabel()}
    assert set(drawn) == {
        "reward",
        "distance to the final target [m]",
        "final speed [m/s]",
        "maximum thrust [N]",
        "minimum slant angle [deg]",
    }
    for axes in drawn.values():
        assert axes.get_ylabel() == "episodes"
        assert [steps.get_label() for steps in axes.patches] == list(policies)
        for steps in axes.patches:
            data: Any = steps
            assert data.get_data().values.sum() == 50
            assert data.get_data().values.shape == (BINS,)
    (first, _) = drawn["reward"].patches
    values: Any = first
    counts, edges = values.get_data().values, values.get_data().edges
    assert counts[0] == sum(k % 3 == 0 for k in range(50))
    assert counts[-1] == sum(k % 3 > 0 for k in range(50))
    assert (edges[0], edges[-1]) == pytest.approx((-1.0, 1.0))
    assert figure.get_suptitle() == "preset hard, 50 episodes; end bins hold what lies beyond"


# Timing


def call(method: Method, case: int, milliseconds: float, grams: float, keeps: bool = True) -> Call:
    status = PlanStatus.OPTIMAL
    return Call(
        method.label, f"case {case}", False, True, status, 1.0, 1e-3 * milliseconds, 1e-3 * grams, 1, keeps
    )


def nothing(*_: object) -> Any:
    raise AssertionError("a picture plans nothing")


def test_timing_shows_the_share_of_calls_done_and_the_median_cost() -> None:
    free, fixed = Method("tight", 61, True, nothing), Method("loose", 31, False, nothing)
    calls = [call(free, k, time, 10.0 * time) for k, time in enumerate((8.0, 2.0, 4.0))]
    calls += [call(fixed, 0, 1.0, 0.0), call(fixed, 1, 3.0, 500.0, keeps=False)]
    calls += [replace(call(fixed, 2, 900.0, 1.0), feasible=False)]
    share, cost = draw_timing([free, fixed], calls).axes
    time, done = line_data(share, free.label)
    np.testing.assert_allclose(time, [2.0, 4.0, 8.0])
    np.testing.assert_allclose(done, [100.0 / 3.0, 200.0 / 3.0, 100.0])
    np.testing.assert_allclose(line_data(share, fixed.label)[0], [1.0, 3.0])
    assert (share.get_xscale(), cost.get_xscale(), cost.get_yscale()) == ("log",) * 3
    assert share.get_ylabel() == "calls on feasible cases done [%]"
    points = [[float(np.asarray(v).item()) for v in line.get_data()] for line in cost.get_lines()]
    assert points[0] == pytest.approx([4.0, 40.0])
    assert points[1] == pytest.approx(
        [2.0, 0.01]
    )  # nothing lost is shown at the least that a logarithm shows
    assert [line.get_marker() for line in cost.get_lines()] == ["o", "s"]
    assert [text.get_text() for text in cost.texts] == ["61", "31"]


# Trade-off


def point(name: str, safe: float, burnt: float, **kind: Any) -> TradeOffRow:
    ratio = Interval(safe, safe - 0.02, safe + 0.01)
    by_tile = Interval(safe, safe - 0.05, safe + 0.03)
    means = {measure: Interval(burnt, burnt - 1.0, burnt + 2.0) for measure in MEASURES}
    score = Score(
        episodes=100,
        safe_site=ratio,
        safe_site_by_tile=by_tile,
        success=ratio,
        success_by_tile=by_tile,
        success_at_least=safe,
        success_at_least_by_tile=safe,
        means=means,
        means_by_tile=means,
        fallbacks=0,
    )
    named = {"split": "validation", "weight": "", "value": math.nan, "privileged": False, "on_front": False}
    return TradeOffRow(policy=name, score=score, **{"preset": "paper", **named, **kind})


def test_a_trade_off_shows_points_front_and_floor() -> None:
    rows = [
        point("cheap", 0.8, 55.0, on_front=True),
        point("safe", 0.95, 66.0, on_front=True),
        point("dear", 0.7, 70.0),
        point("seer", 0.99, 54.0, privileged=True),
    ]
    floor = Interval(50.0, 49.0, 51.0)
    (axes,) = draw_trade_off(rows, [Bounds("paper", 100, Interval(1.0, 0.9, 1.0), floor)]).axes
    assert axes.get_title() == "paper: policies"
    named: dict[str, Any] = {
        str(c.get_label()): c for c in axes.containers if not str(c.get_label()).startswith("_")
    }
    assert list(named) == ["cheap", "safe", "dear", "seer *"]
    for label, (x, y) in zip(named, ((55.0, 80.0), (66.0, 95.0), (70.0, 70.0), (54.0, 99.0)), strict=True):
        line: Any = named[label].lines[0]
        assert [line.get_xdata()[0], line.get_ydata()[0]] == pytest.approx([x, y])
        assert line.get_markerfacecolor() == ("white" if label == "seer *" else line.get_color())
        low, high = bar_ends(named[label])
        assert [low[0, 1], high[0, 1]] == pytest.approx([y - 2.0, y + 1.0])
    thin = [c for c in axes.containers if str(c.get_label()).startswith("_")]
    low, high = bar_ends(thin[0])
    assert [low[0, 1], high[0, 1]] == pytest.approx([75.0, 83.0])
    front = line_data(axes, "front")
    np.testing.assert_allclose(front, [[55.0, 66.0], [80.0, 95.0]])
    np.testing.assert_allclose(line_data(axes, "floor on propellant")[0], [50.0, 50.0])


def test_panels_of_many_presets_stand_three_in_a_row() -> None:
    presets = ("paper", "hard", "partial", "lidar")
    rows = [point("cheap", 0.8, 55.0, preset=name, on_front=True, ratio="success") for name in presets]
    figure = draw_trade_off(rows, [])
    assert [axes.get_title() for axes in figure.axes] == [f"{name}: policies" for name in presets]
    places = [axes.get_subplotspec() for axes in figure.axes]
    assert [place and place.get_geometry()[:3] for place in places] == [(2, 3, k) for k in range(4)]
    for axes in figure.axes:
        assert str(axes.get_ylabel()).startswith("success [%]")
    legends = [axes.get_legend() for axes in figure.axes]
    assert [legend is not None for legend in legends] == [False, False, True, True]
    assert set(legend_words(legends[-1])) == {"cheap", "front"}  # no floor where there are no bounds


def test_a_swept_weight_is_drawn_below_with_its_values() -> None:
    tuning = {"split": "tuning"}
    rows = [
        point("hazard-aware", 0.95, 60.0, on_front=True),
        point("hazard-aware", 0.94, 59.0, **tuning),
        *(
            point("h", 0.9 + 0.01 * k, 58.0 + k, weight="divert_cost", value=2.0**k, **tuning)
            for k in range(3)
        ),
    ]
    floor = Interval(50.0, 49.0, 51.0)
    above, below = draw_trade_off(rows, [Bounds("paper", 100, Interval(1.0, 0.9, 1.0), floor)]).axes
    assert "tuning tiles" in below.get_title()
    shown = [c.get_label() for c in above.containers if not str(c.get_label()).startswith("_")]
    assert shown == ["hazard-aware"]
    assert [text.get_text() for text in below.texts] == ["1", "2", "4"]
    places = np.array([annotation.xy for annotation in below.texts if isinstance(annotation, Annotation)])
    np.testing.assert_allclose(places, [[58.0, 90.0], [59.0, 91.0], [60.0, 92.0]])
    labels = [c.get_label() for c in below.containers if not str(c.get_label()).startswith("_")]
    assert labels == ["divert_cost", "default weights"]


# Stability


def test_stability_maps_the_gain_box_and_the_margins() -> None:
    preset = PRESETS["paper"]
    required = Requirement(math.radians(30.0), 2.0)
    figure = draw_stability(preset, required)
    maps = {axes.get_title(): axes for axes in figure.axes if axes.get_xlabel() == "K_R"}
    assert len(maps) == 5
    for axes in maps.values():
        assert axes.get_ylabel() == "K_V"
        assert (axes.get_xlim(), axes.get_ylim()) == ((5.0, 7.0), (1.0, 3.0))
        assert [v.tolist() for v in line_data(axes, "6/2")] == [[6.0], [2.0]]
    mesh: Any = maps["time to go above which margins are met [s]"].collections[0]
    times = np.asarray(mesh.get_array()).reshape(33, 33)
    period = preset.rules.control_period
    for row, column in ((0, 0), (16, 16), (32, 5)):
        gains = Gains(5.0 + column / 16.0, 1.0 + row / 16.0)
        expected = least_safe_time(gains, period, required.phase_margin, required.gain_margin)
        assert times[row, column] == pytest.approx(expected)
    (margins,) = [axes for axes in figure.axes if axes.get_ylabel() == "phase margin [deg]"]
    assert margins.get_ylim() == (0.0, 90.0)
    time, angle = line_data(margins, "6/2")
    assert (time[0], time[-1]) == pytest.approx((0.5 * period, 80.0))
    expected = [sampled_margins(Gains(6.0, 2.0), float(t), period).phase_margin for t in time]
    np.testing.assert_allclose(angle, np.degrees(expected))
    assert np.array_equal(np.isnan(angle), time <= stable_above(Gains(6.0, 2.0), period))


# Memory


def agent_score(agent: str, seed: int, safe: float) -> AgentScore:
    known = {"agent": agent, "preset": "paper", "seed": seed, "safe_site_percent": safe}
    blank: dict[str, Any] = {"str": "", "int": 0, "float": 0.0}
    fields = AgentScore.__dataclass_fields__
    return AgentScore(
        **{name: known.get(name, blank.get(str(field.type), 0)) for name, field in fields.items()}
    )


def test_memory_shows_every_seed_and_the_mean_with_its_interval() -> None:
    none = Interval(math.nan, math.nan, math.nan)
    rows = [
        GroupRow("paper", "td3", SEED_MEASURES[0], 3, 1000, Interval(90.0, 88.0, 93.0), none, none),
        GroupRow(
            "paper", "td3-lstm", SEED_MEASURES[0], 1, 1000, Interval(95.0, math.nan, math.nan), none, none
        ),
        GroupRow("paper", "td3", SEED_MEASURES[1], 3, 1000, Interval(10.0, 5.0, 15.0), none, none),
    ]
    scores = [agent_score("td3", k, 89.0 + k) for k in range(3)] + [agent_score("td3-lstm", 0, 95.0)]
    (axes,) = draw_memory(rows, scores).axes
    assert axes.get_title() == "paper"
    assert axes.get_ylabel() == "safe site [%]"
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["td3", "td3-lstm"]
    seeds = [np.asarray(line.get_ydata()).tolist() for line in axes.get_lines() if line.get_marker() == "o"]
    assert seeds == [[89.0, 90.0, 91.0], [95.0]]
    assert len(axes.containers) == 2  # one measure is drawn
    low, high = bar_ends(axes.containers[0])
    assert [low[0].tolist(), high[0].tolist()] == [[0.0, 88.0], [0.0, 93.0]]
    low, high = bar_ends(axes.containers[1])
    assert low[0].tolist() == high[0].tolist() == [1.0, 95.0]
