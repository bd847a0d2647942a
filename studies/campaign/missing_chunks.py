"""What a study's folder still lacks: which chunks, and flying them under a progress bar."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.progress import Progress, TaskID

from studies.campaign.executor import OpenExecutor
from studies.campaign.monte_carlo import chunk_bounds, fly_chunks
from studies.campaign.study_folder import StudyFolder


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
    bar: tuple[Progress, TaskID],
) -> None:
    """Fly chunks; each goes to the folder at once, so that a stopped study goes on.

    Args:
        folder: open folder of the study.
        missing: (first episode, one past the last) of each chunk.
        open_executor: makes what runs them.
        workers: processes, unless the executor counts them itself.
        bar: counts flights; it is moved on by those that stand in the folder already.

    Raises:
        ValueError: a policy or a worker failed.
    """
    progress, task = bar
    each = len(folder.study.policies)
    lacking = sum(last - first for first, last in missing)
    progress.advance(task, (folder.study.episodes - lacking) * each)
    for chunk in fly_chunks(folder.study, missing, open_executor, workers=workers):
        folder.store(chunk)
        progress.advance(task, (chunk.last - chunk.first) * each)
        if chunk.attempts > 1:
            again = f"a worker died: episodes {chunk.first} to {chunk.last - 1} were flown again"
            progress.console.print(again)
