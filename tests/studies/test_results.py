"""`make results`: every results page has its commands there, and what is finished is not made again."""

import re
from pathlib import Path

import pytest
from rich.console import Console

import studies.results
from studies.results import RESULTS, MakeResults, Result, choose_results, make_results, read_finished

PAGES = Path(__file__).parents[2] / "docs" / "results"


@pytest.mark.parametrize("name", RESULTS)
def test_the_page_names_the_command(name: str) -> None:
    result = RESULTS[name]
    command = re.sub(r" --out [^\s`]+| --no-figures", "", result.command)
    said = re.sub(r" --out [^\s`]+| --no-figures", "", (PAGES / result.page).read_text(encoding="utf-8"))
    assert f"`python -m {command}`" in said or (command == "studies.compare" and "`make compare`" in said)


def test_every_page_that_names_a_command_is_made() -> None:
    """The others need what is not shipped: runs of training, other planners, models of real ground."""
    pages = {path.name for path in PAGES.glob("*.md") if "\n| command |" in path.read_text(encoding="utf-8")}
    assert pages - {result.page for result in RESULTS.values()} == {"agents.md", "peers.md", "real-ground.md"}


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Result]:
    """Two commands that take no time, and one that is wrong."""
    script = "studies.sample_size --difference 5 --out"
    made = {
        "first": Result("", f"{script} {tmp_path / 'first'}", resumable=False),
        "wrong": Result("", "studies.sample_size --difference -5", resumable=False),
        "last": Result("", f"{script} {tmp_path / 'last'}", resumable=False),
    }
    monkeypatch.setattr(studies.results, "RESULTS", made)
    monkeypatch.setattr(studies.results, "git_commit", lambda: "0123abc")
    return made


def test_a_failure_stops_no_other_and_what_is_finished_is_not_made_again(
    small: dict[str, Result], tmp_path: Path
) -> None:
    options, console = MakeResults(out=tmp_path / "journal"), Console(quiet=True)
    assert make_results(options, console) == ["wrong"]
    finished = read_finished(options.out)
    assert set(finished) == {"first", "last"}
    assert finished["first"].commit == "0123abc"
    table = next((tmp_path / "first").iterdir())
    table.unlink()
    assert make_results(options, console) == ["wrong"]
    assert not table.exists()
    assert make_results(MakeResults(out=options.out, only=("first",), again=True), console) == []
    assert table.exists()


@pytest.mark.parametrize("commit", ["0123abc+changes", "", "fedcba0"])
def test_other_sources_make_everything_anew(
    small: dict[str, Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, commit: str
) -> None:
    options, console = MakeResults(out=tmp_path / "journal", only=("first",)), Console(quiet=True)
    monkeypatch.setattr(studies.results, "git_commit", lambda: commit)
    make_results(options, console)
    table = next((tmp_path / "first").iterdir())
    table.unlink()
    monkeypatch.setattr(studies.results, "git_commit", lambda: commit if commit != "fedcba0" else "0123abc")
    make_results(options, console)
    assert table.exists()


def test_an_unknown_name_is_named() -> None:
    with pytest.raises(ValueError, match="unknown result 'tradeoff'; did you mean trade-off"):
        choose_results(["tradeoff"])


def test_the_list_makes_nothing(small: dict[str, Result], tmp_path: Path) -> None:
    assert make_results(MakeResults(out=tmp_path / "journal", list=True), Console(quiet=True)) == []
    assert not (tmp_path / "journal").exists()


@pytest.mark.parametrize(("then", "way"), [("0123abc", "--resume"), ("fedcba0", "--overwrite")])
def test_begun_work_goes_on_at_the_same_sources_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, then: str, way: str
) -> None:
    """The command prints the options that it was given, in place of making anything."""
    told = tmp_path / "told.txt"
    script = f"import sys; open({str(told)!r}, 'a').write(' '.join(sys.argv[1:]) + chr(10)); sys.exit(1)"
    (tmp_path / "told_module.py").write_text(script)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(studies.results, "RESULTS", {"any": Result("", "told_module")})
    for commit in ("0123abc", then):
        monkeypatch.setattr(studies.results, "git_commit", lambda commit=commit: commit)
        assert make_results(MakeResults(out=tmp_path / "journal"), Console(quiet=True)) == ["any"]
    assert told.read_text().split() == ["--overwrite", way]
