"""The layers of reality: what is paired, what is refused, and that a run repeats and goes on."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hda.flight.episode_row import EpisodeRow
from hda.task.presets import PRESETS
from studies.campaign import monte_carlo
from studies.campaign.claimed_folder import FolderError
from studies.campaign.monte_carlo import Study, fly_chunk, prepare_study
from studies.failures import explained
from studies.realism import Realism, run_realism
from studies.realism.command import find_layers, list_changes, plan_points
from studies.realism.layers import (
    PairRow,
    Verdict,
    compare_order,
    describe_layer,
    judge_order,
    lost_episodes,
)
from studies.statistics.ratios import Interval

_SMALL = Realism(
    presets=("paper", "lidar"), policies=("no-divert", "single-divert"), episodes=4, explained=2, workers=1
)


@pytest.fixture(scope="module")
def row() -> EpisodeRow:
    study = Study(PRESETS["paper"], ("single-divert",), 1)
    prepare_study(study, workers=1)
    return fly_chunk(study, 0, 1).rows["single-divert"][0]


def _rows(row: EpisodeRow, successes: list[bool], policy: str = "single-divert") -> tuple[EpisodeRow, ...]:
    return tuple(
        replace(row, policy=policy, episode=k, tile=k % 3, success=success)
        for k, success in enumerate(successes)
    )


def test_settings_are_flown_in_the_order_given() -> None:
    points = plan_points(replace(_SMALL, presets=("navigated", "paper")))
    assert [point.label for point in points] == ["navigated", "paper"]
    assert replace(points[0].study, preset=PRESETS["paper"]) == points[1].study


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("paper",), "two or more settings, each once, got paper"),
        ((), "got none"),
        (("paper", "paper"), "each once"),
        (("paper", "hard"), "'hard' has another ground or start than 'paper'"),
        (("paper", "lidr"), "did you mean lidar"),
    ],
)
def test_settings_that_cannot_be_paired_are_refused(names: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        find_layers(names)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=40))
def test_a_fall_is_what_is_lost_less_what_is_won(row: EpisodeRow, pairs: list[tuple[bool, bool]]) -> None:
    before, after = (_rows(row, [pair[k] for pair in pairs]) for k in range(2))
    line = describe_layer(
        {"first": {"single-divert": before}, "second": {"single-divert": after}},
        "second",
        "single-divert",
        lambda lost: str(lost),
    )
    lost = [k for k, (was, stays) in enumerate(pairs) if was and not stays]
    won = sum(not was and now for was, now in pairs)
    assert line.lost == len(lost)
    assert line.causes == str(lost)
    assert line.fall.estimate == pytest.approx((len(lost) - won) / len(pairs))
    assert line.fall.low <= line.fall.estimate <= line.fall.high
    assert line.price.estimate == 0.0
    assert lost_episodes(None, after) == [k for k, (_, now) in enumerate(pairs) if not now]


@pytest.mark.parametrize(
    ("first", "last", "verdict"),
    [
        ((0.1, 0.3), (0.2, 0.3), Verdict.KEPT),
        ((0.1, 0.3), (-0.3, -0.1), Verdict.REVERSED),
        ((0.1, 0.3), (-0.1, 0.1), Verdict.LOST),
        ((-0.1, 0.3), (0.1, 0.3), Verdict.NEW),
        ((-0.1, 0.3), (-0.3, -0.1), Verdict.NEW),
        ((-0.1, 0.3), (-0.1, 0.1), Verdict.NONE),
    ],
)
def test_an_order_is_judged_by_both_intervals(
    first: tuple[float, float], last: tuple[float, float], verdict: Verdict
) -> None:
    leads = [Interval((low + high) / 2, low, high) for low, high in (first, last)]
    assert judge_order(*leads) is verdict
    pair = PairRow("nearest-safe", "td3", tuple(leads), leads[0], verdict)
    assert list_changes([pair]) == ([] if verdict in (Verdict.KEPT, Verdict.NONE) else [pair])


def test_a_reversed_order_is_found_whatever_the_names_come_first(row: EpisodeRow) -> None:
    many, few = [True] * 40, [False] * 40

    def layer(first: list[bool], second: list[bool]) -> dict[str, tuple[EpisodeRow, ...]]:
        rows = {"single-divert": first, "nearest-safe": second, "oracle": many}
        return {name: _rows(row, successes, name) for name, successes in rows.items()}

    (pair,) = compare_order({"first": layer(few, many), "second": layer(many, few)})
    assert (pair.better, pair.other, pair.verdict) == ("nearest-safe", "single-divert", Verdict.REVERSED)
    assert pair.fall.estimate == 2.0


def test_a_run_tells_why_and_goes_on_without_flying_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = replace(_SMALL, out=tmp_path)
    lines = run_realism(options)
    assert [(line.preset, line.policy) for line in lines] == [
        (preset, policy) for preset in options.presets for policy in options.policies
    ]
    with (tmp_path / "table.csv").open() as stream:
        told = list(csv.DictReader(stream))
    assert told[0]["step_points"] == ""
    assert told[2]["step_points"] == told[2]["success_drop_points"]
    assert (tmp_path / "realism.png").stat().st_size > 10_000
    assert len((tmp_path / "order.csv").read_text().splitlines()) == 2
    before = (tmp_path / "table.csv").read_bytes()

    def refuse(*arguments: object) -> None:
        raise AssertionError("it was flown again")

    for module in (explained, monte_carlo):  # explains; flies the points
        monkeypatch.setattr(module, "fly", refuse)
    with pytest.raises(FolderError, match="holds a study already"):
        run_realism(options)
    run_realism(replace(options, resume=True))
    assert (tmp_path / "table.csv").read_bytes() == before
