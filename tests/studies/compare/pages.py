"""Reading a report: its tables as text, and the page in a real browser."""

from __future__ import annotations

import csv
import shutil
import time
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

POLICIES = ("no-divert", "single-divert", "nearest-safe", "oracle")
EPISODES = 24
"""What the study of the fixture flies."""


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


def open_at(driver: Any, address: str, width: int) -> None:
    """Open the page on a screen of that width [px], with everything drawn."""
    screen = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 600}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
    driver.get("about:blank")
    driver.get(address)
    scroll_through(driver)
    wait_for(
        driver, "return [...document.querySelectorAll('[data-chart]')].every(n => n.querySelector('svg'))"
    )


CONTRAST = """
const channel = (v) => { v /= 255; return v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; };
const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
const parse = (text) => { const n = numbers(text); return { rgb: n.slice(0, 3), a: n[3] ?? 1 }; };
function behind(node) {
  for (let up = node; up; up = up.parentElement) {
    const color = parse(getComputedStyle(up).backgroundColor);
    if (color.a > 0) return color.rgb;
  }
  return [255, 255, 255];
}
const found = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode.parentElement, style = getComputedStyle(node);
  if (!walker.currentNode.data.trim() || !node.getClientRects().length) continue;
  if (style.visibility !== "visible") continue;
  let opacity = 1;
  for (let up = node; up; up = up.parentElement) opacity *= Number(getComputedStyle(up).opacity);
  const drawn = node instanceof SVGElement ? style.fill : style.color;
  if (!/^rgb/.test(drawn)) continue;
  const color = parse(drawn), back = behind(node), a = opacity * color.a;
  const seen = color.rgb.map((v, k) => a * v + (1 - a) * back[k]);
  const [low, high] = [light(seen), light(back)].sort((x, y) => x - y);
  found.push([(high + 0.05) / (low + 0.05), walker.currentNode.data.trim().slice(0, 40), drawn]);
}
return found;
"""
