"""What the README shows runs: every Python block, and every module that its commands name."""

import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parent.parent
PAGES = ("README.md", "CONTRIBUTING.md")


def test_every_python_block_of_the_readme_runs() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 3
    names: dict[str, Any] = {"__name__": "readme"}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert names["record"].outcome.touchdown_speed < 2.0
    assert names["plan"].propellant < 30.0
    assert names["safety"].deterministic.any()


@pytest.mark.parametrize("page", PAGES)
def test_every_module_of_a_command_exists(page: str) -> None:
    modules = set(re.findall(r"python -m ([a-z_]+(?:\.[a-z_]+)*)", (ROOT / page).read_text()))
    assert modules
    for module in modules:
        assert importlib.util.find_spec(module) is not None, f"{page} names {module}, which does not exist"


@pytest.mark.parametrize("page", PAGES)
def test_every_file_that_a_page_names_exists(page: str) -> None:
    text = (ROOT / page).read_text()
    for name in re.findall(r"`((?:guidance|hda|rl|studies|tests|examples|docs)/[\w/.+-]*)`", text):
        if "NAME" not in name:
            assert (ROOT / name).exists(), f"{page} names {name}, which does not exist"
    for name in re.findall(r"\]\((docs/[^)]+)\)", text):
        assert (ROOT / name).exists()
