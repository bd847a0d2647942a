"""Many episodes, the same for every policy, spread over processes.

Episode k is a function of the study seed and k alone, so neither the number of workers nor the order or
choice of policies changes a row. Episodes run through a `concurrent.futures.Executor`; any that pickles will
do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from hda.dtm_library import Ground, prepare_tiles
from hda.episode import fly
from hda.presets import sample_scenario
from hda.registry import make_policy
from hda.scenario import Preset
from studies.rows import EpisodeRow, summarize_episode

CHUNK_EPISODES = 10


@dataclass(frozen=True)
class Study:
    """Which episodes are flown by which policies.

    Attributes:
        preset: the setting.
        policies: registered names.
        episodes: episodes 0 to episodes - 1 are flown.
        study_seed: seed of the study.
        split: tile split.
    """

    preset: Preset
    policies: tuple[str, ...]
    episodes: int
    study_seed: int = 0
    split: str = "validation"


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
    """What one task gives back: rows and decision times by policy."""

    rows: dict[str, list[EpisodeRow]]
    decision_time: dict[str, NDArray[np.float64]]


def fly_chunk(study: Study, first: int, last: int) -> Chunk:
    """Fly episodes first to last - 1 of a study with each of its policies, in this process."""
    pilots = {name: make_policy(name) for name in study.policies}
    rows: dict[str, list[EpisodeRow]] = {name: [] for name in pilots}
    times: dict[str, list[NDArray[np.float64]]] = {name: [] for name in pilots}
    for episode in range(first, last):
        scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
        for name, pilot in pilots.items():
            record = fly(pilot, scenario)
            rows[name].append(summarize_episode(record))
            times[name].append(record.decision_time)
    return Chunk(rows, {name: np.concatenate(parts) for name, parts in times.items()})


@contextmanager
def local_processes(workers: int) -> Iterator[Executor | None]:
    """Processes on this machine; None for one worker, which flies in this process."""
    if workers == 1:
        yield None
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield pool


def run_study(
    study: Study, executor: Executor | None = None, on_progress: Callable[[int], None] | None = None
) -> StudyResult:
    """Fly a study.

    Args:
        study: what to fly; its tiles must exist (`prepare_study`), or each process builds them when it meets
            them.
        executor: runs the chunks; None flies them here.
        on_progress: called with the number of episodes (times policies) that were just finished.
    """
    starts = range(0, study.episodes, CHUNK_EPISODES)
    bounds = [(first, min(first + CHUNK_EPISODES, study.episodes)) for first in starts]
    chunks: dict[int, Chunk] = {}

    def finish(first: int, last: int, chunk: Chunk) -> None:
        chunks[first] = chunk
        if on_progress is not None:
            on_progress((last - first) * len(study.policies))

    if executor is None:
        for first, last in bounds:
            finish(first, last, fly_chunk(study, first, last))
    else:
        futures: dict[Future[Chunk], tuple[int, int]] = {
            executor.submit(fly_chunk, study, first, last): (first, last) for first, last in bounds
        }
        for future in as_completed(futures):
            finish(*futures[future], future.result())
    ordered = [chunks[first] for first in starts]
    return StudyResult(
        rows=tuple(row for name in study.policies for chunk in ordered for row in chunk.rows[name]),
        decision_time={
            name: np.concatenate([chunk.decision_time[name] for chunk in ordered]) for name in study.policies
        },
    )


def prepare_study(study: Study, workers: int) -> None:
    """Build the terrain that a study flies over, with a progress bar, unless it is cached."""
    prepare_tiles(Ground(study.preset.terrain, study.preset.criteria), study.split, workers)
