"""Search for the flight time of least cost, led by the derivative of the optimum.

The cost J(T) of the fixed-time problem falls steeply where T is short and rises with |g|/exhaust velocity (the
price of hovering) where T is long; J' = a - b/T^2 is exact for an impulsive flight and close for others, so the
search is a secant on J' in 1/T^2. J' comes from the dual solution and costs nothing. Where the secant stalls, the
bracket is halved on the sign of J'.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from guidance.time_window import TimeWindow

_STRETCH = 1.7  # greatest change of the time in one unbracketed step
_PROBES = 24  # times scanned where no feasible time is known
_MOST_STEPS = 40


class TimedSolution(Protocol):
    """What the search must know of a fixed-time solve."""

    @property
    def solved(self) -> bool:
        """Whether the time is feasible."""
        ...

    @property
    def time(self) -> float:
        """[s] the time of flight."""
        ...

    @property
    def value(self) -> float:
        """The cost."""
        ...

    @property
    def slope(self) -> float:
        """Its derivative with respect to the time."""
        ...


Solution = TypeVar("Solution", bound=TimedSolution)


@dataclass(frozen=True)
class TimeModel:
    """What is known of J' before the search.

    Attributes:
        asymptote: a in J' = a - b/T^2; zero if unknown.
        steepness: b, as found by an earlier search; zero if unknown.
    """

    asymptote: float
    steepness: float = 0.0

    def stationary_time(self, sample: TimedSolution) -> float:
        """[s] where J' of the model through one sample vanishes."""
        inverse_square = 1.0 / sample.time**2
        steepness = self.steepness
        if steepness <= 0.0:
            steepness = max(self.asymptote - sample.slope, 1e-12) / inverse_square
        wanted = inverse_square + sample.slope / steepness
        return 1.0 / math.sqrt(wanted) if wanted > 0.0 else math.inf


class TimeSearch(Generic[Solution]):
    """Bracket, samples and steps of one search."""

    def __init__(
        self, evaluate: Callable[[float], Solution], window: TimeWindow, tolerance: float, model: TimeModel
    ) -> None:
        """Prepare; `run` searches.

        Args:
            evaluate: time of flight [s] -> fixed-time solution.
            window: where to look; not empty.
            tolerance: stop when the model promises no greater gain than this, in units of the cost.
            model: prior knowledge of J'.
        """
        self._evaluate = evaluate
        self._tolerance = tolerance
        self.model = model
        self.low, self.high = window.low, window.high
        self.best: Solution | None = None
        self.samples: list[Solution] = []
        self._edges: set[float] = set()  # ends of the bracket that have been evaluated

    def sample(self, time: float) -> Solution:
        """Evaluate one time and shrink the bracket by what it shows."""
        solution = self._evaluate(time)
        self.samples.append(solution)
        self._edges.add(time)
        if solution.solved:
            if self.best is None or solution.value < self.best.value:
                self.best = solution
            below = solution.slope < 0.0
        elif self.best is not None:
            below = time < self.best.time
        else:
            return solution
        if below:
            self.low = max(self.low, time)
        else:
            self.high = min(self.high, time)
        return solution

    def run(self, guess: float) -> Solution | None:
        """The cheapest solution found; None if every time tried, a grid over the window included, is infeasible."""
        latest = self.sample(guess)
        if not latest.solved:
            found = self._probe(guess)
            if found is None:
                return None
            latest = found
        while len(self.samples) < _MOST_STEPS:
            goal = self._goal(latest)
            step = min(max(goal, self.low), self.high)
            if 0.5 * abs(latest.slope * (step - latest.time)) < self._tolerance and latest.solved:
                break
            if step in self._edges:
                if self.high - self.low <= 1e-5 * self.high:
                    break
                step = 0.5 * (self.low + self.high)
            sample = self.sample(step)
            if sample.solved:
                latest = sample
        return self.best

    def _probe(self, guess: float) -> Solution | None:
        """First feasible time on a grid, longer times first, nearest to the guess first."""
        grid = np.geomspace(self.low, self.high, _PROBES)
        longer, shorter = grid[grid > guess], grid[grid <= guess][::-1]
        order = [t for pair in zip(longer, shorter, strict=False) for t in pair]
        rest = longer[len(shorter) :] if len(longer) > len(shorter) else shorter[len(longer) :]
        for time in [*order, *rest]:
            sample = self.sample(float(time))
            if sample.solved:
                self._shrink_to_infeasible(sample)
                return sample
        return None

    def _shrink_to_infeasible(self, found: Solution) -> None:
        """Use the infeasible times that were met before the first feasible one."""
        for sample in self.samples[:-1]:
            if sample.time < found.time:
                self.low = max(self.low, sample.time)
            else:
                self.high = min(self.high, sample.time)

    def _goal(self, latest: Solution) -> float:
        """[s] where J' should vanish, by a secant in 1/T^2 or, with one sample only, by the model."""
        feasible = sorted((s for s in self.samples if s.solved), key=lambda s: s.time)
        falling = [s for s in feasible if s.slope < 0.0]
        rising = [s for s in feasible if s.slope >= 0.0]
        pair = None
        if falling and rising:
            pair = falling[-1], rising[0]
            if self._stalled(pair[0].time, pair[1].time):
                return 0.5 * (pair[0].time + pair[1].time)
        elif len(feasible) >= 2:
            pair = (feasible[-2], feasible[-1]) if falling else (feasible[0], feasible[1])
        if pair is not None:
            ends = [1.0 / s.time**2 for s in pair]
            steepness = (pair[1].slope - pair[0].slope) / max(ends[0] - ends[1], 1e-300)
            if steepness > 0.0:
                self.model = TimeModel(self.model.asymptote, steepness)
        goal = self.model.stationary_time(latest)
        return min(max(goal, latest.time / _STRETCH), latest.time * _STRETCH)

    def _stalled(self, low: float, high: float) -> bool:
        """Whether the last three samples all fell on one side of the bracket without halving it."""
        last = [s for s in self.samples[-3:] if s.solved]
        if len(last) < 3:
            return False
        signs = {s.slope < 0.0 for s in last}
        return len(signs) == 1 and high - low > 0.5 * abs(last[0].time - last[-1].time)
