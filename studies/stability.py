"""Which ZEM/ZEV gains are safe at which time to go: margins, exact solutions and the sampled loop.

Over the agent's gain box it sets side by side the margins of the loop at a held time to go (python-control
and closed form), the powers of the time to go that solve the continuous loop exactly, and the loop whose
thrust is held over each control period, down to cut-off at half a period.
"""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from guidance.state import State
from guidance.validation import finite_number
from guidance.zem_zev import time_to_go
from hda.presets import find_preset
from hda.scenario import Preset
from studies.compare import open_folder
from studies.zem_zev_flight import (
    Clock,
    error_growth,
    flight_powers,
    fly_sampled,
    speed_vanishes,
    thrust_bounded,
)
from studies.zem_zev_loop import (
    Gains,
    closed_margins,
    least_safe_time,
    margins_by_control,
    sampled_margins,
    sampled_margins_by_control,
    stable_above,
)

POSITION_GAINS = (5.0, 7.0)
VELOCITY_GAINS = (1.0, 3.0)
"""The agent's gain box (paper, table of actions)."""
_PHASES = np.linspace(0.55, 1.5, 20)
_TIMES = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0, 80.0)


@dataclass(frozen=True)
class Stability:
    """Command line of the stability study.

    Attributes:
        preset: the setting: control period, start, lander, soft speed.
        gain_points: gains along each side of the box, at least 2.
        phase_margin: [deg] that a safe loop keeps.
        gain_margin: factor that a safe loop keeps (2 is 6 dB).
        out: folder for results; results/stability by default.
        figures: draw the figure.
    """

    preset: str = "paper"
    gain_points: int = 5
    phase_margin: float = 30.0
    gain_margin: float = 2.0
    out: Path = Path("results/stability")
    figures: bool = True

    def __post_init__(self) -> None:
        """Check every option."""
        finite_number("gain_points", self.gain_points, at_least=2, at_most=101)
        finite_number("phase_margin", self.phase_margin, at_least=0.0, at_most=40.0)
        finite_number("gain_margin", self.gain_margin, at_least=1.0)


@dataclass(frozen=True)
class MarginRow:
    """One pair of gains at one time to go, held for the margins.

    The last three fields fly a velocity error from there (within half a period) to cut-off; worst over the
    clock's phase.
    """

    position_gain: float
    velocity_gain: float
    time_to_go_s: float
    crossover_radps: float
    phase_margin_deg: float
    phase_margin_closed_form_deg: float
    delay_margin_s: float
    delay_margin_closed_form_s: float
    gain_margin: float
    sampled_phase_margin_deg: float
    sampled_phase_margin_closed_form_deg: float
    sampled_gain_margin: float
    sampled_stable: bool
    margins_met: bool
    error_position_m_per_mps: float
    error_velocity_left: float
    error_thrust_growth: float


@dataclass(frozen=True)
class GainRow:
    """One pair of gains over a whole flight; `frozen` and `safe`: gains held below that time to go."""

    position_gain: float
    velocity_gain: float
    power_1_real: float
    power_2_real: float
    power_imaginary: float
    speed_vanishes: bool
    thrust_bounded: bool
    phase_margin_deg: float
    delay_margin_over_time_to_go: float
    sampled_stable_above_s: float
    margins_met_above_s: float
    touchdown_speed_mps_median: float
    touchdown_speed_mps_max: float
    frozen_at_stable_mps_median: float
    frozen_at_stable_mps_max: float
    frozen_at_margins_mps_median: float
    frozen_at_margins_mps_max: float
    maximum_thrust_n: float
    maximum_thrust_frozen_n: float


def gain_box(points: int) -> list[Gains]:
    """Pairs of gains over the agent's box, K_V outer."""
    return [
        Gains(float(position), float(velocity))
        for velocity in np.linspace(*VELOCITY_GAINS, points)
        for position in np.linspace(*POSITION_GAINS, points)
    ]


def margin_row(gains: Gains, time: float, period: float, options: Stability) -> MarginRow:
    """Every margin at one time to go, and what a velocity error there becomes by cut-off."""
    loop, exact = margins_by_control(gains, time), closed_margins(gains, time)
    sampled, sampled_exact = (
        sampled_margins_by_control(gains, time, period),
        sampled_margins(gains, time, period),
    )
    first = max(round(time / period), 1)
    growth = [error_growth(gains, Clock(period, first, float(phase))) for phase in _PHASES]
    return MarginRow(
        gains.position,
        gains.velocity,
        time,
        loop.crossover,
        math.degrees(loop.phase_margin),
        math.degrees(exact.phase_margin),
        loop.delay_margin,
        exact.delay_margin,
        loop.gain_margin,
        math.degrees(sampled.phase_margin),
        math.degrees(sampled_exact.phase_margin),
        sampled.gain_margin,
        time > stable_above(gains, period) * (1.0 + 1e-12),
        sampled_exact.meet(math.radians(options.phase_margin), options.gain_margin),
        max(one.position for one in growth),
        max(one.velocity for one in growth),
        max(one.thrust for one in growth),
    )


def mean_descent(preset: Preset) -> tuple[np.ndarray, np.ndarray, float]:
    """Position [m] from the target, velocity [m/s] and time to go [s] in the middle of the preset's starts."""

    def middle(name: str) -> float:
        drawn = getattr(preset.start, name)
        return 0.5 * (drawn.low + drawn.high)

    height = middle("altitude") - preset.terrain.maximum_elevation
    position = np.array([-middle("distance"), 0.0, height])
    velocity = np.array([middle("horizontal_speed"), 0.0, -middle("descent_speed")])
    state = State(position, velocity, middle("mass"))
    return position, velocity, time_to_go(state, np.zeros(3), preset.gravity)


def descend(gains: Gains, preset: Preset, frozen_below: float) -> tuple[np.ndarray, float]:
    """Fly the mean descent at every phase of the clock.

    Returns:
        Touchdown speed [m/s] per phase (at cut-off, plus the fall from there), and the largest thrust [N],
        unsaturated.
    """
    position, velocity, time = mean_descent(preset)
    period = preset.rules.control_period
    gravity = np.array(preset.gravity)
    speeds, push = [], 0.0
    for phase in _PHASES:
        clock = Clock(period, round(time / period), float(phase), frozen_below)
        flight = fly_sampled(gains, clock, position, velocity, gravity)
        fall = 2.0 * -gravity[2] * max(0.0, float(flight.position[-1, 2]))
        speeds.append(math.sqrt(float(flight.velocity[-1] @ flight.velocity[-1]) + fall))
        push = max(push, float(np.linalg.norm(flight.acceleration, axis=1).max()))
    return np.array(speeds), push * preset.start.mass.high


def gain_row(gains: Gains, preset: Preset, options: Stability) -> GainRow:
    """The exact powers, the times to go that are safe, and the mean descent with and without frozen gains."""
    period = preset.rules.control_period
    first, second = flight_powers(gains)
    loop = closed_margins(gains, 1.0)
    stable = stable_above(gains, period)
    safe = least_safe_time(gains, period, math.radians(options.phase_margin), options.gain_margin)
    free, thrust = descend(gains, preset, 0.0)
    at_stable, thrust_frozen = descend(gains, preset, stable)
    at_margins, _ = descend(gains, preset, safe)
    return GainRow(
        gains.position,
        gains.velocity,
        float(first.real),
        float(second.real),
        float(second.imag),
        speed_vanishes(gains),
        thrust_bounded(gains),
        math.degrees(loop.phase_margin),
        loop.delay_margin,
        stable,
        safe,
        *(float(f(s)) for s in (free, at_stable, at_margins) for f in (np.median, np.max)),
        thrust,
        thrust_frozen,
    )


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write equal dataclasses as CSV, a field a column."""
    names = [field.name for field in fields(rows[0])]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        for row in rows:
            values = [getattr(row, name) for name in names]
            writer.writerow([f"{v:.9g}" if isinstance(v, float) else v for v in values])


def print_gains(rows: Sequence[GainRow], preset: Preset) -> None:
    """Print one line per pair of gains."""
    period = preset.rules.control_period
    table = Table(title=f"ZEM/ZEV, control period {period:g} s; speeds: median / worst clock phase")
    headings = ("K_R", "K_V", "powers of t_go", "thrust", "phase margin", "delay / t_go")
    ends = ("stable above", "margins above", "touchdown m/s", "frozen at stable", "frozen at margins")
    for heading in (*headings, *ends):
        table.add_column(heading, justify="right")
    for r in rows:
        if r.power_imaginary > 0.0:
            powers = f"{r.power_1_real:.2f} +- {r.power_imaginary:.2f}j"
        else:
            powers = f"{r.power_1_real:.2f}, {r.power_2_real:.2f}"
        table.add_row(
            f"{r.position_gain:g}",
            f"{r.velocity_gain:g}",
            powers,
            "bounded" if r.thrust_bounded else "grows",
            f"{r.phase_margin_deg:.1f} deg",
            f"{r.delay_margin_over_time_to_go:.3f}",
            f"{r.sampled_stable_above_s:.2f} s",
            f"{r.margins_met_above_s:.2f} s",
            f"{r.touchdown_speed_mps_median:.2f} / {r.touchdown_speed_mps_max:.2f}",
            f"{r.frozen_at_stable_mps_median:.2f} / {r.frozen_at_stable_mps_max:.2f}",
            f"{r.frozen_at_margins_mps_median:.2f} / {r.frozen_at_margins_mps_max:.2f}",
        )
    Console(width=max(Console().width, 146)).print(table)


def study_stability(options: Stability) -> tuple[list[MarginRow], list[GainRow]]:
    """Compute, write gains.csv, margins.csv, conclusions.txt and the figure, and print.

    Raises:
        ValueError: an option is out of range or names something unknown.
        OSError: the folder cannot be written.
    """
    from studies.stability_report import conclude

    preset = find_preset(options.preset)
    period = preset.rules.control_period
    out = open_folder(options.out)
    box = gain_box(options.gain_points)
    gain_rows = [gain_row(gains, preset, options) for gains in box]
    times = sorted({0.501 * period, *(time for time in _TIMES if time > 0.501 * period)})
    margin_rows = [
        margin_row(gains, time, period, options)
        for gains in track(box, "margins", transient=True)
        for time in times
    ]
    write_rows(out / "gains.csv", gain_rows)
    write_rows(out / "margins.csv", margin_rows)
    words = conclude(margin_rows, gain_rows, preset, options)
    (out / "conclusions.txt").write_text("\n".join(words) + "\n")
    if options.figures:
        from studies.stability_figure import draw_stability

        draw_stability(out / "stability.png", preset, options)
    print_gains(gain_rows, preset)
    console = Console()
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return margin_rows, gain_rows


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    try:
        study_stability(tyro.cli(Stability, description=__doc__))
    except (ValueError, OSError) as error:
        Console(stderr=True).print(f"error: {error}", style="red", markup=False, highlight=False)
        sys.exit(2)


if __name__ == "__main__":
    main()
