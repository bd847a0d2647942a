"""Charts of a report, as plotly figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hda.flight.palette import COLORS, line_style, marker_style
from studies.campaign.score import label_measure
from studies.compare.differences import PairedDifference
from studies.compare.histograms import MeasureHistograms
from studies.compare.table import PolicySummary
from studies.paper import PAPER_ROWS
from studies.statistics.ratios import Interval

OUTLINE = "#1a1a1a"
_PAPER_LABELS = {
    "TD3": "bottom right",
    "TD3 + LSTM": "top left",
    "Fixed Control": "bottom left",
    "Single Divert": "top right",
}
"""Where the names stand beside the paper's points, which lie close together."""

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


def draw_headline(summaries: Sequence[PolicySummary]) -> Figure:
    """Unsafe share on a logarithmic axis against propellant, with both intervals; the paper's are stars.

    A policy without an unsafe site has no place on such an axis: it stands hollow at half an episode, and its
    interval reaches down no further.
    """
    from plotly.graph_objects import Figure, Scatter

    figure = Figure()
    for index, summary in enumerate(summaries):
        propellant, unsafe = summary.means["propellant_percent"], unsafe_percent(summary)
        shown = unsafe.estimate or 50.0 / summary.episodes
        marker = marker_style(index) | {"line": {"color": OUTLINE, "width": 1}}
        if not unsafe.estimate:
            marker |= {"symbol": f"{marker['symbol']}-open", "line": {"width": 2}}
        figure.add_trace(
            Scatter(
                x=[propellant.estimate],
                y=[shown],
                error_x=_bars([(propellant.estimate, propellant.low, propellant.high)]),
                error_y=_bars([(shown, _lower_end(unsafe, shown), max(unsafe.high, shown))]),
                mode="markers",
                marker=marker,
                name=summary.policy,
                text=[
                    f"{summary.policy}: {unsafe.estimate:.2f} % unsafe"
                    f" ({unsafe.low:.2f} to {unsafe.high:.2f}), {propellant.estimate:.2f} % propellant"
                ],
                hovertemplate="%{text}<extra></extra>",
            )
        )
    figure.add_trace(
        Scatter(
            x=[row["propellant_percent"] for row in PAPER_ROWS.values()],
            y=[100.0 - row["safe_site_percent"] for row in PAPER_ROWS.values()],
            text=list(PAPER_ROWS),
            textposition=[_PAPER_LABELS[name] for name in PAPER_ROWS],
            textfont={"size": 12, "color": "#555555", "shadow": "0 0 3px #fff, 0 0 3px #fff"},
            cliponaxis=False,
            mode="markers+text",
            marker={"color": "#555555", "symbol": "star-open", "size": 13, "line": {"width": 2}},
            name="the paper",
            hovertemplate="the paper, %{text}<br>%{y:.1f} % unsafe, %{x} % propellant<extra></extra>",
        )
    )
    figure.update_layout(showlegend=True, height=max(460, 140 + 20 * len(summaries)))
    _finish(figure, "propellant burnt [%]", "unsafe sites [%]")
    lowest = [_lower_end(unsafe_percent(summary), 50.0 / summary.episodes) for summary in summaries]
    shares = [*lowest, *(100.0 - row["safe_site_percent"] for row in PAPER_ROWS.values())]
    burnt = [summary.propellant.estimate for summary in summaries]
    burnt += [row["propellant_percent"] for row in PAPER_ROWS.values()]
    figure.update_xaxes(range=[min(burnt) - 1.5, max(burnt) + 2.5])
    ticks = [value for power in range(-5, 3) for value in (10.0**power, 3.0 * 10.0**power) if value <= 100.0]
    figure.update_yaxes(
        type="log",
        range=[math.log10(0.6 * min(shares)), math.log10(130.0)],
        tickvals=ticks,
        ticktext=[f"{value:g}" for value in ticks],
    )
    return figure


def unsafe_percent(summary: PolicySummary) -> Interval:
    """[%] share of unsafe sites with Wilson's interval."""
    safe = summary.safe_site
    return Interval(*(100.0 * (1.0 - end) for end in (safe.estimate, safe.high, safe.low)))


def _lower_end(unsafe: Interval, shown: float) -> float:
    """Where an interval ends on a logarithmic axis: without an unsafe site, at the mark itself."""
    return unsafe.low if unsafe.estimate else shown


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


def draw_distribution(measure: str, histograms: MeasureHistograms) -> Figure:
    """Cumulative distribution of a measure for each policy: the share of episodes up to each value.

    Counts in bins give it at their edges; the first and the last bin hold what lies beyond.
    """
    from plotly.graph_objects import Figure, Scatter

    edges = np.round(histograms.edges[measure], 6)
    figure = Figure()
    for index, name in enumerate(histograms.policies):
        counts = np.cumsum(histograms.count(measure, name))
        share = np.concatenate([[0.0], 100.0 * counts / counts[-1]])
        figure.add_trace(
            Scatter(
                x=edges.tolist(),
                y=np.round(share, 3).tolist(),
                mode="lines",
                line=line_style(index),
                name=name,
                hovertemplate="%{y:.1f} % up to %{x:.4g}",
            )
        )
    figure.update_layout(showlegend=False, height=260)
    _finish(figure, label_measure(measure), "episodes [%]")
    figure.update_yaxes(range=[-2.0, 102.0])
    return figure


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
