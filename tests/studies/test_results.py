"""`make results`: every results page has its commands there, and what is finished is not made again."""

import re
from pathlib import Path

import pytest
from rich.console import Console

from studies.results import RESULTS, MakeResults, Result, command, make_results
from studies.results.command import choose_results, read_finished

DOCS = Path(__file__).parents[2] / "docs"
WRITTEN = sorted(DOCS.rglob("*.md"))
COMMANDS = DOCS / "results" / "commands.md"


def plain(command: str) -> str:
    """A command without what says only where its files go; `make compare` by its longer name."""
    words = " ".join(command.split()).replace("make compare", "python -m studies.compare")
    return re.sub(r" --out \S+| --no-figures", "", words)


def named_commands(text: str) -> set[str]:
    """Commands in backticks, or a line each in a block."""
    spans = re.findall(r"`((?:python -m|make) [^`]+)`", text)
    return {plain(command) for command in spans + re.findall(r"^ {4}(python -m .+)$", text, re.MULTILINE)}


def rows_below(heading: str) -> list[list[str]]:
    """Cells of the table below a heading of the page of commands."""
    section = COMMANDS.read_text(encoding="utf-8").split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


MADE = {plain(f"python -m {result.command}") for result in RESULTS.values()}
LEFT_OUT = {row[0].strip("`") for row in rows_below("What `make results` leaves out")}


@pytest.mark.parametrize("name", RESULTS)
def test_the_page_names_the_command(name: str) -> None:
    result = RESULTS[name]
    page = DOCS / "results" / result.page
    assert plain(f"python -m {result.command}") in named_commands(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_table_with_a_command_is_made_or_left_out_for_a_reason(page: Path) -> None:
    for row in re.findall(r"^\| command \| (.+) \|$", page.read_text(encoding="utf-8"), re.MULTILINE):
        found = re.findall(r"`((?:python -m|make) [^`]+)`", row)
        assert found, f"no command in {row}"
        for one in map(plain, found):
            assert (one in MADE) != any(one.startswith(beginning) for beginning in LEFT_OUT), one


def test_rows_that_name_a_command_are_found() -> None:
    rows = [row for page in WRITTEN for row in re.findall(r"^\| command \|", page.read_text(), re.MULTILINE)]
    assert len(rows) > 25


def test_what_is_left_out_has_a_page_and_a_reason() -> None:
    for beginning, page, why in rows_below("What `make results` leaves out"):
        (home,) = re.findall(r"\((.+)\)", page)
        assert (COMMANDS.parent / home).is_file()
        assert len(why) > 10
        assert not any(command.startswith(beginning.strip("`")) for command in MADE)


def test_every_picture_is_drawn_by_a_command_and_shown_on_a_page() -> None:
    """Emblems are drawn by hand."""
    pictures = {path.name for path in (DOCS / "pictures").iterdir() if path.suffix in (".png", ".gif")}
    rows = rows_below("Pictures of these pages")
    assert [row[0] for row in rows] == sorted(f"`{name}`" for name in pictures)
    pages = [page.read_text(encoding="utf-8") for page in [*WRITTEN, DOCS.parent / "README.md"]]
    for picture, drawn_by, written in rows:
        assert re.fullmatch(r"`python -m (studies|rl|hda)\.[a-z_.]+( [^`]+)?`", drawn_by), picture
        assert written
        assert any(f"pictures/{picture.strip('`')})" in page for page in pages), picture


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> dict[str, Result]:
    """Two commands that take no time, and one that is wrong."""
    script = "studies.sample_size --difference 5 --out"
    made = {
        "first": Result("", f"{script} {tmp_path / 'first'}", resumable=False),
        "wrong": Result("", "studies.sample_size --difference -5", resumable=False),
        "last": Result("", f"{script} {tmp_path / 'last'}", resumable=False),
    }
    monkeypatch.setattr(command, "RESULTS", made)
    monkeypatch.setattr(command, "git_commit", lambda: "0123abc")
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
    monkeypatch.setattr(command, "git_commit", lambda: commit)
    make_results(options, console)
    table = next((tmp_path / "first").iterdir())
    table.unlink()
    monkeypatch.setattr(command, "git_commit", lambda: commit if commit != "fedcba0" else "0123abc")
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
    monkeypatch.setattr(command, "RESULTS", {"any": Result("", "told_module")})
    for commit in ("0123abc", then):
        monkeypatch.setattr(command, "git_commit", lambda commit=commit: commit)
        assert make_results(MakeResults(out=tmp_path / "journal"), Console(quiet=True)) == ["any"]
    assert told.read_text().split() == ["--overwrite", way]
