"""Time every planner on the same landings in one run: processor time, propellant regret, solves.

Starts of the preset on the tuning tiles and the reference cases; fixed-time methods are asked for the time of
flight of the tight optimum (the convex solver on 201 nodes). Methods take turns on each case. Regret is
counted only over plans that, flown in SI, keep every limit. Ratios are of processor time; wall times, which
other jobs on the machine disturb, are written beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.command_line import one_line_errors, open_folder
from studies.campaign.provenance import describe_run, write_provenance
from studies.columns import console_table, write_csv, write_markdown
from studies.timing.conclusions import conclude
from studies.timing.gfold_peer import gfold_present
from studies.timing.measures import Summary, measure_calls, summarize_calls
from studies.timing.methods import paper_cases, reference_cases, timed_methods
from studies.timing.table import CALL_COLUMNS, SUMMARY_COLUMNS

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


def study_timing(options: Timing) -> list[Summary]:
    """Measure, write tables, every call, conclusions.txt, provenance.json and the figure, and print.

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
    write_csv(out / "timing.csv", SUMMARY_COLUMNS, summaries)
    write_markdown(out / "timing.md", SUMMARY_COLUMNS, summaries)
    write_csv(out / "calls.csv", CALL_COLUMNS, calls)
    write_provenance(out / "provenance.json", describe_run(options))
    (out / "conclusions.txt").write_text("\n".join(words) + "\n")
    if options.figures:
        from studies.timing.picture import draw_timing

        draw_timing(methods, calls).savefig(out / "timing.png", dpi=110)
    feasible = sum(case.feasible for case in cases)
    title = f"{feasible} feasible and {len(cases) - feasible} infeasible cases"
    Console(width=max(Console().width, 150)).print(console_table(SUMMARY_COLUMNS, summaries, title))
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return summaries


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with one_line_errors():
        study_timing(tyro.cli(Timing, description=__doc__))
