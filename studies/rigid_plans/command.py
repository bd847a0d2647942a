"""Plans for a body that must turn: both methods of `guidance.solve_pdg_6dof` on the same dispersed starts.

Starts are those of a preset's episodes on the tuning tiles, each to its first target, the body upright and at
rest. A plan is flown open loop by the true motion; one that misses a limit has no flight. Times are of the
processor, on one core. With --openscvx-python the package OpenSCvx is asked its own example of such a descent
and some of these starts, and solve_pdg_6dof beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.successive.solve import DEFAULT_NODES, FEWEST_NODES
from guidance.validation import finite_number
from hda.task.presets import find_preset
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.journal import open_journal
from studies.campaign.provenance import describe_run, identify_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.columns import console_table, write_csv, write_markdown
from studies.peers.openscvx_process import PEERS_WING, demand_openscvx, open_worker
from studies.rigid_plans.openscvx_body import SERVE_BODY
from studies.rigid_plans.peer_answers import CHOSEN_ON, ask_all
from studies.rigid_plans.peer_table import (
    ANSWER_COLUMNS,
    PEER_COLUMNS,
    PeerAnswer,
    conclude_peers,
    sum_up_peers,
)
from studies.rigid_plans.starts import (
    COLUMNS,
    METHODS,
    PLAN_COLUMNS,
    SPLIT,
    STUDY_SEED,
    MethodRow,
    PlannedStart,
    conclude,
    plan_all,
    sum_up,
)

_WING = Path(__file__).parent
_PRODUCTS = ("plans.csv", "table.csv", "table.md", "provenance.json", "conclusions.txt")
_PEER_PRODUCTS = ("answers.csv", "table.csv", "table.md", "provenance.json", "conclusions.txt")


@dataclass(frozen=True, kw_only=True)
class RigidPlans(FolderOptions):
    """Command line of the study.

    Attributes:
        starts: how many, each planned by both methods.
        preset: whose start conditions they are drawn from.
        nodes: of each plan.
        openscvx_python: interpreter of an environment that has OpenSCvx; without one it is not asked.
        peer_starts: how many of the starts OpenSCvx is asked: from the fourth on, as its weights were chosen
            on the first three.
    """

    starts: int = 100
    preset: str = "paper"
    nodes: int = DEFAULT_NODES
    openscvx_python: Path | None = None
    peer_starts: int = 20
    out: Path = Path("results/rigid-plans")

    def __post_init__(self) -> None:
        """Check every option."""
        finite_number("starts", self.starts, at_least=1)
        finite_number("peer_starts", self.peer_starts, at_least=1)
        if self.openscvx_python is not None:
            finite_number("starts", self.starts, at_least=CHOSEN_ON + 1)
            finite_number("peer_starts", self.peer_starts, at_most=self.starts - CHOSEN_ON)
        finite_number("nodes", self.nodes, at_least=FEWEST_NODES)
        find_preset(self.preset)


def study_rigid_plans(options: RigidPlans) -> list[MethodRow]:
    """Plan, and write tables, every plan, conclusions.txt and provenance.json.

    Raises:
        ValueError: the folder holds another study, `resume` and `overwrite` are both given, or the named
            interpreter has no OpenSCvx.
        OSError: the folder cannot be written, or there is no such interpreter.
    """
    python = options.openscvx_python
    versions = {} if python is None else demand_openscvx(python)
    out, console = open_folder(options.out), Console(width=max(Console().width, 130))
    decided = {"preset": options.preset, "nodes": options.nodes}
    identity = identify_run(_WING, decided)
    with open_journal(out, PlannedStart, _PRODUCTS, identity, options.existing) as journal:
        plans = plan_all(options.starts, options.preset, options.nodes, journal)
        rows, words = [sum_up(method, plans) for method in METHODS], conclude(plans)
        write_csv(out / "plans.csv", PLAN_COLUMNS, plans)
        write_csv(out / "table.csv", COLUMNS, rows)
        write_markdown(out / "table.md", COLUMNS, rows)
        (out / "conclusions.txt").write_text("\n".join(words) + "\n")
        write_provenance(out / "provenance.json", {**describe_run(options), "work": journal.describe()})
    if python is not None:
        answers = ask_peers(options, python, versions)
        wide = Console(width=max(Console().width, 190))
        wide.print(console_table(PEER_COLUMNS, sum_up_peers(answers), "beside OpenSCvx"))
        words += conclude_peers(answers)
    title = f"a body that must turn: {options.starts} starts of {options.preset}"
    console.print(console_table(COLUMNS, rows, title))
    for sentence in words:
        console.print(f"- {sentence}", markup=False, highlight=False)
    console.print(f"results in {out}")
    return rows


def ask_peers(options: RigidPlans, python: Path, versions: dict[str, str]) -> list[PeerAnswer]:
    """Ask OpenSCvx and solve_pdg_6dof the same problems; write their tables and provenance under `peers`.

    Args:
        options: of the study.
        python: interpreter that has OpenSCvx.
        versions: of its packages.

    Raises:
        ValueError: the folder holds another study.
        OSError: the folder cannot be written.
    """
    out = options.out / "peers"
    decided = {"preset": options.preset, "nodes": options.nodes, "peers": versions}
    identity = identify_run(_WING, decided, beside=(PEERS_WING,))
    with (
        open_journal(out, PeerAnswer, _PEER_PRODUCTS, identity, options.existing) as journal,
        open_worker(python, SERVE_BODY) as worker,
    ):
        answers = ask_all(options.preset, options.nodes, options.peer_starts, worker, journal)
        rows = sum_up_peers(answers)
        write_csv(out / "answers.csv", ANSWER_COLUMNS, answers)
        write_csv(out / "table.csv", PEER_COLUMNS, rows)
        write_markdown(out / "table.md", PEER_COLUMNS, rows)
        (out / "conclusions.txt").write_text("\n".join(conclude_peers(answers)) + "\n")
        drawn = {"study_seed": STUDY_SEED, "split": SPLIT, "peers": versions}
        told = {**describe_run(options), **drawn, "work": journal.describe()}
        write_provenance(out / "provenance.json", told)
    return answers


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        study_rigid_plans(tyro.cli(RigidPlans, description=__doc__))
