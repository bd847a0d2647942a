"""The layers of reality: what is paired, what is refused, and that a run repeats and goes on."""

import csv
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hda.flight.episode_row import EpisodeRow
from hda.task.presets import PRESETS
from studies.campaign import monte_carlo
from studies.campaign.claimed_folder import FolderError
from studies.campaign.monte_carlo import Study, fly_chunk, prepare_study
from studies.campaign.points import Rows
from studies.failures import explained
from studies.realism import Realism, run_realism
from studies.realism.command import find_layers, list_changes, plan_points
from studies.realism.layers import (
    PairRow,
    Verdict,
    compare_order,
    decide_order,
    describe_layer,
    extra_fall,
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


_FLIGHTS = st.lists(
    st.tuples(*3 * (st.tuples(st.booleans(), st.floats(40.0, 90.0)),)), min_size=1, max_size=40
)


@given(_FLIGHTS)
def test_a_step_is_against_the_setting_before_a_fall_and_a_price_against_the_first(
    row: EpisodeRow, flights: list[tuple[tuple[bool, float], ...]]
) -> None:
    flown = {
        name: {
            "single-divert": tuple(
                replace(own, propellant_percent=flight[k][1])
                for own, flight in zip(_rows(row, [f[k][0] for f in flights]), flights, strict=True)
            )
        }
        for k, name in enumerate(("first", "second", "third"))
    }
    line = describe_layer(flown, "third", "single-divert", str)
    success = np.array([[ended for ended, _ in flight] for flight in flights])
    burnt = np.array([[burnt for _, burnt in flight] for flight in flights])
    lost = np.flatnonzero(success[:, 1] & ~success[:, 2]).tolist()
    assert line.lost == len(lost)
    assert line.causes == str(lost)
    assert line.step.estimate == pytest.approx(success[:, 1].mean() - success[:, 2].mean())
    assert line.fall.estimate == pytest.approx(success[:, 0].mean() - success[:, 2].mean())
    assert line.fall.low <= line.fall.estimate <= line.fall.high
    both = success[:, 0] & success[:, 2]
    if both.any():
        assert line.price.estimate == pytest.approx((burnt[both, 2] - burnt[both, 0]).mean())
    else:
        assert np.isnan(line.price.estimate)
    begun = describe_layer(flown, "first", "single-divert", str)
    assert np.isnan([begun.step.estimate, begun.fall.estimate, begun.price.estimate]).all()
    assert lost_episodes(None, flown["first"]["single-divert"]) == np.flatnonzero(~success[:, 0]).tolist()


@pytest.mark.parametrize(
    ("first", "last", "verdict"),
    [
        (1, 1, Verdict.KEPT),
        (1, -1, Verdict.REVERSED),
        (-1, 1, Verdict.REVERSED),
        (1, 0, Verdict.LOST),
        (0, 1, Verdict.CONFIRMED),
        (0, -1, Verdict.TURNED),
        (0, 0, Verdict.NONE),
    ],
)
def test_an_order_is_judged_by_both_settings(first: int, last: int, verdict: Verdict) -> None:
    assert judge_order(first, last) is verdict
    lead = Interval(0.0, -0.1, 0.1)
    pair = PairRow("nearest-safe", "td3", (lead, lead), lead, verdict)
    assert list_changes([pair]) == ([] if verdict in (Verdict.KEPT, Verdict.NONE) else [pair])


def _layer(row: EpisodeRow, successes: dict[str, list[bool]]) -> Rows:
    return {name: _rows(row, ended, name) for name, ended in successes.items()}


def test_a_reversed_order_is_found_whichever_name_comes_first(row: EpisodeRow) -> None:
    many, few = [True] * 40, [k % 10 == 0 for k in range(40)]
    first = _layer(row, {"single-divert": few, "nearest-safe": many, "oracle": many})
    last = _layer(row, {"single-divert": many, "nearest-safe": few, "oracle": many})
    (pair,) = compare_order({"first": first, "second": last})
    assert (pair.better, pair.other, pair.verdict) == ("nearest-safe", "single-divert", Verdict.REVERSED)
    assert pair.fall.estimate == pytest.approx(1.8)
    assert pair.fall.low < 1.8 < pair.fall.high


def test_equal_policies_are_hardly_ever_told_apart(row: EpisodeRow) -> None:
    """Of five equal policies Holm lets some pair be decided in at most 5 % of studies.

    Forty studies with more than eight such are one alarm in 7000 at that rate.
    """
    rng, names = (
        np.random.default_rng(3),
        ("no-divert", "single-divert", "nearest-safe", "hazard-aware", "td3"),
    )
    pairs = list(combinations(names, 2))
    told = sum(
        any(decide_order(_layer(row, {name: (rng.random(60) < 0.8).tolist() for name in names}), pairs))
        for _ in range(40)
    )
    assert told <= 8


def test_a_fall_of_two_that_never_differ_has_no_ends(row: EpisodeRow) -> None:
    layer = _layer(row, {"single-divert": [True] * 9, "nearest-safe": [True] * 9})
    fall = extra_fall(layer, layer, "single-divert", "nearest-safe")
    assert fall.estimate == 0.0
    assert np.isnan([fall.low, fall.high]).all()


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
