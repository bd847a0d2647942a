"""Without the extra `train` every shipped policy flies, and training says in one line what it needs."""

import importlib.util
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from hda.registry import policy_names
from rl.training_libraries import (
    TRAINING_LIBRARIES,
    TrainingLibrariesError,
    require_training_libraries,
)

ROOT = Path(__file__).parents[2]
BLOCK = f"""
import sys
from importlib.machinery import PathFinder
find, blocked = PathFinder.find_spec, {(*TRAINING_LIBRARIES, "pandas")}
PathFinder.find_spec = lambda name, *rest: None if name.partition(".")[0] in blocked else find(name, *rest)
"""
FLY_ALL = """
import json
import hda, rl
from hda.registry import policy_entry
flown = {}
for name in hda.policy_names():
    entry = policy_entry(name)
    preset = next((p for p in ("paper", "hard", "partial") if entry.belongs_on(p)), "paper")
    flown[name] = str(hda.fly(entry.make(), hda.sample_scenario(preset, episode=0)).outcome.ending)
print(json.dumps(flown))
"""
RUN = "import runpy; sys.argv = {words!r}; runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"


def run_blocked(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", BLOCK + code], cwd=ROOT, capture_output=True, text=True)


def run_command(module: str, *words: str) -> subprocess.CompletedProcess[str]:
    return run_blocked(RUN.format(module=module, words=[module, *words]))


def test_the_extra_is_what_training_needs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extra = [Requirement(line) for line in project["optional-dependencies"]["train"]]
    assert {line.name.replace("-", "_") for line in extra} == set(TRAINING_LIBRARIES)
    core = {Requirement(line).name.replace("-", "_") for line in project["dependencies"]}
    assert not core & {*TRAINING_LIBRARIES, "pandas"}


def test_every_shipped_policy_flies_without_them() -> None:
    import rl  # noqa: F401 - registers the agents

    done = run_blocked(FLY_ALL)
    assert done.returncode == 0, done.stderr
    flown = json.loads(done.stdout)
    assert set(policy_names()) <= set(flown)
    assert len([name for name in flown if name.startswith(("td3", "sac"))]) >= 5


@pytest.mark.parametrize(
    "words", [("autoencoder",), ("td3", "--out", "never"), ("td3-lstm", "--out", "never")], ids=" ".join
)
def test_training_names_the_extra_in_one_line(words: tuple[str, ...]) -> None:
    done = run_command("rl.train", *words)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install 'lunar-hda[train]'" in done.stderr
    assert "torch, stable_baselines3" in done.stderr
    assert not (ROOT / "never").exists()


@pytest.mark.parametrize(
    ("module", "words"), [("rl.training_speed", ()), ("rl.figures", ("reconstruction", "--out", "never.png"))]
)
def test_what_else_needs_them_names_it_too(module: str, words: tuple[str, ...]) -> None:
    done = run_command(module, *words)
    assert done.returncode == 2
    assert "lunar-hda[train]" in done.stderr
    assert "Traceback" not in done.stderr


def test_help_and_export_need_none_of_them() -> None:
    explained = run_command("rl.train", "--help")
    assert explained.returncode == 0, explained.stderr
    assert "td3-lstm-plus" in explained.stdout
    assert "lunar-hda[train]" in " ".join(explained.stdout.split())
    exported = run_command("rl.train", "export", "--name", "none", "--runs", "no-such-run")
    assert "no-such-run is not a run" in exported.stderr
    assert run_blocked("import studies.memory.command, rl.training.actor_export").returncode == 0


@pytest.mark.parametrize("module", ["rl.learning", "rl.learning.td3", "rl.training.run"])
def test_importing_what_learns_names_it(module: str) -> None:
    done = run_blocked(f"import {module}")
    assert "rl.training_libraries.TrainingLibrariesError" in done.stderr
    assert "lunar-hda[train]" in done.stderr


def test_only_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    require_training_libraries()
    find = importlib.util.find_spec
    hidden = "rl.training_libraries.find_spec"
    monkeypatch.setattr(hidden, lambda name: None if name == "tensorboard" else find(name))
    with pytest.raises(TrainingLibrariesError, match=r"^training needs tensorboard; install .*\[train\]'$"):
        require_training_libraries()
