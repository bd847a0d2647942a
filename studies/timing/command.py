"""Time every planner on the same landings in one run: processor time, propellant regret, solves.

Starts of the preset on the tuning tiles and the reference cases; fixed-time methods are asked for the time of
flight of the tight optimum (the convex solver on 201 nodes). Methods take turns on each case. Regret is
counted only over plans that, flown in SI, keep every limit. Ratios are of processor time; wall times, which
other jobs on the machine disturb, are written beside it.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.peers.openscvx_process import (
    OPENSCVX_PACKAGE,
    PEERS_WING,
    demand_openscvx,
    openscvx_version,
)
from studies.timing.answer_times import AnswerBatch, AnswerTime, measure_answers, time_new_processes
from studies.timing.conclusions import conclude
from studies.timing.gfold_peer import PEER_METHOD, gfold_present
from studies.timing.measures import Call, Summary, measure_calls, name_processor, summarize_calls
from studies.timing.methods import Case, paper_cases, reference_cases, timed_methods
from studies.timing.openscvx_peer import open_openscvx
from studies.timing.qoco_peer import QOCO_PACKAGE, qoco_present
from studies.timing.table import ANSWER_COLUMNS, CALL_COLUMNS, SUMMARY_COLUMNS

_ANSWER_PRODUCTS = ("answers.csv", "answers.md")
_WING = Path(__file__).parent
_CASES = _WING / "cases" / "pdg_cases.json"
_PRODUCTS = ("timing.csv", "timing.md", "calls.csv", "provenance.json", "conclusions.txt", "timing.png")


@dataclass(frozen=True, kw_only=True)
class Timing(FolderOptions):
    """Command line of the timing study.

    Attributes:
        starts: starts of the preset, at least 1.
        preset: the setting they are drawn from.
        cases: JSON file of reference cases.
        repeats: calls per case and method; all of them count.
        answers: dispersed and harsh starts each, whose answers by solve_pdg alone are timed; 0 for none.
        processes: new processes in which the import and the first plans are timed.
        openscvx_python: interpreter of an environment that has OpenSCvx; this one by default.
        figures: draw the figure.
    """

    starts: int = 40
    preset: str = "paper"
    cases: Path = _CASES
    repeats: int = 1
    answers: int = 2000
    processes: int = 5
    openscvx_python: Path | None = None
    figures: bool = True
    out: Path = Path("results/timing")

    def __post_init__(self) -> None:
        """Check every option."""
        finite_number("starts", self.starts, at_least=1)
        finite_number("repeats", self.repeats, at_least=1)
        finite_number("answers", self.answers, at_least=0)
        finite_number("processes", self.processes, at_least=1)


def find_peers(options: Timing) -> dict[str, str | None]:
    """Version of each peer package; None where it is not installed.

    Raises:
        ValueError: the interpreter that the user names has no OpenSCvx.
        OSError: there is no such interpreter.
    """
    named = options.openscvx_python
    openscvx = (
        openscvx_version(Path(sys.executable)) if named is None else demand_openscvx(named)[OPENSCVX_PACKAGE]
    )
    return {
        PEER_METHOD: version(PEER_METHOD) if gfold_present() else None,
        QOCO_PACKAGE: version(QOCO_PACKAGE) if qoco_present() else None,
        OPENSCVX_PACKAGE: openscvx,
    }


def identify_timing(options: Timing, peers: dict[str, str | None]) -> dict[str, Any]:
    """All that decides what a call is: how many are made does not.

    Raises:
        OSError: the cases cannot be read.
    """
    decided = {
        "preset": options.preset,
        "cases": sha256(options.cases.read_bytes()).hexdigest()[:16],
        "peers": peers,
        "processor": name_processor(),
    }
    return identify_run(_WING, decided, beside=(PEERS_WING,))


def list_cases(options: Timing) -> list[Case]:
    """Reference cases and drawn starts.

    Raises:
        ValueError: an option names something unknown, or two cases have the same name.
        OSError: the cases cannot be read.
    """
    cases = reference_cases(options.cases) + paper_cases(options.starts, options.preset)
    for name, count in Counter(case.name for case in cases).items():
        if count > 1:
            raise ValueError(f"cases: {count} of them have the name {name!r}")
    return cases


def study_timing(options: Timing) -> list[Summary]:
    """Measure, write tables, every call, conclusions.txt, provenance.json and the figure, and print.

    Raises:
        ValueError: an option is out of range or names something unknown, or the folder holds another study.
        OSError: the cases cannot be read or the folder cannot be written.
    """
    out, console = open_folder(options.out), Console()
    peers = find_peers(options)
    for name in [name for name, found in peers.items() if found is None]:
        console.print(f"{name} is not installed: the study runs without it (extra `peers`)", style="yellow")
    identity = identify_timing(options, peers)
    with (
        open_journal(out, Call, _PRODUCTS, identity, options.existing) as journal,
        open_openscvx(options.openscvx_python or Path(sys.executable)) as openscvx,
    ):
        methods = timed_methods(openscvx if peers[OPENSCVX_PACKAGE] else None)
        cases = list_cases(options)
        calls = measure_calls(methods, cases, options.repeats, journal)
        summaries = [summarize_calls(method.label, calls) for method in methods]
        words = conclude(methods, calls, summaries)
        write_timing(out, calls, summaries, words)
        if options.figures:
            from studies.timing.picture import draw_timing

            draw_timing(methods, calls).savefig(out / "timing.png", dpi=110)
        answer_times = time_answers(options, identity) if options.answers else []
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    feasible = sum(case.feasible for case in cases)
    title = f"{feasible} feasible and {len(cases) - feasible} infeasible cases"
    wide = Console(width=max(Console().width, 150))
    wide.print(console_table(SUMMARY_COLUMNS, summaries, title))
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    if answer_times:
        wide.print(console_table(ANSWER_COLUMNS, answer_times, "processor time of answers"))
    console.print(f"results in {out}")
    return summaries


def time_answers(options: Timing, identity: dict[str, Any]) -> list[AnswerTime]:
    """Time answers in this process and in new ones; write their tables.

    Raises:
        ValueError: the folder holds another study.
        OSError: the folder cannot be written.
    """
    folder = options.out / "answers"
    with open_journal(folder, AnswerBatch, _ANSWER_PRODUCTS, identity, options.existing) as journal:
        rows = time_new_processes(options.processes) + measure_answers(options.answers, journal)
        write_csv(folder / "answers.csv", ANSWER_COLUMNS, rows)
        write_markdown(folder / "answers.md", ANSWER_COLUMNS, rows)
    return rows


def write_timing(
    out: Path, calls: Sequence[Call], summaries: Sequence[Summary], words: Sequence[str]
) -> None:
    """Write the tables, every call and the conclusions."""
    write_csv(out / "timing.csv", SUMMARY_COLUMNS, summaries)
    write_markdown(out / "timing.md", SUMMARY_COLUMNS, summaries)
    write_csv(out / "calls.csv", CALL_COLUMNS, calls)
    (out / "conclusions.txt").write_text("\n".join(words) + "\n")


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_timing(tyro.cli(Timing, description=__doc__))
