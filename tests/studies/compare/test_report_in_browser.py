"""The report in Chromium: it fits a screen and a phone, reads without JavaScript, and its controls work."""

import base64
import re
import tempfile
from pathlib import Path
from typing import Any

import pytest

from tests.studies.compare.pages import (
    CONTRAST,
    assert_no_error,
    open_at,
    open_browser,
    read_lines,
    scroll_through,
    wait_for,
)


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
    folded = browser.execute_script("return document.getElementById('results-table').innerText")
    low = f"{float(read_lines(study / 'table.csv')[0]['safe_site_low']):.1f} to "
    assert low not in folded
    browser.find_element("css selector", "#table [type=checkbox]").click()
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
def test_the_lander_moves_with_the_time_and_the_newest_look_comes_with_it(
    browser: Any, page_address: str
) -> None:
    browser.get(page_address)
    browser.execute_script("document.getElementById('flight-space').scrollIntoView({block: 'center'})")
    wait_for(browser, "return document.getElementById('flight-space').dataset.shown")
    traces = "const t = document.getElementById('flight-space').data.slice(-4);"
    assert (
        browser.execute_script(f"{traces} return t.map(one => one.type)")
        == ["mesh3d"] * 2 + ["scatter3d"] * 2
    )
    feet = f"{traces} return Math.min(...t[0].z)"
    flight = (
        "const p = document.getElementById('policy').value, e = document.getElementById('episode').value;"
        "return JSON.parse([...document.querySelectorAll('script.flight')]"
        ".find(n => n.dataset.policy === p && n.dataset.episode === e).textContent)"
    )
    data = browser.execute_script(flight)
    assert browser.execute_script(feet) == pytest.approx(data["z"][0], abs=0.1)  # upright at the start
    node = len(data["time"]) // 2
    slide = "const s = document.getElementById('{}'); s.value = {}; s.dispatchEvent(new Event('input'))"
    browser.execute_script(slide.format("moment", node))
    wait_for(browser, f"{traces} return Math.abs(Math.min(...t[0].z) - {data['z'][node]}) < 0.1")
    text = browser.find_element("id", "moment-text").text
    assert text.startswith(f"{data['time'][node]:g} s: {data['thrust'][node]:g} N")
    newest = sum(view["time"] <= data["time"][node] + 0.011 for view in data["looks"])
    assert browser.find_element("id", "look-text").text.startswith(f"{newest} of ")
    browser.execute_script(slide.format("look", 1))
    shown = browser.execute_script("return Number(document.getElementById('moment').value)")
    assert data["time"][shown] == pytest.approx(data["looks"][1]["time"], abs=0.011)
    assert_no_error(browser)


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_it_fits_a_screen_and_a_phone(browser: Any, page_address: str, width: int) -> None:
    open_at(browser, page_address, width)
    overflow = "return document.documentElement.scrollWidth"
    assert browser.execute_script(overflow) <= width
    for box in browser.find_elements("css selector", ".table-controls [type=checkbox]"):
        browser.execute_script("arguments[0].click()", box)  # with the intervals too
    assert browser.execute_script(overflow) <= width
    assert_no_error(browser)


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_the_chart_of_safety_and_propellant_comes_first_and_its_labels_do_not_collide(
    browser: Any, page_address: str, width: int
) -> None:
    open_at(browser, page_address, width)
    order = "return [...document.querySelectorAll('main section')].map(section => section.id)"
    assert browser.execute_script(order)[:2] == ["headline", "table"]
    boxes = browser.execute_script(
        "return [...document.querySelectorAll('[data-chart=headline] .textpoint text')].map(text => {"
        " const box = text.getBoundingClientRect(); return [box.left, box.top, box.right, box.bottom]; })"
    )
    assert len(boxes) == 4
    for k, (left, top, right, bottom) in enumerate(boxes):
        assert left >= 0
        assert right <= width
        for other in boxes[:k]:
            apart = left >= other[2] or right <= other[0] or top >= other[3] or bottom <= other[1]
            assert apart, "two names of the paper's points overlap"


@pytest.mark.browser
def test_a_heading_sorts_and_a_word_filters(browser: Any, study: Path, page_address: str) -> None:
    browser.get(page_address)
    names = (
        "return [...document.querySelectorAll('#results-table tbody:not(.paper) tr')]"
        ".filter(line => !line.hidden).map(line => line.cells[0].dataset.value)"
    )
    lines = read_lines(study / "table.csv")
    flown = [line["policy"] for line in lines]
    assert browser.execute_script(names) == flown
    head = browser.find_elements("css selector", "#results-table thead th")[1]  # safe sites
    button = head.find_element("css selector", "button")
    ranked = sorted(lines, key=lambda line: -float(line["safe_site_percent"]))
    button.click()
    assert browser.execute_script(names) == [line["policy"] for line in ranked]
    assert head.get_attribute("aria-sort") == "descending"
    button.click()
    assert browser.execute_script(names)[0] == ranked[-1]["policy"]
    button.click()
    assert browser.execute_script(names) == flown
    assert head.get_attribute("aria-sort") is None
    field = browser.find_element("css selector", "#table [type=search]")
    field.send_keys("Divert")
    assert browser.execute_script(names) == [name for name in flown if "divert" in name]
    assert browser.find_element("css selector", "#table output").text == "2 of 4"
    paper = browser.find_elements("css selector", "#results-table .paper tr")
    assert all(line.is_displayed() for line in paper)


@pytest.mark.browser
def test_it_opens_on_a_failure_beside_a_landing_of_the_same_episode(
    browser: Any, study: Path, page_address: str
) -> None:
    browser.get(page_address)
    rows = {(row["policy"], row["episode"]): row for row in read_lines(study / "episodes.csv")}
    chosen = [
        browser.execute_script(f"return document.getElementById('{name}').value")
        for name in ("policy", "episode", "beside")
    ]
    assert rows[chosen[0], chosen[1]]["outcome"] != "success"
    assert rows[chosen[2], chosen[1]]["outcome"] == "success"
    words = browser.find_element("id", "words-beside").text
    assert words.startswith(f"Beside it: {chosen[2]} landed softly on safe ground")
    browser.execute_script("document.getElementById('flight-time').scrollIntoView({block: 'center'})")
    wait_for(browser, "return document.getElementById('flight-time').dataset.shown")
    drawn = "return document.getElementById('flight-time').data.map(line => line.name)"
    assert {chosen[0], chosen[2]} <= set(browser.execute_script(drawn))
    browser.execute_script(
        "const beside = document.getElementById('beside'); beside.value = '';"
        " beside.dispatchEvent(new Event('change'))"
    )
    wait_for(browser, f"return !({drawn[7:]}).includes('{chosen[2]}')")
    assert browser.find_element("id", "words-beside").text == ""
    assert_no_error(browser)


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_every_text_stands_out_from_what_is_behind_it(browser: Any, page_address: str, width: int) -> None:
    """WCAG 2.1, 1.4.3 (AA): a contrast of 4.5, words in charts and switched-off names among them."""
    open_at(browser, page_address, width)
    browser.execute_script("document.querySelector('#legend button').click()")
    texts = browser.execute_script(CONTRAST)
    assert len(texts) > 200
    assert [text for text in texts if text[0] < 4.5] == []


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
            notice = driver.find_element("css selector", "header .notice").text
            useless = driver.find_elements("css selector", ".chart, .controls, .legend, .look")
            assert len(useless) > 10
            assert not any(node.is_displayed() for node in useless)
            assert all(node.is_displayed() for node in driver.find_elements("css selector", ".range"))
        finally:
            driver.quit()
    for line in read_lines(study / "table.csv"):
        assert line["policy"] in text
        assert f"{float(line['propellant_percent']):.2f}" in text
    assert "need JavaScript" in notice
