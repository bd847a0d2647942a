"""The smaller tables of the results pages against a fresh run: `make results-check`.

What is compared is deterministic and must be equal to the byte. Times are not compared.
"""

import csv
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs" / "results"


@dataclass(frozen=True)
class Check:
    """A table of a page and the command that makes it, or some rows of it.

    Attributes:
        page: under docs/results.
        table: what its mark on the page names: the whole table's command.
        command: what is run.
        written: the table in the folder that the command writes.
        rows: how many rows are compared.
    """

    page: str
    table: str
    command: str
    written: str
    rows: int


CHECKS = (
    Check(
        "comparison.md",
        "make compare",
        "studies.compare --policies no-divert single-divert nearest-safe oracle nearest-safe+convex td3"
        " td3-fixed-gain --no-report --no-figures",
        "table.md",
        7,
    ),
    Check("memory.md", "python -m studies.memory", "studies.memory", "memory.md", 12),
    Check("stability.md", "python -m studies.stability", "studies.stability", "gains.md", 25),
)


def marked_rows(text: str, table: str) -> list[str]:
    """Rows, head included, of the table that a mark names."""
    found = re.findall(
        rf"<!-- table: {re.escape(table)}(?:,[^>]*)? -->\n(.*?)<!-- end of table -->", text, re.DOTALL
    )
    assert len(found) == 1, table
    return [line for line in found[0].splitlines() if line.startswith("|")]


def run(command: str, out: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *command.split(), "--out", str(out)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=3600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("check", CHECKS, ids=[check.page for check in CHECKS])
def test_a_table_is_what_its_command_makes_today(check: Check, tmp_path: Path) -> None:
    run(check.command, tmp_path / "out")
    shown = marked_rows((RESULTS / check.page).read_text(encoding="utf-8"), check.table)
    fresh = (tmp_path / "out" / check.written).read_text(encoding="utf-8").splitlines()
    fresh = [line for line in fresh if line.startswith("|") and not line.startswith("| *the paper")]
    assert len(fresh) == check.rows + 2  # head and rule
    assert [line for line in fresh if line not in shown] == []


@pytest.mark.slow
def test_the_calibration_is_what_its_command_makes_today(tmp_path: Path) -> None:
    run("studies.calibrate --ground-episodes 1", tmp_path)
    with (tmp_path / "paper.csv").open() as file:
        (row,) = [row for row in csv.DictReader(file) if row["setting"].startswith("islands")]
    numbers = [
        f"{float(row['safe_site_percent']):.2f}",
        f"{float(row['propellant_percent']):.2f}",
        f"{float(row['touchdown_speed_mps']):.3f}",
        f"{float(row['miss_distance_m']):.3f}",
        f"{float(row['minimum_slant_angle_deg']):.2f}",
        f"{float(row['maximum_thrust_n']):.0f}",
    ]
    page = (ROOT / "docs" / "explanation" / "calibration.md").read_text(encoding="utf-8")
    assert f"| `paper`, tuning tiles, 6000 episodes | {' | '.join(numbers)} |" in page


@pytest.mark.slow
def test_own_ground_is_what_its_commands_make_today(tmp_path: Path) -> None:
    site = tmp_path / "site.npy"
    made = subprocess.run([sys.executable, "-m", "examples.own_terrain", str(site)], cwd=ROOT)
    assert made.returncode == 0
    command = "studies.compare --episodes 100 --policies single-divert nearest-safe --no-report --no-figures"
    run(f"{command} --terrain {site}", tmp_path / "out")
    table = (tmp_path / "out" / "table.md").read_text(encoding="utf-8")
    ratios = re.findall(r"^\| (?:single-divert|nearest-safe) \| ([\d.]+) (\([\d.-]+\))", table, re.MULTILINE)
    said = " and ".join(f"{value} % {interval}" for value, interval in ratios)
    page = " ".join((RESULTS / "comparison.md").read_text(encoding="utf-8").split())
    assert len(ratios) == 2
    assert said in page


def test_the_table_of_the_readme_is_that_of_the_comparison() -> None:
    """The same policies, with the clustered intervals and fewer columns."""
    full = {
        cells[0]: cells
        for cells in (
            [cell.strip() for cell in line.strip("|").split("|")]
            for line in marked_rows((RESULTS / "comparison.md").read_text(encoding="utf-8"), "make compare")
        )
    }
    rows = marked_rows((ROOT / "README.md").read_text(encoding="utf-8"), "make compare")[2:]
    assert 5 <= len(rows) <= 10
    for line in rows:
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert len(cells) == 5
        name = cells[0].split(",")[0]
        if name.startswith("*"):
            long = full["*the paper: TD3*"]
            assert cells[1:] == [long[1], long[2], long[7], long[6]]
            continue
        long = full.get(name) or full[f"{name} *"]
        clustered = re.sub(r" \([^)]*\)", "", long[1])
        assert cells[1:] == [clustered, long[2].split()[0], long[7], long[6]], name


@pytest.mark.parametrize("page", sorted(RESULTS.glob("*.md")), ids=lambda page: page.name)
def test_a_results_page_names_command_and_date(page: Path) -> None:
    if page.name == "commands.md":  # the list of all commands
        return
    text = page.read_text(encoding="utf-8")
    assert re.search(r"python -m studies|make compare", text)
    assert re.search(r"\b20\d\d-\d\d-\d\d\b", text)
    rows = re.findall(r"^\| code, date \| (.*) \|$", text, re.MULTILINE)
    assert rows, "no row names the code and the date"
    for row in rows:
        known = {
            commit: subprocess.run(["git", "cat-file", "-e", f"{commit}^{{commit}}"], cwd=ROOT).returncode
            == 0
            for commit in re.findall(r"\b[0-9a-f]{7}\b", row)
        }
        assert known, row
        assert all(known.values()), row
