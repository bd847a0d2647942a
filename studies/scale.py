"""How time and memory of a study grow with its episodes and workers.

Each line is a study of its own, flown whole by `python -m studies.compare` in a fresh process and kept in a
folder. Memory is the greatest resident size that any one process of the study reached; processor time counts
them all. On a machine that is busy otherwise, processor time says more than time by the clock.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from guidance.console import tolerate_encoding
from guidance.validation import finite_number
from studies.campaign.claimed_folder import Existing
from studies.campaign.command_line import open_folder, resumable
from studies.campaign.provenance import describe_run, write_provenance
from studies.campaign.run_options import FolderOptions
from studies.campaign.shards import write_durably
from studies.campaign.study_folder import open_study_folder
from studies.columns import Column, console_table, write_csv, write_markdown
from studies.compare.command import Comparison, plan_study, with_reference

_MEASUREMENT = "measurement.json"


@dataclass(frozen=True, kw_only=True)
class Scale(FolderOptions):
    """Command line of the measurement.

    Attributes:
        episodes: sizes of the studies.
        workers: numbers of worker processes; each size is flown with each.
        policy: policy that flies; single-divert is the cheapest study, as it is compared with itself.
        resume: keep the lines that were measured whole, and measure what is missing.
    """

    episodes: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N ...")] = (100, 1000, 10_000)
    workers: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N ...")] = (1, 2)
    policy: str = "single-divert"
    out: Path = Path("results/scale")

    def __post_init__(self) -> None:
        """Check every number."""
        for name in ("episodes", "workers"):
            for value in getattr(self, name):
                finite_number(name, value, at_least=1)


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


COLUMNS: tuple[Column[Measurement], ...] = (
    Column("episodes", "episodes", lambda m: m.episodes),
    Column("workers", "workers", lambda m: m.workers),
    Column("time_s", "time", lambda m: m.seconds, digits=1, unit="s"),
    Column("processor_s", "processor", lambda m: m.processor_seconds, digits=1, unit="s"),
    Column("episodes_per_s", "episodes/s", lambda m: m.episodes / m.seconds, digits=1),
    Column(
        "episodes_per_processor_s", "per processor s", lambda m: m.episodes / m.processor_seconds, digits=1
    ),
    Column("memory_mb", "memory", lambda m: m.memory / 1e6, digits=1, unit="MB"),
    Column("disk_mb", "disk", lambda m: m.disk / 1e6, digits=1, unit="MB"),
)
"""The table; speeds count start and end of the program."""


def measure_study(options: Comparison) -> Measurement:
    """Fly a study in a process of its own, into the folder that the options name.

    Raises:
        ValueError: the study failed; the message is its own.
    """
    assert options.out is not None
    (policy,) = options.policies
    command = [sys.executable, "-m", "studies.compare", "--policies", policy, "--out", str(options.out)]
    command += ["--episodes", str(options.episodes), "--workers", str(options.workers)]
    command += ["--no-figures", "--no-report", *(["--overwrite"] if options.overwrite else [])]
    with tempfile.TemporaryFile("w+") as log:
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
        options.episodes,
        options.workers,
        seconds,
        usage.ru_utime + usage.ru_stime,
        usage.ru_maxrss * kilobyte,
        sum(path.stat().st_size for path in options.out.rglob("*") if path.is_file()),
    )


def read_measurement(options: Comparison) -> Measurement | None:
    """What an earlier run measured; None where it did not end.

    Raises:
        ValueError: the folder holds another study, or one of other versions, or the measurement is damaged.
    """
    assert options.out is not None
    path = options.out / _MEASUREMENT
    if not path.exists():
        return None
    with open_study_folder(options.out, with_reference(plan_study(options)), Existing.RESUME):
        pass  # it is the same study
    try:
        return Measurement(**json.loads(path.read_text()))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} is damaged ({error}); delete it to measure again") from error


def measure_scale(options: Scale) -> list[Measurement]:
    """Measure every size with every number of workers; write table.csv, table.md and provenance.json.

    Raises:
        ValueError: an option names something unknown, a folder holds another study, or a study failed.
        OSError: the folder cannot be written.
    """
    existing, out = options.existing, open_folder(options.out)
    measured = []
    console = Console(width=max(Console().width, 110))
    with console.status("measuring") as status:
        for episodes in options.episodes:
            for workers in options.workers:
                status.update(f"{episodes} episodes, {workers} workers")
                study = Comparison(
                    episodes=episodes,
                    policies=(options.policy,),
                    workers=workers,
                    out=out / f"{episodes}-episodes-{workers}-workers",
                    overwrite=existing is not Existing.REFUSE,  # one that was stopped is measured anew, whole
                )
                plan_study(study)
                found = read_measurement(study) if existing is Existing.RESUME else None
                measured.append(found or _measure_and_keep(study))
    write_csv(out / "table.csv", COLUMNS, measured)
    write_markdown(out / "table.md", COLUMNS, measured)
    write_provenance(out / "provenance.json", describe_run(options))
    console.print(console_table(COLUMNS, measured, f"{options.policy}: time and memory of a study"))
    console.print(f"results in {out}")
    return measured


def _measure_and_keep(study: Comparison) -> Measurement:
    assert study.out is not None
    found = measure_study(study)
    write_durably(study.out / _MEASUREMENT, json.dumps(asdict(found)).encode())
    return found


def main() -> None:
    """Command line; a wrong option is one line on stderr and exit code 2."""
    tolerate_encoding()
    with resumable():
        measure_scale(tyro.cli(Scale, description=__doc__))


if __name__ == "__main__":
    main()
