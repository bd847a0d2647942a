"""Picture of the timing study: how long each method takes, and what its plans cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.timing.measures import Call
    from studies.timing.methods import Method

_LEAST_REGRET = 1e-2  # [g] shown for this and less


def draw_timing(methods: Sequence[Method], calls: Sequence[Call]) -> Figure:
    """Draw how many calls are done by a time, and median regret against median time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 7.5), layout="constrained")
    done, cost = figure.subplots(1, 2)
    families = list(dict.fromkeys(method.name for method in methods))
    for method in methods:
        color = COLORS[families.index(method.name) % len(COLORS)]
        own = [call for call in calls if call.method == method.label and call.feasible]
        if not own:
            continue
        times = np.sort([1e3 * call.processor for call in own])
        dashes = ("-" if method.free else "--") if method.nodes > 31 else ("-." if method.free else ":")
        done.step(
            times,
            100.0 * np.arange(1, times.size + 1) / times.size,
            where="post",
            color=color,
            linestyle=dashes,
            label=method.label,
        )
        regrets = [1e3 * call.regret for call in own if call.keeps_limits]
        if regrets:
            marker = "o" if method.free else "s"
            middle = max(float(np.median(regrets)), _LEAST_REGRET)
            cost.plot(np.median(times), middle, marker, color=color, markersize=8)
            cost.annotate(
                str(method.nodes),
                (float(np.median(times)), middle),
                xytext=(6, 6),
                textcoords="offset points",
                fontsize="small",
            )
    done.set_xscale("log")
    done.set_xlabel("processor time of a call [ms]")
    done.set_ylabel("calls on feasible cases done [%]")
    figure.legend(loc="outside lower center", ncols=5, fontsize="small", title="method, time, nodes")
    cost.set_xscale("log")
    cost.set_yscale("log")
    cost.margins(0.2)
    cost.set_xlabel("median processor time [ms]")
    cost.set_ylabel("median propellant beyond the tight optimum [g]")
    cost.set_title("round: free time of flight; square: fixed; number: nodes", fontsize="medium")
    for axis in (done, cost):
        axis.grid(alpha=0.25, which="both")
    return figure
