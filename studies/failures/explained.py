"""Causes of some failed episodes in words, for the studies that fly several settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console

from hda.flight.episode import fly
from hda.task.scenario import sample_scenario
from studies.campaign.claimed_folder import Existing
from studies.campaign.journal import Journal, open_journal
from studies.campaign.points import Point
from studies.campaign.provenance import identify_run
from studies.failures.causes import Failure, count_causes, explain_failure


def explain_episodes(point: Point, policy: str, episodes: Iterable[int], journal: Journal[Failure]) -> str:
    """Count the causes of failed episodes, the most frequent first; each is flown again once.

    Args:
        point: what was flown.
        policy: its name.
        episodes: numbers of failed episodes.
        journal: of explained failures, which are not flown again.

    Raises:
        ValueError: an episode is a success.
    """
    study, pilot = point.study, point.study.make_policy(policy)

    def explain(episode: int) -> Failure:
        scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
        return explain_failure(fly(pilot, scenario))

    return "; ".join(
        count_causes(
            journal.finish((point.label, policy, episode), lambda episode=episode: explain(episode))
            for episode in episodes
        )
    )


@contextmanager
def open_causes(
    out: Path, decided: dict[str, Any], paths: tuple[str, ...], existing: Existing
) -> Iterator[Journal[Failure]]:
    """Open the journal of the failures that a study explains, in a folder of its own below the study's.

    Args:
        out: the study's folder.
        decided: what decides what a failed episode is, beside the label of its point.
        paths: of the user's policies.
        existing: what to do where there is one.

    Raises:
        FolderError, OSError: as `open_journal`.
    """
    identity = identify_run(Path(__file__).parent, decided, paths)
    with open_journal(out / "causes", Failure, (), identity, existing) as journal:
        yield journal


def print_causes(console: Console, told: Iterable[tuple[str, str, str]]) -> None:
    """Print (label, policy, causes) a line each, where there are causes."""
    for label, policy, causes in told:
        if causes:
            words = f"{label}, {policy}: {causes}"
            console.print(words, highlight=False, markup=False, soft_wrap=True)
