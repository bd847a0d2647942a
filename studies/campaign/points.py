"""Flying what the folders of studies lack: of one, or of several in one run under one progress bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from hda.flight.episode_row import EpisodeRow
from hda.ground.undeclared_voids import name_tiles
from hda.task.first_target import describe_lack
from studies.campaign.claimed_folder import Existing
from studies.campaign.episode_files import write_episodes
from studies.campaign.executor import OpenExecutor, local_processes
from studies.campaign.monte_carlo import Chunk, Study, chunk_bounds, fly_chunks, join_chunks, prepare_study
from studies.campaign.provenance import describe_study, write_checksums, write_provenance
from studies.campaign.study_folder import StudyFolder, open_study_folder

Rows = dict[str, tuple[EpisodeRow, ...]]
"""Policy -> its rows, episodes ascending."""


@dataclass(frozen=True)
class Point:
    """One study of several.

    Attributes:
        label: where it is kept, below the run's folder; unique in the run.
        study: what is flown.
    """

    label: str
    study: Study


def find_missing(folder: StudyFolder) -> list[tuple[int, int]]:
    """Bounds of the chunks to fly; those that are damaged are removed, and named on stderr."""
    finished, damages = folder.find_finished()
    for damage in damages:
        Console(stderr=True).print(f"flown again: {damage}", style="yellow", markup=False, highlight=False)
    return [bounds for bounds in chunk_bounds(folder.study) if bounds not in finished]


def fly_missing(
    folder: StudyFolder,
    missing: Sequence[tuple[int, int]],
    open_executor: OpenExecutor,
    workers: int,
    on_chunk: Callable[[Chunk], None],
) -> None:
    """Fly chunks; each goes to the folder at once, so that a stopped study goes on.

    Args:
        folder: open folder of the study.
        missing: (first episode, one past the last) of each chunk.
        open_executor: makes what runs them.
        workers: processes, unless the executor counts them itself.
        on_chunk: called with each chunk once it is kept.

    Raises:
        ValueError: a policy or a worker failed.
    """
    for chunk in fly_chunks(folder.study, missing, open_executor, workers=workers):
        folder.store(chunk)
        on_chunk(chunk)


def describe_retry(chunk: Chunk) -> str:
    """That a chunk was flown again, in words; empty where it was not."""
    if chunk.attempts == 1:
        return ""
    return f"a worker died: episodes {chunk.first} to {chunk.last - 1} were flown again"


def describe_left_out(chunk: Chunk, study: Study, named: set[int]) -> str:
    """That tiles are not flown over, in words; empty where all of them were named before.

    Args:
        chunk: of the study.
        study: with its start conditions.
        named: tiles that were named; those of this chunk are added.
    """
    fresh = sorted({*chunk.left_out} - named)
    named.update(fresh)
    if not fresh:
        return ""
    return f"not flown over: {name_tiles(fresh)}, without enough {describe_lack(study.preset.start)}"


def fly_points(out: Path, points: Sequence[Point], existing: Existing, workers: int) -> dict[str, Rows]:
    """Fly every point that is not finished yet; terrain is built for those alone.

    Args:
        out: folder of the run; each point has a folder in it, with its shards, episodes.csv, episodes.parquet
            and provenance.json.
        points: what to fly.
        existing: what to do where a point's folder holds a study.
        workers: processes.

    Returns:
        Label -> the rows of each policy.

    Raises:
        ValueError: a folder holds another study or is being written, or a policy or a worker failed.
        OSError: a folder cannot be made or written.
    """
    with ExitStack() as opened:
        folders = [
            opened.enter_context(open_study_folder(out / point.label, point.study, existing))
            for point in points
        ]
        missing = [find_missing(folder) for folder in folders]
        lacking = {
            f.study.preset.terrain: f.study for f, chunks in zip(folders, missing, strict=True) if chunks
        }
        for study in lacking.values():
            prepare_study(study, workers)  # before the bar: building terrain shows one of its own
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, transient=True) as progress:
            total = sum(point.study.episodes * len(point.study.policies) for point in points)
            task = progress.add_task("flights", total=total)
            processes = partial(local_processes, workers)
            for number, (point, folder) in enumerate(zip(points, folders, strict=True)):
                progress.update(task, description=f"{point.label} ({number + 1}/{len(points)})")
                each = len(point.study.policies)
                lacking = sum(last - first for first, last in missing[number])
                progress.advance(task, (point.study.episodes - lacking) * each)
                named: set[int] = set()

                def count(
                    chunk: Chunk, each: int = each, study: Study = point.study, named: set[int] = named
                ) -> None:
                    progress.advance(task, (chunk.last - chunk.first) * each)
                    for words in (describe_retry(chunk), describe_left_out(chunk, study, named)):
                        if words:
                            progress.console.print(words)

                fly_missing(folder, missing[number], processes, workers, count)
        return {point.label: _finish_point(folder) for point, folder in zip(points, folders, strict=True)}


def _finish_point(folder: StudyFolder) -> Rows:
    """Read a flown point, and write its episodes and provenance."""
    study, result = folder.study, join_chunks(folder.study, folder.read_chunks())
    write_episodes(folder.path, result.rows)
    write_provenance(folder.path / "provenance.json", describe_study(study, folder.describe_flight()))
    write_checksums(folder.path)
    return {name: tuple(row for row in result.rows if row.policy == name) for name in study.policies}
