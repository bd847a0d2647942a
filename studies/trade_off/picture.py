"""Picture of the trade-off study: safe landings against propellant, with intervals and the front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from studies.trade_off.table import Bounds, TradeOffRow

_PANELS = 3  # in a row
_MARKERS = ("o", "s", "D", "^", "v", "P", "X")


def draw_trade_off(rows: Sequence[TradeOffRow], bounds: Sequence[Bounds]) -> Figure:
    """Draw a panel per preset: the policies, and below them the sweeps of the weights where there are any.

    Without sweeps the panels stand three in a row. The floor is drawn where `bounds` has one.
    """
    from matplotlib.figure import Figure

    presets = list(dict.fromkeys(row.preset for row in rows))
    swept = any(row.weight for row in rows)
    wide = len(presets) if swept else min(len(presets), _PANELS)
    high = 2 if swept else -(-len(presets) // wide)
    figure = Figure(figsize=(1.5 + 5.4 * wide, 4.6 * high), layout="constrained")
    axes = figure.subplots(high, wide, squeeze=False)
    for number, preset in enumerate(presets):
        axis, column = axes.flat[number], number
        own = [row for row in rows if row.preset == preset]
        weights = [row for row in own if row.weight]
        splits = {row.split for row in weights}
        floor = next((b.floor.estimate for b in bounds if b.preset == preset), None)
        _draw_policies(axis, [r for r in own if not r.weight and r.split not in splits], floor)
        axis.set_title(f"{preset}: policies")
        if swept:
            start = next((r for r in own if not r.weight and r.split in splits), None)
            _draw_weights(axes[1, column], weights, start)
            axes[1, column].set_title(f"{preset}: hazard-aware with one weight changed (tuning tiles)")
    if not swept:
        for axis in axes.flat[len(presets) :]:
            axis.remove()
    for row in axes:
        last = next(axis for axis in reversed(row) if axis.figure is not None)
        last.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    return figure


def _ends(row: TradeOffRow) -> tuple[list[float], list[float], list[float]]:
    """Middle, low and high of (propellant, the ratio, the ratio by tile), in percent."""
    triples = (row.score.propellant, row.landed, row.landed_by_tile)
    factors = (1.0, 100.0, 100.0)
    middle, low, high = (
        [factor * getattr(interval, end) for factor, interval in zip(factors, triples, strict=True)]
        for end in ("estimate", "low", "high")
    )
    return middle, low, high


def _draw_point(axis: Axes, row: TradeOffRow, color: str, marker: str, label: str | None) -> None:
    middle, low, high = _ends(row)
    tile = ([[middle[1] - low[2]], [high[2] - middle[1]]],)
    axis.errorbar([middle[0]], [middle[1]], yerr=tile[0], color=color, elinewidth=0.7, capsize=0, alpha=0.6)
    axis.errorbar(
        [middle[0]],
        [middle[1]],
        xerr=[[middle[0] - low[0]], [high[0] - middle[0]]],
        yerr=[[middle[1] - low[1]], [high[1] - middle[1]]],
        color=color,
        marker=marker,
        markersize=6,
        markerfacecolor="white" if row.privileged else color,
        elinewidth=1.6,
        capsize=2,
        linestyle="none",
        label=label,
    )


def _draw_policies(axis: Axes, rows: Sequence[TradeOffRow], floor: float | None) -> None:
    for k, row in enumerate(rows):
        name = row.policy + (" *" if row.privileged else "")
        _draw_point(axis, row, COLORS[k % len(COLORS)], _MARKERS[k % len(_MARKERS)], name)
    front = sorted(_ends(row)[0][:2] for row in rows if row.on_front)
    axis.step(*np.array(front).T, where="post", color="0.3", linewidth=1.0, linestyle="--", label="front")
    if floor is not None:
        axis.axvline(floor, color="0.5", linewidth=1.0, linestyle=":", label="floor on propellant")
    _label(axis, rows[0].landed_name)


def _draw_weights(axis: Axes, rows: Sequence[TradeOffRow], start: TradeOffRow | None) -> None:
    for k, weight in enumerate(dict.fromkeys(row.weight for row in rows)):
        color, marker = COLORS[k % len(COLORS)], _MARKERS[k % len(_MARKERS)]
        for number, row in enumerate(row for row in rows if row.weight == weight):
            _draw_point(axis, row, color, marker, weight if number == 0 else None)
            middle = _ends(row)[0]
            axis.annotate(
                f"{row.value:g}",
                (middle[0], middle[1]),
                textcoords="offset points",
                xytext=(4, 4),
                fontsize="x-small",
                color=color,
            )
    if start is not None:
        _draw_point(axis, start, "black", "*", "default weights")
    _label(axis, rows[0].landed_name)


def _label(axis: Axes, ratio: str) -> None:
    axis.set_xlabel("propellant burnt [%], mean with Student's interval")
    axis.set_ylabel(f"{ratio} [%], Wilson's interval, thin: by tile")
    axis.grid(alpha=0.25)
