"""Picture of the failing flights beside all: where they began, and where and when their sites were chosen."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import COLORS
from studies.rare_events.flights import LeafRow, RootRow
from studies.rare_events.table import CauseRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANELS: tuple[tuple[str, Callable[[RootRow, LeafRow], float]], ...] = (
    ("first target to the nearest safe ground [m]", lambda root, leaf: root.nearest_safe_m),
    ("first target to the last site [m]", lambda root, leaf: leaf.divert_m),
    ("greatest angle of a target from the vertical [deg]", lambda root, leaf: leaf.off_nadir_deg),
    ("look at which the last site was chosen", lambda root, leaf: float(leaf.chosen)),
    ("safe share of the ground about the last site", lambda root, leaf: leaf.safe_share),
)
_BINS = 16


def draw_failing(roots: Sequence[RootRow], causes: Sequence[CauseRow]) -> Figure:
    """Draw weighted histograms of the failing flights and of all, and the causes.

    Args:
        roots: of the trees.
        causes: of their failures, the greatest share first.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 7.0), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    pairs = [(root, leaf) for root in roots for leaf in root.leaves]
    weights = np.array([leaf.weight for _, leaf in pairs])
    failed = np.array([leaf.failed for _, leaf in pairs], dtype=bool)
    for panel, (title, measure) in zip(axes, _PANELS, strict=False):
        values = np.array([measure(root, leaf) for root, leaf in pairs])
        _draw_histogram(panel, title, values, weights, failed)
    _draw_causes(axes[-1], causes)
    return figure


def _draw_histogram(
    axis: Axes,
    title: str,
    values: np.ndarray[tuple[int], np.dtype[np.float64]],
    weights: np.ndarray[tuple[int], np.dtype[np.float64]],
    failed: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> None:
    known = np.isfinite(values)
    edges = np.histogram_bin_edges(values[known] if known.any() else np.zeros(1), _BINS)
    groups = (("all flights", known, "0.6"), ("failing", known & failed, COLORS[3]))
    for label, chosen, color in groups:
        counts, _ = np.histogram(values[chosen], edges, weights=weights[chosen])
        share = counts / counts.sum() if counts.sum() > 0.0 else counts
        axis.stairs(100.0 * share, edges, label=label, color=color, linewidth=1.6)
    axis.set_xlabel(title)
    axis.set_ylabel("share [%]")
    axis.grid(alpha=0.25)
    axis.legend(frameon=False, fontsize="small")


def _draw_causes(axis: Axes, causes: Sequence[CauseRow]) -> None:
    shown = causes[::-1]
    axis.barh(range(len(shown)), [100.0 * row.share for row in shown], color=COLORS[3])
    names = ["\n".join(textwrap.wrap(row.cause, 26)) for row in shown]
    axis.set_yticks(range(len(shown)), names, fontsize="small")
    axis.set_xlabel("share of the failure probability [%]")
