"""Two lower bounds that leave a span of times of flight open, and the proofs at single times of that span.

The parts are held together, because none of them alone says that there is no flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

from guidance.descent.certificate import Proof
from guidance.descent.dual_bound import DualBound


class ProofOfTime(Proof, Protocol):
    """Proof that no flight of one duration exists."""

    @property
    def time(self) -> float:
        """[s] time of flight."""
        ...


@dataclass(frozen=True, eq=False)
class OuterBound:
    """The tank pays for no flight but perhaps within a span of times: two dual bounds.

    Proofs at single times may fill the span from end to end; between those times nothing is proved.

    Attributes:
        before: of all times up to the span.
        after: of all times from its end on.
        between: proofs at single times of the span, rising, both ends among them; without any the bounds
            alone say nothing of the span.
    """

    before: DualBound
    after: DualBound
    between: tuple[ProofOfTime, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether all proofs hold."""
        parts = (self.before, self.after, *self.between)
        return all(proof.verified for proof in parts)

    @property
    def forbids_outside(self) -> bool:
        """Whether the claims of the two bounds imply that there is no flight outside the span."""
        before, after = self.before, self.after
        outside = before.shortest == 0.0 and before.longest <= after.shortest and math.isinf(after.longest)
        return outside and before.problem is after.problem and before.above_tank and after.above_tank

    def supports(self, lower_bound: float) -> bool:
        """Whether the claims forbid all times outside the span, and proofs span it; for inf alone."""
        return math.isinf(lower_bound) and self.forbids_outside and self._spanned

    @property
    def _spanned(self) -> bool:
        """Whether the bounds meet, or the proofs between rise from the end of one to the other."""
        low, high = self.before.longest, self.after.shortest
        times = [proof.time for proof in self.between]
        if not times:
            return low == high
        rising = all(first < second for first, second in pairwise(times))
        belongs = all(proof.supports(math.inf) for proof in self.between)
        return rising and belongs and times[0] == low and times[-1] == high
