"""Charts of a report, as plotly figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hda.flight.palette import COLORS, line_style, marker_style
from studies.campaign.score import label_measure
from studies.compare.differences import PairedDifference
from studies.compare.histograms import MeasureHistograms
from studies.compare.table import PolicySummary
from studies.paper import PAPER_ROWS

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


def draw_ratio_against_propellant(summaries: Sequence[PolicySummary]) -> Figure:
    """Safe ratio against propellant, with both intervals; the paper's points are open diamonds."""
    from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    for index, summary in enumerate(summaries):
        propellant, safe = summary.means["propellant_percent"], summary.safe_site
        figure.add_trace(
            Scatter(
                x=[propellant.estimate],
                y=[100.0 * safe.estimate],
                error_x=_bars([(propellant.estimate, propellant.low, propellant.high)]),
                error_y=_bars([(100.0 * safe.estimate, 100.0 * safe.low, 100.0 * safe.high)]),
                mode="markers",
                marker=marker_style(index),
                name=summary.policy,
            )
        )
    figure.add_trace(
        Scatter(
            x=[row["propellant_percent"] for row in PAPER_ROWS.values()],
            y=[row["safe_site_percent"] for row in PAPER_ROWS.values()],
            text=list(PAPER_ROWS),
            textposition="top center",
            textfont={"size": 11, "color": "#555555"},
            mode="markers+text",
            marker={"color": "#555555", "symbol": "diamond-open", "size": 11},
            name="the paper",
            hovertemplate="%{text}<br>%{x} %, %{y} %<extra></extra>",
        )
    )
    figure.update_layout(showlegend=True, legend={"orientation": "h", "yanchor": "top", "y": -0.2})
    return _finish(figure, "propellant burnt [%]", "safe site [%]")


def draw_differences(differences: Sequence[PairedDifference]) -> Figure:
    """Difference of the safe ratio from the reference, in percentage points."""
    from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    shown = list(reversed(differences))
    for name, color, symbol, shift in (
        ("safe_site", COLORS[0], "circle", 0.12),
        ("success", COLORS[1], "square", -0.12),
    ):
        ends = [
            (100.0 * d.ratios[name].estimate, 100.0 * d.ratios[name].low, 100.0 * d.ratios[name].high)
            for d in shown
        ]
        figure.add_trace(
            Scatter(
                x=[end[0] for end in ends],
                y=[k + shift for k in range(len(shown))],
                error_x=_bars(ends),
                mode="markers",
                marker={"color": color, "symbol": symbol, "size": 9},
                name=name.replace("_", " "),
                text=[d.policy for d in shown],
                hovertemplate="%{text}: %{x:.2f} points<extra></extra>",
            )
        )
    figure.update_layout(
        showlegend=True,
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.0},
        height=max(260, 90 + 40 * len(shown)),
    )
    figure.add_vline(x=0.0, line={"color": "#555555", "width": 1, "dash": "dash"})
    _finish(figure, f"percentage points against {differences[0].reference}", "")
    figure.update_yaxes(
        tickmode="array",
        tickvals=list(range(len(shown))),
        ticktext=[d.policy for d in shown],
        automargin=True,
    )
    return figure


def draw_histogram(measure: str, histograms: MeasureHistograms) -> Figure:
    """Distribution of a measure for each policy, as steps over equal bins; the end bins hold the rest."""
    from plotly.graph_objects import Figure, Scatter

    edges = histograms.edges[measure]
    centers = np.round((edges[:-1] + edges[1:]) / 2.0, 6)
    figure = Figure()
    for index, name in enumerate(histograms.policies):
        figure.add_trace(
            Scatter(
                x=centers.tolist(),
                y=histograms.count(measure, name).tolist(),
                mode="lines",
                line={**line_style(index), "shape": "hvh", "width": 1.6},
                name=name,
            )
        )
    figure.update_layout(showlegend=False, height=260)
    return _finish(figure, label_measure(measure), "episodes")


def _bars(ends: Sequence[tuple[float, float, float]]) -> dict[str, Any]:
    # an interval may lie beyond any picture (one episode alone): such an end is not drawn
    lengths = [(high - middle, middle - low) for middle, low, high in ends]
    return {
        "type": "data",
        "symmetric": False,
        "array": [up if np.isfinite(up) else 0.0 for up, _ in lengths],
        "arrayminus": [down if np.isfinite(down) else 0.0 for _, down in lengths],
        "thickness": 1.5,
    }


def _finish(figure: Figure, x_title: str, y_title: str) -> Figure:
    figure.update_layout(
        template="none",
        margin={"l": 60, "r": 16, "t": 24, "b": 48},
        font={"family": "system-ui, sans-serif", "size": 13},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        hovermode="closest",
    )
    figure.update_xaxes(title=x_title, gridcolor="#dddddd", zeroline=False, automargin=True)
    figure.update_yaxes(title=y_title, gridcolor="#dddddd", zeroline=False, automargin=True)
    return figure
