"""What the README and the documentation show runs: Python blocks, and commands as far as their options."""

import importlib
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

from hda import registry
from studies.launcher import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
WRITTEN = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
PAGES = ("README.md", "CONTRIBUTING.md", "SECURITY.md", *WRITTEN)
MOST_LINES = 250
_COMMAND = re.compile(r"python -m ([a-z_]+(?:\.[a-z_]+)*)\b(?!\.[A-Z])((?: +[\w./:=+,-]+)*)")


def read_page(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def python_blocks(page: str) -> list[str]:
    """Those in lists too, where they are indented."""
    fences = re.findall(r"^( *)```python\n(.*?)^ *```", read_page(page), re.DOTALL | re.MULTILINE)
    return [dedent(block) for _, block in fences]


def test_no_page_and_no_source_holds_marks_of_a_merge() -> None:
    """Of all that git keeps, what was staged is read; a line of equals signs alone may underline a title."""
    marks = r"^(<{7}|>{7}|[|]{7})( |$)"
    found = subprocess.run(
        ["git", "grep", "-n", "-I", "-E", marks], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stdout, found.stderr) == (1, "", "")


@pytest.fixture
def empty_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to run in, from which the repository's examples can be imported.

    What a page registers is forgotten after it; the agents stay.
    """
    importlib.import_module("rl")
    registry.policy_names()
    monkeypatch.setattr(registry, "REGISTRY", registry.REGISTRY.copy())
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_blocks(page: str, names: dict[str, Any]) -> dict[str, Any]:
    """Run the blocks of a page in order, in one namespace."""
    names["__name__"] = "page"
    for block in python_blocks(page):
        exec(compile(block, page, "exec"), names)
    return names


def test_git_keeps_every_page() -> None:
    """One of them under a name that `.gitignore` hides would be missing from every clone."""
    kept = subprocess.run(["git", "ls-files", "docs"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(WRITTEN) <= set(kept.stdout.splitlines())


def test_the_readme_is_short() -> None:
    text = read_page("README.md")
    assert text.count("\n") <= 150
    assert len(text.encode()) <= 9000


def test_the_architecture_lists_every_cache() -> None:
    page = read_page("docs/explanation/architecture.md")
    sources = [
        path for package in ("guidance", "hda", "rl", "studies") for path in (ROOT / package).rglob("*.py")
    ]
    cached = re.compile(r"^ *@(?:functools\.)?(?:lru_)?cache\b", re.MULTILINE)
    modules = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for path in sources
        if cached.search(path.read_text(encoding="utf-8"))
    }
    assert len(modules) > 15
    assert {module for module in modules if f"`{module}`" not in page} == set()


@pytest.mark.parametrize("page", WRITTEN)
def test_no_page_is_long(page: str) -> None:
    assert read_page(page).count("\n") <= MOST_LINES


@pytest.mark.usefixtures("empty_place")
def test_every_python_block_of_the_readme_runs() -> None:
    assert len(python_blocks("README.md")) >= 3
    names = run_blocks("README.md", {})
    assert names["record"].outcome.touchdown_speed < 2.0
    assert names["plan"].propellant < 30.0


@pytest.mark.usefixtures("empty_place")
@pytest.mark.parametrize("page", [page for page in WRITTEN if python_blocks(page)])
def test_every_python_block_of_the_documentation_runs(page: str) -> None:
    run_blocks(page, {})


def test_python_block_of_contributing_runs() -> None:
    """It stands for a line among those of the registry, so it is given what they import."""
    from hda.policies.composition import ComposedPolicy
    from hda.policies.entry import PolicyEntry
    from hda.policies.planned_descent import PlannedDescent
    from hda.site_selection import NearestSafeSite

    blocks = python_blocks("CONTRIBUTING.md")
    assert len(blocks) == 1
    names = {
        "ComposedPolicy": ComposedPolicy,
        "MySelection": NearestSafeSite,
        "PlannedDescent": PlannedDescent,
        "PolicyEntry": PolicyEntry,
    }
    entry = eval(blocks[0], names)
    assert entry.make().name == entry.name


def test_pages_of_the_documentation_have_blocks() -> None:
    """A pattern that finds nothing must not pass."""
    assert sum(len(python_blocks(page)) for page in WRITTEN) >= 30


@pytest.mark.parametrize("page", [page for page in PAGES if "python -m " in read_page(page)])
def test_every_module_of_a_command_exists(page: str) -> None:
    for module, _ in _COMMAND.findall(read_page(page)):
        assert importlib.util.find_spec(module) is not None, f"{page} names {module}, which does not exist"


@pytest.mark.parametrize("page", [page for page in PAGES if "`make " in read_page(page)])
def test_every_target_of_make_exists(page: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z-]+)", read_page(page))) <= targets


@pytest.mark.parametrize("page", [page for page in PAGES if "lunar-hda " in read_page(page)])
def test_every_command_of_the_launcher_exists(page: str) -> None:
    named = re.findall(r"(?:`|^    )lunar-hda (?!needs)([a-z][a-z-]*)", read_page(page), re.MULTILINE)
    assert set(named) <= set(COMMANDS)


def commands() -> dict[str, set[str]]:
    """Module, with its subcommand if it has some -> options that a page gives it."""
    found: dict[str, set[str]] = {}
    for page in PAGES:
        for module, words in _COMMAND.findall(read_page(page)):
            first = words.split()[:1] if module in ("rl.train", "rl.figures") else []
            options = {word for word in words.split() if word.startswith("--")}
            found.setdefault(" ".join([module, *first]), set()).update(options)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(commands().keys() - {"examples.memory_task"}))  # no options
def test_every_option_of_a_command_exists(command: str) -> None:
    options = commands()[command] - {"--help", "--write"}
    shown = subprocess.run(
        [sys.executable, "-m", *command.split(), "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert shown.returncode == 0, shown.stderr
    assert {option for option in options if option not in shown.stdout} == set()


def newest_changes() -> str:
    """Of the change log the newest section alone: what older versions named may be gone."""
    return "## [".join(read_page("CHANGELOG.md").split("\n## [")[:2])


@pytest.mark.parametrize("page", [*PAGES, "CHANGELOG.md"])
def test_every_file_that_a_page_names_exists(page: str) -> None:
    text = newest_changes() if page == "CHANGELOG.md" else read_page(page)
    for name in re.findall(r"`((?:guidance|hda|rl|studies|tests|examples|docs)/[\w/.+-]*)`", text):
        if "NAME" not in name:
            assert (ROOT / name).exists(), f"{page} names {name}, which does not exist"
    for name in re.findall(r"\]\((?![a-z]+:|#)([^)#]+)(?:#[^)]*)?\)", text):
        home = ROOT if page.startswith("docs/") is False else (ROOT / page).parent
        assert (home / name).exists(), f"{page} links to {name}, which does not exist"
