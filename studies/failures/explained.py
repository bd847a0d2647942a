"""Causes of some failed episodes in words, for the studies that fly several settings."""

from __future__ import annotations

from collections.abc import Iterable

from hda.flight.episode import fly
from hda.task.scenario import sample_scenario
from studies.campaign.journal import Journal
from studies.campaign.points import Point
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
