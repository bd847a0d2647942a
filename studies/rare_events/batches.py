"""The work of the study in batches: flown by several processes, kept in a journal as they are finished."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from time import process_time

from studies.campaign.executor import local_processes
from studies.campaign.journal import Journal
from studies.campaign.monte_carlo import Study
from studies.rare_events.flights import RootRow, fly_passage, fly_root
from studies.rare_events.level_values import LevelValues, Passage

BATCH = 25
"""Episodes of a batch."""


@dataclass(frozen=True)
class Batch:
    """What a batch gave.

    Attributes:
        roots: of its episodes; empty in a pilot.
        passages: of a pilot.
        steps: decision intervals flown.
        seconds: [s] of processor time, scenarios and levels included; not reproducible.
    """

    roots: tuple[RootRow, ...]
    passages: tuple[Passage, ...]
    steps: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Work:
    """Some episodes to fly.

    Attributes:
        name: of this part of the run, unique in it.
        study: its policy, preset, split and seed; the first one is number 0.
        first: number of the first episode.
        count: how many.
        values: of the levels; None for whole flights.
        effort: whole flights that an episode may cost, in the mean.
        pilot: only the levels and the end of each flight are asked for.
    """

    name: str
    study: Study
    first: int
    count: int
    values: LevelValues | None = None
    effort: float = 1.0
    pilot: bool = False


def fly_batch(work: Work, first: int, last: int) -> Batch:
    """Fly episodes first to last - 1, in this process."""
    began = process_time()
    if work.pilot:
        flown = [fly_passage(work.study, episode) for episode in range(first, last)]
        passages, steps = tuple(passage for passage, _ in flown), sum(steps for _, steps in flown)
        return Batch((), passages, steps, process_time() - began)
    roots = tuple(fly_root(work.study, episode, work.values, work.effort) for episode in range(first, last))
    return Batch(roots, (), sum(root.steps for root in roots), process_time() - began)


def fly_work(
    work: Work, journal: Journal[Batch], workers: int, on_batch: Callable[[int], None]
) -> list[Batch]:
    """Fly what the journal lacks; give all batches in the order of their episodes.

    Args:
        work: what to fly.
        journal: of the run; each batch is kept as it is finished.
        workers: processes.
        on_batch: called with the number of episodes of each batch.

    Raises:
        ValueError: the policy failed.
    """
    end = work.first + work.count
    spans = [(first, min(first + BATCH, end)) for first in range(work.first, end, BATCH)]
    lacking = []
    for span in spans:
        if journal.find((work.name, *span)) is None:
            lacking.append(span)
        else:
            on_batch(span[1] - span[0])
    for span, batch in _fly_spans(work, lacking, workers):
        journal.keep((work.name, *span), batch)
        on_batch(span[1] - span[0])
    return [batch for span in spans if (batch := journal.find((work.name, *span))) is not None]


def _fly_spans(
    work: Work, spans: Sequence[tuple[int, int]], workers: int
) -> Iterator[tuple[tuple[int, int], Batch]]:
    if not spans:
        return
    with local_processes(workers) as executor:
        if executor is None:
            for span in spans:
                yield span, fly_batch(work, *span)
            return
        futures = {executor.submit(fly_batch, work, *span): span for span in spans}
        for future in as_completed(futures):
            yield futures[future], future.result()
