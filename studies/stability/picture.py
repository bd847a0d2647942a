"""Picture of the stability study: maps over the gain box, and margins against the time to go."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hda.flight.palette import COLORS
from hda.task.presets import Preset
from studies.stability.held_loop import Gains, closed_margins, least_safe_time, sampled_margins, stable_above
from studies.stability.sampled_flight import flight_powers
from studies.stability.sweep import POSITION_GAINS, VELOCITY_GAINS, Requirement, descend

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

_SHOWN = (Gains(6.0, 2.0), Gains(5.0, 1.0), Gains(7.0, 1.0), Gains(5.0, 3.0), Gains(7.0, 3.0))
_POINTS = 33


def draw_stability(preset: Preset, required: Requirement) -> Figure:
    """Draw the maps and the margins; the caller saves the figure."""
    from matplotlib.figure import Figure

    period = preset.rules.control_period
    box = [
        [Gains(float(p), float(v)) for p in np.linspace(*POSITION_GAINS, _POINTS)]
        for v in np.linspace(*VELOCITY_GAINS, _POINTS)
    ]
    safe = np.array(
        [
            [least_safe_time(g, period, required.phase_margin, required.gain_margin) for g in row]
            for row in box
        ]
    )
    powers = np.array([[flight_powers(g)[0].real for g in row] for row in box])
    free = np.array([[descend(g, preset, 0.0).residual.max() for g in row] for row in box])
    held = np.array(
        [
            [descend(g, preset, float(time)).residual.max() for g, time in zip(row, times, strict=True)]
            for row, times in zip(box, safe, strict=True)
        ]
    )
    figure = Figure(figsize=(16, 9), layout="constrained")
    axes = figure.subplots(2, 3)
    _draw_map(axes[0, 0], powers, "least Re n; bounded thrust above 2", (1.25, 1.5, 1.75, 2.0, 2.25, 2.5))
    _draw_margins(axes[0, 1], period, required)
    _draw_map(axes[0, 2], safe, "time to go above which margins are met [s]", (1.5, 1.75, 2.0, 2.5, 3.0))
    speeds = (0.5, preset.rules.soft_speed, preset.rules.crash_speed, 10.0, 20.0, 50.0)
    _draw_map(axes[1, 0], free, "worst speed left at cut-off, mean descent [m/s]", speeds)
    _draw_map(axes[1, 1], held, "the same, gains frozen where margins end [m/s]", speeds)
    strikes = np.array([[descend(g, preset, 0.0).time_left.max() for g in row] for row in box])
    strikes = np.maximum(strikes, 0.1 * period)  # after cut-off it is negative; the scale is a logarithm
    _draw_map(axes[1, 2], strikes, "worst time to go at which the plane is met [s]", (0.25, 1.0, 5.0, 10.0))
    figure.suptitle(
        f"ZEM/ZEV, control period {period:g} s; margins: {math.degrees(required.phase_margin):g} deg and a "
        f"factor {required.gain_margin:g}; worst over the phase of the clock; no thrust limit"
    )
    return figure


def _draw_map(axis: Axes, values: NDArray[np.float64], title: str, levels: tuple[float, ...]) -> None:
    from matplotlib.colors import LogNorm

    positions = np.linspace(*POSITION_GAINS, values.shape[1])
    velocities = np.linspace(*VELOCITY_GAINS, values.shape[0])
    wide = values.max() > 20.0 * values.min()
    norm = LogNorm(values.min(), values.max()) if wide else None
    mesh = axis.pcolormesh(positions, velocities, values, cmap="cividis", norm=norm, shading="gouraud")
    axis.figure.colorbar(mesh, ax=axis)
    inside = [level for level in sorted(set(levels)) if values.min() < level < values.max()]
    if inside:
        lines = axis.contour(positions, velocities, values, levels=inside, colors="white", linewidths=1.2)
        axis.clabel(lines, fmt="%g")
    axis.plot(6.0, 2.0, "o", color=COLORS[1], label="6/2")
    axis.set_xlabel("K_R")
    axis.set_ylabel("K_V")
    axis.set_title(title, fontsize="medium")
    axis.legend(loc="lower left")


def _draw_margins(axis: Axes, period: float, required: Requirement) -> None:
    times = np.geomspace(0.5 * period, 80.0, 400)
    for color, gains in zip(COLORS, _SHOWN, strict=False):
        margins = [math.degrees(sampled_margins(gains, float(t), period).phase_margin) for t in times]
        axis.semilogx(times, margins, color=color, label=f"{gains.position:g}/{gains.velocity:g}")
        held = math.degrees(closed_margins(gains, 1.0).phase_margin)
        axis.axhline(held, color=color, linestyle=":", linewidth=1.0)
        axis.axvline(stable_above(gains, period), color=color, linestyle="--", linewidth=0.7)
    axis.axhline(math.degrees(required.phase_margin), color="0.4", linewidth=0.8)
    axis.set_ylim(0.0, 90.0)
    axis.set_xlabel("time to go [s]")
    axis.set_ylabel("phase margin [deg]")
    axis.set_title("sampled (solid), continuous (dotted); dashed: stable to the right", fontsize="medium")
    axis.legend(loc="lower right", title="K_R/K_V")
    axis.grid(alpha=0.25)
