"""Many episodes, the same for every policy, spread over processes.

Episode k is a function of the study seed and k alone, so neither the number of workers nor the order or
choice of policies changes a row. Episodes run in chunks through an executor (`studies.campaign.executor`).
A worker that dies (out of memory, killed) costs a retry of the chunks that it may have held.
"""

from __future__ import annotations

import traceback
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hda.flight.episode import fly
from hda.flight.episode_row import EpisodeRow, summarize_episode
from hda.ground.library import Ground, prepare_tiles
from hda.policies.entry import AnyPolicy
from hda.registry import make_policy, policy_entry
from hda.task.presets import Preset
from hda.task.scenario import sample_scenario
from studies.campaign.executor import ClusterExecutor, OpenExecutor, WorkerDiedError, advise_script

CHUNK_EPISODES = 10
MOST_CHUNKS = 10_000
MOST_ATTEMPTS = 3
_CHUNKS_AT_ONCE = 2  # chunks handed to an executor, per worker: enough to keep it busy, few to fly again


class PolicyError(ValueError):
    """A policy raised something in flight; the message names it and the episode."""


@dataclass(frozen=True)
class Study:
    """Which episodes are flown by which policies.

    Attributes:
        preset: the setting.
        policies: registered names.
        episodes: episodes 0 to episodes - 1 are flown.
        study_seed: seed of the study.
        split: tile split.
        paths: paths `package.module:Name` of policies that are not registered; `policies` holds their names.
    """

    preset: Preset
    policies: tuple[str, ...]
    episodes: int
    study_seed: int = 0
    split: str = "validation"
    paths: tuple[str, ...] = ()

    def make_policy(self, name: str) -> AnyPolicy:
        """Make one of the study's policies, in any process."""
        for path in self.paths:
            policy_entry(path)
        return make_policy(name)


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Everything that a study flew.

    Attributes:
        rows: one per policy and episode; policies in the order of the study, episodes ascending.
        decision_time: policy -> wall time of every decision [s], shape (decisions,).
    """

    rows: tuple[EpisodeRow, ...]
    decision_time: dict[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Chunk:
    """What one task gives back.

    Attributes:
        first: first episode.
        last: one past the last episode.
        rows: policy -> its rows, episodes ascending.
        decision_time: policy -> wall time of every decision [s], shape (decisions,).
        attempts: how often it was begun; above 1 where a worker died.
        left_out: numbers of the tiles that its episodes passed over, ascending: too little hazard for a first
            target.
    """

    first: int
    last: int
    rows: dict[str, list[EpisodeRow]]
    decision_time: dict[str, NDArray[np.float64]]
    attempts: int = 1
    left_out: tuple[int, ...] = ()


def chunk_bounds(study: Study) -> list[tuple[int, int]]:
    """(first episode, one past the last) of every chunk of a study."""
    size = chunk_episodes(study.episodes)
    starts = range(0, study.episodes, size)
    return [(first, min(first + size, study.episodes)) for first in starts]


def chunk_episodes(episodes: int) -> int:
    """Episodes of a chunk: few, but so many that a study has at most MOST_CHUNKS files of them."""
    return max(CHUNK_EPISODES, -(-episodes // MOST_CHUNKS))


def fly_chunk(study: Study, first: int, last: int) -> Chunk:
    """Fly episodes first to last - 1 of a study with each of its policies, in this process.

    Raises:
        PolicyError: a policy raised something.
    """
    pilots = {name: study.make_policy(name) for name in study.policies}
    rows: dict[str, list[EpisodeRow]] = {name: [] for name in pilots}
    times: dict[str, list[NDArray[np.float64]]] = {name: [] for name in pilots}
    left_out: set[int] = set()
    for episode in range(first, last):
        scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
        left_out.update(scenario.left_out)
        for name, pilot in pilots.items():
            try:
                record = fly(pilot, scenario)
            except Exception as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                raise PolicyError(
                    f"policy {name!r} failed in episode {episode} of study seed {study.study_seed}:"
                    f" {type(error).__name__}: {error} ({where.filename}, line {where.lineno})"
                ) from error
            rows[name].append(summarize_episode(record))
            times[name].append(record.decision_time)
    seconds = {name: np.concatenate(parts) for name, parts in times.items()}
    return Chunk(first, last, rows, seconds, left_out=tuple(sorted(left_out)))


def fly_chunks(
    study: Study,
    bounds: Iterable[tuple[int, int]],
    open_executor: OpenExecutor,
    most_attempts: int = MOST_ATTEMPTS,
    workers: int = 2,
) -> Iterator[Chunk]:
    """Fly chunks of a study and give each as soon as it is finished, in any order.

    Where a worker dies the executor is opened anew, and the chunks that had been handed to it fly again.

    Args:
        study: what to fly; its tiles must exist (`prepare_study`), or each process builds them when it meets
            them.
        bounds: (first episode, one past the last) of each chunk.
        open_executor: makes the executor that runs the chunks; None in place of one flies them here.
        most_attempts: how often a chunk may be begun.
        workers: processes of the executor, unless it counts them itself; twice as many chunks are handed to
            it at a time.

    Raises:
        PolicyError: a policy raised something.
        WorkerDiedError: workers died `most_attempts` times while they held the same chunk.
    """
    waiting = deque((first, last, 1) for first, last in bounds)
    while waiting:
        lost: list[tuple[int, int, int]] = []
        with open_executor() as executor:
            if executor is None:
                while waiting:
                    first, last, _ = waiting.popleft()
                    yield fly_chunk(study, first, last)
                return
            yield from _fly_until_broken(study, waiting, lost, executor, workers)
        for first, last, attempts in sorted(lost, reverse=True):
            if attempts >= most_attempts:
                raise WorkerDiedError(
                    f"a worker process died {attempts} times while it held episodes {first} to {last - 1}"
                    " (out of memory, or killed); a smaller number of workers needs less memory"
                    + advise_script()
                )
            waiting.appendleft((first, last, attempts + 1))


def _fly_until_broken(
    study: Study,
    waiting: deque[tuple[int, int, int]],
    lost: list[tuple[int, int, int]],
    executor: Executor,
    workers: int,
) -> Iterator[Chunk]:
    """Fly what waits until nothing does or the executor breaks; then `lost` holds what it had been given."""
    running: dict[Future[Chunk], tuple[int, int, int]] = {}
    cluster = executor if isinstance(executor, ClusterExecutor) else None
    while (waiting or running) and not lost:
        at_once = _CHUNKS_AT_ONCE * max(1, cluster.count_workers() if cluster else workers)
        try:
            while waiting and len(running) < at_once:
                running[executor.submit(fly_chunk, study, *waiting[0][:2])] = waiting[0]
                waiting.popleft()
        except BrokenExecutor:
            if not running:
                lost.append(waiting.popleft())
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            task = running.pop(future)
            try:
                chunk = future.result()
            except BrokenExecutor:
                lost.append(task)
            except WorkerDiedError as error:
                raise WorkerDiedError(f"{error} while it held episodes {task[0]} to {task[1] - 1}") from error
            else:
                restarts = cluster.count_restarts(future) if cluster else 0
                yield replace(chunk, attempts=task[2] + restarts)
    lost.extend(running.values())


def join_chunks(study: Study, chunks: Iterable[Chunk]) -> StudyResult:
    """Put the chunks of a whole study together; their order means nothing.

    Raises:
        ValueError: episodes are missing, or there twice.
    """
    ordered = sorted(chunks, key=lambda chunk: chunk.first)
    if [(chunk.first, chunk.last) for chunk in ordered] != chunk_bounds(study):
        raise ValueError("the chunks do not make up the study")
    return StudyResult(
        rows=tuple(row for name in study.policies for chunk in ordered for row in chunk.rows[name]),
        decision_time={
            name: np.concatenate([chunk.decision_time[name] for chunk in ordered]) for name in study.policies
        },
    )


def prepare_study(study: Study, workers: int) -> None:
    """Build the terrain that a study flies over, with a progress bar, unless it is cached."""
    prepare_tiles(Ground(study.preset.terrain, study.preset.criteria), study.split, workers)
