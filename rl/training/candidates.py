"""Which weights of a run to ship: its actors and the means of successive ones, judged on the tuning tiles.

An actor trained against a moving critic wanders about a good one. The mean of the weights of several
successive actors lies nearer to the middle than any of them (Polyak and Juditsky 1992; Izmailov et al. 2018,
arXiv 1803.05407).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hda.worker_pool import map_in_processes
from rl.inference.artefacts import Tensors

if TYPE_CHECKING:
    from hda.task.presets import Preset
    from rl.settings import AgentSettings
    from rl.training.scoring import Score

TUNING_SEED = 900_000
"""Study seed of the periodic validation of a run, on the tuning tiles."""
CHOICE_SEED = 900_001
"""Study seed of the choice, on the tuning tiles; not that of the periodic validation."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An actor, or the mean of several, and how it flew the tuning tiles.

    Attributes:
        run: folder of the run.
        seed: of the run.
        steps: environment steps at which the averaged actors were kept.
        tensors: weights.
        score: on the tuning tiles.
    """

    run: Path
    seed: int
    steps: tuple[int, ...]
    tensors: Tensors
    score: Score


@dataclass(frozen=True)
class Choice:
    """How candidates are judged.

    Attributes:
        averages: how many successive actors are averaged; 1 is an actor itself.
        candidates: best ones, over as many episodes as the run's own validation, that are flown again.
        episodes: tuning episodes that each of these flies.
        last: only the last so many actors of a run are judged, 0 for all. Of very many the best by few
            episodes is the luckiest.
    """

    averages: tuple[int, ...] = (1, 3, 5, 9)
    candidates: int = 5
    episodes: int = 1000
    last: int = 0


def average_tensors(actors: Sequence[Tensors]) -> Tensors:
    """Mean of the weights of actors of one shape, name by name.

    Raises:
        ValueError: no actor, or their names differ.
    """
    if not actors or any(set(actor) != set(actors[0]) for actor in actors):
        raise ValueError("actors to average must be of one kind")
    return {name: np.mean([actor[name] for actor in actors], axis=0).astype(np.float32) for name in actors[0]}


@dataclass(frozen=True, eq=False)
class _Flights:
    """Weights over the first episodes of a study on the tuning tiles."""

    tensors: Tensors
    settings: AgentSettings
    preset: Preset
    study_seed: int
    episodes: int

    def score(self) -> Score:
        from rl.training.actor_export import policy_of
        from rl.training.scoring import score_policy

        policy = policy_of(self.tensors, self.settings)
        return score_policy(policy, self.preset, "tuning", self.study_seed, self.episodes)


def _score_all(flights: Sequence[_Flights], workers: int, task: str) -> list[Score]:
    """Score each, in processes, with a bar; the order of the flights is kept."""
    from rich.progress import Progress

    with Progress() as progress:
        bar = progress.add_task(task, total=len(flights))
        return map_in_processes(_Flights.score, flights, workers, on_done=partial(progress.advance, bar))


def best_of_run(run: Path, choice: Choice, workers: int) -> Candidate:
    """The best weights of one run.

    All windows of successive actors fly the episodes of the periodic validation; the best fly more episodes,
    drawn with another seed, and the best of these is chosen: successes first, then the reward.

    Args:
        run: folder of the run.
        choice: how candidates are judged.
        workers: processes; the choice does not depend on them.

    Raises:
        ValueError: the folder holds no run, or the run has no validated actor.
    """
    from hda.task.presets import find_preset
    from rl.inference.artefacts import load_artefact
    from rl.settings import settings_from_json
    from rl.training.run_folder import read_rows, read_run

    card = read_run(run)
    preset, settings = find_preset(card["preset"]), settings_from_json(card["settings"])
    rows = [row for row in read_rows(run / "validation.csv") if int(row["updates"]) > 0]
    if not rows:
        raise ValueError(f"{run} has no validated actor")
    rows = rows[-choice.last :]
    steps = [int(row["step"]) for row in rows]
    actors = [load_artefact(run / "actors" / f"step-{step:09d}", "actor").tensors for step in steps]
    windows = [
        slice(end - length, end)
        for length in sorted(set(choice.averages))
        for end in range(length, len(actors) + 1)
    ]

    def flights(window: slice, study_seed: int, episodes: int) -> _Flights:
        return _Flights(average_tensors(actors[window]), settings, preset, study_seed, episodes)

    means = [window for window in windows if window.stop - window.start > 1]
    first = [flights(window, TUNING_SEED, int(float(rows[0]["episodes"]))) for window in means]
    ranks = {
        (k, k + 1): (float(row["success_percent"]), float(row["reward"]))  # flown while it learnt
        for k, row in enumerate(rows)
    }
    for window, score in zip(means, _score_all(first, workers, f"{run}: means of actors"), strict=True):
        ranks[window.start, window.stop] = score.rank
    windows.sort(key=lambda window: ranks[window.start, window.stop], reverse=True)
    best = windows[: choice.candidates]
    again = [flights(window, CHOICE_SEED, choice.episodes) for window in best]
    scores = _score_all(again, workers, f"{run}: the best of them")
    chosen, score = max(zip(best, scores, strict=True), key=lambda pair: pair[1].rank)
    return Candidate(run, int(card["seed"]), tuple(steps[chosen]), average_tensors(actors[chosen]), score)
