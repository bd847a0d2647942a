"""Verification of a results folder: ours is accepted; what was changed is refused, by name."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.campaign.claimed_folder import Existing
from studies.campaign.points import Point, fly_points
from studies.campaign.provenance import CHECKSUMS, digest_files, write_checksums
from studies.compare.command import Comparison, compare, plan_study
from studies.failures.command import Failures, show_failures
from studies.verify.command import Verify, main, show_verification
from studies.verify.entries import LEADERBOARD_HEADINGS, entry_faults, leaderboard_lines
from studies.verify.flights import chance_of_notice, choose_episodes
from studies.verify.held_results import HeldResultsError, read_results
from studies.verify.verification import Verification, verify_results

EPISODES = 12
POLICIES = ("no-divert", "single-divert", "nearest-safe")


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("verified") / "study"
    compare(Comparison(episodes=EPISODES, policies=POLICIES, workers=1, out=out, figures=False))
    return out


@pytest.fixture
def copied(flown: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(flown, tmp_path / "study"))


def verify(folder: Path, **options) -> Verification:
    return verify_results(folder, np.random.default_rng(1), **options)


def refusals(found: Verification) -> list[str]:
    assert not found.accepted
    return [f"{finding.check}: {finding.words}" for finding in found.findings if not finding.passed]


def edit(path: Path, change: Callable[[str], str], sealed: bool = True) -> None:
    """Change a file; a forger writes the checksums anew."""
    before = path.read_text()
    path.write_text(change(before))
    assert path.read_text() != before
    if sealed:
        write_checksums(path.parent)


def test_our_own_folder_is_accepted(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(flown).flown == tuple(range(EPISODES))
    assert show_verification(Verify(flown, seed=3, workers=1))
    printed = capsys.readouterr().out
    assert f"{flown} is verified" in printed
    assert "not checked, but for its checksum: report.html, timings.csv, trajectories/" in printed
    assert "12 of 12 episodes, drawn by seed 3" in printed


def test_a_small_folder_has_no_entry(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert not show_verification(Verify(flown, seed=3, workers=1, entry=True))
    assert "no entry for the leaderboard: it has fewer than 1000 episodes" in capsys.readouterr().out


def found_again(flown: Path, episodes: int, commit: str | None, **told: Any) -> Verification:
    """As if so many episodes of a study had been flown, and flown again."""
    found = verify(flown, least=1)
    assert found.results is not None
    study = replace(found.results.study, episodes=episodes, **told)
    results = replace(found.results, study=study, provenance={"git_commit": commit})
    return replace(found, results=results, flown=tuple(range(episodes)))


def test_only_some_folders_may_stand_on_the_leaderboard(flown: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.verify.entries.git_commit", lambda: "abc")
    good = found_again(flown, 1000, "abc")
    assert entry_faults(good) == []
    assert entry_faults(replace(good, flown=(1, 2))) == ["2 of its episodes were flown again, not all"]
    assert entry_faults(found_again(flown, 1000, "abc", split="tuning")) == ["it was flown on tuning tiles"]
    assert entry_faults(found_again(flown, 1000, "abc", study_seed=7)) == ["its study seed is 7, not 0"]
    assert entry_faults(found_again(flown, 1000, "abd")) == ["it was flown at commit abd, and here is abc"]
    monkeypatch.setattr("studies.verify.entries.git_commit", lambda: "abc+changes")
    dirty = found_again(flown, 1000, "abc+changes")
    assert entry_faults(dirty) == ["its commit has changes that nobody else has"]
    monkeypatch.setattr("studies.verify.entries.git_commit", lambda: None)
    assert entry_faults(found_again(flown, 1000, None)) == ["it was flown at commit None, and here is None"]


def test_lines_of_the_leaderboard_fit_its_page(flown: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "leaderboard.md").read_text()
    assert f"| {' | '.join(LEADERBOARD_HEADINGS)} |" in page
    lines = leaderboard_lines(found_again(flown, EPISODES, "0123456789"))
    assert len(lines) == len(POLICIES)
    assert lines[0].startswith("| nearest-safe | paper | 12 validation | 100.0 [")
    assert "| 0123456 |" in lines[0]
    assert {line.count("|") for line in lines} == {len(LEADERBOARD_HEADINGS) + 1}


def test_a_point_of_another_study_is_accepted_too(tmp_path: Path) -> None:
    study = plan_study(Comparison(episodes=3, policies=("nearest-safe",), split="tuning"))
    fly_points(tmp_path, [Point("alone", study)], Existing.REFUSE, 1)
    assert verify(tmp_path / "alone").accepted


def test_rows_without_the_reference_policy_are_accepted(tmp_path: Path) -> None:
    out = tmp_path / "alone"
    compare(Comparison(episodes=3, policies=("no-divert",), workers=1, out=out, figures=False, report=False))
    assert verify(out).accepted


def test_shards_need_not_be_handed_in(copied: Path) -> None:
    shutil.rmtree(copied / "shards")
    assert verify(copied, least=1).accepted


@pytest.mark.parametrize(
    "name",
    [
        "checksums.sha256",
        "episodes.csv",
        "episodes.parquet",
        "paired.csv",
        "provenance.json",
        "report.html",
        "shards/study.json",
        "table.csv",
        "table.md",
        "timings.csv",
    ],
)
def test_one_changed_byte_is_refused(copied: Path, name: str) -> None:
    path = copied / name
    content = bytearray(path.read_bytes())
    content[np.random.default_rng(len(content)).integers(len(content))] ^= 1
    path.write_bytes(content)
    told = refusals(verify(copied))
    assert told[0].startswith("checksums: ")
    assert name == CHECKSUMS or name in told[0]


def test_a_missing_file_is_refused(copied: Path) -> None:
    (copied / "table.md").unlink()
    assert refusals(verify(copied)) == ["checksums: table.md is missing"]


def test_a_forged_flight_is_found_by_flying_it(copied: Path) -> None:
    def lighten(text: str) -> str:
        lines = text.splitlines(keepends=True)
        place = next(k for k, line in enumerate(lines) if line.startswith("nearest-safe,7,"))
        cells = lines[place].split(",")
        cells[13] = str(int(cells[13]) + 1)  # decisions: on no table
        lines[place] = ",".join(cells)
        return "".join(lines)

    (copied / "episodes.parquet").unlink()
    edit(copied / "episodes.csv", lighten)
    (words,) = refusals(verify(copied))
    assert words.startswith("flights: 1 of 36 flights differ: nearest-safe, episode 7: decisions ")


def flatter(text: str) -> str:
    return text.replace("nearest-safe,paper,12,100", "nearest-safe,paper,12,99")


def test_tables_must_follow_from_the_episodes(copied: Path) -> None:
    edit(copied / "table.csv", flatter)
    (words,) = refusals(verify(copied))
    assert words.startswith("table.csv: nearest-safe, safe_site_percent: 99 for 100")


def test_a_flattered_document_is_refused(copied: Path) -> None:
    edit(copied / "table.md", lambda text: text.replace("| nearest-safe | 100.0", "| nearest-safe | 99.0"))
    (words,) = refusals(verify(copied))
    assert words.startswith("table.md: line 5 is ")


def test_a_folder_with_figures_and_failures_that_was_resumed_is_accepted(copied: Path) -> None:
    compare(Comparison(episodes=EPISODES, policies=POLICIES, workers=1, out=copied, resume=True))
    assert any((copied / "figures").iterdir())
    show_failures(Failures(copied, policies=("no-divert",), most=1))
    assert verify(copied, least=1).accepted


def test_nothing_flies_where_the_folder_contradicts_itself(copied: Path) -> None:
    edit(copied / "table.csv", flatter)
    assert verify(copied).flown == ()


def change_provenance(folder: Path, change: Callable[[dict], object]) -> None:
    def edited(text: str) -> str:
        held = json.loads(text)
        change(held)
        return json.dumps(held)

    edit(folder / "provenance.json", edited)


def test_another_version_is_refused(copied: Path) -> None:
    change_provenance(copied, lambda held: held["versions"].update(numba="0.1"))
    (words,) = refusals(verify(copied))
    assert 'versions.numba was "0.1", is ' in words
    assert "it was flown at commit" in words


def test_a_policy_that_raises_is_refused(copied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stumble(*_: object) -> None:
        raise KeyError("tile")

    monkeypatch.setattr("studies.campaign.monte_carlo.fly", stumble)
    (words,) = refusals(verify(copied))
    assert words.startswith("flights: policy 'no-divert' failed in episode 0 of study seed 0: KeyError")


def test_a_changed_preset_is_refused(copied: Path) -> None:
    change_provenance(copied, lambda held: held["preset"]["rules"].update(thrust_error=0.0))
    (words,) = refusals(verify(copied))
    assert "preset.rules.thrust_error was 0.0, is 0.05" in words
    assert "the study varied the preset, and such a point cannot be verified" in words


def test_another_number_of_episodes_is_refused(copied: Path) -> None:
    change_provenance(copied, lambda held: held["study"].update(episodes=10))
    assert "episodes 0 to 9 of each policy once" in refusals(verify(copied))[0]


def test_a_policy_that_changed_since_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "pilot_to_verify.py"
    shutil.copy(Path(__file__).parents[2] / "examples" / "my_policy.py", module)
    monkeypatch.syspath_prepend(str(tmp_path))
    out = tmp_path / "own"
    own = ("pilot_to_verify:SafestNearby", "no-divert")
    compare(Comparison(episodes=2, policies=own, workers=1, out=out, figures=False, report=False))
    assert verify(out).accepted
    before = digest_files(module)
    module.write_text(module.read_text() + "\n")
    assert digest_files(module) != before
    assert "sources.pilot_to_verify was" in refusals(verify(out))[0]


def test_a_policy_that_is_not_here_is_refused(copied: Path) -> None:
    for name in ("episodes.csv", "table.csv", "paired.csv"):
        edit(copied / name, lambda text: text.replace("nearest-safe", "nearest-save"))
    (copied / "episodes.parquet").unlink()
    change_provenance(copied, lambda held: held["study"].update(policies=[*POLICIES[:2], "nearest-save"]))
    assert (
        "policies: nearest-save: unknown policy 'nearest-save'; did you mean nearest-safe"
        in refusals(verify(copied))[0]
    )


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("episodes.csv", lambda text: text[: len(text) // 2], "its last line has no end"),
        ("episodes.csv", lambda text: "", "its last line has no end"),
        ("episodes.csv", lambda text: text.replace("tile", "tiles", 1), "other columns"),
        ("episodes.csv", lambda text: text.replace("True", "Truly", 1), "neither True nor False"),
        ("episodes.csv", lambda text: text.replace("nearest-safe,3,", "nearest-safe,4,"), "once, in order"),
        ("provenance.json", lambda text: "[]", "holds no object"),
        ("provenance.json", lambda text: "{", "damaged"),
        ("provenance.json", lambda text: "{}", "tells no study"),
        ("provenance.json", lambda text: text.replace('"validation"', '"own"'), "terrain of its own"),
    ],
)
def test_damaged_folders_are_refused_in_words(
    copied: Path, name: str, change: Callable[[str], str], words: str
) -> None:
    edit(copied / name, change)
    assert any(words in told for told in refusals(verify(copied)))


def test_an_empty_folder_is_refused_and_the_command_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(HeldResultsError, match=r"provenance\.json is missing"):
        read_results(tmp_path)
    monkeypatch.setattr("sys.argv", ["verify", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    assert f"{tmp_path} is refused" in capsys.readouterr().out.replace("\n", "")


@given(st.integers(1, 400), st.floats(0.0, 1.0), st.integers(1, 50), st.integers(0, 2**32))
def test_the_draw_has_the_share_and_the_least(episodes: int, share: float, least: int, seed: int) -> None:
    drawn = choose_episodes(episodes, share, least, np.random.default_rng(seed))
    assert len(set(drawn)) == len(drawn) >= min(episodes, max(least, share * episodes))
    assert len(drawn) <= max(least, share * episodes + 1)
    assert drawn == sorted(drawn)
    assert 0 <= drawn[0] <= drawn[-1] < episodes


def test_chance_of_notice_is_that_of_a_draw_without_replacement() -> None:
    assert chance_of_notice(1, 10, 3) == pytest.approx(0.3)
    assert chance_of_notice(2, 10, 3) == pytest.approx(1.0 - 7 * 6 / (10 * 9))
    assert chance_of_notice(3, 10, 8) == pytest.approx(1.0)
