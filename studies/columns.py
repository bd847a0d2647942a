"""Columns of a table, written once: the CSV file, the document, the console and the report read them."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from enum import Flag, auto
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from studies.statistics.ratios import Interval, scaled

if TYPE_CHECKING:
    from rich.table import Table

Row = TypeVar("Row", contravariant=True)
Outer = TypeVar("Outer")
Value = str | int | float | Interval


class Output(Flag):
    """Where a column stands."""

    FILE = auto()
    DOCUMENT = auto()
    CONSOLE = auto()
    REPORT = auto()
    ALL = FILE | DOCUMENT | CONSOLE | REPORT


@dataclass(frozen=True)
class Column(Generic[Row]):
    """One column of a table whose lines are made of `Row`s.

    Attributes:
        key: name in the file, with the unit where it has one.
        heading: short name in tables, without the unit.
        value: gives the value of a line, in the unit; nan is an empty cell.
        digits: decimals that are shown; None shows whole numbers and words as they are.
        unit: shown behind the headings.
        label: name in full, without the unit; the heading by default.
        interval: `value` gives an Interval: the file has its ends too.
        between: stands between the ends of an interval where it is shown.
        by_tile: gives the interval clustered by tile, for those that have one.
        stem: name that the ends begin with in the file; `key` by default.
        late: joined the file after others: it stands at its end, so that files keep their order.
        form: shows a number where decimals will not do.
        mark: what follows the value where it is shown, such as a star.
        words: is aligned as words are.
        brief: a document leaves its intervals out, the console the one clustered by tile.
        outputs: where it stands.
    """

    key: str
    heading: str
    value: Callable[[Row], Value]
    digits: int | None = None
    unit: str = ""
    label: str = ""
    interval: bool = False
    between: str = "-"
    by_tile: Callable[[Row], Interval] | None = None
    stem: str = ""
    late: bool = False
    form: Callable[[float], str] | None = None
    mark: Callable[[Row], str] | None = None
    words: bool = False
    brief: bool = False
    outputs: Output = Output.ALL

    @property
    def title(self) -> str:
        """Heading with the unit."""
        return f"{self.heading} {self.unit}".strip()

    @property
    def full_title(self) -> str:
        """Label with the unit in brackets."""
        name = self.label or self.heading
        return f"{name} [{self.unit}]" if self.unit else name

    def through(self, part: Callable[[Outer], Row]) -> Column[Outer]:
        """The same column of lines that hold a `Row`, which `part` gives."""
        tiled, mark = self.by_tile, self.mark
        return Column(
            **{
                **{field.name: getattr(self, field.name) for field in fields(self)},
                "value": lambda line: self.value(part(line)),
                "by_tile": None if tiled is None else lambda line: tiled(part(line)),
                "mark": None if mark is None else lambda line: mark(part(line)),
            }
        )

    def names(self) -> list[str]:
        """Names in the file, without those of the ends clustered by tile."""
        stem = self.stem or self.key
        return [self.key, f"{stem}_low", f"{stem}_high"] if self.interval else [self.key]

    def tile_names(self) -> list[str]:
        """Names in the file of the ends clustered by tile; none where there are none."""
        stem = self.stem or self.key
        return [] if self.by_tile is None else [f"{stem}_tile_low", f"{stem}_tile_high"]

    def cells(self, row: Row) -> list[str]:
        """What stands in the file under `names`."""
        value = self.value(row)
        if isinstance(value, Interval):
            return [file_number(end) for end in (value.estimate, value.low, value.high)]
        return [file_number(value) if isinstance(value, float) else str(value)]

    def tile_cells(self, row: Row) -> list[str]:
        """What stands in the file under `tile_names`."""
        if self.by_tile is None:
            return []
        tiled = self.by_tile(row)
        return [file_number(tiled.low), file_number(tiled.high)]

    def show(self, number: float) -> str:
        """A number as tables show it; nan is empty."""
        if math.isnan(number):
            return ""
        if self.form is not None:
            return self.form(number)
        return str(number) if self.digits is None else f"{number:.{self.digits}f}"

    def text(self, row: Row) -> str:
        """The value of a line as tables show it, without its interval."""
        value = self.value(row)
        mark = "" if self.mark is None else self.mark(row)
        if isinstance(value, str):
            return value + mark
        return self.show(value.estimate if isinstance(value, Interval) else value) + mark

    def ranges(self, row: Row) -> list[str]:
        """The interval, and the one clustered by tile, as tables show them: as many as there are.

        An end that is unknown or infinite says nothing, so such an interval is not shown.
        """
        value = self.value(row)
        found = [value] if isinstance(value, Interval) else []
        found += [] if self.by_tile is None else [self.by_tile(row)]
        told = [one for one in found if math.isfinite(one.low) and math.isfinite(one.high)]
        return [f"{self.show(one.low)}{self.between}{self.show(one.high)}" for one in told]


def percent_interval(
    key: str,
    heading: str,
    ratio: Callable[[Row], Interval],
    *,
    digits: int = 1,
    label: str = "",
    stem: str = "",
) -> Column[Row]:
    """A column of a ratio with its interval, in percent.

    Args:
        key: name in the file, with the unit.
        heading: short name in tables.
        ratio: gives the ratio of a line, in [0, 1].
        digits: decimals that are shown.
        label: name in full.
        stem: name that the ends begin with in the file.
    """

    def percent(row: Row) -> Interval:
        return scaled(ratio(row), 100.0)

    return Column(key, heading, percent, digits, "%", label, interval=True, stem=stem)


def points_interval(
    key: str,
    heading: str,
    difference: Callable[[Row], Interval],
    *,
    digits: int = 1,
    stem: str = "",
    between: str = " to ",
) -> Column[Row]:
    """A column of a difference in percentage points with its interval, each with its sign.

    Args:
        key: name in the file, with the unit.
        heading: short name in tables.
        difference: gives that of a line, in points.
        digits: decimals that are shown.
        stem: name that the ends begin with in the file.
        between: stands between the ends.
    """
    form = f"{{:+.{digits}f}}".format
    return Column(
        key, heading, difference, unit="points", interval=True, between=between, stem=stem, form=form
    )


def field_columns(kind: type[Any]) -> list[Column[Any]]:
    """A column for every field of a dataclass, under its own name."""
    return [Column(field.name, field.name, attrgetter(field.name)) for field in fields(kind)]


def file_number(value: float) -> str:
    """A number as files have it; nan is empty."""
    return "" if math.isnan(value) else f"{value:.9g}"


def format_p(p: float) -> str:
    """A p-value in two digits."""
    return "<1e-4" if p < 1e-4 else f"{p:.2g}"


def standing_in(columns: Sequence[Column[Row]], output: Output) -> list[Column[Row]]:
    """Columns that stand in an output, in their order."""
    return [column for column in columns if output in column.outputs]


def write_csv(path: Path, columns: Sequence[Column[Row]], rows: Iterable[Row]) -> None:
    """Write lines as CSV: columns, the ends clustered by tile, late columns; equal lines give equal bytes.

    Raises:
        OSError: the file cannot be written.
    """
    shown = standing_in(columns, Output.FILE)
    first, late = [c for c in shown if not c.late], [c for c in shown if c.late]
    names = [c.names() for c in first] + [c.tile_names() for c in shown] + [c.names() for c in late]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(chain.from_iterable(names))
        for row in rows:
            cells = [c.cells(row) for c in first] + [c.tile_cells(row) for c in shown]
            writer.writerow(chain.from_iterable(cells + [c.cells(row) for c in late]))


def markdown_lines(columns: Sequence[Column[Row]], rows: Iterable[Row]) -> list[str]:
    """The table for a document, in Markdown."""
    shown = standing_in(columns, Output.DOCUMENT)
    lines = ["| " + " | ".join(column.title for column in shown) + " |"]
    lines.append("|" + "".join("---|" if column.words else "---:|" for column in shown))
    lines += ["| " + " | ".join(document_cell(column, row) for column in shown) + " |" for row in rows]
    return lines


def write_markdown(path: Path, columns: Sequence[Column[Row]], rows: Iterable[Row]) -> None:
    """Write the table for a document.

    Raises:
        OSError: the file cannot be written.
    """
    path.write_text("\n".join(markdown_lines(columns, rows)) + "\n")


def document_cell(column: Column[Row], row: Row) -> str:
    """A cell of a document: the value, its interval in round brackets, the one by tile in square ones."""
    brackets = zip(("({})", "[{}]"), [] if column.brief else column.ranges(row), strict=False)
    return " ".join([column.text(row), *(bracket.format(ends) for bracket, ends in brackets)])


def console_cell(column: Column[Row], row: Row) -> str:
    """A cell of the console: the value, and below it its intervals."""
    ranges = column.ranges(row)[: 1 if column.brief else 2]
    brackets = zip(("{}", "\\[{}]"), ranges, strict=False)
    return "\n".join([column.text(row), *(bracket.format(ends) for bracket, ends in brackets)])


def console_table(
    columns: Sequence[Column[Row]], rows: Iterable[Row], title: str, caption: str = ""
) -> Table:
    """The table for the console."""
    from rich.table import Table

    table = Table(title=title.replace("[", "\\["), caption=caption)
    shown = standing_in(columns, Output.CONSOLE)
    for column in shown:
        justify = "left" if column.words else "right"
        table.add_column(column.title, justify=justify, no_wrap=column.words)
    for row in rows:
        table.add_row(*(console_cell(column, row) for column in shown))
    return table
