"""Time every planner on the same landings in one run: processor time, propellant regret, solves.

Starts of the preset on the tuning tiles and the reference cases; fixed-time methods are asked for the time of
flight of the tight optimum (the convex solver on 201 nodes). Methods take turns on each case. Regret is
counted only over plans that, flown in SI, keep every limit. Ratios are of processor time; wall times, which
other jobs on the machine disturb, are written beside it.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.command_line import one_line_errors, open_folder
from studies.timing.conclusions import conclude
from studies.timing.gfold_peer import gfold_present
from studies.timing.measures import Call, Summary, measure_calls, summarize_calls
from studies.timing.methods import paper_cases, reference_cases, timed_methods

_CASES = Path(__file__).parent / "cases" / "pdg_cases.json"


@dataclass(frozen=True)
class Timing:
    """Command line of the timing study.

    Attributes:
        starts: starts of the preset, at least 1.
        preset: the setting they are drawn from.
        cases: JSON file of reference cases.
        repeats: calls per case and method; all of them count.
        out: folder for results; results/timing by default.
        figures: draw the figure.
    """

    starts: int = 40
    preset: str = "paper"
    cases: Path = _CASES
    repeats: int = 1
    out: Path = Path("results/timing")
    figures: bool = True

    def __post_init__(self) -> None:
        """Check every option."""
        finite_number("starts", self.starts, at_least=1)
        finite_number("repeats", self.repeats, at_least=1)


def write_summaries(path: Path, summaries: Sequence[Summary]) -> None:
    """Write the table as CSV."""
    names = ["method", "time", "nodes", "feasible_calls", "solved", "limits_broken", "infeasible_calls"]
    names += ["refused", "cpu_ms_p50", "cpu_ms_p99", "cpu_ms_max", "wall_ms_p50"]
    names += ["regret_g_median", "regret_g_max", "solves_mean"]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        for s in summaries:
            times = [*s.processor, s.wall]
            numbers = [*(1e3 * t for t in times), *(1e3 * r for r in s.regret), s.solves]
            cells = ["" if np.isnan(number) else f"{number:.5g}" for number in numbers]
            counts = [s.feasible, s.solved, s.broken, s.infeasible, s.refused]
            writer.writerow([*s.method.rsplit(", ", 2), *counts, *cells])


def write_calls(path: Path, calls: Sequence[Call]) -> None:
    """Write every call as CSV."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(
            ["method", "case", "status", "cpu_ms", "wall_ms", "regret_g", "solves", "keeps_limits"]
        )
        for c in calls:
            regret = "" if np.isnan(c.regret) else f"{1e3 * c.regret:.5g}"
            times = [f"{1e3 * t:.5g}" for t in (c.processor, c.seconds)]
            writer.writerow([c.method, c.case, c.status.value, *times, regret, c.solves, c.keeps_limits])


def print_summaries(summaries: Sequence[Summary], title: str) -> None:
    """Print one line per method."""
    table = Table(title=title)
    table.add_column("method, time, nodes")
    headings = ("solved", "limits broken", "refused", "cpu ms", "99 %", "max", "wall ms", "regret g", "max g")
    for heading in (*headings, "solves"):
        table.add_column(heading, justify="right")
    for s in summaries:
        times = [*s.processor, s.wall]
        numbers = [*(f"{1e3 * t:.1f}" for t in times), *(f"{1e3 * r:.1f}" for r in s.regret)]
        counts = [f"{s.solved}/{s.feasible}", str(s.broken), f"{s.refused}/{s.infeasible}"]
        table.add_row(s.method, *counts, *numbers, "-" if np.isnan(s.solves) else f"{s.solves:.1f}")
    Console(width=max(Console().width, 140)).print(table)


def study_timing(options: Timing) -> list[Summary]:
    """Measure, write timing.csv, calls.csv, conclusions.txt and the figure, and print.

    Raises:
        ValueError: an option is out of range or names something unknown.
        OSError: the cases cannot be read or the folder cannot be written.
    """
    out, console = open_folder(options.out), Console()
    methods = timed_methods()
    if not gfold_present():
        console.print("gfold is not installed: the study runs without it (extra `peers`)", style="yellow")
    cases = reference_cases(options.cases) + paper_cases(options.starts, options.preset)
    calls = measure_calls(methods, cases, options.repeats)
    summaries = [summarize_calls(method.label, calls) for method in methods]
    words = conclude(methods, calls, summaries)
    write_summaries(out / "timing.csv", summaries)
    write_calls(out / "calls.csv", calls)
    (out / "conclusions.txt").write_text("\n".join(words) + "\n")
    if options.figures:
        from studies.timing.picture import draw_timing

        draw_timing(methods, calls).savefig(out / "timing.png", dpi=110)
    feasible = sum(case.feasible for case in cases)
    print_summaries(summaries, f"{feasible} feasible and {len(cases) - feasible} infeasible cases")
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return summaries


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        study_timing(tyro.cli(Timing, description=__doc__))
