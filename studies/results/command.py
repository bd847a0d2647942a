"""The tables of the documentation made again, in the order of need: `make results`.

Each is a command of its own, which keeps finished work and goes on with it. What is finished at the present
commit is written to a journal and not made again. Stopped, the same call goes on. What is left out, such as
what needs files or packages that are not shipped, stands in docs/results/commands.md with its reason.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.validation import unknown_name
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.provenance import git_commit
from studies.campaign.shards import write_durably
from studies.results.entries import RESULTS

_FINISHED = "finished.json"
_BEGUN = "begun.json"


@dataclass(frozen=True, kw_only=True)
class MakeResults:
    """Command line.

    Attributes:
        only: names of results; all of them by default.
        list: say what would be made, and make nothing.
        again: make also what is finished at this commit.
        out: folder of the journal; each command says where its tables stand.
    """

    only: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ()
    list: bool = False
    again: bool = False
    out: Path = Path("results")


@dataclass(frozen=True)
class Finished:
    """A result that was made.

    Attributes:
        command: what made it.
        commit: of the sources, `+changes` where they differ from it; empty outside a checkout.
        seconds: [s] by the clock, of the call that finished it.
        date: when, UTC.
    """

    command: str
    commit: str
    seconds: float
    date: str


def choose_results(only: Sequence[str]) -> list[str]:
    """Names of the results to make, in the order of need.

    Raises:
        ValueError: there is no result of that name.
    """
    for name in only:
        if name not in RESULTS:
            raise ValueError(unknown_name("result", name, RESULTS))
    return [name for name in RESULTS if not only or name in only]


def read_finished(folder: Path) -> dict[str, Finished]:
    """What is finished, by name; nothing where there is no journal."""
    path = folder / _FINISHED
    if not path.exists():
        return {}
    return {name: Finished(**entry) for name, entry in json.loads(path.read_text()).items()}


def is_current(name: str, finished: dict[str, Finished], commit: str) -> bool:
    """Whether a result was made by its command at these very sources."""
    made = finished.get(name)
    known = bool(commit) and not commit.endswith("+changes")
    return known and made is not None and (made.command, made.commit) == (RESULTS[name].command, commit)


def make_results(options: MakeResults, console: Console) -> list[str]:
    """Run what is missing, one command after the other.

    Returns:
        Names of those that failed; their own messages say why.

    Raises:
        ValueError: a name is unknown.
        OSError: the journal cannot be written.
    """
    names, commit = choose_results(options.only), git_commit() or ""
    finished = read_finished(options.out)
    if options.list:
        console.print(_list_results(names, finished, commit))
        return []
    folder, failed = open_folder(options.out), []
    for number, name in enumerate(names, 1):
        result = RESULTS[name]
        if is_current(name, finished, commit) and not options.again:
            console.print(f"{number}/{len(names)} {name}: finished at this commit")
            continue
        console.print(f"{number}/{len(names)} {name}: python -m {result.command}")
        words = [*shlex.split(result.command), *_keeping(name, folder, commit, options.again)]
        began = time.perf_counter()
        if subprocess.run([sys.executable, "-m", *words], check=False).returncode != 0:
            failed.append(name)
            continue
        seconds, date = time.perf_counter() - began, datetime.now(UTC).date().isoformat()
        finished[name] = Finished(result.command, commit, round(seconds, 1), date)
        entries = {name: asdict(entry) for name, entry in finished.items()}
        write_durably(folder / _FINISHED, json.dumps(entries, indent=1).encode())
    return failed


def _keeping(name: str, folder: Path, commit: str, again: bool) -> list[str]:
    """Go on with what the same sources began; replace what others made."""
    if not RESULTS[name].resumable:
        return []
    path = folder / _BEGUN
    begun = json.loads(path.read_text()) if path.exists() else {}
    same = bool(commit) and begun.get(name) == commit and not again
    write_durably(path, json.dumps({**begun, name: commit}, indent=1).encode())
    return ["--resume"] if same else ["--overwrite"]


def _list_results(names: Sequence[str], finished: dict[str, Finished], commit: str) -> Table:
    """What stands where, and what is still to be made."""
    table = Table("name", "page", "command", "state")
    for name in names:
        made = finished.get(name)
        state = "missing"
        if made is not None:
            now = is_current(name, finished, commit)
            state = f"{'made' if now else 'of older code'}, {made.date}, {made.seconds:.0f} s"
        table.add_row(name, RESULTS[name].page, f"python -m {RESULTS[name].command}", state)
    return table


def main() -> None:
    """Command line; exit code 1 if a result could not be made."""
    tolerate_encoding()
    options = tyro.cli(MakeResults, description=__doc__)
    with resumable("the same call goes on"):
        failed = make_results(options, Console())
        if failed:
            raise ValueError(f"not made: {', '.join(failed)}; the lines above say why")
