"""`--quick`: six policies, a hundred episodes, and the report where somebody can see it."""

import sys
import webbrowser
from dataclasses import replace
from pathlib import Path

import pytest

from hda.registry import policy_entry
from studies.compare.command import QUICK, Comparison, compare, read_options
from studies.compare.quick import QUICK_FOLDER, QUICK_POLICIES, show_report
from studies.compare.table import REFERENCE_POLICY


def test_it_is_a_hundred_episodes_of_six_policies_that_fly_by_default() -> None:
    quick = read_options(["--quick"])
    assert (quick.episodes, quick.policies, quick.out) == (100, QUICK_POLICIES, QUICK_FOLDER)
    assert (quick.overwrite, quick.report, quick.figures) == (True, True, False)
    assert len(QUICK_POLICIES) == 6
    assert REFERENCE_POLICY in QUICK_POLICIES
    assert all(policy_entry(name).belongs_on("paper") for name in QUICK_POLICIES)


def test_what_was_asked_for_besides_stays() -> None:
    """Also where it is the value that the comparison has without `--quick`."""
    asked = ["--episodes", "1000", "--policies", "default", "--figures", "--no-report", "--preset", "hard"]
    quick = read_options(["--quick", *asked])
    assert (quick.episodes, quick.policies, quick.out) == (1000, ("default",), QUICK_FOLDER)
    assert (quick.figures, quick.report, quick.preset) == (True, False, "hard")


@pytest.mark.parametrize("given", ["--resume", "--out mine", f"--out {QUICK_FOLDER}"])
def test_a_study_is_not_replaced_where_a_folder_is_named_or_resumed(given: str) -> None:
    assert not read_options(["--quick", *given.split()]).overwrite


def test_without_it_nothing_is_shortened() -> None:
    assert read_options([]) == Comparison()
    assert read_options(["--quick", "--no-quick"]) == Comparison()


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A screen before a terminal, and the addresses that a browser is asked for."""
    addresses: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(webbrowser, "open", lambda address: not addresses.append(address))
    return addresses


def test_the_report_is_opened_where_there_is_a_screen(opened: list[str], tmp_path: Path) -> None:
    assert show_report(tmp_path / "report.html")
    assert opened == [(tmp_path / "report.html").as_uri()]


@pytest.mark.parametrize("lacking", ["screen", "terminal", "browser"])
def test_else_it_is_not(
    lacking: str, opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(address: str) -> bool:
        raise webbrowser.Error(address)

    if lacking == "screen":
        monkeypatch.delenv("DISPLAY")
    elif lacking == "terminal":
        monkeypatch.setattr(sys.stdout, "isatty", lambda: False)
    else:
        monkeypatch.setattr(webbrowser, "open", fail)
    assert not show_report(tmp_path / "report.html")
    assert opened == []


def test_its_path_is_printed_where_it_cannot_be_opened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = replace(QUICK, episodes=1, policies=("no-divert",), out=tmp_path, workers=1)
    compare(asked)
    assert f"open {tmp_path / 'report.html'}" in capsys.readouterr().out
    assert not (tmp_path / "figures").exists()
