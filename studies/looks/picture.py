"""Pictures of the looks study: precision and recall over the range, and the calibration of the belief."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hda.flight.palette import COLORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from studies.looks.calibration import CalibrationRow
    from studies.looks.table import LookRow


def draw_looks(rows: Sequence[LookRow]) -> Figure:
    """Draw both ratios in percent, with their intervals by tile; dotted: the share of safe ground."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.0), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for axis, name in zip(axes, ("precision", "recall"), strict=True):
        for k, rays in enumerate(sorted({row.rays for row in rows})):
            own = sorted((row for row in rows if row.rays == rays), key=lambda row: row.slant_range)
            ratios = [getattr(row, name) for row in own]
            middle = [100.0 * ratio.estimate for ratio in ratios]
            ends = (
                [100.0 * (ratio.estimate - ratio.low) for ratio in ratios],
                [100.0 * (ratio.high - ratio.estimate) for ratio in ratios],
            )
            axis.errorbar(
                [row.slant_range for row in own],
                middle,
                yerr=ends,
                color=COLORS[k % len(COLORS)],
                marker="o",
                capsize=2,
                label=f"{rays} x {rays} rays",
            )
        axis.set_xlabel("range [m]")
        axis.set_ylim(0.0, 103.0)
        axis.grid(alpha=0.25)
    own = sorted((row for row in rows if row.rays == rows[0].rays), key=lambda row: row.slant_range)
    axes[0].plot(
        [row.slant_range for row in own],
        [100.0 * row.safe for row in own],
        color="0.4",
        linestyle=":",
        label="safe ground",
    )
    axes[0].set_ylabel("ratio [%], interval clustered by tile")
    axes[0].set_title("precision: called safe and is safe")
    axes[1].set_title("recall: is safe and called safe")
    axes[0].legend(frameon=False)
    return figure


def draw_calibration(rows: Sequence[CalibrationRow]) -> Figure:
    """Draw the share of safe ground over the probability told, with intervals by tile; dashed: equal."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 5.0), layout="constrained")
    axis = figure.subplots()
    axis.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linestyle="--", label="as told")
    for k, rays in enumerate(sorted({row.rays for row in rows})):
        own = sorted((row for row in rows if row.rays == rays), key=lambda row: row.told)
        axis.errorbar(
            [row.told for row in own],
            [row.safe.estimate for row in own],
            yerr=(
                [row.safe.estimate - row.safe.low for row in own],
                [row.safe.high - row.safe.estimate for row in own],
            ),
            color=COLORS[k % len(COLORS)],
            marker="o",
            capsize=2,
            label=f"{rays} x {rays} rays",
        )
    axis.set_xlabel("probability that the belief tells")
    axis.set_ylabel("share of safe ground, interval clustered by tile")
    axis.set_xlim(-0.02, 1.02)
    axis.set_ylim(-0.02, 1.02)
    axis.grid(alpha=0.25)
    axis.legend(frameon=False)
    return figure
