"""Finished items of a study that flies no chunks: a timed call, an explained failure, a pair of gains.

DIR/journal/items.jsonl has a line an item: its key, its row, the session that worked it out, a checksum. A
line is on the disk before the next item is begun; a damaged one (a killed process leaves half a line) is
dropped, and its item done again. DIR/journal/identity.json says what the run is.

Rows are frozen dataclasses: JSON keeps numbers to the last bit (nan and the infinities by Python's names), an
enum by its value, a tuple as a list; the types of the fields bring them back, and anything else is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import IO, Any, Generic, TypeVar, cast, get_args, get_origin, get_type_hints

from rich.console import Console

from studies.campaign.claimed_folder import Contents, Existing, claim_folder
from studies.campaign.shards import write_durably

Row = TypeVar("Row")
Key = tuple[str | int | float, ...]
"""Names an item within its study."""

_IDENTITY = "journal/identity.json"
_ITEMS = "journal/items.jsonl"


class JournalError(ValueError):
    """A line of a journal is damaged."""


@dataclass(frozen=True)
class _Item(Generic[Row]):
    row: Row
    session: str


class Journal(Generic[Row]):
    """The open journal of a run; only `open_journal` makes one."""

    def __init__(self, kind: type[Row], items: dict[str, _Item[Row]], stream: IO[bytes], session: str):
        """Go on with the items of a file that is open for this session."""
        self._kind, self._items, self._stream, self._session = kind, items, stream, session

    def find(self, key: Key) -> Row | None:
        """The row of a finished item; None where it is not finished."""
        item = self._items.get(json.dumps(key))
        return None if item is None else item.row

    def keep(self, key: Key, row: Row) -> Row:
        """Keep the row of an item; when this returns, it is on the disk.

        Returns:
            The row as a later run will read it.

        Raises:
            JournalError, TypeError: the row is not made of what its fields say.
            OSError: it cannot be written.
        """
        line = _write_line(key, row, self._session)
        name, item = _read_line(line, self._kind)
        self._stream.write(line + b"\n")
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._items[name] = item
        return item.row

    def finish(self, key: Key, work: Callable[[], Row]) -> Row:
        """The row of an item as it was kept; where it was not, it is worked out and kept."""
        found = self.find(key)
        return self.keep(key, work()) if found is None else found

    def describe(self) -> dict[str, Any]:
        """For the provenance: how many items of the journal each session of the program worked out."""
        counts = Counter(item.session for item in self._items.values())
        return {"sessions": [{"session": name, "items": count} for name, count in sorted(counts.items())]}


@contextmanager
def open_journal(
    path: Path, kind: type[Row], products: tuple[str, ...], identity: dict[str, Any], existing: Existing
) -> Iterator[Journal[Row]]:
    """Open the journal of a run in its folder, or say why not, before any work is done.

    Damaged lines are dropped and named on stderr.

    Args:
        path: the run's folder; made if it does not exist.
        kind: frozen dataclass of the rows, of numbers, strings, enums, tuples and such dataclasses.
        products: names, or patterns with a star, of what else the run leaves in its folder.
        identity: all that decides the rows (`studies.campaign.provenance.identify_run`).
        existing: what to do where the folder holds a run already (`claim_folder`).

    Raises:
        FolderError: another process writes there; or the folder holds a run and `existing` is `REFUSE`; or
            it is `RESUME` and the run there has other options or versions: the message names them.
        OSError: the folder cannot be made or written.
    """
    named = tuple(name for name in products if "*" not in name)
    patterns = tuple(name for name in products if "*" in name)
    contents = Contents(_IDENTITY, named, (*patterns, _ITEMS, "journal/.items.jsonl.*"))
    with claim_folder(path, contents, identity, existing) as session:
        for draft in path.glob("journal/.items.jsonl.*"):
            draft.unlink()  # a killed process was writing it
        items = _mend_items(path / _ITEMS, kind)
        with (path / _ITEMS).open("ab") as stream:
            yield Journal(kind, items, stream, session)


def _mend_items(path: Path, kind: type[Row]) -> dict[str, _Item[Row]]:
    """Read the items of a file; it then exists, and holds whole lines alone."""
    content = path.read_bytes() if path.exists() else None
    items: dict[str, _Item[Row]] = {}
    whole = b""
    for number, line in enumerate((content or b"").splitlines(), 1):
        try:
            name, item = _read_line(line, kind)
        except JournalError as error:
            told = f"done again: {path}, line {number}, is damaged: {error}"
            Console(stderr=True).print(told, style="yellow", markup=False, highlight=False)
        else:
            items[name] = item
            whole += line + b"\n"
    if whole != content:
        write_durably(path, whole)
    return items


def _write_line(key: Key, row: Any, session: str) -> bytes:
    told = {"key": list(key), "row": asdict(row), "session": session}
    return json.dumps({**told, "sha256": _digest(told)}, default=_enum_value).encode()


def _read_line(line: bytes, kind: type[Row]) -> tuple[str, _Item[Row]]:
    """Name and item of a line.

    Raises:
        JournalError: the line is damaged, or holds no such row.
    """
    try:
        told = json.loads(line)
        checksum = told.pop("sha256")
        if checksum != _digest(told):
            raise JournalError("its checksum does not hold")
        row = cast(Row, read_value(kind, told["row"]))
        return json.dumps(told["key"]), _Item(row, str(told["session"]))
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
        if isinstance(error, JournalError):
            raise
        raise JournalError(f"{type(error).__name__}: {error}") from error


def _digest(told: dict[str, Any]) -> str:
    text = json.dumps(told, sort_keys=True, default=_enum_value)
    return hashlib.sha256(text.encode()).hexdigest()


def _enum_value(value: Any) -> Any:
    """What JSON does not know: a plain enum goes by its value."""
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f"no row may hold a {type(value).__name__}")


def read_value(kind: Any, value: Any) -> Any:
    """A value of a row from its JSON, by its type.

    Args:
        kind: float, int, bool, str, an Enum, a tuple of such kinds, or a dataclass of them.
        value: what `json.loads` gave.

    Raises:
        ValueError: the value is not of the kind.
        TypeError: no row may hold the kind.
    """
    if is_dataclass(kind):
        names, hints = [field.name for field in fields(kind)], get_type_hints(kind)
        if not isinstance(value, dict) or sorted(value) != sorted(names):
            raise ValueError(f"a row has the fields {', '.join(names)}, got {value!r}")
        return cast(Any, kind)(**{name: read_value(hints[name], value[name]) for name in names})
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise ValueError(f"a tuple is a list, got {value!r}")
        kinds = get_args(kind)
        if kinds[1:] == (Ellipsis,):
            kinds = kinds[:1] * len(value)
        return tuple(read_value(each, part) for each, part in zip(kinds, value, strict=True))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    if kind not in (float, int, bool, str):
        raise TypeError(f"no row may hold a {kind!r}")
    if type(value) is not kind:
        raise ValueError(f"a {kind.__name__} was asked for, got {value!r}")
    return value
