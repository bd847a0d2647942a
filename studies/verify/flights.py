"""Flying a random share of the episodes of a results folder again, with every policy of it."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from rich.progress import track

from hda.flight.episode_row import ROW_COLUMNS
from studies.campaign.episode_files import episode_line
from studies.campaign.executor import local_processes
from studies.campaign.monte_carlo import PolicyError, Study, fly_chunk, prepare_study
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


def fly_lines(study: Study, episode: int) -> dict[str, str]:
    """Fly an episode with the policies of a study: policy -> its line of episodes.csv.

    Raises:
        PolicyError: a policy raised something.
    """
    return {name: episode_line(row) for name, (row,) in fly_chunk(study, episode, episode + 1).rows.items()}


def check_flights(results: HeldResults, episodes: Sequence[int], workers: int) -> Finding:
    """Whether the episodes, flown again, give the lines of the folder to the byte."""
    study = replace(results.study, policies=results.policies)
    prepare_study(study, workers)
    differing = []
    try:
        with local_processes(workers) as executor:
            task = partial(fly_lines, study)
            flown = map(task, episodes) if executor is None else executor.map(task, episodes)
            shown = track(flown, "episodes flown again", total=len(episodes), transient=True)
            for episode, lines in zip(episodes, shown, strict=True):
                pairs = {name: (results.lines[name, episode], line) for name, line in lines.items()}
                differing += [
                    f"{name}, episode {episode}: {_describe_difference(*pair)}"
                    for name, pair in pairs.items()
                    if pair[0] != pair[1]
                ]
    except (PolicyError, BrokenExecutor) as error:
        return Finding("flights", False, str(error) or "a worker process died")
    flights = len(episodes) * len(study.policies)
    if not differing:
        flown_again = "1 episode" if len(episodes) == 1 else f"{len(episodes)} episodes"
        return Finding("flights", True, f"{flown_again} of {len(study.policies)} policies, equal to the byte")
    words = "; ".join(differing[:_SHOWN])
    return Finding("flights", False, f"{len(differing)} of {flights} flights differ: {words}")


def chance_of_notice(altered: int, episodes: int, flown: int) -> float:
    """Probability that a draw of `flown` episodes of `episodes` holds one of those that are altered."""
    unseen = np.arange(altered)
    return 1.0 - float(np.prod(np.clip((episodes - flown - unseen) / (episodes - unseen), 0.0, 1.0)))


def _describe_difference(there: str, here: str) -> str:
    """The first cell in which two lines differ."""
    held, found = csv.reader([there, here])
    cells = zip(ROW_COLUMNS, held, found, strict=False)
    return next(
        (f"{column} {old} for {new}" for column, old, new in cells if old != new), "written otherwise"
    )
