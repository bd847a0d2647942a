"""Picture of the bounds and flights: what each loses, and what the difference consists of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.information_bound.table import StepRow

_PROVED, _FLOWN = COLORS[0], COLORS[1]
_ROOM = 0.08  # of the width of the picture, beside what is drawn


def draw_steps(lines: Sequence[StepRow]) -> Figure:
    """Draw a line per step, the weakest bound on top: its loss, with a bar from the loss of the step before.

    Below them stands the whole difference between the first bound and the last flight, in two parts: up to
    the first flight, and from there on. Nothing that flies can lie in the shaded part.

    Args:
        lines: bounds first, then flights; at least one of each. All flights but the last see the true map.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 0.36 * len(lines) + 2.0), layout="constrained")
    axes = figure.subplots()
    losses = np.array([line.loss.estimate for line in lines])
    low, high = (np.array([getattr(line.loss, end) for line in lines]) for end in ("low", "high"))
    room = _ROOM * (high.max() - low.min())
    left, right = low.min() - 2.0 * room, high.max() + 3.0 * room
    axes.axvspan(left, losses[0], color="0.9", label="no policy, on average")
    for proved, color, label in (
        (True, _PROVED, "bound, proved"),
        (False, _FLOWN, "flown; * sees the true map, or is told it"),
    ):
        own = np.array([k for k, line in enumerate(lines) if line.proved == proved])
        ends = losses[own] - low[own], high[own] - losses[own]
        axes.errorbar(losses[own], own, xerr=ends, fmt="o", color=color, markersize=4, capsize=2, label=label)
        risen = own[own > 0]
        axes.barh(
            risen,
            losses[risen] - losses[risen - 1],
            left=losses[risen - 1],
            color=color,
            alpha=0.35,
            height=0.6,
        )
    for k, line in enumerate(lines[1:], 1):
        axes.text(high[k] + 0.4 * room, k, f"{line.rise.estimate:+.2f}", va="center", fontsize="small")
    _draw_sum(axes, lines, losses)
    axes.set_xlim(left, right)
    sighted = [f"{line.step} *" if not line.proved else line.step for line in lines[:-1]]
    axes.set_yticks(range(len(lines) + 1), [*sighted, lines[-1].step, "in sum"])
    axes.set_ylim(len(lines) + 0.6, -0.6)
    axes.set_xlabel("loss [%]: propellant, a failure counts a whole tank; mean, interval by tile")
    axes.grid(axis="x", alpha=0.25)
    axes.legend(loc="upper right", frameon=False, fontsize="small")
    return figure


def _draw_sum(axes: Axes, lines: Sequence[StepRow], losses: np.ndarray) -> None:
    """The line below the steps: how the last one's distance from the first bound divides."""
    flown = next(k for k, line in enumerate(lines) if not line.proved)
    parts = (
        (losses[0], losses[flown], _PROVED, "how it flies"),
        (losses[flown], losses[-1], _FLOWN, "what it does not know"),
    )
    row = len(lines)
    for begin, end, color, words in parts:
        axes.barh([row], [end - begin], left=[begin], color=color, alpha=0.75, height=0.6, gid=words)
    axes.text(
        0.5 * (losses[0] + losses[flown]),
        row,
        f"{parts[0][3]}: {losses[flown] - losses[0]:.2f} points",
        ha="center",
        va="center",
        fontsize="small",
        color="white",
    )
    axes.text(
        losses[-1],
        row,
        f"  {parts[1][3]}: {losses[-1] - losses[flown]:.2f}",
        va="center",
        fontsize="small",
    )
