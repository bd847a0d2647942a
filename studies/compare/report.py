"""The report of a study: one HTML file that needs no network.

The tables are plain HTML and read without JavaScript; charts and the episode browser are drawn by plotly.js,
which stands in the file once. The tables read the columns of the files (`COLUMNS`).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from hda.ground.own_terrain import OwnTerrain
from studies.campaign.monte_carlo import Study
from studies.campaign.score import MEASURE_COLUMNS
from studies.columns import Column, Output, Row, standing_in
from studies.compare.charts import (
    draw_differences,
    draw_distribution,
    draw_headline,
    line_style,
)
from studies.compare.differences import DIFFERENCE_COLUMNS, PairedDifference
from studies.compare.flights import FlightPicture, picture_ground, picture_lander
from studies.compare.opening import choose_curves, choose_opening
from studies.compare.scores import StudyScores
from studies.compare.table import COLUMNS, REFERENCE_POLICY, PolicySummary, paper_line
from studies.paper import PAPER_ROWS


@dataclass(frozen=True)
class ReportContent:
    """All that a report shows.

    Attributes:
        study: what was flown.
        scores: what its episodes gave.
        summaries: lines of the table.
        differences: paired differences from the reference policy.
        provenance: where it comes from.
    """

    study: Study
    scores: StudyScores
    summaries: list[PolicySummary]
    differences: list[PairedDifference]
    provenance: dict[str, Any]


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes:
        column: column of the CSV file that the value stands in.
        value: the value as the file has it; empty where it stands in no file.
        text: what is shown.
        ranges: the intervals that are shown below it, the one clustered by tile in brackets.
    """

    column: str
    value: str
    text: str
    ranges: tuple[str, ...] = ()


def write_report(path: Path, content: ReportContent, flights: Sequence[FlightPicture]) -> None:
    """Write the report.

    Raises:
        OSError: the file cannot be written.
    """
    from jinja2 import Environment, PackageLoader, select_autoescape
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=PackageLoader("studies", "templates"),
        autoescape=select_autoescape(default=True),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["script_json"] = lambda value: Markup(script_json(value))

    def source(name: str) -> Markup:
        assert environment.loader is not None
        return Markup(environment.loader.get_source(environment, name)[0])

    study = content.study
    episodes = sorted({flight.episode for flight in flights})
    opening = choose_opening(flights, content.summaries)
    page = environment.get_template("report.html").render(
        study=study,
        headings=[column.full_title for column in standing_in(COLUMNS, Output.REPORT)],
        lines=table_lines(COLUMNS, content.summaries),
        paper=paper_lines(),
        reference=REFERENCE_POLICY,
        difference_headings=[column.full_title for column in standing_in(DIFFERENCE_COLUMNS, Output.REPORT)],
        difference_lines=table_lines(DIFFERENCE_COLUMNS, content.differences),
        styles=[
            {"name": name, "shown": name in choose_curves(study.policies), **line_style(k)}
            for k, name in enumerate(study.policies)
        ],
        charts=make_charts(content),
        measures=[column.key for column in MEASURE_COLUMNS],
        flights=list(flights),
        grounds={str(episode): picture_ground(study, episode) for episode in episodes},
        opening=None if opening is None else asdict(opening),
        lander=picture_lander(study.preset),
        left_out=find_left_out(content),
        provenance=content.provenance,
        provenance_text=json.dumps(content.provenance, indent=1, sort_keys=True, default=str),
        css=source("report.css"),
        scripts=[source(name) for name in ("tables.js", "charts.js", "lander.js", "flights.js")],
        plotly=Markup(get_plotlyjs().replace("</script", "<\\/script")),
    )
    path.write_text(page, encoding="utf-8")


def find_left_out(content: ReportContent) -> list[int]:
    """Numbers of the tiles over which no episode begins, for want of hazard around a first target."""
    terrain = content.study.preset.terrain
    known = terrain.too_safe if isinstance(terrain, OwnTerrain) else ()
    return sorted({*known, *content.provenance["flight"].get("left_out_tiles", ())})


def script_json(value: Any) -> str:
    """JSON that may stand in a script element, whatever strings it holds."""
    text = json.dumps(value, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def make_charts(content: ReportContent) -> dict[str, Any]:
    """Chart name -> plotly figure as plain JSON; differences only where there is something to compare."""
    figures = {"headline": draw_headline(content.summaries)}
    if content.differences:
        figures["differences"] = draw_differences(content.differences)
    for column in MEASURE_COLUMNS:
        figures[f"distribution-{column.key}"] = draw_distribution(column.key, content.scores.histograms)
    return {name: json.loads(str(figure.to_json())) for name, figure in figures.items()}


def table_lines(columns: Sequence[Column[Row]], rows: Sequence[Row]) -> list[list[Cell]]:
    """Lines of a table: each value with its intervals."""
    shown = standing_in(columns, Output.REPORT)
    return [[_table_cell(column, row) for column in shown] for row in rows]


def _table_cell(column: Column[Row], row: Row) -> Cell:
    plain_tiled = zip(("{}", "[{}]"), replace(column, between=" to ").ranges(row), strict=False)
    ranges = tuple(form.format(ends) for form, ends in plain_tiled)
    return Cell(column.key, column.cells(row)[0], column.text(row), ranges)


def paper_lines() -> list[list[Cell]]:
    """The paper's rows, in the columns of the table."""
    shown = standing_in(COLUMNS, Output.REPORT)
    return [
        [Cell(column.key, "", text) for column, text in zip(shown, paper_line(name, shown), strict=True)]
        for name in PAPER_ROWS
    ]
