"""Which ZEM/ZEV gains are safe at which time to go: margins, exact solutions and the sampled loop.

Over the agent's gain box it sets side by side the margins of the loop at a held time to go (python-control
and closed form), the powers of the time to go that solve the continuous loop exactly, and the loop whose
thrust is held over each control period, down to cut-off at half a period.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import track

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.task.presets import Preset, find_preset
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, field_columns, write_csv, write_markdown
from studies.stability.conclusions import conclude
from studies.stability.held_loop import Gains
from studies.stability.sweep import GainRow, MarginRow, Requirement, gain_box, gain_row, margin_row
from studies.stability.table import GAIN_COLUMNS

_TIMES = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 40.0, 80.0)
_PRODUCTS = (
    "gains.csv",
    "gains.md",
    "margins.csv",
    "provenance.json",
    "conclusions.txt",
    "stability.png",
)


@dataclass(frozen=True, kw_only=True)
class Stability(FolderOptions):
    """Command line of the stability study.

    Attributes:
        preset: the setting: control period, start, lander, soft speed.
        gain_points: gains along each side of the box, at least 2.
        phase_margin: [deg] that a safe loop keeps.
        gain_margin: factor that a safe loop keeps (2 is 6 dB).
        figures: draw the figure.
    """

    preset: str = "paper"
    gain_points: int = 5
    phase_margin: float = 30.0
    gain_margin: float = 2.0
    figures: bool = True
    out: Path = Path("results/stability")

    def __post_init__(self) -> None:
        """Check every option."""
        finite_number("gain_points", self.gain_points, at_least=2, at_most=101)
        finite_number("phase_margin", self.phase_margin, at_least=0.0, at_most=40.0)
        finite_number("gain_margin", self.gain_margin, at_least=1.0)

    @property
    def required(self) -> Requirement:
        """The margins in radians and as a factor."""
        return Requirement(math.radians(self.phase_margin), self.gain_margin)


@dataclass(frozen=True)
class PairRows:
    """What is kept of one pair of gains.

    Attributes:
        gain: over a whole flight.
        margins: at each time to go.
    """

    gain: GainRow
    margins: tuple[MarginRow, ...]


def study_pair(gains: Gains, preset: Preset, required: Requirement) -> PairRows:
    """Every row of one pair of gains."""
    period = preset.rules.control_period
    times = sorted({0.501 * period, *(time for time in _TIMES if time > 0.501 * period)})
    return PairRows(
        gain_row(gains, preset, required),
        tuple(margin_row(gains, time, period, required) for time in times),
    )


def study_stability(options: Stability) -> tuple[list[MarginRow], list[GainRow]]:
    """Compute, write tables, conclusions.txt, provenance.json and the figure, and print.

    Raises:
        ValueError: an option is out of range or names something unknown, or the folder holds another study.
        OSError: the folder cannot be written.
    """
    preset, required = find_preset(options.preset), options.required
    out, box = open_folder(options.out), gain_box(options.gain_points)
    decided = {
        "preset": preset.name,
        "phase_margin": options.phase_margin,
        "gain_margin": options.gain_margin,
    }
    identity = identify_run(Path(__file__).parent, decided)
    with open_journal(out, PairRows, _PRODUCTS, identity, options.existing) as journal:
        pairs = [
            journal.finish((gains.position, gains.velocity), partial(study_pair, gains, preset, required))
            for gains in track(box, "margins", transient=True)
        ]
        gain_rows = [pair.gain for pair in pairs]
        margin_rows = [row for pair in pairs for row in pair.margins]
        write_csv(out / "gains.csv", field_columns(GainRow), gain_rows)
        write_csv(out / "margins.csv", field_columns(MarginRow), margin_rows)
        write_markdown(out / "gains.md", GAIN_COLUMNS, gain_rows)
        words = conclude(margin_rows, gain_rows, preset, required)
        (out / "conclusions.txt").write_text("\n".join(words) + "\n")
        if options.figures:
            from studies.stability.picture import draw_stability

            draw_stability(preset, required).savefig(out / "stability.png", dpi=110)
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    period = preset.rules.control_period
    title = f"ZEM/ZEV, control period {period:g} s; speeds in m/s, median / worst clock phase"
    Console(width=max(Console().width, 176)).print(console_table(GAIN_COLUMNS, gain_rows, title))
    console = Console()
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return margin_rows, gain_rows


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_stability(tyro.cli(Stability, description=__doc__))
