"""Splitting and Russian roulette: one weighted tree of branches that grows out of one start.

Before each step a branch is held against a window of weights. Above it the branch is split into equal parts;
below it the branch goes on with a chance that is its weight over a heavier one, and then weighs as much as
that. Either way the expected weight stays, so the weighted count of any event is unbiased whatever the
windows are; they decide how much it scatters and what it costs.

Sources: Kahn and Harris, Estimation of Particle Transmission by Random Sampling, NBS Applied Mathematics
Series 12, 1951 (splitting and roulette); Booth and Hendricks, Nuclear Technology/Fusion 5, 1984 (windows of
weights).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

State = TypeVar("State")
End = TypeVar("End")

MOST_PARTS = 50
"""A branch is split into no more at a time."""


@dataclass(frozen=True)
class Window:
    """Weights at which a branch simply goes on.

    Attributes:
        low: roulette is played below it.
        aim: weight of what survives it; at least `low`.
        high: a heavier branch is split into so many parts as bring it nearest to this; at least `aim`.
    """

    low: float
    aim: float
    high: float


NO_WINDOW = Window(0.0, 1.0, np.inf)
"""Neither splitting nor roulette: a branch is a whole flight."""


@dataclass(frozen=True, eq=False)
class Ended(Generic[End]):
    """A step that ended its branch.

    Attributes:
        end: what is known of it.
    """

    end: End


@dataclass(frozen=True, eq=False)
class Leaf(Generic[End]):
    """The end of a branch.

    Attributes:
        weight: how many starts it stands for, in expectation.
        end: what is known of it.
    """

    weight: float
    end: End


@dataclass(frozen=True, eq=False)
class Tree(Generic[End]):
    """All that grew out of a start.

    Attributes:
        leaves: every branch that came to its end; none where roulette ended all.
        steps: how many were taken.
        branches: how many there were, the start's own among them.
    """

    leaves: tuple[Leaf[End], ...]
    steps: int
    branches: int


def grow_tree(
    start: State,
    advance: Callable[[State, int], State | Ended[End]],
    window: Callable[[State], Window],
    rng: np.random.Generator,
) -> Tree[End]:
    """Follow a start of weight 1 to all its ends.

    Args:
        start: where it begins.
        advance: takes one step of the branch of a number; branches of different numbers must draw
            independently, and 0 is the start's own.
        window: of the weights in a state.
        rng: decides who goes on below a window; not drawn from where nothing is.

    Returns:
        The leaves, a branch split off before the one that it left.
    """
    waiting: list[tuple[State, float, int]] = [(start, 1.0, 0)]
    leaves: list[Leaf[End]] = []
    branches, steps = 1, 0
    while waiting:
        state, weight, branch = waiting.pop()
        limits = window(state)
        if weight < limits.low:
            if rng.random() * limits.aim >= weight:
                continue
            weight = limits.aim
        parts = min(max(1, round(weight / limits.high)), MOST_PARTS)
        numbers = (branch, *range(branches, branches + parts - 1))
        branches += parts - 1
        for number in numbers:
            following, steps = advance(state, number), steps + 1
            if isinstance(following, Ended):
                leaves.append(Leaf(weight / parts, following.end))
            else:
                waiting.append((following, weight / parts, number))
    return Tree(tuple(leaves), steps, branches)
