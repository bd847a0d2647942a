"""A column is written once: file, document, console and report show the same values in the same order."""

import csv
import math
from dataclasses import dataclass, fields
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from hda.flight.episode_row import MEASURES
from studies.campaign.score import MEASURE_COLUMNS, Score
from studies.columns import (
    Column,
    Output,
    console_table,
    markdown_lines,
    percent_interval,
    points_interval,
    standing_in,
    write_csv,
)
from studies.compare.differences import DIFFERENCE_COLUMNS
from studies.compare.table import COLUMNS
from studies.statistics.ratios import Interval


@dataclass(frozen=True)
class Line:
    name: str
    ratio: float
    half: float


TWO: tuple[Column[Line], ...] = (
    Column("name", "name", lambda line: line.name, words=True, mark=lambda line: " *"),
    Column("added", "added", lambda line: 7, late=True, outputs=Output.FILE),
    Column(
        "ratio_percent",
        "ratio",
        lambda line: Interval(line.ratio, line.ratio - line.half, line.ratio + line.half),
        digits=2,
        unit="%",
        interval=True,
        by_tile=lambda line: Interval(line.ratio, line.ratio - 2.0 * line.half, line.ratio + 2.0 * line.half),
        stem="ratio",
    ),
)


@given(ratio=st.floats(-1e6, 1e6), half=st.floats(0.0, 1e3))
def test_every_output_shows_the_value_of_the_file(tmp_path_factory, ratio: float, half: float) -> None:
    path: Path = tmp_path_factory.mktemp("columns") / "table.csv"
    line = Line("one", ratio, half)
    write_csv(path, TWO, [line])
    with path.open(newline="") as stream:
        (row,) = csv.DictReader(stream)
    assert list(row) == [
        "name",
        "ratio_percent",
        "ratio_low",
        "ratio_high",
        "ratio_tile_low",
        "ratio_tile_high",
        "added",
    ]
    kept = float(row["ratio_percent"])
    assert math.isclose(kept, ratio, rel_tol=1e-8, abs_tol=1e-300)
    column = TWO[2]
    shown = float(column.text(line))
    assert abs(shown - ratio) <= 0.005 + 1e-9 * abs(ratio)
    (document,) = markdown_lines(TWO, [line])[2:]
    ends = [f"{ratio + k * half:.2f}" for k in (-1.0, 1.0, -2.0, 2.0)]
    assert document == f"| one * | {ratio:.2f} ({ends[0]}-{ends[1]}) [{ends[2]}-{ends[3]}] |"
    table = console_table(TWO, [line], "title [as it is]")
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ["one *", f"{ratio:.2f}\n{ends[0]}-{ends[1]}\n\\[{ends[2]}-{ends[3]}]"]


def test_ratios_are_shown_in_percent_and_differences_with_their_signs() -> None:
    line = Interval(0.25, -0.125, 0.5)
    ratio: Column[Interval] = percent_interval("success_percent", "success", lambda value: value, stem="won")
    assert ratio.names() == ["success_percent", "won_low", "won_high"]
    assert ratio.cells(line) == ["25", "-12.5", "50"]
    assert (ratio.title, ratio.text(line), ratio.ranges(line)) == ("success %", "25.0", ["-12.5-50.0"])
    lead: Column[Interval] = points_interval("lead_points", "lead", lambda value: value, digits=2)
    assert lead.cells(line) == ["0.25", "-0.125", "0.5"]
    assert (lead.title, lead.text(line), lead.ranges(line)) == ("lead points", "+0.25", ["-0.12 to +0.50"])


def test_a_nan_is_an_empty_cell_everywhere(tmp_path: Path) -> None:
    column: Column[float] = Column("value", "value", lambda value: value, digits=1)
    write_csv(tmp_path / "table.csv", (column,), [math.nan])
    assert (tmp_path / "table.csv").read_text() == 'value\n""\n'
    assert column.text(math.nan) == ""


def test_names_of_a_file_are_its_own() -> None:
    for columns in (COLUMNS, DIFFERENCE_COLUMNS):
        names = [name for column in columns for name in (*column.names(), *column.tile_names())]
        assert len(names) == len(set(names))


def test_every_measure_and_figure_of_a_score_has_a_column() -> None:
    assert tuple(column.key for column in MEASURE_COLUMNS) == MEASURES
    keys = {column.stem or column.key for column in COLUMNS}
    figures = {field.name for field in fields(Score)} - {"means", "means_by_tile"}
    assert {name.removesuffix("_by_tile") for name in figures} <= keys


def test_documents_show_less_than_the_console() -> None:
    shown = {
        output: {column.key for column in standing_in(COLUMNS, output)}
        for output in (Output.DOCUMENT, Output.CONSOLE, Output.REPORT, Output.FILE)
    }
    assert shown[Output.DOCUMENT] < shown[Output.CONSOLE] < shown[Output.FILE]
    assert shown[Output.CONSOLE] - shown[Output.DOCUMENT] == {"mcnemar_p", "reward"}
    assert shown[Output.CONSOLE] - shown[Output.REPORT] == {"success_at_least_by_tile"}
    assert shown[Output.REPORT] <= shown[Output.CONSOLE]


def test_a_column_seen_through_a_part_keeps_its_names_and_cells() -> None:
    line = Line("one", 0.25, 0.125)
    for column in TWO:
        outer: Column[tuple[int, Line]] = column.through(lambda pair: pair[1])
        assert outer.names() == column.names()
        assert outer.tile_cells((0, line)) == column.tile_cells(line)
        assert outer.text((0, line)) == column.text(line)
