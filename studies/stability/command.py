"""Which ZEM/ZEV gains are safe at which time to go: margins, exact solutions and the sampled loop.

Over the agent's gain box it sets side by side the margins of the loop at a held time to go (python-control
and closed form), the powers of the time to go that solve the continuous loop exactly, and the loop whose
thrust is held over each control period, down to cut-off at half a period.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import track
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.task.presets import Preset, find_preset
from studies.campaign.command_line import one_line_errors, open_folder
from studies.stability.conclusions import conclude
from studies.stability.sweep import GainRow, MarginRow, Requirement, gain_box, gain_row, margin_row

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

    @property
    def required(self) -> Requirement:
        """The margins in radians and as a factor."""
        return Requirement(math.radians(self.phase_margin), self.gain_margin)


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
    table = Table(title=f"ZEM/ZEV, control period {period:g} s; speeds in m/s, median / worst clock phase")
    headings = ("K_R", "K_V", "powers of t_go", "thrust", "phase margin", "delay / t_go")
    ends = ("stable above", "margins above", "speed left", "frozen: stable", "margins", "touchdown")
    for heading in (*headings, *ends):
        table.add_column(heading, justify="right")
    for r in rows:
        if r.power_imaginary > 0.0:
            powers = f"{r.power_1_real:.2f}+-{r.power_imaginary:.2f}j"
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
            f"{r.residual_speed_mps_median:.2f} / {r.residual_speed_mps_max:.2f}",
            f"{r.frozen_at_stable_mps_median:.2f} / {r.frozen_at_stable_mps_max:.2f}",
            f"{r.frozen_at_margins_mps_median:.2f} / {r.frozen_at_margins_mps_max:.2f}",
            f"{r.touchdown_speed_mps_max:.1f}, {r.touchdown_time_to_go_s_max:.1f} s",
        )
    Console(width=max(Console().width, 160)).print(table)


def study_stability(options: Stability) -> tuple[list[MarginRow], list[GainRow]]:
    """Compute, write gains.csv, margins.csv, conclusions.txt and the figure, and print.

    Raises:
        ValueError: an option is out of range or names something unknown.
        OSError: the folder cannot be written.
    """
    preset = find_preset(options.preset)
    period = preset.rules.control_period
    out = open_folder(options.out)
    box = gain_box(options.gain_points)
    gain_rows = [gain_row(gains, preset, options.required) for gains in box]
    times = sorted({0.501 * period, *(time for time in _TIMES if time > 0.501 * period)})
    margin_rows = [
        margin_row(gains, time, period, options.required)
        for gains in track(box, "margins", transient=True)
        for time in times
    ]
    write_rows(out / "gains.csv", gain_rows)
    write_rows(out / "margins.csv", margin_rows)
    words = conclude(margin_rows, gain_rows, preset, options.required)
    (out / "conclusions.txt").write_text("\n".join(words) + "\n")
    if options.figures:
        from studies.stability.picture import draw_stability

        draw_stability(preset, options.required).savefig(out / "stability.png", dpi=110)
    print_gains(gain_rows, preset)
    console = Console()
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return margin_rows, gain_rows


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        study_stability(tyro.cli(Stability, description=__doc__))
