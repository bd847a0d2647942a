"""The command line of the comparison: files, equal bytes, clear errors."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

from hda.registry import policy_names
from studies.compare.command import Comparison, compare, plan_study

EPISODES = 24


def run(out: Path, **options) -> Path:
    compare(Comparison(episodes=EPISODES, out=out, **options))
    return out


def contents(folder: Path) -> tuple[bytes, bytes]:
    return (folder / "episodes.csv").read_bytes(), (folder / "table.csv").read_bytes()


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    policies = ("no-divert", "single-divert", "nearest-safe", "oracle")
    return run(tmp_path_factory.mktemp("flown") / "study", workers=1, policies=policies)


def test_two_workers_give_the_same_bytes(flown: Path, tmp_path: Path) -> None:
    policies = ("no-divert", "single-divert", "nearest-safe", "oracle")
    again = run(tmp_path / "two", workers=2, policies=policies, figures=False, report=False)
    assert contents(again) == contents(flown)


def test_order_of_policies_changes_nothing(flown: Path, tmp_path: Path) -> None:
    policies = ("oracle", "nearest-safe", "no-divert", "single-divert", "oracle")
    again = run(tmp_path / "order", workers=1, policies=policies, figures=False, report=False)
    assert contents(again) == contents(flown)


@pytest.mark.parametrize("policy", ["nearest-safe", "single-divert", "oracle"])
def test_a_subset_gives_the_same_lines(flown: Path, tmp_path: Path, policy: str) -> None:
    alone = run(tmp_path / "alone", workers=1, policies=(policy,), figures=False, report=False)
    for name in ("episodes.csv", "table.csv"):
        lines = (flown / name).read_text().splitlines()
        expected = [lines[0], *(line for line in lines[1:] if line.startswith(f"{policy},"))]
        assert (alone / name).read_text().splitlines() == expected


def test_every_file_is_there(flown: Path) -> None:
    for name in (
        "episodes.csv",
        "episodes.parquet",
        "table.csv",
        "paired.csv",
        "timings.csv",
        "provenance.json",
    ):
        assert (flown / name).stat().st_size > 0
    assert (flown / "figures" / "histograms.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((flown / "figures").glob("trajectory-*.png"))) == 4
    assert len(list((flown / "trajectories").glob("*.npz"))) >= 4
    assert (flown / "report.html").read_text().startswith("<!doctype html>")


def test_provenance_says_how_to_make_it_again(flown: Path) -> None:
    provenance = json.loads((flown / "provenance.json").read_text())
    assert provenance["study"]["episodes"] == EPISODES
    assert provenance["study"]["study_seed"] == 0
    assert provenance["preset"]["rules"]["control_period"] > 0.0
    assert {"numpy", "numba", "lunar-hda"} <= set(provenance["versions"])


def test_every_policy_flew_every_episode(flown: Path) -> None:
    with (flown / "episodes.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    flights = [(row["policy"], int(row["episode"])) for row in rows]
    assert len(flights) == len(set(flights)) == 4 * EPISODES
    tiles = {(row["episode"], row["tile"]) for row in rows}
    assert len(tiles) == EPISODES  # the same ground for every policy


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (Comparison(episodes=0), "episodes must be at least 1"),
        (Comparison(episodes=-3), "episodes must be at least 1"),
        (Comparison(workers=0), "workers must be at least 1"),
        (Comparison(study_seed=-1), "study_seed must be at least 0"),
        (Comparison(preset="papper"), "did you mean paper"),
        (Comparison(policies=("singel-divert",)), "did you mean single-divert"),
        (Comparison(policies=()), "policies must name at least one"),
    ],
)
def test_a_wrong_option_is_named(options: Comparison, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan_study(options)


def test_all_means_every_registered_policy() -> None:
    assert plan_study(Comparison(policies=("all",))).policies == policy_names()


def test_an_unwritable_folder_is_refused_before_any_flight(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(OSError, match="file"):
        compare(Comparison(episodes=10**9, out=blocker / "study"))


def test_the_command_line_ends_with_one_line_and_code_2(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "studies.compare", "--policies", "singel-divert", "--out", str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 2
    assert ended.stderr.strip().startswith(
        "error: unknown policy 'singel-divert'; did you mean single-divert"
    )
    assert "Traceback" not in ended.stderr


def test_help_explains_every_option() -> None:
    command = [sys.executable, "-m", "studies.compare", "--help"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    for option in ("--episodes", "--policies", "--preset", "--study-seed", "--workers", "--out"):
        assert option in ended.stdout
