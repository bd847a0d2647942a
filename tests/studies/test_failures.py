"""Failed episodes: what a look read is what the sensor gave, and causes follow from it."""

import csv
import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from guidance.rigid_body import DEFAULT_BODY
from hda.flight.episode import fly
from hda.flight.outcome import Ending
from hda.flight.record import EpisodeRecord
from hda.flight.touchdown_report import TouchdownFault
from hda.registry import make_policy
from hda.task.presets import PRESETS, Preset
from hda.task.rules import Range
from hda.task.scenario import Scenario, sample_scenario
from studies.campaign.claimed_folder import FolderError
from studies.campaign.monte_carlo import Study
from studies.compare.command import Comparison, compare
from studies.failures import causes, command
from studies.failures.causes import (
    Cause,
    Failure,
    explain_failure,
    find_remedies,
    last_change,
)
from studies.failures.command import Failures, read_study, show_failures
from studies.failures.readings import count_safe_cells, read_pixels
from studies.failures.table import describe_failure, write_markdown

HARD = PRESETS["hard"]


def failures(policy: str, preset: Preset, episodes: int) -> list[EpisodeRecord]:
    pilot = make_policy(policy)
    records = [fly(pilot, sample_scenario(preset, 0, k)) for k in range(episodes)]
    return [record for record in records if not record.outcome.success]


@pytest.mark.parametrize("error", [0.0, 30.0])
def test_read_pixels_are_those_of_the_sensor(error: float) -> None:
    """Without noise a look shows the true probability where it reads, and nothing elsewhere."""
    preset = replace(
        HARD,
        lidar=replace(HARD.lidar, noise=0.0),
        rules=replace(HARD.rules, navigation_position_error=error),
    )
    record = fly(make_policy("nearest-safe"), sample_scenario(preset, 1, 0))
    for index, observation in enumerate(record.observations):
        rows, columns, read = read_pixels(record, index)
        shown = np.zeros(read.shape, dtype=np.float32)
        where = np.nonzero(read)
        shown[where] = record.scenario.tile.probability[rows[where[0]], columns[where[1]]]
        assert np.array_equal(shown, observation.safety_map)


@pytest.mark.parametrize("limit", [8.0, 20.0])
def test_on_a_body_they_are_those_within_its_own_cone(limit: float) -> None:
    """It leans, so that a cone about the vertical would give other pixels in some look."""
    lidar = replace(HARD.lidar, noise=0.0, off_nadir_limit=math.radians(limit))
    preset = replace(HARD, name="with-a-body", lidar=lidar, body=DEFAULT_BODY)
    record = fly(make_policy("nearest-safe"), sample_scenario(preset, 1, 0))
    turned, upright_segments = 0, tuple(replace(segment, body_path=None) for segment in record.segments)
    for index, observation in enumerate(record.observations):
        rows, columns, read = read_pixels(record, index)
        shown = np.zeros(read.shape, dtype=np.float32)
        where = np.nonzero(read)
        shown[where] = record.scenario.tile.probability[rows[where[0]], columns[where[1]]]
        assert np.array_equal(shown, observation.safety_map)
        _, _, upright = read_pixels(replace(record, segments=upright_segments), index)
        turned += not np.array_equal(read, upright)
    assert turned > 0


def test_on_a_body_that_measures_ranges_the_map_alone_tells_what_was_read() -> None:
    lidar = replace(PRESETS["rigid-body"].lidar, off_nadir_limit=math.radians(5.7))
    preset = replace(PRESETS["rigid-body"], name="fixed-sensor", lidar=lidar)
    record = fly(make_policy("nearest-safe"), sample_scenario(preset, 1, 0))
    shown = 0
    for index, observation in enumerate(record.observations):
        rows, _, read = read_pixels(record, index)
        assert observation.ground is not None
        known = observation.ground.known_map(observation.target, observation.width, rows.size)
        assert not (read & ~known).any()
        assert read.sum() >= 0.9 * known.sum()  # all but those beyond the tile's edge
        shown += int(known.sum())
    assert shown > 0  # a look may show nothing


def test_a_landing_that_leans_alone_is_told_so() -> None:
    record = next(r for r in failures("single-divert", PRESETS["lidar"], 60) if r.outcome.report is not None)
    report = record.outcome.report
    assert report is not None
    for faults, told in (
        ((TouchdownFault.TILT,), True),
        ((TouchdownFault.TILT, TouchdownFault.TURN_RATE), True),
        ((TouchdownFault.TILT, TouchdownFault.VERTICAL_SPEED), False),
    ):
        ended = replace(record.outcome, ending=Ending.HARD_LANDING, report=replace(report, faults=faults))
        cause = explain_failure(replace(record, outcome=ended)).cause
        assert (cause is Cause.LEANT) == told


def test_causes_fit_the_record() -> None:
    found = failures("single-divert", HARD, 40)
    assert len(found) >= 5
    for record in found:
        failure = explain_failure(record)
        assert failure.safe_cells_in_reach <= failure.safe_cells_seen
        site = record.decisions[-1].site
        if failure.cause is Cause.NONE_SEEN:
            assert failure.safe_cells_seen == 0
        if failure.cause is Cause.MISSED:
            assert record.scenario.tile.is_safe(site)
        if failure.cause is Cause.MISREAD:
            assert failure.last_reading >= 0.5
            assert not record.scenario.tile.is_safe(site)
        assert failure.cause not in (Cause.TANK_EMPTY, Cause.TIMED_OUT)
        assert describe_failure(failure).endswith(".")


def test_blind_ground_is_none_seen() -> None:
    """A sensor that looks straight down only sees the ground below it."""
    blind = replace(HARD, lidar=replace(HARD.lidar, off_nadir_limit=math.radians(0.5)))
    causes = [explain_failure(record).cause for record in failures("no-divert", blind, 10)]
    assert Cause.NONE_SEEN in causes
    assert count_safe_cells(fly(make_policy("no-divert"), sample_scenario(HARD, 0, 0)))[0] > 0


def test_a_light_tank_runs_dry() -> None:
    poor = replace(HARD, start=replace(HARD.start, mass=Range(1165.0, 1165.0)))
    causes = {explain_failure(record).cause for record in failures("single-divert", poor, 4)}
    assert causes == {Cause.TANK_EMPTY}


def test_an_engine_that_errs_is_remedied_by_an_exact_one() -> None:
    wild = replace(HARD, rules=replace(HARD.rules, thrust_error=0.6))
    study = Study(wild, ("nearest-safe",), 12)
    remedies = [find_remedies(study, "nearest-safe", r) for r in failures("nearest-safe", wild, 12)]
    assert any("exact engine" in names for names in remedies)


def test_exact_navigation_is_a_remedy_where_a_filter_errs(monkeypatch: pytest.MonkeyPatch) -> None:
    own, flown = PRESETS["navigated"], []
    (record,) = failures("no-divert", own, 1)

    def watch(pilot: object, scenario: Scenario) -> EpisodeRecord:
        flown.append(scenario.preset)
        return record

    monkeypatch.setattr(causes, "fly", watch)
    assert find_remedies(Study(own, ("no-divert",), 1), "no-divert", record) == ()
    assert replace(own, navigation=None) in flown
    assert own not in flown


def test_a_success_has_no_cause() -> None:
    record = fly(make_policy("oracle"), sample_scenario("paper", 0, 0))
    assert record.outcome.success
    with pytest.raises(ValueError, match="is a success"):
        explain_failure(record)


def test_the_last_change_is_the_decision_that_chose_the_site() -> None:
    record = fly(make_policy("single-divert"), sample_scenario("hard", 0, 2))
    index = last_change(record)
    site = record.decisions[-1].site
    assert all(np.array_equal(decision.site, site) for decision in record.decisions[index:])
    assert index == 0 or not np.array_equal(record.decisions[index - 1].site, site)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("study")
    compare(
        Comparison(
            episodes=12, policies=("single-divert",), preset="hard", workers=1, out=out, figures=False,
            report=False, overwrite=True,
        )
    )  # fmt: skip
    return out


def test_every_failed_episode_is_shown(flown: Path) -> None:
    with (flown / "episodes.csv").open() as stream:
        failed = [int(row["episode"]) for row in csv.DictReader(stream) if row["success"] == "False"]
    assert read_study(flown)[1] == {"single-divert": failed}
    explained = show_failures(Failures(flown, most=2))
    assert [failure.episode for failure in explained["single-divert"]] == failed[:2]
    folder = flown / "failures"
    for episode in failed[:2]:
        assert (folder / f"single-divert-{episode:06d}.png").read_bytes().startswith(b"\x89PNG")
    text = (folder / "failures.md").read_text()
    assert f"{len(failed)} failed, the first 2 shown" in text
    assert len((folder / "failures.csv").read_text().splitlines()) == 3
    assert json.loads((folder / "provenance.json").read_text())["options"]["most"] == 2


@pytest.mark.parametrize("stop", [0, 1, 3])
def test_a_stopped_run_goes_on_where_it_was(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop: int
) -> None:
    """Stopped in a later failure, resumed, asked for more: the rows of a whole run, none explained twice."""
    whole = show_failures(Failures(flown, most=4, figures=False, out=tmp_path / "whole"))["single-divert"]
    done: list[int] = []

    def explain(record: EpisodeRecord) -> Failure:
        if len(done) == stop:
            raise KeyboardInterrupt
        done.append(record.scenario.streams.episode)
        return explain_failure(record)

    options = Failures(flown, most=4, figures=False, out=tmp_path / "parts")
    monkeypatch.setattr(command, "explain_failure", explain)
    with pytest.raises(KeyboardInterrupt):
        show_failures(options)
    monkeypatch.undo()
    with pytest.raises(FolderError, match=r"--resume.*--overwrite"):
        show_failures(options)
    resumed: list[int] = []
    monkeypatch.setattr(
        command,
        "explain_failure",
        lambda record: resumed.append(record.scenario.streams.episode) or explain_failure(record),
    )
    rows = show_failures(replace(options, resume=True))["single-divert"]
    assert done + resumed == [failure.episode for failure in whole]
    assert len(done) == stop
    assert [repr(row) for row in rows] == [repr(row) for row in whole]  # nan is not nan
    for name in ("failures.csv", "failures.md"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    sessions = json.loads((tmp_path / "parts" / "provenance.json").read_text())["work"]["sessions"]
    assert [entry["items"] for entry in sessions] == [count for count in (stop, len(whole) - stop) if count]


def test_only_a_missing_picture_is_drawn_again(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = Failures(flown, most=3, out=tmp_path)
    failures = show_failures(options)["single-divert"]
    pictures = {
        failure.episode: tmp_path / f"single-divert-{failure.episode:06d}.png" for failure in failures
    }
    before = {episode: path.read_bytes() for episode, path in pictures.items()}
    lost = failures[1].episode
    pictures[lost].unlink()
    again: list[int] = []
    monkeypatch.setattr(
        command,
        "fly",
        lambda pilot, scenario: again.append(scenario.streams.episode) or fly(pilot, scenario),
    )
    monkeypatch.setattr(command, "explain_failure", None)  # it is not asked
    show_failures(replace(options, resume=True))
    assert again == [lost]
    assert {episode: path.read_bytes() for episode, path in pictures.items()} == before
    monkeypatch.undo()
    (tmp_path / "mine.png").write_text("mine")
    show_failures(replace(options, most=1, overwrite=True))
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        "mine.png",
        pictures[failures[0].episode].name,
    ]


def test_failures_of_another_study_are_not_mixed_in(flown: Path, tmp_path: Path) -> None:
    show_failures(Failures(flown, most=1, figures=False, out=tmp_path / "failures"))
    other = tmp_path / "other"
    shutil.copytree(flown / "shards", other / "shards")
    held = other / "shards" / "study.json"
    held.write_text(held.read_text().replace('"study_seed": 0', '"study_seed": 1'))
    with pytest.raises(FolderError, match=r"options\.study_seed was 0, is 1"):
        show_failures(Failures(other, most=1, figures=False, out=tmp_path / "failures", resume=True))


def test_a_wrong_folder_or_policy_is_named(flown: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no study"):
        show_failures(Failures(tmp_path))
    with pytest.raises(ValueError, match="did you mean single-divert"):
        show_failures(Failures(flown, policies=("singel-divert",)))
    with pytest.raises(ValueError, match="most must be at least 1"):
        Failures(flown, most=0)


def test_what_failed_at_touchdowns_on_real_ground_is_named_and_counted(tmp_path: Path) -> None:
    found = [explain_failure(record) for record in failures("single-divert", PRESETS["lidar"], 30)]
    assert found
    for failure in found:
        assert failure.faults
        assert f"At the touchdown failed: {', '.join(failure.faults)}." in describe_failure(failure)
    study = Study(PRESETS["lidar"], ("single-divert",), 30)
    write_markdown(
        tmp_path / "failures.md", study, {"single-divert": found}, {"single-divert": len(found)}, False
    )
    text = (tmp_path / "failures.md").read_text()
    for fault in {fault for failure in found for fault in failure.faults}:
        assert f"{sum(fault in failure.faults for failure in found)} x {fault}" in text
    on_plane = [explain_failure(record) for record in failures("single-divert", HARD, 5)]
    assert all(failure.faults == () for failure in on_plane)
