"""Search for the flight time of least cost, led by the derivative of the optimum.

The cost J(T) of the fixed-time problem falls steeply where T is short, and rises where T is long with a
slope that nears a = |g|/exhaust velocity, the price of hovering. J' = a - b/(T - c)^2 describes both, so the
search is a secant (with three samples an inverse parabola) of T over w = (a - J')^(-1/2), in which the model
is a straight line. J' comes from the dual solution and costs nothing. Where this stalls, the bracket is
halved on the sign of J'.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Generic, NamedTuple, Protocol, TypeVar

from guidance.flight_time.time_window import TimeWindow

_STRETCH = 1.7  # greatest change of the time in one unbracketed step
_BLIND_STEP = 1.25  # change of the time where nothing is known of the curvature
_MOST_STEPS = 40
_KINK = 5.0  # tolerances that a smooth model may not overlook between two samples


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
    """What is known of J' = a - b/(T - c)^2 before the search.

    Attributes:
        asymptote: a, or zero if unknown: then J' itself takes the place of w.
        secant: dT/dw, as found by an earlier search; zero if unknown.
        dead_time: c/T for the first step, where `secant` is unknown: 0.75 suits a typical descent; nearer to
            one, the step is smaller.
    """

    asymptote: float
    secant: float = 0.0
    dead_time: float = 0.75

    def warp(self, slope: float) -> float:
        """w, in which T is nearly linear."""
        if self.asymptote <= 0.0:
            return slope
        return 1.0 / math.sqrt(max(self.asymptote - slope, 1e-3 * self.asymptote))

    def stationary_time(self, sample: TimedSolution) -> float:
        """[s] where J' of the model through one sample vanishes."""
        here, goal = self.warp(sample.slope), self.warp(0.0)
        if self.secant > 0.0:
            return sample.time + self.secant * (goal - here)
        if self.asymptote <= 0.0:
            return sample.time * (_BLIND_STEP if sample.slope < 0.0 else 1.0 / _BLIND_STEP)
        return sample.time * (1.0 + (1.0 - self.dead_time) * (goal / here - 1.0))

    def gain(self, sample: TimedSolution) -> float:
        """What the way to the stationary time promises, in units of the cost."""
        return 0.5 * abs(sample.slope * (self.stationary_time(sample) - sample.time))


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

    def sample(self, time: float, known: Solution | None = None) -> Solution:
        """Evaluate one time, unless its solution is known, and shrink the bracket by what it shows."""
        solution = self._evaluate(time) if known is None else known
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

    def run(self, guess: float, known: Solution | None = None) -> Solution | None:
        """The cheapest solution found; None if every time tried, a grid over the window included, fails.

        Args:
            guess: where to start.
            known: the solution there, if the caller has it.
        """
        latest = self.sample(guess, known)
        if not latest.solved:
            found = self._probe(guess)
            if found is None:
                return None
            latest = found
        while len(self.samples) < _MOST_STEPS and not self._closed():
            goal = self._goal(latest)
            step = min(max(goal, self.low), self.high)
            if 0.5 * abs(latest.slope * (step - latest.time)) < self._tolerance and self._kink() < _KINK:
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
        grid = TimeWindow(self.low, self.high).grid()
        longer, shorter = list(grid[grid > guess]), list(grid[grid <= guess][::-1])
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
        """[s] where J' should vanish."""
        feasible = sorted((s for s in self.samples if s.solved), key=lambda s: s.time)
        falling = [s for s in feasible if s.slope < 0.0]
        rising = [s for s in feasible if s.slope >= 0.0]
        if len(feasible) >= 2:
            pair = feasible[-2:] if not rising else feasible[:2]
            if falling and rising:
                pair = [falling[-1], rising[0]]
                if self._stalled():
                    return _tangents_cross(*pair).time
            gap = self.model.warp(pair[1].slope) - self.model.warp(pair[0].slope)
            secant = (pair[1].time - pair[0].time) / gap if gap > 0.0 else 0.0  # zero where J is concave
            self.model = replace(self.model, secant=secant)
            goal = self._parabola(feasible)
            if falling and rising and goal is not None and pair[0].time < goal < pair[1].time:
                return goal
        goal = self.model.stationary_time(latest)
        if len(feasible) >= 2 and not (falling and rising):
            before = self.samples[-2]
            if before.solved and abs(latest.slope) > 0.5 * abs(before.slope):  # no end in sight: go faster
                least = 2.0 * abs(latest.time - before.time)
                goal = latest.time + math.copysign(max(least, abs(goal - latest.time)), goal - latest.time)
        return min(max(goal, latest.time / _STRETCH), latest.time * _STRETCH)

    def _parabola(self, feasible: list[Solution]) -> float | None:
        """[s] inverse parabola through the three samples nearest to J' = 0, or None."""
        if len(feasible) < 3:
            return None
        goal = self.model.warp(0.0)
        near = sorted(feasible, key=lambda s: abs(self.model.warp(s.slope) - goal))[:3]
        w = [self.model.warp(s.slope) - goal for s in near]
        gaps = (w[0] - w[1]) * (w[0] - w[2]) * (w[1] - w[2])
        if gaps == 0.0:
            return None
        return (
            near[0].time * w[1] * w[2] * (w[1] - w[2])
            - near[1].time * w[0] * w[2] * (w[0] - w[2])
            + near[2].time * w[0] * w[1] * (w[0] - w[1])
        ) / gaps

    def _stalled(self) -> bool:
        """Whether the last two samples fell on one side of the optimum: at a kink, tangents are better."""
        last = [s.slope < 0.0 for s in self.samples[-3:] if s.solved]
        return len(last) == 3 and last[-1] == last[-2]

    def _kink(self) -> float:
        """What the tangents at the samples next to the optimum leave to gain (J convex), in tolerances.

        Zero where the optimum is not bracketed yet.
        """
        falling, rising = nearest_to_optimum(self.samples)
        if self.best is None or falling is None or rising is None:
            return 0.0
        return (self.best.value - _tangents_cross(falling, rising).value) / self._tolerance

    def _closed(self) -> bool:
        """Whether a bracketed optimum leaves nothing to gain."""
        signs = {s.slope < 0.0 for s in self.samples if s.solved}
        return len(signs) == 2 and self._kink() < 1.0


def nearest_to_optimum(samples: Iterable[Solution]) -> tuple[Solution | None, Solution | None]:
    """The last solved sample of the falling side, and the first of the rising one."""
    solved = [s for s in samples if s.solved]
    falling, rising = [s for s in solved if s.slope < 0.0], [s for s in solved if s.slope >= 0.0]
    last = max(falling, key=lambda s: s.time, default=None)
    return last, min(rising, key=lambda s: s.time, default=None)


class _Crossing(NamedTuple):
    """Where two tangents meet: a time [s] and a cost."""

    time: float
    value: float


def _tangents_cross(falling: TimedSolution, rising: TimedSolution) -> _Crossing:
    """Where the tangents at two samples on either side of the optimum meet."""
    if rising.slope == falling.slope:
        return _Crossing(falling.time, min(falling.value, rising.value))
    time = (falling.value - rising.value + rising.slope * rising.time - falling.slope * falling.time) / (
        rising.slope - falling.slope
    )
    time = min(max(time, min(falling.time, rising.time)), max(falling.time, rising.time))
    return _Crossing(time, falling.value + falling.slope * (time - falling.time))
