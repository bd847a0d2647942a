"""The report of a study: one HTML file that needs no network.

The tables are plain HTML and read without JavaScript; charts and the episode browser are drawn by plotly.js,
which stands in the file once. The table is filled from table.csv itself.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from studies.campaign.executor import OpenExecutor
from studies.campaign.monte_carlo import Study
from studies.campaign.rows import MEASURES, RATIOS
from studies.compare.charts import (
    LABELS,
    draw_differences,
    draw_histogram,
    draw_ratio_against_propellant,
    line_style,
)
from studies.compare.differences import PairedDifference
from studies.compare.flights import FlightPicture, choose_flights, fly_pictures, picture_ground
from studies.compare.scores import StudyScores
from studies.compare.table import AT_LEAST_CONFIDENCE, REFERENCE_POLICY, PolicySummary
from studies.paper import PAPER_ROWS

_DIGITS = {"miss_distance_m": 3, "touchdown_speed_mps": 3, "maximum_thrust_n": 0}


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
        value: the value as the file has it.
        text: what is shown.
        range: the interval that is shown below it, or nothing.
        tile_range: the interval clustered by tile, or nothing.
    """

    column: str
    value: str
    text: str
    range: str = ""
    tile_range: str = ""


def fly_report_flights(
    content: ReportContent, open_executor: OpenExecutor, folder: Path, on_progress: Callable[[int, int], None]
) -> list[FlightPicture]:
    """Fly again the episodes that the report shows; their whole flights go to `folder` as NPZ.

    Args:
        content: scores and study.
        open_executor: makes the executor that flies them.
        folder: for the NPZ files.
        on_progress: called with (flights done, flights in all).
    """
    chosen = choose_flights(content.scores, content.study.policies)
    done = 0

    def advance() -> None:
        nonlocal done
        done += 1
        on_progress(done, len(chosen))

    with open_executor() as executor:
        return fly_pictures(content.study, chosen, executor, folder, advance)


def write_report(path: Path, content: ReportContent, flights: Sequence[FlightPicture]) -> None:
    """Write the report; table.csv must stand beside it.

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
    page = environment.get_template("report.html").render(
        study=study,
        columns=table_columns(),
        lines=table_lines(path.with_name("table.csv")),
        paper=paper_lines(),
        reference=REFERENCE_POLICY,
        difference_lines=difference_lines(content.differences),
        styles=[{"name": name, **line_style(k)} for k, name in enumerate(study.policies)],
        charts=make_charts(content),
        labels=LABELS,
        flights=list(flights),
        grounds={str(episode): picture_ground(study, episode) for episode in episodes},
        colors={name: line_style(k)["color"] for k, name in enumerate(study.policies)},
        provenance=content.provenance,
        provenance_text=json.dumps(content.provenance, indent=1, sort_keys=True, default=str),
        css=source("report.css"),
        script=source("report.js"),
        plotly=Markup(get_plotlyjs().replace("</script", "<\\/script")),
    )
    path.write_text(page, encoding="utf-8")


def script_json(value: Any) -> str:
    """JSON that may stand in a script element, whatever strings it holds."""
    text = json.dumps(value, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def make_charts(content: ReportContent) -> dict[str, Any]:
    """Chart name -> plotly figure as plain JSON; differences only where there is something to compare."""
    figures = {"ratio-propellant": draw_ratio_against_propellant(content.summaries)}
    if content.differences:
        figures["differences"] = draw_differences(content.differences)
    for measure in LABELS:
        figures[f"histogram-{measure}"] = draw_histogram(measure, content.scores.histograms)
    return {name: json.loads(str(figure.to_json())) for name, figure in figures.items()}


def table_columns() -> list[tuple[str, str]]:
    """(column of table.csv, heading) in the order shown."""
    return [
        ("policy", "policy"),
        ("safe_site_percent", "safe site [%]"),
        ("success_percent", "success [%]"),
        ("success_at_least", f"success at least [%] (at {AT_LEAST_CONFIDENCE:.0%})"),
        ("mcnemar_p", "p"),
        *((name, LABELS[name]) for name in MEASURES),
        ("fallbacks", "fallbacks"),
    ]


def table_lines(path: Path) -> list[list[Cell]]:
    """Lines of the table, from table.csv."""
    with path.open(newline="") as stream:
        return [_table_line(row) for row in csv.DictReader(stream)]


def _table_line(row: dict[str, str]) -> list[Cell]:
    privileged = row["privileged"] == "True"
    cells = [Cell("policy", row["policy"], row["policy"] + (" (privileged)" if privileged else ""))]
    for name in RATIOS:
        shown = _shown(row, f"{name}_percent", 1, f"{name}_low", f"{name}_high")
        tile = _range(row[f"{name}_tile_low"], row[f"{name}_tile_high"], 1)
        cells.append(replace(shown, tile_range=f"[{tile}]"))
    p = row["mcnemar_p"]
    cells.append(Cell("mcnemar_p", p, format_p(float(p)) if p else ""))
    for name in MEASURES:
        digits = _DIGITS.get(name, 2)
        shown = _shown(row, name, digits, f"{name}_low", f"{name}_high")
        tile = _range(row[f"{name}_tile_low"], row[f"{name}_tile_high"], digits)
        cells.append(replace(shown, tile_range=f"[{tile}]"))
    at_least = row["success_at_least"]
    cells.insert(3, Cell("success_at_least", at_least, f"{float(at_least):.2f}"))
    return [*cells, Cell("fallbacks", row["fallbacks"], row["fallbacks"])]


def _shown(row: dict[str, str], name: str, digits: int, low: str, high: str) -> Cell:
    return Cell(name, row[name], f"{float(row[name]):.{digits}f}", _range(row[low], row[high], digits))


def _range(low: str, high: str, digits: int) -> str:
    return f"{float(low):.{digits}f} to {float(high):.{digits}f}"


def format_p(p: float) -> str:
    """A p-value in two digits."""
    return "<0.0001" if p < 1e-4 else f"{p:.2g}"


def paper_lines() -> list[list[Cell]]:
    """The paper's rows, in the columns of the table."""
    lines = []
    for name, row in PAPER_ROWS.items():
        cells = [Cell("policy", name, f"the paper: {name}")]
        for column, _ in table_columns()[1:]:
            digits = 1 if column == "safe_site_percent" else _DIGITS.get(column, 2)
            value = row.get(column)
            cells.append(Cell(column, "", "" if value is None else f"{value:.{digits}f}"))
        lines.append(cells)
    return lines


def difference_lines(differences: Sequence[PairedDifference]) -> list[list[Cell]]:
    """Lines of the table of paired differences."""
    lines = []
    for difference in differences:
        cells = [Cell("policy", difference.policy, difference.policy)]
        shown = partial(_difference_cell, difference)
        cells += [shown(f"{name}_points", difference.ratios[name], 100.0, 1) for name in RATIOS]
        for name, p in (("mcnemar_p", difference.mcnemar_p), ("holm_p", difference.holm_p)):
            cells.append(Cell(name, f"{p:.9g}", format_p(p)))
        for name in MEASURES:
            digits = _DIGITS.get(name, 2)
            by_tile = difference.means_by_tile[name]
            tile = f"[{by_tile.low:+.{digits}f} to {by_tile.high:+.{digits}f}]"
            cells.append(replace(shown(name, difference.means[name], 1.0, digits), tile_range=tile))
        lines.append(cells)
    return lines


def _difference_cell(
    difference: PairedDifference, column: str, interval: Any, scale: float, digits: int
) -> Cell:
    low, middle, high = (scale * value for value in (interval.low, interval.estimate, interval.high))
    return Cell(column, f"{middle:.9g}", f"{middle:+.{digits}f}", f"{low:+.{digits}f} to {high:+.{digits}f}")
