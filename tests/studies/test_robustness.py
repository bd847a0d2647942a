"""The robustness sweep: factors change one number, breaks are found where rows fall, files repeat."""

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from hda.flight.episode_row import EpisodeRow
from hda.task.presets import PRESETS, Preset
from studies.campaign.claimed_folder import FolderError
from studies.campaign.points import Rows
from studies.robustness.breaks import find_breaks
from studies.robustness.command import Robustness, plan_points, run_robustness
from studies.robustness.factor import Factor
from studies.robustness.factors import FACTORS
from studies.robustness.navigation_factors import NAVIGATION_FACTORS


def flat(preset: Preset) -> dict[str, float]:
    """Every number of a preset by its path."""
    found = {}

    def walk(value: object, name: str) -> None:
        if isinstance(value, dict):
            for key, part in value.items():
                walk(part, f"{name}.{key}")
        elif isinstance(value, int | float):
            found[name] = float(value)

    walk(asdict(preset), "")
    return found


def home(factor: Factor) -> Preset:
    """A preset that has the factor's number."""
    return next(preset for preset in PRESETS.values() if factor.applies(preset))


@pytest.mark.parametrize("preset", PRESETS.values(), ids=lambda preset: preset.name)
@pytest.mark.parametrize("factor", FACTORS.values(), ids=lambda factor: factor.name)
def test_the_own_value_changes_nothing(factor: Factor, preset: Preset) -> None:
    if not factor.applies(preset):
        with pytest.raises(ValueError, match=r"measures|filter|no navigation sensor"):
            factor.nominal(preset)
        return
    same = flat(factor.vary(preset, factor.nominal(preset)))
    assert same == pytest.approx(flat(preset), abs=1e-12)


@pytest.mark.parametrize("factor", FACTORS.values(), ids=lambda factor: factor.name)
def test_a_level_moves_its_factor_and_no_other(factor: Factor) -> None:
    preset = home(factor)
    for level in factor.levels:
        varied = factor.vary(preset, level)
        if factor.name != "speed":  # a factor on the preset's own
            assert factor.nominal(varied) == pytest.approx(level)
        for other in FACTORS.values():
            if other.name != factor.name and other.applies(preset):
                assert other.nominal(varied) == pytest.approx(other.nominal(preset)), other.name
    double = FACTORS["speed"].vary(PRESETS["paper"], 2.0).start
    assert (double.descent_speed.low, double.horizontal_speed.high) == (40.0, 20.0)


def test_fewer_levels_are_among_more() -> None:
    for factor in FACTORS.values():
        few, more = (factor.chosen(home(factor), count) for count in (1, 3))
        assert set(few) <= set(more)
        assert list(more) == sorted(more)


def test_looks_further_apart_leave_the_time_to_land() -> None:
    rules = FACTORS["observation-interval"].vary(PRESETS["paper"], 7.5).rules
    assert rules.decision_interval * rules.max_decisions >= 100.0


def rows(policy: str, failures: Sequence[int], outcome: str = "unsafe-site", episodes: int = 100) -> Rows:
    made = []
    for k in range(episodes):
        good = k not in failures
        ending = "success" if good else outcome
        numbers = (0.0, 0.1, 50.0, 75.0, 1e4, 0.5, 30.0, 6, 0, 500.0, 500.0)
        made.append(EpisodeRow(policy, k, 1000 + k % 18, ending, good, good, *numbers))
    return {policy: tuple(made)}


def test_a_policy_breaks_where_its_fall_is_certain_and_lasts() -> None:
    nominal = {**rows("a", [3]), **rows("b", [3])}
    levels = {
        0.1: {**rows("a", [3, 4]), **rows("b", range(3, 30))},
        0.2: {**rows("a", range(40), "crash"), **rows("b", [3])},
        0.3: {**rows("a", range(60), "crash"), **rows("b", range(20))},
    }
    first, second = find_breaks("noise", 0.05, nominal, levels)
    assert (first.policy, first.level, first.step, first.ending, first.more) == ("a", 0.2, 2, "crash", 40)
    assert first.episodes == tuple(k for k in range(40) if k != 3)
    assert first.drop.estimate == pytest.approx(0.39)
    assert 0.25 < first.drop.low < 0.39 < first.drop.high
    assert (second.policy, second.level, second.side) == ("b", 0.3, "above")  # at 0.2 it was well again


def test_both_sides_are_searched_outward() -> None:
    nominal = rows("a", [])
    levels = {1.0: rows("a", range(50)), 2.0: rows("a", range(30)), 9.0: rows("a", [])}
    (found,) = find_breaks("altitude", 5.0, nominal, levels)
    assert (found.side, found.level, found.step) == ("below", 2.0, 1)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Robustness]:
    options = Robustness(
        factors=("mass", "slant-limit"),
        policies=("no-divert", "single-divert"),
        episodes=10,
        levels=1,
        workers=1,
        out=tmp_path_factory.mktemp("robustness"),
    )
    run_robustness(options)
    return options.out, options


def test_every_factor_has_its_table_and_figure(swept: tuple[Path, Robustness]) -> None:
    out, _ = swept
    for factor in ("mass", "slant-limit"):
        assert (out / f"{factor}.png").read_bytes().startswith(b"\x89PNG")
        assert (out / f"{factor}.md").read_text().count("\n") == 6
        with (out / f"{factor}.csv").open() as stream:
            lines = list(csv.DictReader(stream))
        assert len(lines) == 4
        for line in lines:
            low, middle, high = (float(line[f"success_{end}"]) for end in ("low", "percent", "high"))
            assert low <= middle <= high
            assert int(line["episodes"]) == 10


def test_too_little_propellant_breaks_by_the_tank(swept: tuple[Path, Robustness]) -> None:
    out, _ = swept
    with (out / "breaks.csv").open() as stream:
        found = [line for line in csv.DictReader(stream) if line["factor"] == "mass"]
    assert [line["policy"] for line in found] == ["single-divert"]  # no-divert never lands safely
    assert found[0]["ending"] == "tank-empty"
    assert "the tank ran dry" in found[0]["causes"]


def test_resuming_flies_nothing_and_writes_the_same(swept: tuple[Path, Robustness]) -> None:
    out, options = swept
    before = (out / "mass.csv").read_bytes()
    with pytest.raises(FolderError, match="holds a study already"):
        run_robustness(replace(options, factors=("mass",), figures=False))
    run_robustness(replace(options, factors=("mass",), figures=False, resume=True))
    assert (out / "mass.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"episodes": 0}, "episodes must be at least 1"),
        ({"levels": 0}, "levels must be at least 1"),
        ({"factors": ("thrust-eror",)}, "did you mean thrust-error"),
        ({"factors": ()}, "factors must name at least one"),
        ({"preset": "papper"}, "did you mean paper"),
        ({"policies": ("singel-divert",)}, "did you mean single-divert"),
    ],
)
def test_a_wrong_option_is_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_points(Robustness(**options))


def test_the_sensors_of_a_filter_are_chosen_together() -> None:
    _, points = plan_points(Robustness(levels=1, preset="navigated", factors=("navigation",)))
    assert len(points) == 1 + sum(factor.applies(PRESETS["navigated"]) for factor in NAVIGATION_FACTORS)
    assert all(point.study.preset.navigation != points[0].study.preset.navigation for point in points[1:])
    _, turning = plan_points(Robustness(levels=1, preset="rigid-body", factors=("navigation",)))
    gained = {point.label.split("/")[0] for point in turning} - {
        point.label.split("/")[0] for point in points
    }
    assert gained == {"gyroscope-noise", "gyroscope-bias"}
    with pytest.raises(ValueError, match="'lidar' has no navigation filter"):
        plan_points(Robustness(levels=1, preset="lidar", factors=("navigation",)))


@pytest.mark.parametrize("name", ["gyroscope-noise", "gyroscope-bias"])
def test_only_a_body_that_turns_has_a_gyroscope(name: str) -> None:
    """Levels are in deg/sqrt(h) and deg/h, and 0 is a gyroscope that does not err."""
    factor, body = FACTORS[name], PRESETS["rigid-body"]
    assert [preset.name for preset in PRESETS.values() if factor.applies(preset)] == ["rigid-body"]
    assert factor.nominal(body) == pytest.approx({"gyroscope-noise": 0.07, "gyroscope-bias": 1.0}[name])
    navigation = factor.vary(body, 60.0).navigation
    assert navigation is not None
    assert navigation.gyroscope is not None
    gyroscope = navigation.gyroscope
    per_hour = {"gyroscope-noise": gyroscope.noise * 60.0, "gyroscope-bias": gyroscope.bias * 3600.0}
    assert math.degrees(per_hour[name]) == pytest.approx(60.0)
    with pytest.raises(ValueError, match="'navigated' has no navigation sensor 'gyroscope'"):
        plan_points(Robustness(levels=1, preset="navigated", factors=(name,)))


def test_every_factor_is_planned() -> None:
    _, points = plan_points(Robustness(levels=2))
    assert len(points) == 1 + 2 * sum(factor.applies(PRESETS["paper"]) for factor in FACTORS.values())
    _, ranging = plan_points(Robustness(levels=1, preset="lidar"))
    assert {"rays/64", "range-noise/10", "scan-time/5"} < {point.label for point in ranging}
    assert not any(point.label.startswith("map-noise") for point in ranging)
    assert len({point.label for point in points}) == len(points)
    assert math.isclose(points[1].study.preset.rules.thrust_error, 0.15)
