"""The journal: rows come back as they were, to the bit; what is finished is not done again."""

import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.campaign.claimed_folder import Existing, FolderError
from studies.campaign.journal import Journal, JournalError, open_journal, read_value

PRODUCTS = ("table.csv", "*.png")
IDENTITY = {"options": {"preset": "paper", "limit": 1.5}, "versions": {"numpy": "1"}}


class Ending(StrEnum):
    SOFT = "soft landing"
    HARD = "hard"


class Level(Enum):
    LOW = 1
    HIGH = 2


@dataclass(frozen=True)
class Inner:
    speed: float
    level: Level


@dataclass(frozen=True)
class Row:
    name: str
    count: int
    safe: bool
    value: float
    ending: Ending
    quantiles: tuple[float, float, float] = (0.0, 0.0, 0.0)
    words: tuple[str, ...] = ()
    inner: tuple[Inner, ...] = ()


ROWS = st.builds(
    Row,
    name=st.text(),
    count=st.integers(),
    safe=st.booleans(),
    value=st.floats(),
    ending=st.sampled_from(Ending),
    quantiles=st.tuples(st.floats(), st.floats(), st.floats()),
    words=st.lists(st.text(), max_size=3).map(tuple),
    inner=st.lists(st.builds(Inner, speed=st.floats(), level=st.sampled_from(Level)), max_size=3).map(tuple),
)
KEYS = st.lists(st.text() | st.integers() | st.floats(allow_nan=False), min_size=1, max_size=3).map(tuple)


def bits(value: Any) -> Any:
    """The same for values that are the same to the bit, type and all; every nan is one."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("d", value)
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    if hasattr(value, "__dataclass_fields__"):
        return type(value), tuple(bits(getattr(value, name)) for name in value.__dataclass_fields__)
    return type(value), value


def opened(path: Path, existing: Existing = Existing.RESUME, **changes: Any) -> Any:
    return open_journal(path, Row, PRODUCTS, {**IDENTITY, **changes}, existing)


def row(number: int) -> Row:
    return Row(f"item {number}", number, True, math.nan, Ending.HARD, words=("a", "b"))


@settings(max_examples=60)
@given(rows=st.dictionaries(KEYS, ROWS, max_size=4))
def test_rows_come_back_to_the_bit(tmp_path_factory: pytest.TempPathFactory, rows: dict[Any, Row]) -> None:
    path = tmp_path_factory.mktemp("run")
    with opened(path, Existing.REFUSE) as journal:
        kept = {key: journal.keep(key, value) for key, value in rows.items()}
    assert {key: bits(value) for key, value in kept.items()} == {k: bits(value) for k, value in rows.items()}
    with opened(path) as journal:
        found = {key: journal.find(key) for key in rows}
        assert journal.find(("absent", *(part for key in rows for part in key))) is None
    assert {key: bits(value) for key, value in found.items()} == {k: bits(value) for k, value in rows.items()}


def test_an_item_is_on_the_disk_before_the_next_is_begun(tmp_path: Path) -> None:
    with opened(tmp_path) as journal:
        for number in range(3):
            journal.keep((number,), row(number))
            lines = (tmp_path / "journal" / "items.jsonl").read_text().splitlines()
            assert [json.loads(line)["key"] for line in lines] == [[k] for k in range(number + 1)]


@dataclass
class Work:
    """Rows by their number; the one that stops it raises."""

    stop: int | None = None
    done: list[int] = field(default_factory=list)

    def item(self, number: int) -> Callable[[], Row]:
        def work() -> Row:
            if number == self.stop:
                raise KeyboardInterrupt
            self.done.append(number)
            return row(number)

        return work

    def run(self, journal: Journal[Row]) -> list[Row]:
        return [journal.finish((number, "x"), self.item(number)) for number in range(6)]


@pytest.mark.parametrize("stop", range(6))
def test_a_stopped_run_goes_on(tmp_path: Path, stop: int) -> None:
    first, second, third = Work(stop), Work(), Work()
    with pytest.raises(KeyboardInterrupt), opened(tmp_path, Existing.REFUSE) as journal:
        first.run(journal)
    with opened(tmp_path) as journal:
        rows = second.run(journal)
    assert (first.done, second.done) == ([*range(stop)], [*range(stop, 6)])
    assert [bits(one) for one in rows] == [bits(row(number)) for number in range(6)]
    with opened(tmp_path) as journal:
        third.run(journal)
        counts = [entry["items"] for entry in journal.describe()["sessions"]]
    assert not third.done
    assert counts == [count for count in (stop, 6 - stop) if count]


@settings(max_examples=80)
@given(data=st.data())
def test_a_damaged_line_is_done_again(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Whatever a crash or an accident made of the file, no row but the kept ones is read."""
    path = tmp_path_factory.mktemp("run")
    with opened(path) as journal:
        Work().run(journal)
    file = path / "journal" / "items.jsonl"
    content = file.read_bytes()
    start = data.draw(st.integers(0, len(content) - 1))
    end = data.draw(st.sampled_from([len(content), min(start + 1, len(content))]) | st.integers(start))
    file.write_bytes(content[:start] + data.draw(st.binary(max_size=8)) + content[end:])
    again = Work()
    with opened(path) as journal:
        kept = [number for number in range(6) if journal.find((number, "x")) is not None]
        rows = again.run(journal)
    assert sorted(kept + again.done) == [*range(6)]
    assert [bits(one) for one in rows] == [bits(row(number)) for number in range(6)]
    with opened(path) as journal:
        assert [bits(one) for one in Work(stop=0).run(journal)] == [bits(one) for one in rows]


def test_a_half_written_last_line_is_named_and_mended(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with opened(tmp_path) as journal:
        Work().run(journal)
    file = tmp_path / "journal" / "items.jsonl"
    content = file.read_bytes()
    file.write_bytes(content[:-40])
    with opened(tmp_path) as journal:
        assert journal.find((5, "x")) is None
        assert file.read_bytes() == b"".join(content.splitlines(keepends=True)[:5])
    words = " ".join(capfd.readouterr().err.split())
    assert "done again" in words
    assert "line 6, is damaged" in words


@pytest.mark.parametrize(
    ("there", "put"), [('"count": 3', '"count": 4'), ("[3, ", "[7, "), ("item 3", "item 4")]
)
def test_a_line_that_still_reads_but_was_changed_is_dropped(tmp_path: Path, there: str, put: str) -> None:
    with opened(tmp_path) as journal:
        Work().run(journal)
    file = tmp_path / "journal" / "items.jsonl"
    text = file.read_text()
    assert text.count(there) == 1
    file.write_text(text.replace(there, put))
    with opened(tmp_path) as journal:
        assert [k for k in range(8) if journal.find((k, "x")) is None] == [3, 6, 7]


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"options": {"preset": "hard", "limit": 1.5}}, r"options\.preset was .paper., is .hard."),
        ({"options": {"preset": "paper"}}, r"options\.limit was 1\.5, is null"),
        ({"versions": {"numpy": "2"}}, r"versions\.numpy was .1., is .2."),
    ],
)
def test_another_run_is_refused_by_name(tmp_path: Path, changes: dict[str, Any], named: str) -> None:
    with opened(tmp_path) as journal:
        journal.keep((1,), row(1))
    with pytest.raises(FolderError, match=named), opened(tmp_path, **changes):
        pass
    with opened(tmp_path) as journal:
        assert journal.find((1,)) is not None


def test_a_run_is_replaced_only_when_asked(tmp_path: Path) -> None:
    with opened(tmp_path) as journal:
        journal.keep((1,), row(1))
    for name in ("table.csv", "one.png", "mine.txt"):
        (tmp_path / name).write_text("")
    with pytest.raises(FolderError, match=r"--resume.*--overwrite"), opened(tmp_path, Existing.REFUSE):
        pass
    with opened(tmp_path, Existing.OVERWRITE, options={}) as journal:
        assert journal.find((1,)) is None
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == [".lock", "mine.txt"]
    with opened(tmp_path, options={}):
        pass  # it is the new run's folder
    with pytest.raises(FolderError, match="holds another study"), opened(tmp_path):
        pass


def test_products_without_a_journal_are_a_run_too(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("")
    with pytest.raises(FolderError, match="holds a study already"), opened(tmp_path, Existing.REFUSE):
        pass
    with pytest.raises(FolderError, match="no finished work"), opened(tmp_path):
        pass


def test_one_writer_at_a_time(tmp_path: Path) -> None:
    with opened(tmp_path), pytest.raises(FolderError, match="being written by process"), opened(tmp_path):
        pass


@pytest.mark.parametrize(
    "wrong",
    [
        Row(1, 1, True, 1.0, Ending.HARD),  # pyright: ignore[reportArgumentType]
        Row("", 1, 1, 1.0, Ending.HARD),  # pyright: ignore[reportArgumentType]
        Row("", 1, True, 1, Ending.HARD),
        Row("", 1, True, 1.0, "gone"),  # pyright: ignore[reportArgumentType]
        Row("", 1, True, 1.0, Ending.HARD, (1.0, 2.0)),  # pyright: ignore[reportArgumentType]
        Row("", 1, True, 1.0, Ending.HARD, words="ab"),  # pyright: ignore[reportArgumentType]
    ],
)
def test_a_row_that_would_not_come_back_is_refused_at_once(tmp_path: Path, wrong: Row) -> None:
    with opened(tmp_path) as journal:
        with pytest.raises(JournalError):
            journal.keep((1,), wrong)
        assert journal.find((1,)) is None
    assert (tmp_path / "journal" / "items.jsonl").read_bytes() == b""


def test_kinds_that_no_row_may_hold() -> None:
    with pytest.raises(TypeError, match="no row may hold"):
        read_value(dict[str, float], {})
    with pytest.raises(ValueError, match="fields speed, level"):
        read_value(Inner, {"speed": 1.0, "level": 1, "more": 2})
