"""Before the flights all code is compiled, in one process; what is shown changes nothing that is written."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from guidance.kernel import cache_folder
from hda import registry
from hda.registry import policy_entry
from hda.task.presets import PRESETS
from studies.campaign.monte_carlo import PolicyError, Study
from studies.compare.command import Comparison, compare
from studies.compare.flying import is_compiled, rehearse

RAISES = "tests.studies.compare.test_flying:Raising"


class Raising:
    """A policy that fails at its first decision."""

    name = "raising"

    def begin(self, view, rng):
        return None

    def decide(self, observation, memory):
        raise RuntimeError("no idea")


def test_a_rehearsal_says_what_an_episode_takes(capsys: pytest.CaptureFixture[str]) -> None:
    study = Study(PRESETS["paper"], ("no-divert", "single-divert"), 50)
    assert 0.0 < rehearse(study, Console()) < 5.0
    assert is_compiled(study)
    capsys.readouterr()
    rehearse(study, Console())
    assert capsys.readouterr().out.startswith("loading compiled code (about 5 s)\n")


def test_code_of_a_policy_counts_once_it_has_flown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.compare.flying.kernel_folder", lambda: tmp_path / "kernels")
    both = Study(PRESETS["paper"], ("no-divert", "single-divert", "nearest-safe+casadi"), 50)
    assert not is_compiled(both)
    rehearse(replace(both, policies=("no-divert",)), Console())
    assert is_compiled(replace(both, policies=("no-divert",)))
    assert not is_compiled(both)
    rehearse(both, Console())
    assert is_compiled(both)  # slow policies are not rehearsed


def test_code_of_a_policy_counts_on_the_preset_on_which_it_flew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.compare.flying.kernel_folder", lambda: tmp_path)
    paper, lidar = (Study(PRESETS[name], ("no-divert",), 50) for name in ("paper", "lidar"))
    rehearse(paper, Console())
    assert is_compiled(paper)
    assert not is_compiled(lidar)  # paper compiles neither ground nor ranges
    rehearse(lidar, Console())
    assert is_compiled(paper)
    assert is_compiled(lidar)
    assert (tmp_path / "rehearsed.txt").read_text().splitlines() == ["lidar no-divert", "paper no-divert"]


def test_a_policy_that_fails_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
    policy_entry(RAISES)  # as a command line that names it does
    study = Study(PRESETS["paper"], ("raising",), 50, paths=(RAISES,))
    with pytest.raises(PolicyError, match=r"policy 'raising' failed in episode 0 .* no idea"):
        rehearse(study, Console())


def test_the_products_do_not_depend_on_a_rehearsal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = {"policies": ("no-divert", "td3"), "episodes": 40, "figures": False, "report": False}
    compare(Comparison(**plain, workers=1, out=tmp_path / "rehearsed"))
    shown = capsys.readouterr().out
    assert "compil" in shown
    assert "safe site %: no-divert " in shown
    monkeypatch.setattr("studies.compare.flying._FEW_CHUNKS", 100)
    compare(Comparison(**plain, workers=1, out=tmp_path / "not"))
    assert "compil" not in capsys.readouterr().out
    for name in ("episodes.csv", "table.csv"):
        assert (tmp_path / "rehearsed" / name).read_bytes() == (tmp_path / "not" / name).read_bytes()


def test_a_finished_study_is_neither_rehearsed_nor_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = {"policies": ("no-divert",), "episodes": 40, "figures": False, "report": False, "workers": 1}
    compare(Comparison(**asked, out=tmp_path))
    capsys.readouterr()
    compare(Comparison(**asked, out=tmp_path, resume=True))
    shown = capsys.readouterr().out
    assert "compiled" not in shown
    assert "episodes:" not in shown


@pytest.mark.slow
def test_the_first_run_on_a_machine_says_that_it_compiles(tmp_path: Path) -> None:
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "terrain").symlink_to((cache_folder() / "terrain").resolve())
    words = ["--episodes", "2", "--policies", "no-divert", "--no-figures", "--no-report"]
    done = subprocess.run(
        [sys.executable, "-m", "studies.compare", *words, "--out", str(tmp_path / "study")],
        capture_output=True,
        text=True,
        env={**os.environ, "LUNAR_HDA_CACHE": str(tmp_path / "cache")},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("compiling, once for this version of the code (about 25 s)\n")
    assert "\x1b" not in done.stdout
    compiled = {path.name for path in (tmp_path / "cache" / "kernels").rglob("*.nbc")}
    assert any("enter_zem_zev" in name for name in compiled)
    unneeded = ("range_down", "find_contact", "hold_command")  # on paper
    assert not any(word in name for name in compiled for word in unneeded)


@pytest.mark.slow
def test_a_policy_that_fails_in_a_process_is_named_by_its_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
    monkeypatch.setattr("studies.compare.flying.kernel_folder", lambda: tmp_path)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    policy_entry(RAISES)
    study = Study(PRESETS["paper"], ("no-divert", "raising"), 50, paths=(RAISES,))
    with pytest.raises(PolicyError, match=r"policy 'raising' failed in episode 0 .* no idea"):
        rehearse(study, Console(), workers=2)
