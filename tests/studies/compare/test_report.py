"""The report: one file, no network, the numbers of table.csv, and flights that end as their rows say."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hda.flight.episode import fly
from hda.flight.episode_row import EpisodeRow
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from studies.campaign.monte_carlo import Chunk, Study
from studies.compare.command import Comparison, compare
from studies.compare.flights import (
    FAILED_PER_POLICY,
    MOST_FLIGHTS,
    choose_flights,
    coarse_ground,
    pack_levels,
    picture_ground,
    picture_lander,
    reduce_flight,
)
from studies.compare.report import script_json
from studies.compare.scores import score_study
from tests.studies.compare.pages import POLICIES, Page, read_lines


@pytest.mark.parametrize(
    ("table", "file"), [("results-table", "table.csv"), ("difference-table", "paired.csv")]
)
def test_the_tables_hold_the_numbers_of_the_files(study: Path, table: str, file: str) -> None:
    page = Page((study / "report.html").read_text())
    shown = page.cells[table][1:]  # the first line is the head
    lines = read_lines(study / file)
    assert len(lines) == (4 if file == "table.csv" else 3)
    for line, cells in zip(lines, shown, strict=False):
        assert len(cells) >= 11
        assert cells == {name: line[name] for name in cells}
    for (name, row, column), text in page.shown.items():
        value = page.cells[name][row][column]
        if name == table and value and re.fullmatch(r"[+-]?[\d.]+", text.split()[0]):
            digits = len(text.split()[0].partition(".")[2])
            assert float(text.split()[0]) == pytest.approx(float(value), abs=0.5 * 10**-digits + 1e-9) or (
                column.endswith("_p") and float(text.split()[0]) == pytest.approx(float(value), rel=0.06)
            )


def test_the_file_stands_alone(study: Path) -> None:
    text = (study / "report.html").read_text()
    assert all(address.startswith(("#", "data:")) for address in Page(text).addresses)
    assert text.count("* plotly.js v") == 1
    assert len(text) < 15e6
    assert "default-src 'none'" in text


def test_the_whole_flights_stand_beside_it(study: Path) -> None:
    flights = re.findall(
        r'class="flight" data-policy="(.+?)" data-episode="(\d+)"', (study / "report.html").read_text()
    )
    assert len(flights) >= len(POLICIES)
    for policy, episode in flights:
        with np.load(study / "trajectories" / f"{policy}-{int(episode):06d}.npz", allow_pickle=False) as kept:
            assert kept["path"].shape == (kept["time"].size, 7)


def test_every_flight_ends_as_its_row_says(study: Path) -> None:
    rows = {(row["policy"], row["episode"]): row for row in read_lines(study / "episodes.csv")}
    pattern = (
        r'data-policy="(.+?)" data-episode="(\d+)" data-ending="(.+?)" data-words="(.+?)">(\{.*?\})</script>'
    )
    found = re.findall(pattern, (study / "report.html").read_text())
    assert found
    for policy, episode, ending, words, text in found:
        row, data = rows[policy, episode], json.loads(text)
        assert ending == row["outcome"]
        assert f"{float(row['touchdown_speed_mps']):.2f} m/s" in words
        assert data["touchdown"][0] == pytest.approx(float(row["touchdown_x_m"]), abs=0.006)
        assert data["time"][-1] == pytest.approx(float(row["flight_time_s"]), abs=0.006)
        assert len(data["looks"]) == int(row["decisions"])
        assert max(data["thrust"]) == pytest.approx(float(row["maximum_thrust_n"]), abs=0.51)


def test_a_flight_tells_the_page_how_its_lander_stands_and_the_page_has_the_lander() -> None:
    study = Study(PRESETS["paper"], ("nearest-safe",), 1)
    record = fly(study.make_policy("nearest-safe"), sample_scenario("paper", 0, 3))
    data = reduce_flight(record).data
    vectors = np.array(data["attitude"])
    assert vectors.shape == (3, len(data["time"]))
    turns = Rotation.from_quat(
        np.vstack([np.sqrt(1.0 - (vectors**2).sum(axis=0)), vectors]).T, scalar_first=True
    )
    kept = np.searchsorted(record.time, np.array(data["time"][:-1]) - 0.006)
    thrust = record.thrust[kept]
    size = np.linalg.norm(thrust, axis=1, keepdims=True)
    burns = size[:, 0] > 0.0
    axes = turns.apply([0.0, 0.0, 1.0])[:-1]
    np.testing.assert_allclose(axes[burns], (thrust / np.maximum(size, 1e-9))[burns], atol=0.005)
    lander = picture_lander(study.preset)
    assert not lander["rigid"]
    assert picture_lander(PRESETS["rigid-body"])["rigid"]
    for part in ("body", "plume"):
        surface = lander[part]
        assert max(max(corner) for corner in surface["triangles"]) < len(surface["x"])
        assert len(surface["colors"]) == len(surface["triangles"][0])
    assert max(surface["x"]) <= max(lander["body"]["x"]) <= 0.5 * lander["size"]
    assert lander["size"] == lander["enlarged"] * study.preset.criteria.footprint_diameter


def test_one_episode_of_one_policy_has_a_report(tmp_path: Path) -> None:
    compare(Comparison(episodes=1, policies=("single-divert",), workers=1, out=tmp_path, figures=False))
    text = (tmp_path / "report.html").read_text()
    assert "Only single-divert was flown" in text
    assert "Infinity" not in text[: text.index("plotly.js v")]  # no JSON that a browser refuses


def made_row(policy: str, episode: int, outcome: str) -> EpisodeRow:
    safe = outcome == "success"
    return EpisodeRow(
        policy, episode, 1000, outcome, safe, safe, 0, 0, 67.0, 71.0, 4500.0, 0, 45.0, 9, 0, 0, 0
    )


@given(data=st.data(), policies=st.integers(1, 30), episodes=st.integers(1, 30))
def test_few_flights_are_chosen_and_each_kind_of_failure_is_among_them(
    data: st.DataObject, policies: int, episodes: int
) -> None:
    names = [f"policy-{k}" for k in range(policies)]
    ends = st.sampled_from(["success", "unsafe-site", "crash", "hard-landing"])
    outcomes = data.draw(st.lists(ends, min_size=episodes, max_size=episodes))
    rows = [made_row(name, k, outcomes[k]) for name in names for k in range(episodes)]
    own = {name: [row for row in rows if row.policy == name] for name in names}
    chunk = Chunk(0, episodes, own, {name: np.ones(1) for name in names})
    chosen = choose_flights(score_study(names, names[0], [chunk]), names)
    assert len(set(chosen)) == len(chosen) <= MOST_FLIGHTS
    for name in names:
        own = [episode for policy, episode in chosen if policy == name]
        failed = [episode for episode in own if outcomes[episode] != "success"]
        assert 0 in own
        assert len(own) <= FAILED_PER_POLICY + 2
        if policies <= 20:
            assert {outcomes[k] for k in failed} == set(outcomes) - {"success"}


@given(values=st.lists(st.floats(0.0, 1.0, width=32), min_size=1, max_size=99))
def test_packed_maps_come_back_to_a_sixteenth(values: list[float]) -> None:
    packed = np.frombuffer(base64.b64decode(pack_levels(np.array(values, dtype=np.float32))), dtype=np.uint8)
    levels = np.stack([packed & 15, packed >> 4], axis=1).ravel()[: len(values)]
    assert np.abs(levels / 15.0 - np.array(values)).max() <= 0.5 / 15.0 + 1e-6


def test_the_ground_in_the_report_is_the_tile() -> None:
    study = Study(PRESETS["paper"], ("no-divert",), 1)
    scenario = sample_scenario("paper", 0, 3)
    ground = picture_ground(study, 3)
    west, south = ground["truth_corner"]
    bits = np.unpackbits(np.frombuffer(base64.b64decode(ground["truth"]), dtype=np.uint8), bitorder="little")
    truth = bits.reshape(ground["truth_cells"], ground["truth_cells"]).astype(bool)
    for row, column in ((0, 0), (57, 130), (199, 199), (100, 100)):
        position = np.array([west + column + 0.5, south + row + 0.5, 0.0])
        assert truth[row, column] == scenario.tile.is_safe(position)
    height, hazard = coarse_ground(scenario.tile, 500.0, 500.0)
    cells = scenario.tile.elevation[500 - 288 : 500 - 280, 500 - 288 : 500 - 280]
    assert height[0, 0] == pytest.approx(float(cells.mean()), abs=1e-4)
    assert hazard.mean() == pytest.approx(1.0 - scenario.tile.deterministic[212:788, 212:788].mean())
    _, outside = coarse_ground(scenario.tile, 0.0, 0.0)
    assert outside[0, 0] == 1.0


@given(text=st.text())
def test_no_string_can_leave_a_script(text: str) -> None:
    written = script_json({"words": text + "</script><!--"})
    assert "<" not in written
    assert json.loads(written)["words"] == text + "</script><!--"


@pytest.mark.slow
def test_a_thousand_episodes_stay_under_15_megabytes(tmp_path: Path) -> None:
    options = Comparison(episodes=1000, policies=POLICIES, out=tmp_path / "study", figures=False)
    compare(options)
    assert (tmp_path / "study" / "report.html").stat().st_size < 15e6
    rebuilt = (tmp_path / "study" / "report.html").read_text()
    compare(replace(options, resume=True))  # only the products are made again
    again = (tmp_path / "study" / "report.html").read_text()
    flights = r"<script type=\"application/json\" class=\"flight\".*?</script>"
    assert re.findall(flights, again) == re.findall(flights, rebuilt)
