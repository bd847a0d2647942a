"""Several studies in one run, each in a folder of its own under one progress bar; finished work is kept."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from hda.flight.episode_row import EpisodeRow
from studies.campaign.episode_files import write_episodes
from studies.campaign.executor import local_processes
from studies.campaign.missing_chunks import find_missing, fly_missing
from studies.campaign.monte_carlo import Study, join_chunks, prepare_study
from studies.campaign.provenance import describe_study, write_provenance
from studies.campaign.study_folder import Existing, StudyFolder, open_study_folder

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
                fly_missing(folder, missing[number], processes, workers, (progress, task))
        return {point.label: _finish_point(folder) for point, folder in zip(points, folders, strict=True)}


def _finish_point(folder: StudyFolder) -> Rows:
    """Read a flown point, and write its episodes and provenance."""
    study, result = folder.study, join_chunks(folder.study, folder.read_chunks())
    write_episodes(folder.path, result.rows)
    write_provenance(folder.path / "provenance.json", describe_study(study, folder.describe_flight()))
    return {name: tuple(row for row in result.rows if row.policy == name) for name in study.policies}
