"""What a planner proves of all flights: that there is none, or what none undercuts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol


class Proof(Protocol):
    """A proof that is checked by code which shares nothing with what found it."""

    @property
    def verified(self) -> bool:
        """Whether the proof holds."""
        ...

    def supports(self, lower_bound: float) -> bool:
        """Whether the proof, if it holds, implies that no flight burns less [kg]; inf: that there is none."""
        ...


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is proved of all flights of a landing problem, and how far the proof reaches.

    Attributes:
        scope: in words, which times of flight and which mesh are covered, and by what.
        causes: the limits that forbid every flight; empty where there are flights.
        proofs: Farkas proofs (`guidance.convex.farkas`), one per time of flight, a dual bound
            (`guidance.descent.dual_bound`), or two of them with such proofs between
            (`guidance.descent.outer_bound`); empty if closed-form bounds alone decide.
        lower_bound: [kg] no flight burns less; inf where there is none.
    """

    scope: str
    causes: tuple[str, ...]
    proofs: tuple[Proof, ...] = ()
    lower_bound: float = math.inf

    @property
    def verified(self) -> bool:
        """Whether every proof holds, and implies the lower bound; a closed form has none, and counts as held.

        The check runs when it is asked for. Before a planner says that there is no flight, it has run for
        Farkas proofs, not for a dual bound.
        """
        return all(proof.supports(self.lower_bound) and proof.verified for proof in self.proofs)
