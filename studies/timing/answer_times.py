"""How long an answer of `solve_pdg` takes, by what it says: over many starts, and in a new process."""

from __future__ import annotations

import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np
from rich.progress import track

from guidance import PlanStatus, solve_pdg
from studies.campaign.journal import Journal

TARGET = (0.0, 0.0, 50.0)
QUANTILES = (0.5, 0.9, 0.99, 0.999)
_BATCH = 500
_FIRST = 500  # starts that are not counted: what their answers need is compiled or assembled on first use
_SEED = 20260
_NEW_PROCESS = """
from time import process_time
start = process_time()
from guidance import solve_pdg
times = [process_time() - start]
for east in (200.0, 210.0):
    start = process_time()
    solve_pdg((east, 100.0, 950.0, -8.0, -4.0, -30.0, 1200.0), (0.0, 0.0, 50.0))
    times.append(process_time() - start)
print(*times)
"""


@dataclass(frozen=True)
class AnswerBatch:
    """Answers to some starts of one kind, in order.

    Attributes:
        answers: what `solve_pdg` said: status and method; with "nearest" asked for, where it was.
        seconds: processor time of each.
    """

    answers: tuple[str, ...]
    seconds: tuple[float, ...]


@dataclass(frozen=True)
class AnswerTime:
    """Processor times of one answer to one kind of starts.

    Attributes:
        starts: their kind.
        answer: what was said.
        count: how often.
        quantiles: [s] at QUANTILES, a measured value each, the next one up.
        greatest: [s].
    """

    starts: str
    answer: str
    count: int
    quantiles: tuple[float, ...]
    greatest: float


def draw_dispersed(rng: np.random.Generator) -> list[float]:
    """Start anywhere from which most can land: low or high, near or far, slow or fast."""
    height = rng.uniform(100.0, 1200.0)
    distance, bearing = rng.uniform(0.0, 0.5) * height, rng.uniform(0.0, 2.0 * np.pi)
    return [
        distance * np.cos(bearing),
        distance * np.sin(bearing),
        TARGET[2] + height,
        *rng.uniform(-15.0, 15.0, 2),
        -rng.uniform(0.0, 0.9) * np.sqrt(2.0 * 1.62 * height),
        rng.uniform(1190.0, 1200.0),
    ]


def draw_harsh(rng: np.random.Generator) -> list[float]:
    """Low, fast, short of propellant: about half of these cannot land."""
    distance, bearing = rng.uniform(0.0, 300.0), rng.uniform(0.0, 2.0 * np.pi)
    return [
        distance * np.cos(bearing),
        distance * np.sin(bearing),
        TARGET[2] + rng.uniform(0.5, 300.0),
        *rng.uniform(-30.0, 30.0, 2),
        rng.uniform(-60.0, 10.0),
        rng.uniform(1152.0, 1200.0),
    ]


KINDS: dict[str, Callable[[np.random.Generator], list[float]]] = {
    "dispersed": draw_dispersed,
    "harsh": draw_harsh,
}


def time_batch(kind: str, first: int, count: int) -> AnswerBatch:
    """Answer some starts; one that cannot land is asked for the nearest reachable point too.

    Args:
        kind: of KINDS.
        first: number of the first start.
        count: how many.
    """
    answers, seconds = [], []
    for number in range(first, first + count):
        start = KINDS[kind](np.random.default_rng([_SEED, list(KINDS).index(kind), number]))
        for unreachable in ("raise", "nearest"):
            began = process_time()
            plan = solve_pdg(start, TARGET, unreachable=unreachable, throw=False)
            seconds.append(process_time() - began)
            asked = "" if unreachable == "raise" else ", nearest asked for"
            answers.append(f"{plan.status.value} ({plan.method}){asked}")
            if plan.status is PlanStatus.OPTIMAL:
                break
    return AnswerBatch(tuple(answers), tuple(seconds))


def measure_answers(starts: int, journal: Journal[AnswerBatch]) -> list[AnswerTime]:
    """Time the answers to `starts` starts of each kind; batches in the journal are not asked again."""
    times: dict[tuple[str, str], list[float]] = defaultdict(list)
    spans = [
        (kind, first, min(_BATCH, starts - first)) for kind in KINDS for first in range(0, starts, _BATCH)
    ]
    for kind in dict.fromkeys(span[0] for span in spans if journal.find(span) is None):
        time_batch(kind, starts, _FIRST)
    for span in track(spans, "answers", transient=True):
        kind, batch = span[0], journal.finish(span, lambda span=span: time_batch(*span))
        for answer, seconds in zip(batch.answers, batch.seconds, strict=True):
            times[kind, answer].append(seconds)
    return [sum_up(kind, answer, values) for (kind, answer), values in sorted(times.items())]


def sum_up(starts: str, answer: str, seconds: Sequence[float]) -> AnswerTime:
    """Quantiles of processor times [s]."""
    marks = np.quantile(seconds, QUANTILES, method="higher")
    return AnswerTime(starts, answer, len(seconds), tuple(float(m) for m in marks), float(np.max(seconds)))


def time_new_processes(count: int) -> list[AnswerTime]:
    """Processor time, in processes of their own, of the import and of the first and the second plan."""
    told = [
        subprocess.run([sys.executable, "-c", _NEW_PROCESS], capture_output=True, text=True, check=True)
        for _ in track(range(count), "new processes", transient=True)
    ]
    rows = np.array([[float(word) for word in run.stdout.split()] for run in told])
    names = ("import of solve_pdg", "first plan", "second plan")
    return [sum_up("new process", name, rows[:, k].tolist()) for k, name in enumerate(names)]
