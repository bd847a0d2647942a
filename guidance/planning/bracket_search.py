"""Search for the flight time of least cost where the cost has no known shape: a bracket on the sign of J'.

The cost of a flight that ends with a velocity need not be convex in the time of flight, its slope may exceed
the price of hovering, and it may have a kink where the engine has nothing to do. `TimeSearch` would trust its
model of J' there. This search goes downhill by growing steps until the sign of J' changes, and then closes in
by secants, or by halves where a secant ends on the same side twice. It takes a few more solves.
"""

from __future__ import annotations

from guidance.flight_time.search import Solution, TimeSearch, nearest_to_optimum

_FIRST_STEP = 0.02  # of the time; doubled at each step downhill
_NEAR = 0.1  # of the time: where no sign has changed, the optimum is thought to lie no farther away
_MARGIN = 0.1  # of the bracket: no secant ends nearer to its ends
_MOST_STEPS = 50


class BracketSearch(TimeSearch[Solution]):
    """A search that trusts nothing but the sign of J', and slopes to say when it may end."""

    def run(self, guess: float, known: Solution | None = None) -> Solution | None:
        """The cheapest solution found; None if every time tried, a grid over the window included, fails.

        Args:
            guess: where to start.
            known: the solution there, if the caller has it.
        """
        if not self.sample(guess, known).solved and self._probe(guess) is None:
            return None
        width = _FIRST_STEP
        while len(self.samples) < _MOST_STEPS:
            inside = (s for s in self.samples if self.low <= s.time <= self.high)
            falling, rising = nearest_to_optimum(inside)
            if falling is not None and rising is not None:
                step = self._between(falling, rising)
            else:
                step = self._downhill(falling, rising, width)
                width *= 2.0
            if step is None:
                break
            self.sample(step)
        return self.best

    def _between(self, falling: Solution, rising: Solution) -> float | None:
        """[s] the next time inside the bracket; None where slopes leave nothing to gain in it."""
        gap, total = rising.time - falling.time, rising.slope - falling.slope
        if gap * rising.slope * -falling.slope <= self._tolerance * total or gap <= 1e-6 * rising.time:
            return None
        last = [s.slope < 0.0 for s in self.samples[-2:] if s.solved]
        fraction = 0.5 if len(last) == 2 and last[0] == last[1] else -falling.slope / total
        return falling.time + gap * min(max(fraction, _MARGIN), 1.0 - _MARGIN)

    def _downhill(self, falling: Solution | None, rising: Solution | None, width: float) -> float | None:
        """[s] the next time where no sign has changed yet; None where slope and room leave no gain."""
        here, end = (falling, self.high) if falling is not None else (rising, self.low)
        if here is None:
            return None
        room = abs(end - here.time)
        if 0.5 * abs(here.slope) * min(room, _NEAR * here.time) < self._tolerance or room <= 1e-6 * here.time:
            return None
        if width * here.time < 0.7 * room:
            return here.time * (1.0 + width if end > here.time else 1.0 - width)
        return 0.5 * (here.time + end) if end in self._edges else end
