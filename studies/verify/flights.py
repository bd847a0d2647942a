"""Flying a random share of the episodes of a results folder again, with every policy of it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from rich.progress import track

from hda.flight.episode import fly
from hda.flight.episode_row import ROW_COLUMNS, summarize_episode
from hda.task.scenario import sample_scenario
from studies.campaign.episode_files import episode_line
from studies.campaign.executor import local_processes
from studies.campaign.monte_carlo import Study, prepare_study
from studies.verify.checks import Finding
from studies.verify.held_results import HeldResults

_SHOWN = 3


def choose_episodes(episodes: int, share: float, least: int, rng: np.random.Generator) -> list[int]:
    """Draw the episodes to fly again, each equally likely, ascending.

    Args:
        episodes: of the study.
        share: of them, 0 to 1.
        least: so many at least, as far as there are.
        rng: draws them.
    """
    wanted = min(episodes, max(least, int(np.ceil(share * episodes))))
    return sorted(int(episode) for episode in rng.choice(episodes, wanted, replace=False))


def fly_lines(study: Study, policies: Sequence[str], episode: int) -> dict[str, str]:
    """Fly an episode with policies: policy -> its line of episodes.csv."""
    scenario = sample_scenario(study.preset, study.study_seed, episode, study.split)
    return {
        name: episode_line(summarize_episode(fly(study.make_policy(name), scenario))) for name in policies
    }


def check_flights(results: HeldResults, episodes: Sequence[int], workers: int) -> Finding:
    """Whether the episodes, flown again, give the lines of the folder to the byte."""
    study, policies = results.study, results.policies
    prepare_study(study, workers)
    differing = []
    task = partial(fly_lines, study, policies)
    with local_processes(workers) as executor:
        flown = map(task, episodes) if executor is None else executor.map(task, episodes)
        for episode, lines in zip(
            episodes, track(flown, "episodes flown again", total=len(episodes), transient=True), strict=True
        ):
            differing += [
                _describe_difference(name, episode, results.lines[name, episode], line)
                for name, line in lines.items()
                if results.lines[name, episode] != line
            ]
    flights = len(episodes) * len(policies)
    if not differing:
        return Finding(
            "flights", True, f"{_count(len(episodes))} of {len(policies)} policies, equal to the byte"
        )
    words = "; ".join(differing[:_SHOWN])
    return Finding("flights", False, f"{len(differing)} of {flights} flights differ: {words}")


def chance_of_notice(altered: int, episodes: int, flown: int) -> float:
    """Probability that a draw of `flown` episodes of `episodes` holds one of those that are altered."""
    unseen = np.arange(altered)
    return 1.0 - float(np.prod(np.clip((episodes - flown - unseen) / (episodes - unseen), 0.0, 1.0)))


def _count(episodes: int) -> str:
    return f"{episodes} episode{'' if episodes == 1 else 's'}"


def _describe_difference(policy: str, episode: int, there: str, here: str) -> str:
    """The first cell in which two lines differ."""
    cells = zip(ROW_COLUMNS, there.split(","), here.split(","), strict=True)
    column, held, found = next(cell for cell in cells if cell[1] != cell[2])
    return f"{policy}, episode {episode}: {column} {held} for {found}"
