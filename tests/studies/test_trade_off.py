"""The trade-off study: the front, the sweep of the weights, the files."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hda
from hda import registry
from hda.flight.episode import fly
from hda.flight.episode_row import MEASURES
from hda.policies.composition import ComposedPolicy
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.site_price import HazardAwareWeights
from hda.registry import make_policy
from hda.task.presets import find_preset
from hda.task.scenario import sample_scenario
from studies.campaign.score import Score
from studies.columns import write_csv
from studies.statistics.ratios import Interval
from studies.trade_off.command import TradeOff, bound_preset, find_front, plan_points, run_trade_off
from studies.trade_off.table import BOUNDS_COLUMNS, TradeOffRow, describe_bounds, print_trade_off
from studies.trade_off.weights import SWEEP, change_weight, sweep_name, sweep_path


@pytest.fixture(autouse=True)
def forgetful_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    hda.policy_names()
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())


def row(
    name: str, safe: float, burnt: float, privileged: bool = False, ratio_name: str = "safe_site"
) -> TradeOffRow:
    ratio, other = Interval(safe, safe, safe), Interval(0.5, 0.5, 0.5)
    means: dict[str, Interval] = {name: Interval(burnt, burnt, burnt) for name in MEASURES}
    score = Score(
        episodes=100,
        safe_site=ratio if ratio_name == "safe_site" else other,
        safe_site_by_tile=ratio,
        success=ratio if ratio_name == "success" else other,
        success_by_tile=ratio,
        success_at_least=safe,
        success_at_least_by_tile=safe,
        means=means,
        means_by_tile=means,
        fallbacks=0,
    )
    return TradeOffRow("paper", "validation", name, "", float("nan"), privileged, score, ratio=ratio_name)


@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), st.booleans()), min_size=1, max_size=12),
    st.sampled_from(("safe_site", "success")),
)
def test_the_front_is_what_nothing_open_beats(places: list[tuple[int, int, bool]], ratio: str) -> None:
    rows = [
        row(f"p{k}", safe / 5.0, float(burnt), seen, ratio) for k, (safe, burnt, seen) in enumerate(places)
    ]
    front = find_front(rows)
    for k, (safe, burnt, seen) in enumerate(places):
        beaten = any(
            not their_seen and s >= safe and b <= burnt and (s > safe or b < burnt)
            for s, b, their_seen in places
        )
        assert (f"p{k}" in front) == (not seen and not beaten)


def test_a_weight_at_its_default_flies_as_hazard_aware() -> None:
    default = HazardAwareWeights().failure_cost
    scenario = sample_scenario("paper", 5, 0, "tuning")
    plain = fly(make_policy("hazard-aware"), scenario)
    same = fly(make_policy(sweep_path("failure_cost", default)), scenario)
    assert same.policy == sweep_name("failure_cost", default)
    assert np.array_equal(same.path, plain.path)


def test_a_changed_weight_is_flown_by_the_law_of_hazard_aware() -> None:
    plain = make_policy("hazard-aware")
    assert isinstance(plain, ComposedPolicy)
    assert change_weight("failure_cost", 20.0).guidance_law == plain.guidance_law


def test_sweeps_leave_the_default_out() -> None:
    for weight, values in SWEEP.items():
        assert getattr(HazardAwareWeights(), weight) not in values
        for value in values:
            selection = change_weight(weight, value).site_selection
            assert isinstance(selection, HazardAwareSite)
            assert getattr(selection.weights, weight) == value


@pytest.mark.parametrize("path", ["failure_csot=3", "failure_cost=-1", "failure_cost=x", "nothing"])
def test_a_wrong_weight_is_no_policy(path: str) -> None:
    with pytest.raises(ValueError, match="policy"):
        make_policy(f"studies.trade_off.weights:{path}")


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    hda.policy_names()
    folder = tmp_path_factory.mktemp("trade_off")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
        run_trade_off(
            TradeOff(
                presets=("paper",),
                policies=("no-divert", "single-divert", "oracle"),
                weights=("commit_time",),
                episodes=10,
                sweep_episodes=2,
                reference="single-divert",
                workers=1,
                out=folder,
            )
        )
    return folder


def test_policies_fly_validation_and_weights_fly_tuning(out: Path) -> None:
    with (out / "table.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    splits = {line["policy"]: line["split"] for line in lines}
    assert splits == {
        "no-divert": "validation",
        "single-divert": "validation",
        "oracle": "validation",
        "hazard-aware": "tuning",
        "hazard-aware.commit_time-0.5": "tuning",
        "hazard-aware.commit_time-7.5": "tuning",
    }
    assert [line["value"] for line in lines if line["weight"] == "commit_time"] == ["0.5", "7.5"]
    assert not any(line["on_front"] == "True" for line in lines if line["policy"] == "oracle")
    assert any(line["on_front"] == "True" for line in lines if line["policy"] == "single-divert")


def test_policies_are_held_against_the_reference(out: Path) -> None:
    with (out / "standings.csv").open() as stream:
        lines = {line["policy"]: line for line in csv.DictReader(stream)}
    with (out / "paper" / "policies" / "episodes.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    failures = {
        name: sum(row["success"] == "False" for row in rows if row["policy"] == name) for name in lines
    }
    assert list(lines) == ["no-divert", "single-divert", "oracle"]
    assert (lines["single-divert"]["standing"], lines["single-divert"]["fails_more_points"]) == (
        "the reference",
        "",
    )
    for name in ("no-divert", "oracle"):
        more = 100.0 * (failures[name] - failures["single-divert"]) / 10
        assert float(lines[name]["fails_more_points"]) == pytest.approx(more)
    assert "| the reference |" in (out / "standings.md").read_text()


def test_every_point_leaves_its_rows_and_where_they_come_from(out: Path) -> None:
    assert json.loads((out / "provenance.json").read_text())["options"]["sweep_episodes"] == 2
    for label, lines in (("paper/policies", 3 * 10), ("paper/weights", 3 * 2)):
        with (out / label / "episodes.csv").open() as stream:
            assert len(list(csv.DictReader(stream))) == lines
        told = json.loads((out / label / "provenance.json").read_text())
        assert told["study"]["split"] == ("validation" if label == "paper/policies" else "tuning")
        assert sum(session["episodes"] for session in told["flight"]["sessions"]) == lines // 3


def test_no_policy_beats_the_bounds(out: Path) -> None:
    with (out / "bounds.csv").open() as stream:
        (bounds,) = csv.DictReader(stream)
    with (out / "table.csv").open() as stream:
        flown = [line for line in csv.DictReader(stream) if line["split"] == "validation"]
    assert all(float(line["success_percent"]) <= float(bounds["ceiling_percent"]) for line in flown)
    assert all(float(line["propellant_percent"]) >= float(bounds["floor_percent"]) for line in flown)


@pytest.mark.parametrize(("preset", "bounded"), [("paper", True), ("lidar", False)])
def test_a_preset_that_measures_ranges_has_a_floor_and_says_why_no_ceiling(
    preset: str, bounded: bool, tmp_path: Path
) -> None:
    bounds = bound_preset(find_preset(preset), TradeOff(episodes=2))
    assert (bounds.ceiling is not None) == bounded
    assert bounds.episodes == 2
    assert 20.0 < bounds.floor.estimate < 60.0
    assert ("no ceiling, as a sensor that measures ranges" in describe_bounds(bounds)) == (not bounded)
    write_csv(tmp_path / "bounds.csv", BOUNDS_COLUMNS, [bounds])
    with (tmp_path / "bounds.csv").open() as stream:
        (line,) = csv.DictReader(stream)
    assert (line["ceiling_percent"] == "") == (not bounded)
    assert float(line["floor_percent"]) == pytest.approx(bounds.floor.estimate)


def test_what_a_run_does_not_write_is_gone_from_its_folder(tmp_path: Path) -> None:
    options = TradeOff(
        presets=("paper",),
        policies=("no-divert", "single-divert"),
        weights=("none",),
        episodes=2,
        reference="single-divert",
        workers=1,
        out=tmp_path / "traded",
    )
    products = {"bounds.csv", "standings.csv", "standings.md", "trade-off.png"}

    def left() -> set[str]:
        return products & {path.name for path in options.out.iterdir()}

    run_trade_off(options)
    assert left() == products
    run_trade_off(replace(options, resume=True, bounds=False, ratio="success"))
    assert left() == products - {"bounds.csv"}
    assert "| success | yes |" in (options.out / "table.md").read_text()
    run_trade_off(replace(options, resume=True, reference=None, figures=False))
    assert left() == {"bounds.csv"}
    assert "| safe site | yes |" in (options.out / "table.md").read_text()


def test_the_title_names_the_ratio_that_is_set_against_propellant(capsys: pytest.CaptureFixture[str]) -> None:
    for name, words in (("safe_site", "safe site"), ("success", "success")):
        print_trade_off([row("oracle", 0.9, 50.0, True, name)], [])
        assert f"{words} against propellant" in capsys.readouterr().out


def test_the_picture_is_there(out: Path) -> None:
    assert (out / "trade-off.png").read_bytes().startswith(b"\x89PNG")
    assert "| paper | tuning | hazard-aware.commit_time-7.5 |" in (out / "table.md").read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"weights": ("failure_csot",)}, "did you mean failure_cost"),
        ({"weights": ()}, "weights must name at least one"),
        ({"presets": ("papper",)}, "did you mean paper"),
        ({"reference": "hazard-awar"}, "reference on paper: policy 'hazard-awar'; did you mean hazard-aware"),
        ({"policies": ("rivals",), "reference": "hazard-aware"}, "reference on paper: policy 'hazard-aware'"),
    ],
)
def test_a_wrong_option_is_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_points(TradeOff(**options))


def test_without_weights_only_policies_fly() -> None:
    points = plan_points(TradeOff(weights=("none",)))
    assert [point.label for point in points] == ["paper/policies", "hard/policies"]
