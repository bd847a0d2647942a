"""The report: one file, no network, the numbers of table.csv, and a browser of episodes that works."""

import base64
import csv
import json
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
)
from studies.compare.report import script_json
from studies.compare.scores import score_study

POLICIES = ("no-divert", "single-divert", "nearest-safe", "oracle")
EPISODES = 24


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report") / "study"
    compare(Comparison(episodes=EPISODES, policies=POLICIES, workers=1, out=out, figures=False))
    return out


class Page(HTMLParser):
    """Cells of every table, and every address that the page names outside its scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.cells: dict[str, list[dict[str, str]]] = {}
        self.addresses: list[str] = []
        self.shown: dict[tuple[str, int, str], str] = {}
        self._table = ""
        self._cell: tuple[str, int, str] | None = None
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = {name: value or "" for name, value in attrs}
        self.addresses += [named[name] for name in ("src", "href", "action") if name in named]
        if tag == "table":
            self._table = named.get("id", "")
        elif tag == "tr":
            self.cells.setdefault(self._table, []).append({})
        elif tag in ("th", "td") and "data-column" in named:
            self.cells[self._table][-1][named["data-column"]] = named["data-value"]
            self._cell = (self._table, len(self.cells[self._table]) - 1, named["data-column"])
            self.shown[self._cell] = ""

    def handle_endtag(self, tag: str) -> None:
        if tag in ("th", "td"):
            self._cell = None

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self.shown[self._cell] = f"{self.shown[self._cell]} {data.strip()}".strip()


def read_lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


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


# ---- in a real browser ----


@pytest.fixture(scope="module")
def page_address(study: Path) -> str:
    return (study / "report.html").as_uri()


def open_browser(profile: str, *arguments: str) -> Any:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    assert browser is not None, "chromium is missing: apt-get install chromium chromium-driver"
    assert driver is not None, "chromedriver is missing: apt-get install chromium chromium-driver"
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for argument in (
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--enable-unsafe-swiftshader",  # WebGL without a graphics card
        "--window-size=1300,900",
        f"--user-data-dir={profile}",
        *arguments,
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=Service(driver))


@pytest.fixture
def browser() -> Iterator[Any]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        driver = open_browser(profile)
        yield driver
        driver.quit()


def wait_for(driver: Any, script: str, seconds: float = 30.0) -> Any:
    deadline = time.monotonic() + seconds
    while not (value := driver.execute_script(script)):
        assert time.monotonic() < deadline, f"never true: {script}"
        time.sleep(0.05)
    return value


def assert_no_error(driver: Any) -> None:
    assert [entry for entry in driver.get_log("browser") if entry["level"] == "SEVERE"] == []


def scroll_through(driver: Any) -> None:
    height = driver.execute_script("return document.documentElement.scrollHeight")
    for top in range(0, height, 500):
        driver.execute_script(f"window.scrollTo(0, {top})")
        time.sleep(0.1)


@pytest.mark.browser
def test_every_chart_is_drawn_without_error_or_network(browser: Any, page_address: str) -> None:
    browser.get(page_address)
    timing = "const t = performance.getEntriesByType('navigation')[0]; return t.loadEventEnd"
    assert wait_for(browser, timing) > 0.0  # the page has loaded
    scroll_through(browser)
    charts = browser.execute_script("return document.querySelectorAll('[data-chart]').length")
    assert charts == 8
    wait_for(
        browser, "return [...document.querySelectorAll('[data-chart]')].every(n => n.querySelector('svg'))"
    )
    wait_for(browser, "return document.getElementById('flight-space').dataset.shown")
    assert browser.execute_script("return Boolean(document.querySelector('#flight-space canvas'))")
    loaded = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name)")
    assert [name for name in loaded if not name.startswith(("data:", "blob:"))] == []
    assert_no_error(browser)


@pytest.mark.browser
def test_the_shown_table_is_table_csv(browser: Any, study: Path, page_address: str) -> None:
    browser.get(page_address)
    shown = browser.execute_script(
        "return [...document.querySelectorAll('#results-table tbody:not(.paper) tr')].map(line =>"
        " [...line.children].map(cell => [cell.dataset.column, cell.dataset.value, cell.innerText]))"
    )
    for line, cells in zip(read_lines(study / "table.csv"), shown, strict=True):
        for column, value, text in cells:
            assert value == line[column]
            if column.endswith(("_percent", "_mps", "_deg", "_m", "_n")):
                digits = len(text.split()[0].partition(".")[2])
                assert text.split()[0] == f"{float(line[column]):.{digits}f}"
        assert cells[1][2].split()[1] == f"{float(line['safe_site_low']):.1f}"


@pytest.mark.browser
def test_the_episode_browser_switches(browser: Any, study: Path, page_address: str) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import Select

    browser.get(page_address)
    browser.execute_script("document.getElementById('flight-time').scrollIntoView({block: 'center'})")
    wait_for(browser, "return document.getElementById('flight-time').dataset.shown")
    altitude = "return document.getElementById('flight-time').data[0].y"
    first = browser.execute_script(altitude)
    Select(browser.find_element(By.ID, "policy")).select_by_value("single-divert")
    episodes = Select(browser.find_element(By.ID, "episode"))
    assert len(episodes.options) >= 2
    last = str(episodes.options[-1].get_attribute("value"))
    episodes.select_by_value(last)
    browser.execute_script("document.getElementById('flight-time').scrollIntoView({block: 'center'})")
    wait_for(
        browser, f"return document.getElementById('flight-time').dataset.shown === 'single-divert/{last}'"
    )
    second = browser.execute_script(altitude)
    assert second != first
    row = next(
        r
        for r in read_lines(study / "episodes.csv")
        if (r["policy"], r["episode"]) == ("single-divert", last)
    )
    words = browser.find_element(By.ID, "words").text
    assert words.startswith(f"Episode {last}: single-divert ")
    assert f"{float(row['touchdown_speed_mps']):.2f} m/s" in words

    browser.execute_script("document.getElementById('flight-map').scrollIntoView({block: 'center'})")
    wait_for(
        browser, f"return document.getElementById('flight-map').dataset.shown === 'single-divert/{last}'"
    )
    before = browser.find_element(By.ID, "look-text").text
    browser.execute_script(
        "const look = document.getElementById('look'); look.value = 3; look.dispatchEvent(new Event('input'))"
    )
    assert browser.find_element(By.ID, "look-text").text != before
    shown = browser.execute_script("return document.getElementById('flight-map').data[1].z.length")
    assert shown == 64
    browser.find_element(By.ID, "next").click()
    assert not browser.find_element(By.ID, "words").text.startswith(f"Episode {last}: single-divert ")
    browser.execute_script("location.hash = '#flight/oracle/0'")
    wait_for(browser, "return document.getElementById('words').innerText.startsWith('Episode 0: oracle')")
    assert_no_error(browser)


@pytest.mark.browser
def test_it_fits_a_phone(browser: Any, page_address: str) -> None:
    screen = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    browser.get(page_address)
    scroll_through(browser)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
    assert_no_error(browser)


@pytest.mark.browser
def test_it_prints(browser: Any, page_address: str) -> None:
    browser.get(page_address)
    pdf = base64.b64decode(browser.print_page())
    assert pdf.startswith(b"%PDF")
    pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
    assert 3 <= pages <= 30


@pytest.mark.browser
def test_the_tables_need_no_javascript(study: Path, page_address: str) -> None:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        driver = open_browser(profile, "--blink-settings=scriptEnabled=false")
        try:
            driver.get(page_address)
            text = driver.find_element("id", "results-table").text
            notice = driver.find_element("css selector", "noscript").text
        finally:
            driver.quit()
    for line in read_lines(study / "table.csv"):
        assert line["policy"] in text
        assert f"{float(line['propellant_percent']):.2f}" in text
    assert "need JavaScript" in notice


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
