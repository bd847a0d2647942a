"""Picture of one factor of the robustness sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import MATPLOTLIB_DASHES, line_style
from studies.campaign.points import Rows
from studies.statistics.ratios import wilson_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = (("safe_site", "safe site [%]"), ("success", "success [%]"))


def draw_sweep(label: str, own: float, levels: Mapping[float, Rows]) -> Figure:
    """Draw safe sites and successes against a factor's value, with Wilson's intervals.

    Args:
        label: of the axis.
        own: the preset's own value, marked.
        levels: value -> rows of each policy, rising.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 4.4), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    values = np.array(list(levels))
    spread = 0.006 * float(values.max() - values.min() or 1.0)
    policies = list(levels[own])
    for axis, (ratio, title) in zip(axes, _PANELS, strict=True):
        for k, policy in enumerate(policies):
            ends = []
            for rows in levels.values():
                hits = sum(getattr(row, ratio) for row in rows[policy])
                interval = wilson_interval(hits, len(rows[policy]))
                ends.append((interval.estimate, interval.low, interval.high))
            middle, low, high = 100.0 * np.array(ends).T
            style = line_style(k)
            axis.errorbar(
                values + spread * (k - 0.5 * (len(policies) - 1)),
                middle,
                yerr=(middle - low, high - middle),
                color=style["color"],
                linestyle=MATPLOTLIB_DASHES[style["dash"]],
                marker="o",
                markersize=3.5,
                linewidth=1.3,
                elinewidth=0.8,
                capsize=1.5,
                label=policy,
            )
        axis.axvline(own, color="0.6", linewidth=0.8, linestyle=":", zorder=0)
        axis.set_xlabel(label)
        axis.set_ylabel(title)
        axis.set_ylim(-3.0, 103.0)
        axis.grid(alpha=0.25)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False, fontsize="small")
    return figure
