"""Picture of the layers: success of each policy from setting to setting."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import MATPLOTLIB_DASHES, line_style
from hda.registry import policy_entry
from studies.campaign.points import Rows
from studies.statistics.ratios import wilson_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_layers(flown: Mapping[str, Rows]) -> Figure:
    """Draw success and propellant of each policy against the setting, success with Wilson's intervals.

    Args:
        flown: setting -> rows of each policy, from the first setting to the last.
    """
    from matplotlib.figure import Figure

    layers, policies = list(flown), list(next(iter(flown.values())))
    figure = Figure(figsize=(13.0, 0.16 * len(policies) + 3.6), layout="constrained")
    success, propellant = figure.subplots(1, 2)
    for k, policy in enumerate(policies):
        place = np.arange(len(layers)) + 0.4 / len(policies) * (k - 0.5 * (len(policies) - 1))
        every = [flown[layer][policy] for layer in layers]
        ends = [wilson_interval(sum(row.success for row in rows), len(rows)) for rows in every]
        middle = np.array([100.0 * one.estimate for one in ends])
        low, high = (100.0 * np.array([getattr(one, end) for one in ends]) for end in ("low", "high"))
        style = line_style(k)
        drawn = {"color": style["color"], "linestyle": MATPLOTLIB_DASHES[style["dash"]], "marker": "o"}
        label = f"{policy} *" if policy_entry(policy).privileged else policy
        errors = (middle - low, high - middle)
        success.errorbar(
            place, middle, yerr=errors, markersize=3.5, linewidth=1.2, elinewidth=0.8, label=label, **drawn
        )
        burnt = [float(np.mean([row.propellant_percent for row in rows])) for rows in every]
        propellant.plot(place, burnt, markersize=3.5, linewidth=1.2, **drawn)
    for axes, title in ((success, "success [%]"), (propellant, "propellant burnt [%]")):
        axes.set_xticks(range(len(layers)), layers)
        axes.set_ylabel(title)
        axes.grid(alpha=0.25)
    handles, labels = success.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", frameon=False, fontsize="small")
    return figure
