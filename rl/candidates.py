"""Which weights of a run to ship: its actors and the means of successive ones, judged on the tuning tiles.

An actor trained against a moving critic wanders about a good one. The mean of the weights of several
successive actors lies nearer to the middle than any of them (Polyak and Juditsky 1992; Izmailov et al. 2018,
arXiv 1803.05407).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rl.artefacts import Tensors

if TYPE_CHECKING:
    from hda.scenario import Preset
    from rl.algorithms import AgentSettings
    from rl.scoring import Score

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
    """

    averages: tuple[int, ...] = (1, 3, 5, 9)
    candidates: int = 5
    episodes: int = 1000


def average_tensors(actors: Sequence[Tensors]) -> Tensors:
    """Mean of the weights of actors of one shape, name by name.

    Raises:
        ValueError: no actor, or their names differ.
    """
    if not actors or any(set(actor) != set(actors[0]) for actor in actors):
        raise ValueError("actors to average must be of one kind")
    return {name: np.mean([actor[name] for actor in actors], axis=0).astype(np.float32) for name in actors[0]}


def best_of_run(run: Path, seed: int, preset: Preset, settings: AgentSettings, choice: Choice) -> Candidate:
    """The best weights of one run.

    All windows of successive actors fly the episodes of the periodic validation; the best fly more episodes,
    drawn with another seed, and the best of these is chosen: successes first, then the reward.

    Raises:
        ValueError: the run has no validated actor.
    """
    from rl.actor_export import policy_of
    from rl.artefacts import load_artefact
    from rl.run_folder import read_rows
    from rl.scoring import score_policy
    from rl.training_recorder import TUNING_SEED

    rows = [row for row in read_rows(run / "validation.csv") if int(row["updates"]) > 0]
    if not rows:
        raise ValueError(f"{run} has no validated actor")
    steps = [int(row["step"]) for row in rows]
    actors = [load_artefact(run / "actors" / f"step-{step:09d}", "actor").tensors for step in steps]
    first = int(float(rows[0]["episodes"]))

    def fly(window: slice, study_seed: int, episodes: int) -> Candidate:
        tensors = average_tensors(actors[window])
        score = score_policy(policy_of(tensors, settings), preset, "tuning", study_seed, episodes)
        return Candidate(run, seed, tuple(steps[window]), tensors, score)

    def rank(window: slice) -> tuple[float, float]:
        if window.stop - window.start > 1:
            return fly(window, TUNING_SEED, first).score.rank
        row = rows[window.start]  # flown while it learnt
        return float(row["success_percent"]), float(row["reward"])

    windows = [
        slice(end - length, end)
        for length in sorted(set(choice.averages))
        for end in range(length, len(actors) + 1)
    ]
    ranked = sorted(windows, key=rank, reverse=True)
    again = [fly(window, CHOICE_SEED, choice.episodes) for window in ranked[: choice.candidates]]
    return max(again, key=lambda candidate: candidate.score.rank)
