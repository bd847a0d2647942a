"""Another package `guidance` in front of ours is said in one line, at the import of any package of ours."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import guidance
from hda.own_guidance import require_own_guidance

ROOT = Path(guidance.__file__).parents[1]


def import_with(first: Path, statement: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(first), str(ROOT)])}
    command = [sys.executable, "-c", statement]
    return subprocess.run(command, capture_output=True, text=True, env=env, cwd=first, check=False)


def place_package(folder: Path) -> Path:
    """As that of PyPI: a package of another distribution, which must not even be run."""
    package = folder / "guidance"
    package.mkdir()
    init = package / "__init__.py"
    init.write_text("raise SystemExit('the foreign package was run')\n")
    return init


def place_module(folder: Path) -> Path:
    """A user's own file of that name beside the script."""
    file = folder / "guidance.py"
    file.write_text("raise SystemExit('the foreign module was run')\n")
    return file


def place_mixture(folder: Path) -> Path:
    """pip installed the other one last, into the same folder: our modules are there, its `__init__` is."""
    shutil.copytree(ROOT / "guidance", folder / "guidance", ignore=shutil.ignore_patterns("__pycache__"))
    init = folder / "guidance" / "__init__.py"
    init.write_text("raise SystemExit('the foreign package was run')\n")
    return init


@pytest.mark.parametrize("place", [place_package, place_module, place_mixture])
@pytest.mark.parametrize(
    "statement",
    ["import hda", "import rl", "import studies.compare.command", "from hda.task.presets import PRESETS"],
)
def test_a_foreign_guidance_is_named_with_the_way_out(place, statement, tmp_path):
    file = place(tmp_path)
    done = import_with(tmp_path, statement)
    assert done.returncode == 1, done
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("ImportError: lunar-hda needs its own package `guidance`")
    assert str(file) in last
    assert "virtual environment" in last


def test_ours_passes_wherever_it_stands(tmp_path):
    shutil.copytree(ROOT / "guidance", tmp_path / "guidance")
    assert import_with(tmp_path, "import hda, guidance; print(guidance.Lander())").returncode == 0
    require_own_guidance()


def test_no_guidance_at_all_is_said_too(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ImportError, match="finds none"):
        require_own_guidance()
