"""What a release says of itself agrees everywhere, and its files are what an index accepts."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
BADGES = ROOT / "docs" / "pictures" / "badges"


def test_the_version_is_one() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    assert re.findall(r"^version: (.+)$", citation, re.MULTILINE) == [PROJECT["version"]]
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[0] in ("Unreleased", PROJECT["version"])
    assert PROJECT["version"] in headings
    minor = PROJECT["version"].rsplit(".", 1)[0]
    assert f"{minor}.x" in (ROOT / "SECURITY.md").read_text()


def test_the_citation_is_dated_as_the_change_log() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    (released,) = re.findall(r"^date-released: (\S+)$", citation, re.MULTILINE)
    assert f"## [{PROJECT['version']}] - {released}" in (ROOT / "CHANGELOG.md").read_text()


def test_the_badges_say_what_the_project_says() -> None:
    prefix = "Programming Language :: Python :: 3."
    minors = [word.removeprefix(prefix) for word in PROJECT["classifiers"] if word.startswith(prefix)]
    assert " | ".join(f"3.{minor}" for minor in minors) in (BADGES / "python.svg").read_text()
    assert f">{PROJECT['license']}<" in (BADGES / "licence.svg").read_text()
    assert "make test" in (BADGES / "tests.svg").read_text()
    readme = (ROOT / "README.md").read_text()
    assert all(f"docs/pictures/badges/{path.name}" in readme for path in BADGES.glob("*.svg"))


def test_the_film_at_the_head_is_small() -> None:
    assert (ROOT / "docs" / "pictures" / "flight.gif").stat().st_size < 1_500_000


@pytest.mark.slow
def test_wheel_and_sdist_are_what_an_index_accepts(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    built = subprocess.run(build, capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    files = sorted(str(path) for path in tmp_path.iterdir())
    assert [Path(file).suffix for file in files] == [".whl", ".gz"]
    check = [sys.executable, "-m", "twine", "check", "--strict", *files]
    checked = subprocess.run(check, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert checked.stdout.count("PASSED") == 2
