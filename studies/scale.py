"""How time and memory of a study grow with its episodes and workers.

Each line is a study of its own, flown by `python -m studies.compare` in a fresh process and folder. Memory is
the greatest resident size that any one process of the study reached; processor time counts them all. On a
machine that is busy otherwise, processor time says more than time by the clock.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from hda.registry import policy_entry
from studies.campaign.command_line import one_line_errors


@dataclass(frozen=True)
class Scale:
    """Command line of the measurement.

    Attributes:
        episodes: sizes of the studies.
        workers: numbers of worker processes; each size is flown with each.
        policy: policy that flies; single-divert is the cheapest study, as it is compared with itself.
    """

    episodes: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N ...")] = (100, 1000, 10_000)
    workers: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N ...")] = (1, 2)
    policy: str = "single-divert"


@dataclass(frozen=True)
class Measurement:
    """What one study took.

    Attributes:
        episodes: its episodes.
        workers: its worker processes.
        seconds: time by the clock [s].
        processor_seconds: processor time of every process [s].
        memory: greatest resident size of one process [bytes].
        disk: size of the folder [bytes].
    """

    episodes: int
    workers: int
    seconds: float
    processor_seconds: float
    memory: int
    disk: int


def measure_study(policy: str, episodes: int, workers: int) -> Measurement:
    """Fly a study in a process of its own.

    Raises:
        ValueError: the study failed; the message is its own.
    """
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "study"
        command = [sys.executable, "-m", "studies.compare", "--policies", policy, "--out", str(out)]
        command += ["--episodes", str(episodes), "--workers", str(workers), "--no-figures", "--no-report"]
        with (Path(name) / "log").open("w+") as log:
            begun = time.perf_counter()
            process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
            _, status, usage = os.wait4(process.pid, 0)
            seconds = time.perf_counter() - begun
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode != 0:
                log.seek(0)
                raise ValueError(f"the study failed: {log.read().strip()[-500:]}")
        kilobyte = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss
        return Measurement(
            episodes,
            workers,
            seconds,
            usage.ru_utime + usage.ru_stime,
            usage.ru_maxrss * kilobyte,
            sum(path.stat().st_size for path in out.rglob("*") if path.is_file()),
        )


def measure_scale(options: Scale) -> list[Measurement]:
    """Measure every size with every number of workers, and print each as it comes.

    Raises:
        ValueError: an option is out of range, or a study failed.
    """
    for name in ("episodes", "workers"):
        for value in getattr(options, name):
            finite_number(name, value, at_least=1)
    policy = policy_entry(options.policy).name
    measured = []
    console = Console(width=max(Console().width, 110))
    with console.status("measuring") as status:
        for episodes in options.episodes:
            for workers in options.workers:
                status.update(f"{episodes} episodes, {workers} workers")
                measured.append(measure_study(policy, episodes, workers))
    console.print(tabulate(policy, measured))
    return measured


def tabulate(policy: str, measured: list[Measurement]) -> Table:
    """The table of the measurements; speeds count start and end of the program."""
    table = Table(title=f"{policy}: time and memory of a study")
    heads = (
        "episodes",
        "workers",
        "time s",
        "processor s",
        "episodes/s",
        "per processor s",
        "memory MB",
        "disk MB",
    )
    for head in heads:
        table.add_column(head, justify="right")
    for m in measured:
        speeds = m.episodes / m.seconds, m.episodes / m.processor_seconds
        cells = (m.seconds, m.processor_seconds, *speeds, m.memory / 1e6, m.disk / 1e6)
        table.add_row(str(m.episodes), str(m.workers), *(f"{value:.1f}" for value in cells))
    return table


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    options = tyro.cli(Scale, description=__doc__)
    with one_line_errors():
        measure_scale(options)


if __name__ == "__main__":
    main()
