"""Several studies in one run, each in a folder of its own under one progress bar; finished work is kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from studies.campaign.executor import local_processes
from studies.campaign.missing_chunks import find_missing, fly_missing
from studies.campaign.monte_carlo import Study, StudyResult, join_chunks, prepare_study
from studies.campaign.rows import EpisodeRow
from studies.campaign.study_folder import Existing, open_study_folder

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


def fly_points(out: Path, points: Sequence[Point], existing: Existing, workers: int) -> dict[str, Rows]:
    """Fly every point that is not finished yet.

    Args:
        out: folder of the run; each point has a folder in it.
        points: what to fly.
        existing: what to do where a point's folder holds a study.
        workers: processes.

    Returns:
        Label -> the rows of each policy.

    Raises:
        ValueError: a folder holds another study or is being written, or a policy or a worker failed.
        OSError: a folder cannot be made or written.
    """
    for study in {point.study.preset.terrain: point.study for point in points}.values():
        prepare_study(study, workers)  # before the bar: building terrain shows one of its own
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    flown = {}
    with Progress(*columns, transient=True) as progress:
        total = sum(point.study.episodes * len(point.study.policies) for point in points)
        task = progress.add_task("flights", total=total)
        for number, point in enumerate(points, start=1):
            progress.update(task, description=f"{point.label} ({number}/{len(points)})")
            result = _fly_point(out / point.label, point.study, existing, workers, progress)
            flown[point.label] = {
                name: tuple(row for row in result.rows if row.policy == name) for name in point.study.policies
            }
    return flown


def _fly_point(path: Path, study: Study, existing: Existing, workers: int, progress: Progress) -> StudyResult:
    with open_study_folder(path, study, existing) as folder:
        bar = (progress, progress.task_ids[0])
        fly_missing(folder, find_missing(folder), partial(local_processes, workers), workers, bar)
        return join_chunks(study, folder.read_chunks())
