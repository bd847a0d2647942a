"""Progress: plain lines without control characters, time left that comes down, a table that grows."""

import io
import re

import pytest
from rich.console import Console

from studies.compare import display
from studies.compare.display import Phase, show_phase


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands where its one value says."""
    now = [100.0]
    monkeypatch.setattr(display, "monotonic", lambda: now[0])
    return now


def test_time_left_is_the_expectation_until_a_step_tells_better(clock: list[float]) -> None:
    phase = Phase("work", 10, 50.0, started=100.0)
    assert phase.seconds_left == 50.0
    clock[0] = 120.0
    assert phase.seconds_left == 30.0
    phase.completed = 5  # 4 s a step were measured, 5 expected: half of each
    assert phase.seconds_left == pytest.approx(0.5 * 20.0 + 0.5 * 25.0)
    phase.completed = 10
    assert phase.describe_time() == "20 s"


def test_without_an_expectation_nothing_is_said_before_the_first_step(clock: list[float]) -> None:
    phase = Phase("work", 4, started=100.0)
    assert phase.seconds_left is None
    assert phase.describe_time() == "0 s"
    clock[0], phase.completed = 103.0, 1
    assert phase.describe_time() == "3 s, about 9 s left"


def test_what_was_kept_from_an_earlier_run_says_nothing_about_the_pace(clock: list[float]) -> None:
    phase = Phase("work", 100, completed=90, kept=90, started=100.0)
    clock[0] = 110.0
    assert phase.seconds_left is None
    phase.completed = 95
    assert phase.seconds_left == pytest.approx(10.0)


def test_unequal_steps_tell_nothing(clock: list[float]) -> None:
    phase = Phase("compiling", 6, 40.0, steady=False, started=100.0)
    clock[0], phase.completed = 110.0, 5
    assert phase.seconds_left == 30.0
    clock[0] = 150.0
    assert phase.describe_time() == "50 s, almost done"


def test_plain_output_has_few_lines_and_no_control_character(clock: list[float]) -> None:
    stream = io.StringIO()
    console = Console(file=stream, width=40)
    with show_phase(console, Phase("episodes", 1000, 500.0, started=100.0)) as shown:
        for _ in range(1000):
            clock[0] += 0.5
            shown.advance(
                1,
                pytest.fail,
                lambda: "safe site %: one 90.0, two 80.0, and so on beyond the width of the console",
            )
    text = stream.getvalue()
    lines = text.splitlines()
    assert re.search(r"[\x00-\x09\x0b-\x1f\x7f]", text) is None
    assert lines[0] == "episodes (about 500 s)"
    assert len(lines) == 11
    assert lines[5].startswith("episodes: 500/1000, 250 s, about 250 s left; safe site %: one 90.0, two 80.0")
    assert lines[-1].startswith("episodes: 1000/1000, 500 s; safe")


def test_quick_steps_do_not_flood_plain_output(clock: list[float]) -> None:
    stream = io.StringIO()
    with show_phase(Console(file=stream), Phase("report", 50, started=100.0)) as shown:
        for _ in range(50):
            clock[0] += 0.02
            shown.advance(1)
    assert stream.getvalue().splitlines() == ["report", "report: 50/50, 1 s"]


def test_a_terminal_shows_the_bar_and_the_table_and_clears_them(clock: list[float]) -> None:
    stream, made = io.StringIO(), []

    def table() -> str:
        made.append(clock[0])
        return "the table so far"

    console = Console(file=stream, force_terminal=True, width=80, height=20, color_system=None)
    with show_phase(console, Phase("episodes", 400, 8.0, started=100.0)) as shown:
        for _ in range(130):
            clock[0] += 0.02
            shown.advance(1, table, pytest.fail)
        shown.print("a line that stays")
    assert len(made) == 2  # once a second
    text = stream.getvalue()
    assert "130/400" in text
    assert "s left" in text
    assert "the table so far" in text
    visible = text[text.rindex("a line that stays") :]
    assert "\x1b[2K" in visible  # what was drawn is erased
