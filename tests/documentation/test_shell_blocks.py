"""Every line of a shell block runs as it is written, in order, where a reader of the page would stand.

Lines that install or build are checked for what they name. Training is cut short, and says where.
"""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")))

_FEW_STEPS = "--steps 1020 --random-steps 1000 --validate-every 510 --validation-episodes 2"
SHORTER = {
    "python -m rl.train td3 --seed 0 --out runs/td3-0": (
        f"python -m rl.train td3 --seed 0 {_FEW_STEPS} --out runs/td3-0"
    ),
    "python -m rl.train td3 --seed 0 --steps 60000 --out runs/first": (
        f"python -m rl.train td3 --seed 0 {_FEW_STEPS} --out runs/first"
    ),
    "python -m rl.train export --name first --runs runs/first --averages 1 --candidates 2 --episodes 200"
    " --validation-episodes 200 --out runs": (
        "python -m rl.train export --name first --runs runs/first --averages 1 --candidates 2 --episodes 2"
        " --validation-episodes 2 --out runs"
    ),
    "python -m studies.compare --policies my_agent:AGENT td3 single-divert --episodes 200 --out mine": (
        "python -m studies.compare --policies my_agent:AGENT td3 single-divert --episodes 2 --out mine"
    ),
}
"""Line of a page -> what is run in its place: the same, with fewer steps or episodes."""


def shell_lines(page: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.splitlines() if line.strip()]


def write_files(page: str, folder: Path) -> None:
    """The Python blocks that a page tells its reader to save."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for name, block in re.findall(r"<!-- file: (\S+) -->\n```python\n(.*?)```", text, re.DOTALL):
        (folder / name).write_text(block)


def test_what_is_cut_short_stands_on_a_page() -> None:
    lines = {line for page in PAGES for line in shell_lines(page)}
    assert set(SHORTER) <= lines
    assert len(lines) > 10


@pytest.mark.parametrize("page", [page for page in PAGES if shell_lines(page)])
def test_what_is_installed_or_made_exists(page: str) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    for line in shell_lines(page):
        program, *words = line.split()
        assert program in ("pip", "make", "python", "lunar-hda"), line
        if program == "make":
            assert set(words) <= set(targets), line
        if program == "pip":
            assert set(re.findall(r"\[([a-z]+)\]", line)) <= set(extras), line


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if any("python -m" in x for x in shell_lines(page))])
def test_the_lines_of_a_page_run_in_order(page: str, tmp_path: Path) -> None:
    write_files(page, tmp_path)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for line in shell_lines(page):
        words = SHORTER.get(line, line).split()
        if words[:2] != ["python", "-m"]:
            continue
        done = subprocess.run(
            [sys.executable, *words[1:]],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=900,
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        assert "Traceback" not in done.stderr, line
